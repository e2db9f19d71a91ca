"""Hardware of the bench (CANopen drive, encoders, buses) and its simulation; imports nothing of `hil`."""
