"""Matplotlib figures of a diagnosis."""
