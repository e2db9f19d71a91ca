"""A hypothesis, its residuals, its fit, its noise floor, its evidence."""
