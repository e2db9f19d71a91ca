"""Pages of results: HTML that opens without a network, pictures, and the numbers as JSON."""
