"""Bench files: description of axis, control, encoders and drive by the owner."""
