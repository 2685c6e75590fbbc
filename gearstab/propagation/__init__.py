"""The equation x' = A(t) x + b(t) of every system, and what propagates it."""
