"""Damping from which on a system is stable, and growth rates as functions of damping."""
