"""Simulated devices for the drivers: CANopen nodes, a serial line, and the axis (plant) that they move."""
