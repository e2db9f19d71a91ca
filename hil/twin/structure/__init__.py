"""Structure of the axis: elements, chain, modes, frequency response."""
