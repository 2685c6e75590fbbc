"""A scene of a benchmark: one system and its mesh frequencies, with its segments as plain numbers.

The segments are made here once more and independently of :mod:`gearstab.floquet`, so that the methods that are compared
with it do not inherit its errors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from gearstab.floquet.dispatch import in_modes
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.modal import mean_modes
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Profile

COUPLED = 1e-12
"""Damping between rigid-body and elastic modes below this part of the largest is rounding."""


@dataclass(frozen=True)
class Scene:
    """One system (no batch) and the range of mesh frequencies (rad per unit time) it is looked at."""

    system: GearSystem
    start: float
    stop: float

    @cached_property
    def edges(self) -> list[float]:
        """Return where in the common period (0 to 1) anything jumps or has a kink; the first is 0, the last 1."""
        counts = self.system.common_period()[1]
        varying: tuple[Mesh | PeriodicTerm, ...] = (*self.system.meshes, *self.system.terms)
        found = {0.0, 1.0}
        for part, count in zip(varying, counts, strict=True):
            profiles = part.profiles if isinstance(part, PeriodicTerm) else (part.waveform,)
            for point in np.concatenate([np.ravel(profile.breakpoints()) for profile in profiles]):
                found |= {float((point + part.lag + k) / count) % 1.0 for k in range(count)}
        return sorted(found)

    @cached_property
    def segments(self) -> list[tuple[float, tuple[float, ...]]]:
        """(duration in periods 2 pi/Omega of the first mesh, stiffness of each mesh), over one common period.

        Of a scene whose stiffness is piecewise constant and has no further terms.
        """
        return [(self.cycles * (b - a), self.levels(0.5 * (a + b))) for a, b in pairwise(self.edges)]

    def levels(self, tau: float) -> tuple[float, ...]:
        """Stiffness of each mesh at the part tau of the common period."""
        counts = self.system.common_period()[1]
        return tuple(
            float(mesh.mean_stiffness + 2 * mesh.amplitude * mesh.waveform.value(np.asarray(count * tau - mesh.lag)))
            for mesh, count in zip(self.system.meshes, counts, strict=False)
        )

    @property
    def cycles(self) -> float:
        """Common period in periods of the first mesh."""
        return float(self.system.common_period()[0])

    def generator(self, levels: tuple[float, ...]) -> Array:
        """A of (q, q')' = A (q, q'), ``(2n, 2n)``, with the mesh stiffnesses ``levels`` and without further terms."""
        stiffness = self.system.stiffness_matrix([np.asarray(level) for level in levels])
        return self._first_order(stiffness, self.system.damping_matrix)

    def generator_at(self, tau: float) -> Array:
        """The same at the part tau of the common period, with all terms."""
        constant, parts = self._parts
        for function, matrix in parts:
            constant = constant + function(tau) * matrix
        return constant

    def lookup(self) -> Callable[[float], Array]:
        """:meth:`generator_at` as fast as can be: looked up where it is constant between the edges."""
        if not self.exact:
            return self.generator_at
        generators, ends = [self.generator(levels) for _, levels in self.segments], np.array(self.edges[1:-1])
        return lambda tau: generators[int(np.searchsorted(ends, tau, side="right"))]

    @cached_property
    def _parts(self) -> tuple[Array, list[tuple[Callable[[float], Array], Array]]]:
        """Constant part of A, and functions of tau with their matrices, prepared for speed."""
        system, n = self.system, self.system.size
        counts = system.common_period()[1]
        zero = np.zeros((n, n))
        constant = self.generator(tuple(float(mesh.mean_stiffness) for mesh in system.meshes))
        bare = self._first_order(zero, zero)
        found: list[tuple[Callable[[float], Array], Array]] = []

        def add(profile: Profile, count: int, lag: Array | float, stiffness: Array, damping: Array) -> None:
            shift = float(lag)
            matrix = self._first_order(stiffness, damping) - bare
            found.append((lambda tau: profile.value(np.asarray(count * tau - shift)), matrix))

        for mesh, count in zip(system.meshes, counts, strict=False):
            add(mesh.waveform, count, mesh.lag, 2 * mesh.amplitude * mesh.outer, zero)
        for term, count in zip(system.terms, counts[len(system.meshes) :], strict=True):
            outer = np.outer(term.left, term.right)
            for profile, parts in ((term.stiffness, (outer, zero)), (term.damping, (zero, outer))):
                if profile is not None:
                    add(profile, count, term.lag, *parts)
        return constant, found

    def _first_order(self, stiffness: Array, damping: Array) -> Array:
        n = self.system.size
        solved = np.linalg.solve(self.system.mass, np.concatenate([stiffness, damping], axis=1))
        return np.block([[np.zeros((n, n)), np.eye(n)], [-solved]])

    @property
    def exact(self) -> bool:
        """Whether segments of constant mesh stiffness are all of it."""
        return self.system.piecewise_constant and not self.system.terms

    @property
    def conservative(self) -> bool:
        """No damping and no further terms, or damping proportional to the mass, which only shifts the exponents."""
        system = self.system
        ratio = np.linalg.solve(system.mass, system.damping_matrix)
        uniform = ratio[0, 0] * np.eye(system.size)
        return in_modes(system) and bool(np.allclose(ratio, uniform, rtol=0, atol=1e-14 * np.abs(ratio).max()))

    def frequencies(self, count: int) -> Array:
        """``count`` mesh frequencies spread over the range, none of them a round number."""
        golden = 0.5 * (np.sqrt(5.0) - 1.0)
        return self.start + (self.stop - self.start) * ((np.arange(count) + 0.5) * golden % 1.0)


def without_rigid_modes(system: GearSystem) -> GearSystem:
    """The system (no batch) in its elastic modes, q = Phi_e u.

    Rigid-body modes take no part in stability, but their defective multiplier 1 would: the largest in a stable system,
    and known to eight digits only. They stay where damping couples them to the elastic modes.
    """
    modes = mean_modes(system)
    if not modes.rigid.any():
        return system
    elastic = modes.shapes[:, ~modes.rigid]
    moved = [np.abs(modes.shapes.T @ term.right) for term in system.terms]
    if any(part[modes.rigid].max() > COUPLED * part.max() for part in moved):
        return system
    modal = np.abs(modes.shapes.T @ system.damping_matrix @ modes.shapes)
    if modal[modes.rigid].max() > COUPLED * modal.max():
        return system
    found = system.undriven().projected(elastic)
    back = np.linalg.solve(found.mass, elastic.T @ system.mass)
    symmetries = tuple(replace(item, turn=back @ item.turn @ elastic) for item in system.symmetries)
    return replace(found, symmetries=symmetries, coordinates=tuple(f"u{p + 1}" for p in range(found.size)))
