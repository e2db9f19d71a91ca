"""Pictures of a diagnosis, as matplotlib figures."""
