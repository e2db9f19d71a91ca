"""Report of a diagnosis: page and pictures."""
