"""How exactly an axis goes where it is sent: figures of ISO 230-2 (positions) and ISO 230-4 (circles)."""
