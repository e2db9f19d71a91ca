"""From a profile file to the set-points of every tick."""
