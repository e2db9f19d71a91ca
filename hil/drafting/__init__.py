"""Draft a bench file of an axis from its recording alone."""
