"""Scores of the answers against the truth."""
