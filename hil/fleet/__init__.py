"""Hundreds of recordings of many axes, watched over months: index, condition of each recording, trends, pages."""
