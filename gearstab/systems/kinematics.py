"""Kinematics of a train: speeds of all bodies from linear relations over exact fractions.

A shaft makes two bodies turn alike; a held body rests; a mesh obeys Willis' equation relative to the body that its axes
are fixed in, the housing or a carrier. Epicyclic trains, loops and differentials are all solved by elimination.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from gearstab.errors import NotPossible

Where = tuple[str | int, ...]
"""Path below ``system`` of what a relation comes from."""


@dataclass(frozen=True)
class Relation:
    """sum of factor times speed = value, over the bodies of ``factors``."""

    factors: Mapping[str, Fraction | int]
    where: Where
    value: Fraction | int = 0


@dataclass(frozen=True)
class MeshMotion:
    """Two gears in mesh: z_1 (w_1 - w_f) = -+ z_2 (w_2 - w_f), - of external gears, + where one gear is internal.

    gears, teeth: names and numbers of teeth, z_1 and z_2. fixed_in: the carrier f of the axes, "" for the housing.
    """

    gears: tuple[str, str]
    teeth: tuple[int | Fraction, int | Fraction]
    internal: bool
    where: Where
    fixed_in: str = ""

    @property
    def relation(self) -> Relation:
        """Willis' equation."""
        z_1, z_2 = self.teeth[0], self.teeth[1] * (-1 if self.internal else 1)
        frame = {self.fixed_in: -(z_1 + z_2)} if self.fixed_in else {}
        return Relation({self.gears[0]: z_1, self.gears[1]: z_2, **frame}, self.where)

    def relative(self, speeds: Mapping[str, Fraction], gear: int = 0) -> Fraction:
        """Return the speed of a gear relative to the body that the mesh is fixed in."""
        return speeds[self.gears[gear]] - (speeds[self.fixed_in] if self.fixed_in else 0)

    @property
    def reversed(self) -> MeshMotion:
        """The same with the other gear first."""
        return replace(self, gears=self.gears[::-1], teeth=self.teeth[::-1])

    def frequency(self, speeds: Mapping[str, Fraction]) -> Fraction:
        """Return the mesh frequency, teeth times relative speed."""
        return Fraction(self.teeth[0] * abs(self.relative(speeds)))


class TrainError(NotPossible):
    """A train that cannot turn or does not hang together; ``where`` is the path below ``system`` of what is wrong."""

    def __init__(self, where: Where, message: str, remedy: str) -> None:
        super().__init__(message, remedy)
        self.where = where

    def __str__(self) -> str:
        return f"{'.'.join(map(str, ('system', *self.where)))}: {super().__str__()}"


class Undetermined(NotPossible):
    """Speeds that the relations leave open; ``bodies`` are those concerned."""

    def __init__(self, bodies: Sequence[str]) -> None:
        names = ", ".join(bodies)
        super().__init__(f"the speed of {names} is not determined", "hold a member, connect it, or give it a speed")
        self.bodies = bodies


Row = tuple[dict[str, Fraction], Fraction, frozenset[int]]
"""Factors and value of a combination of relations, and the numbers of these."""


def solve(bodies: Iterable[str], relations: Sequence[Relation]) -> dict[str, Fraction]:
    """Return the speed of every body, by elimination.

    Raises TrainError at the first relation that contradicts those before it, Undetermined where speeds stay open.
    """
    names, (pivots, _) = list(bodies), _eliminated(relations)
    if open_ := [body for body in names if body not in pivots or len(pivots[body][0]) > 1]:
        raise Undetermined(open_)
    return {body: pivots[body][1] for body in names}


def reactions(
    bodies: Iterable[str], relations: Sequence[Relation], torques: Mapping[str, Fraction]
) -> dict[int, Fraction]:
    """Return lambda_i by the number of a relation: it acts on body b with the torque lambda_i times its factor.

    With the given torques all bodies are in equilibrium (virtual work). Relations that follow from others before them
    carry nothing. Speeds must be determined.
    """
    _, independent = _eliminated(relations)
    rows = []
    for body in bodies:
        factors = {str(i): relations[i].factors.get(body, 0) for i in independent}
        rows.append(Relation(factors, (), -torques.get(body, Fraction(0))))
    return {int(number): value for number, value in solve(map(str, independent), rows).items()}


def _eliminated(relations: Sequence[Relation]) -> tuple[dict[str, Row], list[int]]:
    """The pivot row of each body, free of all other pivots, and the numbers of the relations that are independent."""
    pivots: dict[str, Row] = {}
    independent = []
    for number, relation in enumerate(relations):
        factors = {body: Fraction(factor) for body, factor in relation.factors.items() if factor}
        row = (factors, Fraction(relation.value), frozenset((number,)))
        for other, pivot in pivots.items():
            row = _without(row, other, pivot)
        body = next(iter(row[0]), None)
        if body is None and row[1]:
            raise _contradiction(relations, row)
        if body is not None:
            independent.append(number)
            scale = row[0][body]
            row = ({name: factor / scale for name, factor in row[0].items()}, row[1] / scale, row[2])
            pivots = {other: _without(pivot, body, row) for other, pivot in pivots.items()} | {body: row}
    return pivots, independent


def _without(row: Row, body: str, pivot: Row) -> Row:
    """The row with a body eliminated by the row that has it as its pivot."""
    share = row[0].get(body)
    if not share:
        return row
    left = {name: row[0].get(name, 0) - share * pivot[0].get(name, 0) for name in {**row[0], **pivot[0]}}
    return {k: factor for k, factor in left.items() if factor}, row[1] - share * pivot[1], row[2] | pivot[2]


def _contradiction(relations: Sequence[Relation], row: Row) -> TrainError:
    """The relation that comes last among those of a contradiction, with all bodies concerned."""
    involved = sorted(row[2])
    bodies = dict.fromkeys(body for number in involved for body in relations[number].factors)
    return TrainError(
        relations[involved[-1]].where,
        f"the train jams here: no speeds of {', '.join(bodies)} meet all shafts, meshes and held bodies between them",
        "change the numbers of teeth of this loop, or release one of these bodies",
    )
