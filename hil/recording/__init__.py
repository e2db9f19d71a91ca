"""Recordings: read, write while running, import from other formats."""
