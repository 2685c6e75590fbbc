"""Finding certificates: pieces that cover a range, and coordinates that prove them, in floating point.

Coordinates are Floquet vectors at the middle of a piece, those that grow most first. How long a piece may be is found
by asking the verifier, so that nothing is kept that it refuses: a piece is followed by a longer one, and tried again at
half its length where it fails. Towards an edge pieces shrink with the distance to it, down to a floor.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import expm

from gearstab.certificates.verifier import Array, Certificate, Flow, near, proves

LONGER, SHORTER = 4.0, 0.6
"""Length of what is tried after a piece that is proved, at most, and after one that is not, as parts of its own."""
AGAIN, BOLDER = 1.0, 1.3
"""The first after a piece that was not proved at once, and what becomes of it with every piece that is."""
TOWARDS = 0.95
"""Part of the distance to an edge that a piece may take."""
FIRST = 0.01
"""Length of the first piece, relative to Omega, where no edge is near."""
GRADED = 1e-6
"""Ratio of multipliers below which the modes of the mean system serve as coordinates."""
REAL = 1e-12
"""Imaginary part, relative to the modulus, below which a multiplier is real."""
CIRCLE = 1e-9
"""Growth over a period that is rounding."""
WITHIN = 0.25
"""Where between the growth of two directions, as logarithms, the rate that tells them apart lies."""
BALANCING = 5
"""Rounds of balancing the lengths of Floquet vectors."""


class Maker:
    """Certificates of one system. floor: width, relative to Omega, that is given up where nothing can be proved."""

    def __init__(self, flow: Flow, floor: float) -> None:
        self.flow, self.floor = flow, floor
        self.generators = np.array([near(generator) for generator in flow.generators])
        self.fractions = np.asarray(flow.fractions)
        self.form = None if flow.form is None else near(flow.form)

    def cover(self, low: float, high: float, edges: tuple[bool, bool] = (False, False)) -> Iterator[Certificate]:
        """Pieces of an interval of Omega, ascending, all of them proved.

        edges: whether its ends are edges between stable and unstable.
        """
        at, stop = np.log([low, high])
        width, more = self.floor if edges[0] else FIRST, LONGER
        while at < stop:
            rest = stop - at
            if edges[1]:
                width = min(width, max(TOWARDS * rest, self.floor))
            width = min(width, rest)
            piece = self.proposal(max(low, float(np.exp(at))), min(high, float(np.exp(at + width))))
            if piece is not None and proves(self.flow, piece):
                yield piece
                at, width, more = at + width, more * width, min(BOLDER * more, LONGER)
            elif width > self.floor:
                width, more = max(SHORTER * width, self.floor), AGAIN
            else:
                at, width = at + width, LONGER * width

    def proposal(self, low: float, high: float) -> Certificate | None:
        """What may prove what the multipliers in the middle say; None where rounding has the last word."""
        period = 2 * np.pi * self.flow.cycles / np.sqrt(low * high)
        monodromy = np.eye(self.generators.shape[-1])
        for segment in expm(self.generators * (self.fractions * period)[:, None, None]):
            monodromy = segment @ monodromy
        if not np.isfinite(monodromy).all():
            return None
        values, vectors = np.linalg.eig(monodromy)
        if np.abs(values).max() < 1 and np.linalg.cond(vectors) * np.abs(values).min() < GRADED * np.abs(values).max():
            values, vectors = np.linalg.eig(np.tensordot(self.fractions, self.generators, 1))
            values = np.exp(values - values.real.max() - 1)
        order = np.argsort(-np.abs(values), kind="stable")
        values, vectors = values[order], vectors[:, order]
        pairs = values.imag > REAL * np.abs(values)
        own = pairs | (np.abs(values.imag) <= REAL * np.abs(values))
        values, vectors, pairs = values[own], vectors[:, own], pairs[own]
        if len(values) + pairs.sum() != len(monodromy) or not values.all():
            return None
        coordinates = self._balanced(vectors, pairs)
        growth = np.log(np.abs(np.repeat(values, 1 + pairs)))
        gap = growth - np.maximum(np.append(growth[1:], -np.inf), 0.0)
        outside = int(np.argmax(gap)) + 1
        if gap[outside - 1] > CIRCLE:
            next_growth = growth[outside] if outside < len(growth) else growth[-1]
            log_rate = 2 * max(0.0, next_growth + WITHIN * (growth[outside - 1] - next_growth))
            return Certificate(low, high, outside, _single(np.exp(log_rate)), coordinates)
        if self.form is None:
            return Certificate(low, high, 0, 1.0, coordinates)
        return Certificate(low, high, 0, 0.0, coordinates, _separators(self.form, values, vectors))

    def _balanced(self, vectors: Array, pairs: Array) -> Array:
        """Real coordinates of Floquet vectors, of such lengths that what couples two of them is alike both ways."""
        owner = np.repeat(np.arange(len(pairs)), 1 + pairs)
        first = np.searchsorted(owner, np.arange(len(pairs)))
        columns = np.empty((len(vectors), len(owner)))
        columns[:, first], columns[:, first[pairs] + 1] = vectors.real, vectors[:, pairs].imag
        try:
            inner = np.linalg.solve(columns, self.generators @ columns)
        except np.linalg.LinAlgError:
            return columns
        size = np.zeros((len(pairs), len(pairs)))
        np.add.at(size, (owner[:, None], owner), np.einsum("s,sij->ij", self.fractions, inner**2))
        np.fill_diagonal(size, 0.0)
        length = np.ones(len(pairs))
        for _ in range(BALANCING):
            into, out = (size / length[:, None] ** 2).sum(axis=0), (size * length**2).sum(axis=1)
            coupled = (into > 0) & (out > 0)
            length[coupled] = np.sqrt(length[coupled]) * (out[coupled] / into[coupled]) ** 0.125
        return (columns * length[owner]).astype(np.float32).astype(float)


def _separators(form: Array, values: Array, vectors: Array) -> tuple[float, ...]:
    """Numbers between the 2 cos(theta) of neighbours of unequal Krein signature."""
    signature = np.sign(np.einsum("ij,ik,kj->j", vectors.conj(), form, vectors).imag)
    turns = 2 * np.cos(np.angle(values))
    order = np.argsort(turns)
    middle, change = 0.5 * (turns[order][1:] + turns[order][:-1]), np.diff(signature[order]) != 0
    return tuple(_single(value) for value in middle[change])


def _single(value: float) -> float:
    return float(np.float32(value))
