"""Location of a mismatch: block, phase of motion, position, speed, period."""
