"""Time response: histories and steady states of linear systems, exact between the jumps of the mesh stiffness."""

from gearstab.response.history import (
    RESPONSE_FLAGS,
    RampResponse,
    Response,
    driven_response,
    free_response,
    ramp_response,
    steady_state,
)  # fmt: skip
from gearstab.response.spectra import Harmonics, harmonics

__all__ = [
    "RESPONSE_FLAGS", "Harmonics", "RampResponse", "Response", "driven_response", "free_response", "harmonics",
    "ramp_response", "steady_state",
]  # fmt: skip
