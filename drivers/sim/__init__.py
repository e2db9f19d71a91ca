"""The simulated reality behind the drivers: CANopen nodes, serial line, and the plant they move."""
