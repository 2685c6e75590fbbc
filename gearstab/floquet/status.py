"""What the status of a point says."""

from __future__ import annotations

STATUS_FLAGS = {
    "eigenvalues": 1, "krein": 2, "rescaled": 4, "negative_stiffness": 8, "failed": 16, "not_converged": 32,
    "per_mesh": 64, "lyapunov": 128, "undecided": 256, "near_boundary": 512,
}  # fmt: skip
"""Bits of ``status``: decided by the eigenvalues of the monodromy matrix; by the Krein signature; the matrix outgrew
double precision and was scaled; a state of the system has a negative stiffness; no finite result; the error estimate
exceeds the tolerance; one mesh frequency at a time, the others averaged; an estimated Lyapunov exponent; one whose
confidence interval contains zero; so near to a boundary that the error of the multipliers may decide the verdict."""
