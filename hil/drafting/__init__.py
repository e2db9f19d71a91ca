"""Draft a map of a foreign file and a bench file of its axis from the recording alone."""
