"""Time response of linear systems, exact between the jumps of the mesh stiffness."""

from gearstab.response.linear import Response, free_response

__all__ = ["Response", "free_response"]
