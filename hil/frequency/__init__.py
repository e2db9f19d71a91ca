"""Frequency responses of an axis, measured from a recording and computed from its twin; margins of its loops."""
