"""Stability maps of gear systems with periodic mesh stiffness."""

__version__ = "0.1.0"
