"""Control law."""
