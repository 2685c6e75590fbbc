"""Certificates: what proves stability and instability over intervals of the mesh frequency, for anybody to check."""
