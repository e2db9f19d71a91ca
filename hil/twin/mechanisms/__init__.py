"""The mechanisms of the library, one file each."""
