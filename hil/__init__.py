"""Real-time hardware-in-the-loop servo control, digital twin and diagnosis of a ball-screw axis."""
