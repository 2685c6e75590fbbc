"""Finding certificates: pieces that cover a range, and coordinates that prove them, in floating point.

Coordinates are Floquet vectors near the middle of a piece, those that grow most first. How far they reach is asked of a
few mesh frequencies beyond; what the verifier then refuses is tried again at a part of its length. Towards an edge
pieces shrink with the distance to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.linalg import expm

from gearstab.certificates.choices import GRADED, REAL, balanced
from gearstab.certificates.polynomials import near
from gearstab.certificates.verifier import Array, Certificate, Flow, proves

FIRST = 0.01
"""From the lower end of the first piece to where its coordinates are looked for, relative to Omega, if no edge is near.
"""
REACH = np.array([0.5, 1.0, 1.6, 2.4, 3.6, 6.0, 10.0, 17.0])
"""How far beyond they may reach, as parts of that."""
SHORTER, LONGER = 0.4, 0.55
"""Factors on the next distance: of a piece that was not proved, and of the length of one that was."""
LEAST = 0.05
"""Part of the definiteness in the middle that must be left at the ends: the verifier needs some for its balls."""
WIDE = 1e6
"""Ratio of multipliers above which the modes of the mean system serve as coordinates."""
CONDITION = 1e8
"""Largest condition of eigenvectors from which exponentials are made."""
CIRCLE = 1e-9
"""Growth over a period that is rounding."""
WITHIN = 0.25
"""Where between the growth of two directions, as logarithms, the rate that tells them apart lies."""


class Maker:
    """Certificates of one system. floor: width, relative to Omega, that is given up where nothing can be proved."""

    def __init__(self, flow: Flow, floor: float) -> None:
        self.flow, self.floor = flow, floor
        self.generators = np.array([near(generator) for generator in flow.generators])
        self.states, self.fractions = np.asarray(flow.states), np.asarray(flow.fractions)
        self.following = np.array([[near(part) for part in parts] for parts in flow.following])
        self.share = np.bincount(self.states, self.fractions)
        self.form = None if flow.form is None else near(flow.form)
        if flow.following:
            self.spectra = None
            return
        values, vectors = np.linalg.eig(self.generators)
        diagonal = np.linalg.cond(vectors).max() < CONDITION
        self.spectra = (values, vectors, np.linalg.inv(vectors)) if diagonal else None

    def _generators(self, omega: float) -> Array:
        """``(D, m, m)``, of all states."""
        if not self.flow.following:
            return self.generators
        return np.asarray(self.generators + (self.following[:, 0] + self.following[:, 1] / omega) / omega)

    def cover(self, low: float, high: float, edges: tuple[bool, bool] = (False, False)) -> Iterator[Certificate]:
        """Pieces of an interval of Omega, ascending, all of them proved.

        edges: whether its ends are edges between stable and unstable.
        """
        at, stop = low * (1 + edges[0] * self.floor), high * (1 - edges[1] * self.floor)
        distance, trust = self.floor if edges[0] else FIRST, len(REACH)
        while at < stop:
            piece = self._reaching(at, stop, distance, trust)
            if piece is not None and proves(self.flow, piece):
                yield piece
                trust = min(trust + 1, len(REACH))
                at, distance = piece.high, max(LONGER * (piece.high / piece.low - 1), SHORTER * self.floor)
            elif piece is not None and trust > 1:
                trust //= 2
            elif distance > SHORTER * self.floor:
                distance *= SHORTER
            else:
                at, distance = at * (1 + self.floor), self.floor

    def _reaching(self, low: float, stop: float, distance: float, trust: int) -> Certificate | None:
        """A piece from ``low`` to as far as what its coordinates, taken at a distance, prove; trust: how many of REACH
        are asked.
        """
        middle = min(low * (1 + distance), np.sqrt(low * stop))
        ends = np.minimum(middle + (middle - low) * REACH[:trust], stop)
        phi = self._monodromy(np.array([middle, low, *ends]))
        found = self._claim(phi[0], low, middle)
        if found is None:
            return None
        definite = self._definiteness(found, phi)
        enough = definite[1:] > LEAST * max(definite[0], 0.0)
        if not enough[0]:
            return None
        reached = int(np.argmin(np.append(enough, False))) - 1
        return replace(found, high=float(ends[reached - 1])) if reached else found

    def _definiteness(self, piece: Certificate, phi: Array) -> Array:
        """The least eigenvalue of the form that proves a piece for ``(P, m, m)``; 1 where coordinates are others."""
        x = piece.coordinates
        if piece.rate:
            moved = np.linalg.solve(x, phi @ x)
            if piece.outside == 0 and np.linalg.cond(moved[0]) > GRADED:
                return np.ones(len(phi))
            signs = np.where(np.arange(len(x)) < piece.outside, 1.0, -1.0)
            form = np.swapaxes(moved, 1, 2) @ (signs[:, None] * moved) - piece.rate * np.diag(signs)
            return np.asarray(np.linalg.eigvalsh(form)[:, 0])
        assert self.form is not None
        turned = self.form @ phi
        total = phi - np.linalg.solve(self.form, np.swapaxes(turned, 1, 2))
        form = turned + np.swapaxes(turned, 1, 2)
        for zero in piece.separators:
            form = form @ (total - zero * np.eye(len(x)))
        form = x.T @ form @ x
        return np.asarray(np.linalg.eigvalsh(form * np.sign(form[:1, :1, :1]))[:, 0])

    def _monodromy(self, omega: Array) -> Array:
        """``(P, m, m)``, at each omega ``(P,)``."""
        m = self.generators.shape[-1]
        found = np.broadcast_to(np.eye(m), (len(omega), m, m))
        if self.flow.following:
            every = np.array([self._generators(at) for at in omega.tolist()])
            for state, f in zip(self.states, self.fractions, strict=True):
                found = expm(every[:, state] * (f * 2 * np.pi * self.flow.cycles)) @ found
            return found
        for state, f in zip(self.states, self.fractions, strict=True):
            times = f * 2 * np.pi * self.flow.cycles / omega
            if self.spectra is None:
                own = expm(self.generators[state] * times[:, None, None])
            else:
                values, vectors, back = (part[state] for part in self.spectra)
                own = ((vectors * np.exp(values * times[:, None])[:, None, :]) @ back).real
            found = own @ found
        return found

    def proposal(self, low: float, high: float) -> Certificate | None:
        """Return the claim that the multipliers in the middle suggest; None where rounding has the last word."""
        return self._claim(self._monodromy(np.array([np.sqrt(low * high)]))[0], low, high)

    def _claim(self, monodromy: Array, low: float, high: float) -> Certificate | None:
        if not np.isfinite(monodromy).all():
            return None
        values, vectors = np.linalg.eig(monodromy)
        least, most = np.abs(values).min(), np.abs(values).max()
        # The condition is 1 at least, and takes longest to find.
        if most < 1 and least * WIDE <= most and np.linalg.cond(vectors) * least * WIDE <= most:
            values, vectors = np.linalg.eig(np.tensordot(self.share, self._generators(low), 1))
            # Of rates what orders and pairs them: multipliers themselves may be below all doubles.
            values = np.exp(values.real / np.abs(values.real).max() - 2 + 1j * np.sign(values.imag))
        order = np.argsort(-np.abs(values), kind="stable")
        values, vectors = values[order], vectors[:, order]
        pairs = values.imag > REAL * np.abs(values)
        own = pairs | (np.abs(values.imag) <= REAL * np.abs(values))
        values, vectors, pairs = values[own], vectors[:, own], pairs[own]
        if len(values) + pairs.sum() != len(monodromy) or not values.all():
            return None
        coordinates = balanced(vectors, pairs, self._generators(low), self.share)
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


def _separators(form: Array, values: Array, vectors: Array) -> tuple[float, ...]:
    """Numbers between the 2 cos(theta) of neighbours of unequal Krein signature."""
    signature = np.sign(np.einsum("ij,ik,kj->j", vectors.conj(), form, vectors).imag)
    turns = 2 * np.cos(np.angle(values))
    order = np.argsort(turns)
    middle, change = 0.5 * (turns[order][1:] + turns[order][:-1]), np.diff(signature[order]) != 0
    return tuple(_single(value) for value in middle[change])


def _single(value: float) -> float:
    return float(np.float32(value))
