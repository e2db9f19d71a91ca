"""One look for every result: a page that works offline, pictures, and the numbers as JSON."""
