"""The control loop on a bench, real or simulated."""
