"""Time response: histories and steady states of linear systems, exact between the jumps of the mesh stiffness."""

from gearstab.response.linear.history import RESPONSE_FLAGS, Response, driven_response, free_response
from gearstab.response.linear.periodic import Harmonics, harmonics, steady_state

__all__ = [
    "RESPONSE_FLAGS",
    "Harmonics",
    "Response",
    "driven_response",
    "free_response",
    "harmonics",
    "steady_state",
]
