"""Exact boundaries of undamped systems with gyroscopic and centripetal terms, whose speeds may follow the mesh."""
