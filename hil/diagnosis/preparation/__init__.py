"""From recordings to data sets: usable parts, control law, held-out part, checks."""
