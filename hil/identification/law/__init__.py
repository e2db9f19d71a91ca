"""Control law of an axis: replayed on measured inputs, fitted to recorded commands."""
