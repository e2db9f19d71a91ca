"""Bench files: what the owner knows of axis, control, encoders and drive."""
