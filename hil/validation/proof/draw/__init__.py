"""Random cases: axes, motions, concealed effects."""
