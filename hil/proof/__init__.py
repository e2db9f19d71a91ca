"""The proof: effects concealed in a simulated axis, recordings of it, and what a diagnosis makes of them."""
