"""The digital twin: a chain of inertias in modal coordinates, and the mechanisms it may contain."""
