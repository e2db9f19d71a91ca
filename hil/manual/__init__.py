"""The manual: guide pages (docs/guide, shipped with the package), references generated from the code, JSON Schemas."""
