"""Run-ups and coast-downs: what grows while the mesh frequency changes."""

STATUS_FLAGS = {"too_long": 1, "failed": 2, "rounding": 4}
"""The exact motion was not followed, as the path has too many segments; the growth rate could not be computed; motions
grow so much that rounding errors become as large as them."""
