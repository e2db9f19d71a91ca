"""Hardware of the bench (CANopen drive, encoders, buses) and its simulation; knows nothing of `hil`."""
