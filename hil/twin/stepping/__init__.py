"""The compiled simulation of the twin: packed arrays, one step, loops over ticks."""
