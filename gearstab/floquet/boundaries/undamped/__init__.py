"""The search for the unstable intervals of conservative rows, in NumPy and compiled."""
