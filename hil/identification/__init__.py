"""Comparison of a recording with the twin, and fits of the nominal parameters."""
