"""Simulated devices (CANopen nodes, serial line) and the simulated axis that they move and measure."""
