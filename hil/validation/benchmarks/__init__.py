"""Benchmarks of the loop, the simulation and the diagnosis on this machine, for `hil bench`."""
