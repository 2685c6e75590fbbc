"""Speeds of rotation of a model given as matrices, and what acts with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Annotated, Any

import numpy as np

from gearstab.config.document.problems import Path
from gearstab.config.document.tree import Document, value_at
from gearstab.config.model.axes import matrix
from gearstab.config.model.conflicts import Conflict, exactly_one, items
from gearstab.config.model.fields import Ratio, Section, optional
from gearstab.config.model.units import Quantity
from gearstab.rotation import Rotation
from gearstab.systems.feasibility import worst_entry
from gearstab.systems.matrices.file import OF_ROTATION
from gearstab.systems.parts.damping import not_square

SKEW_TOLERANCE = 1e-12
"""Part of the largest entry by which a gyroscopic matrix may differ from a skew one, a centripetal from a symmetric."""

Inertia = Annotated[float, Quantity("kg", ("kg m", "kg m^2"), entry=True)]
Drag = Annotated[float, Quantity("N s/m", ("N s", "N m s"), entry=True)]


class RotationSection(Section):
    """A speed of rotation W, and matrices that act with it: W G q' + (W H + W^2 K) q."""

    speed_ratio: Annotated[Fraction, Ratio(signed=True)] | None = optional("speed ratio of a rotation")
    """W/Omega, exact: "1/25", or -1 for the other sense; or give speed."""
    speed: Annotated[float, Quantity("rad/s")] | None = optional("speed of a rotation")
    """W, held whatever the mesh frequency (rad/s, "1500 rpm"); or give speed_ratio."""
    gyroscopic: list[list[Inertia]] | None = optional("gyroscopic matrix")
    """G in W G q', skew (kg, or kg m^2 of rotations)."""
    centripetal: list[list[Inertia]] | None = optional("centripetal matrix")
    """K in W^2 K q, symmetric and added, so negative where rotation softens (kg, or kg m^2)."""
    circulatory: list[list[Drag]] | None = optional("circulatory matrix")
    """H in W H q, of rotating damping (N s/m, or N m s)."""

    def conflicts(self, size: int | None, of_file: bool) -> Iterator[Conflict]:
        """One speed, and matrices of the size of the system; of_file: whether a file may hold the matrices."""
        yield from exactly_one(self, ("speed_ratio", "speed"))
        if not of_file and all(self[name] is None for name in OF_ROTATION):
            yield (), "missing", "has no matrix", f"add {', '.join(OF_ROTATION[:-1])} or {OF_ROTATION[-1]}"
        for name in OF_ROTATION:
            yield from not_square(self, name, size)


def rotations(sections: Sequence[RotationSection]) -> tuple[Rotation, ...]:
    """Return the rotations that sections describe; a speed ratio of 0 is none."""
    return tuple(
        Rotation(
            part.speed_ratio,
            np.asarray(0.0 if part.speed is None else part.speed, dtype=float),
            **{name: matrix(part[name]) for name in OF_ROTATION if part[name] is not None},
        )
        for part in sections
        if part.speed_ratio != 0
    )


def check_rotation(document: Document, system: Any) -> None:
    """Report gyroscopic matrices that are not skew, and centripetal ones that are not symmetric."""
    table = (("gyroscopic", 1.0, "skew", "-"), ("centripetal", -1.0, "symmetric", ""))
    for place, part in items(system.rotation):
        for name, sign, kind, minus in table:
            if part[name] is None:
                continue
            full = matrix(part[name])
            values = full.reshape(-1, *full.shape[-2:])[0]
            wrong = np.abs(values + sign * values.T)
            if np.max(wrong) <= SKEW_TOLERANCE * np.max(np.abs(values)):
                continue
            i, j, entries = worst_entry(values, wrong)
            path: Path = ("system", "rotation", place, name, i, j)
            message = f"must be {kind}: {entries}, so {wrong[i, j]:.3g} too much"
            remedy = f"make one {minus}1 times the other; what is left belongs in damping, stiffness or circulatory"
            written = value_at(document.data, path) is not None
            document.report(path if written else ("system", "rotation"), "matrix", message, remedy)
