"""Compiled simulation of the twin: records, one step, loops over ticks."""
