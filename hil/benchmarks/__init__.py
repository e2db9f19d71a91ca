"""Benchmarks of the loop, the simulation and the diagnosis on this machine; run by `hil bench`, never by tests."""
