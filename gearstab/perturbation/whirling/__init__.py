"""First-order tongues of systems whose motions are no real modes."""

from gearstab.perturbation.whirling.rows import whirling_rows

__all__ = ["whirling_rows"]
