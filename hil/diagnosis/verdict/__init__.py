"""Verdict, findings and their confidence, cross-validation."""
