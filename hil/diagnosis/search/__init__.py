"""The search for the mechanisms that explain a mismatch."""
