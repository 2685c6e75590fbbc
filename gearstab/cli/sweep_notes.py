"""What ``gearstab sweep`` says at its end of points whose answers need a word."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gearstab.sweep import Plan, Summary

FLAGS = {
    ("floquet", "not_converged"): "the error estimate exceeds the tolerance at {points}; see error_estimate",
    ("floquet", "undecided"): "the stability is undecided at {points}: the confidence interval contains zero",
    ("required_damping", "beyond"): "no damping up to `largest` suffices at {points}",
    ("response", "unstable"): "the steady state is unstable at {points}: it is not what would be seen",
    ("response", "separation"): "teeth would part at {points}: the linear answer does not hold there, loads are "
    "overstated; give the meshes a backlash",
    ("response", "unresolved"): "too few samples for the fastest vibration at {points}: raise samples_per_cycle",
    ("response", "unbalanced"): "the load accelerates the train as a whole at {points}; a steady state leaves that "
    "part of it out",
    ("response", "ill_conditioned"): "the steady state is sensitive at {points}: a Floquet multiplier is near 1, or "
    "the system grows strongly",
    ("response", "failed"): "there is no steady state at {points}: a Floquet multiplier is 1",
    ("response", "chatter"): "the history ends at {points} because impacts come too many or too close",
}
"""By method and flag of ``status``."""

PARTED = "separation"

TEETH = {
    "undercut": "are undercut", "top_land": "are pointed", "interference": "interfere, so that contact is cut off",
    "fillet_contact": "touch inside of a fillet", "contact_ratio": "lose contact (contact ratio below 1)",
    "tip_clearance": "come too close to a root", "backlash": "are too thick for the centre distance",
    "trochoid_interference": "collide outside of the path of contact", "trimming": "cannot be put in radially",
}  # fmt: skip
"""By notice."""


def notes(plan: Plan, summary: Summary) -> list[str]:
    """Return one line for each flag that points carry, and for each mesh whose teeth are not sound."""
    found = []
    for layout in plan.layouts:
        name = layout.method.name
        # A history with backlash follows teeth that part; steady states beside growth rates need not repeat these.
        known = {PARTED, "unstable"} if layout.method.singly else set()
        known |= {"unstable"} if "floquet" in summary.flags else set()
        for flag, count in summary.flags.get(name, {}).items():
            if (name, flag) in FLAGS and flag not in known:
                found.append(FLAGS[name, flag].format(points=share(count, layout.points)))
    return found + teeth(plan)


def share(count: int, total: int) -> str:
    """Return ``12.3 % of the points``; never 0.0 % or 100.0 % where that is rounded."""
    if count == total:
        return "every point"
    part = 100 * count / total
    return f"{part:.1f} % of the points" if 0.05 <= part < 99.95 else f"{count:,} of {total:,} points"


def teeth(plan: Plan) -> list[str]:
    """Return one line for each mesh and notice of a gearbox."""
    if plan.teeth is None:
        return []
    from gearstab.systems.gearbox.notices import NOTICE_FLAGS

    over = " x ".join(axis.name for axis in plan.teeth.axes)
    flags = plan.teeth.flags.reshape(-1, len(plan.teeth.meshes))
    found = []
    for mesh, column in zip(plan.teeth.meshes, flags.T, strict=True):
        for name, mask in NOTICE_FLAGS.items():
            count = int(np.count_nonzero(column & mask))
            where = f" at {count:,} of {len(column):,} values of {over}" if over and count < len(column) else ""
            if count:
                found.append(f"teeth of mesh {mesh} {TEETH[name]}{where}; gearstab info tells more")
    return found
