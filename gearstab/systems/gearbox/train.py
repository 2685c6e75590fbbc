"""Kinematics of a gear train: which way and how fast every rotor turns, through shafts and meshes."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from fractions import Fraction

from gearstab.config.model.not_modelled import CARRIER, INSTEAD_OF_CARRIER
from gearstab.errors import NotPossible


class TrainError(NotPossible):
    """A train that cannot turn or does not hang together; ``where`` is the path below ``system`` of what is wrong."""

    def __init__(self, where: tuple[str | int, ...], message: str, remedy: str) -> None:
        super().__init__(message, remedy)
        self.where = where

    def __str__(self) -> str:
        return f"{'.'.join(map(str, ('system', *self.where)))}: {super().__str__()}"


@dataclass(frozen=True)
class Link:
    """Two rotors (numbers) whose speeds are in a fixed ratio, speed of ``second`` = ratio * speed of ``first``."""

    first: int
    second: int
    ratio: Fraction
    where: tuple[str | int, ...]


def speeds(rotors: int, links: list[Link], start: int) -> list[Fraction]:
    """Signed speeds of all rotors over that of ``start`` (a breadth-first walk through shafts and meshes).

    Raises TrainError where a rotor is not connected to the start or a loop of gears would jam.
    """
    found: dict[int, Fraction] = {start: Fraction(1)}
    queue = deque([start])
    while queue:
        here = queue.popleft()
        for link in links:
            for one, other, ratio in ((link.first, link.second, link.ratio), (link.second, link.first, 1 / link.ratio)):
                if one != here:
                    continue
                speed = found[here] * ratio
                if other not in found:
                    found[other] = speed
                    queue.append(other)
                elif found[other] != speed:
                    raise TrainError(
                        link.where,
                        f"a loop of gears jams here: it asks for {speed} and {found[other]} times the input speed",
                        "change the numbers of teeth of this loop or leave a member out",
                    )
    if len(found) < rotors:
        lost = next(r for r in range(rotors) if r not in found)
        raise TrainError(
            ("rotors", lost),
            "is not connected to the input by shafts and meshes",
            f"add a shaft or a mesh to it; {CARRIER}: {INSTEAD_OF_CARRIER}",
        )
    return [found[r] for r in range(rotors)]


def mesh_link(driver: int, driven: int, teeth: tuple[int, int], internal: bool, where: tuple[str | int, ...]) -> Link:
    """A mesh turns the driven gear the other way, or the same way where one gear is internal."""
    ratio = Fraction(teeth[0], teeth[1])
    return Link(driver, driven, ratio if internal else -ratio, where)


def mesh_frequency_ratios(teeth: list[int], drivers: list[int], speed: list[Fraction]) -> list[Fraction]:
    """Mesh frequency, teeth times speed of the driver, over that of the first mesh."""
    passing = [z * abs(speed[driver]) for z, driver in zip(teeth, drivers, strict=True)]
    return [value / passing[0] for value in passing]
