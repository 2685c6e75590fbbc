"""Run-ups and coast-downs: what grows while the mesh frequency changes."""

STATUS_FLAGS = {"too_long": 1, "failed": 2, "rounding": 4, "sampled": 8, "coarse": 16}
"""The exact motion was not followed, as the path has too many segments; the growth rate could not be computed; motions
grow so much that rounding errors become as large as them; regions were looked for by samples where two multipliers
meet; or in equal steps only, so that narrower ones may be missing."""
