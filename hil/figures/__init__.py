"""Pictures: panels over time as data, and matplotlib figures drawn from them."""
