"""The proof: effects concealed in a simulated axis, its recordings, and their blind diagnosis."""
