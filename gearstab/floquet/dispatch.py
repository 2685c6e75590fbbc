"""Choice of the theory that a system is analysed by, and the only place that makes it.

* Segments: mesh stiffness that is constant between jumps. The monodromy matrix over the common period of all meshes is
  the exact product of the segments' propagators, in the modes of the mean system (:mod:`~gearstab.floquet.segments`).
* Steps: mesh stiffness that is smooth somewhere. The same with Magnus steps, as many as a tolerance needs
  (:mod:`~gearstab.floquet.smooth`).
* First order: further terms of K(t) and C(t), damping that is not symmetric, matrices that act with a speed of
  rotation (:mod:`~gearstab.floquet.general`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gearstab.floquet import blockwise
from gearstab.floquet.stability import FloquetStability
from gearstab.support import ONLY_MESHES, unsupported
from gearstab.system import Array, GearSystem

if TYPE_CHECKING:
    from gearstab.floquet.report import Reduction

TOLERANCE = 1e-9
"""Tolerance of the multipliers where propagation is not exact."""


def in_modes(system: GearSystem) -> bool:
    """Whether theory in the modes of the mean system applies; else that of the first-order form."""
    return unsupported(system, ONLY_MESHES) is None


def exact(system: GearSystem) -> bool:
    """Whether the monodromy matrix is a product of segments that rounding alone makes wrong."""
    return system.piecewise_constant and in_modes(system)


def solve(
    system: GearSystem,
    mesh_frequency: Array,
    exponents: bool = False,
    reduction: bool = True,
    tolerance: float = TOLERANCE,
) -> FloquetStability:
    """Stability of every row of a system at every mesh frequency of the first mesh.

    Parts of the system that the meshes do not couple are solved one by one (:mod:`~gearstab.floquet.segments.blocks`),
    unless theory of the first-order form is needed.

    Parameters
    ----------
    system: any batch shape; the result has one row for each entry of the flattened batch.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``, rad per unit time, positive.
    exponents: whether to compute all characteristic exponents too (slower).
    reduction: False to treat every system as a whole (slower, for comparison).
    tolerance: of the multipliers over the common period, relative to the largest one or 1, where propagation is not
        exact; points that do not reach it are marked.

    Raises ValueError where the mesh frequencies have no common period.
    """
    omega = system.operating_points(mesh_frequency)
    if in_modes(system):
        return blockwise.analyse(system, omega, exponents, reduction, tolerance)
    from gearstab.floquet import general

    return general.analyse(system, omega, exponents, tolerance)


def reduction(system: GearSystem) -> Reduction:
    """Return the reduction of a single system (no batch).

    Without an affordable common period it is that of a window, with the segments of that. A system that theory in
    modes does not apply to is solved as a whole but for its rigid-body modes.
    """
    from gearstab.floquet import report

    return report.reduced(system) if in_modes(system) else report.whole(system)
