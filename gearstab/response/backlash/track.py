"""Many pieces of a motion at once, as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np

from gearstab.response.backlash.follow import Chatter, Stretch
from gearstab.system import Array

AT_ONCE = 64
"""Stretches that are gathered to one track."""


@dataclass(frozen=True)
class Track:
    """S stretches, one after the other, see :class:`~gearstab.response.backlash.follow.Stretch`.

    powers: ``(S, degree + 1, D)``;  length, begin: ``(S,)``;  period: ``(S,)``, integers.
    contact: ``(S, meshes)``;  values: ``(S, order, J)``, the varying functions as powers of u, None where they
        are not known as such.
    mesh, kind, speed: ``(S,)``, of the event at the end; where there is none mesh is -1.  grazing: ``(S,)`` bool.
    """

    powers: Array
    length: Array
    begin: Array
    period: Array
    contact: Array
    values: Array | None
    mesh: Array
    kind: Array
    speed: Array
    grazing: Array

    def __getitem__(self, which: slice | Array) -> Track:
        """Some of them."""
        parts = ((part.name, getattr(self, part.name)) for part in fields(self))
        return replace(self, **{name: part[which] for name, part in parts if part is not None})


def gathered(stretches: Iterator[Stretch]) -> Iterator[Track]:
    """The same motion as tracks; what ends it is raised when all that was before it is out."""
    kept: list[Stretch] = []
    try:
        for stretch in stretches:
            kept.append(stretch)
            if len(kept) == AT_ONCE:
                yield _track(kept)
                kept = []
    except (Chatter, OverflowError):
        if kept:
            yield _track(kept)
        raise


def _track(kept: list[Stretch]) -> Track:
    pieces, events = [stretch.piece for stretch in kept], [stretch.event for stretch in kept]
    values = [stretch.values for stretch in kept if stretch.values is not None]
    return Track(
        powers=np.stack([piece.powers for piece in pieces]),
        length=np.array([piece.length for piece in pieces]),
        begin=np.array([stretch.begin for stretch in kept]),
        period=np.array([stretch.period for stretch in kept]),
        contact=np.stack([stretch.contact for stretch in kept]),
        values=np.stack(values)[:, None] if values else None,
        mesh=np.array([-1 if event is None else event.mesh for event in events]),
        kind=np.array([0 if event is None else event.kind for event in events]),
        speed=np.array([np.nan if event is None else event.speed for event in events]),
        grazing=np.array([stretch.grazing for stretch in kept]),
    )
