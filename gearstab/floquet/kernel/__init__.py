"""The kernels, compiled and in NumPy, and the last word on points that they leave in doubt."""
