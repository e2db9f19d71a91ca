"""Oscilloscope: a process of its own that reads the rows of a run from shared memory, or recordings, for a browser."""
