"""Conceal effects in real recordings by exact edits of their channels; nothing here simulates an axis."""
