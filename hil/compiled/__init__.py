"""Support of compiled kernels: rounding without fused products, cache folder."""
