"""Where a mismatch acts: block, phase of motion, position, speed, period."""
