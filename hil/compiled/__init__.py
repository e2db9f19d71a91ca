"""What every compiled kernel needs: rounding without fused products, and a folder for the cache."""
