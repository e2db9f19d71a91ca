"""Blind diagnosis of cases by another process."""
