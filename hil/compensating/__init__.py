"""From a diagnosed bench to the compensation of its axis."""
