"""Time response: histories and steady states of linear systems, exact between the jumps of the mesh stiffness."""

from gearstab.response.linear.history import RESPONSE_FLAGS, Response, driven_response, free_response
from gearstab.response.linear.periodic import Harmonics, harmonics, steady_state
from gearstab.response.linear.ramp import RampResponse, ramp_response

__all__ = [
    "RESPONSE_FLAGS",
    "Harmonics",
    "RampResponse",
    "Response",
    "driven_response",
    "free_response",
    "harmonics",
    "ramp_response",
    "steady_state",
]
