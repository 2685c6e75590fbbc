"""Stiffness of a mesh over its cycle, for any contact ratio, and its reductions to simpler waves.

Phase 0 is the entry of a pair of teeth: floor(c) + 1 pairs carry for the fraction c - floor(c), then floor(c).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from gearstab.errors import NotPossible
from gearstab.gears.compliance import pair_stiffness
from gearstab.gears.pair import Pair
from gearstab.waveforms import Fourier, Helical
from gearstab.waveforms.base import stiff_fraction
from gearstab.waveforms.tooth import Piecewise, Tooth, averaged, nodes, through

Array = np.ndarray

DEGREE = 20  # of the polynomial on each piece: 1e-14 of the stiffness for common teeth
DEGREES = (DEGREE, 40, 80, 160)  # tried in turn for slender tips, until the last coefficients are below
RESOLVED = 1e-12
Keep = Literal["peak-to-peak", "first harmonic", "levels"]


@dataclass(frozen=True)
class StiffnessModel:
    """How single pairs make up the mesh, and what measurements say of them.

    Parameters
    ----------
    double_contact_factor: f, the stiffness of two pairs in contact over the sum of theirs. Teeth on one body deflect
        each other, which the sum ignores: plane finite elements give f = 0.77 (19/48 teeth). n pairs that influence
        each other equally then have the fraction f_n = 1/[1 + (n - 1) (1/f - 1)] of their sum.
    single_pair_stiffness: N/m, of one pair in contact at the pitch point; the computed curve is scaled to it. Pairs of
        an internal wheel then have this stiffness all along their path.
    variation: (max k - min k)/mean k of the mesh: the computed curve is stretched about its mean to it.
    foundation: whether the teeth stand on an elastic body.

    Raises NotPossible for values out of range.
    """

    double_contact_factor: float = 1.0
    single_pair_stiffness: float | None = None
    variation: float | None = None
    foundation: bool = True

    def __post_init__(self) -> None:
        if not 0.5 < self.double_contact_factor <= 1:
            # At 1/2 a second pair adds nothing, below it would soften the mesh.
            raise NotPossible(f"double_contact_factor must lie above 0.5 and up to 1, not {self.double_contact_factor}")
        if self.single_pair_stiffness is not None and not self.single_pair_stiffness > 0:
            raise NotPossible(f"single_pair_stiffness must be positive, not {self.single_pair_stiffness}")
        if self.variation is not None and not self.variation >= 0:
            raise NotPossible(f"variation must not be negative, not {self.variation}")

    def shared(self, pairs: Array) -> Array:
        """f_n for n pairs in contact."""
        return 1 / (1 + (np.maximum(pairs, 1) - 1) * (1 / self.double_contact_factor - 1))


PLAIN = StiffnessModel()


@dataclass(frozen=True)
class RectangularReduction:
    """Parameters of a rectangular wave in place of the computed one."""

    mean_stiffness: float
    epsilon: float
    contact_ratio: float


@dataclass(frozen=True)
class MeshStiffness:
    """k(x) of a mesh, N/m, over the phase x of its cycle.

    Parameters
    ----------
    pair, model: what it was computed from.
    transverse: k(x) of spur teeth of the transverse section, with breakpoints where a pair enters and leaves.
    """

    pair: Pair
    model: StiffnessModel
    transverse: Piecewise

    @cached_property
    def curve(self) -> Piecewise:
        """k(x), of helical teeth the mean of the transverse stiffness over the overlap ratio.

            k(x) = 1/eps_beta int_0^eps_beta k_t(x - u) du

        A slice at y of the face width b is a spur mesh, delayed by eps_beta y/b; slices do not brace each other.
        """
        return averaged(self.transverse, self.pair.overlap_ratio)

    @property
    def contact_ratio(self) -> float:
        """Mean number of pairs in contact in the transverse section."""
        return self.pair.contact_ratio

    @property
    def start(self) -> float:
        """The phase at which its rectangular wave begins."""
        return 0.0

    @cached_property
    def waveform(self) -> Tooth:
        """w with k = mean [1 + 2 epsilon w]."""
        return Tooth(self.curve, self.pair.contact_ratio)

    @property
    def mean(self) -> float:
        """k_g."""
        return float(self.curve.mean)

    @property
    def extremes(self) -> tuple[float, float]:
        """The least and the greatest k."""
        low, high = self.curve.extremes
        return float(low), float(high)

    @property
    def epsilon(self) -> float:
        """(max k - min k)/(2 mean k)."""
        low, high = self.extremes
        return (high - low) / (2 * self.mean)

    @property
    def levels(self) -> tuple[float, float]:
        """Mean of the transverse stiffness while floor(c) pairs carry, and while floor(c) + 1 do.

        The latter is NaN for an integer contact ratio.
        """
        high, low = self.transverse.means
        return float(low), float(high) if self.transverse.lengths[0] > 0 else float("nan")

    def harmonic(self, order: int) -> float:
        """Amplitude of the harmonic of that order over the mean stiffness."""
        return float(np.hypot(*self.curve.fourier(order))) / self.mean

    def rectangular(self, keep: Keep = "peak-to-peak") -> RectangularReduction:
        """Return the rectangular wave of the mean and contact ratio of the transverse stiffness, with one more of its
        quantities.

        ``peak-to-peak``: max k - min k. ``first harmonic``: its amplitude, 4 epsilon sin(pi d)/pi with d = c -
        floor(c). ``levels``: the difference of the mean stiffness with more and with fewer pairs in contact. Averaged
        over the overlap ratio it is a trapezoid with ramps of that width.

        Raises NotPossible where no such wave of positive stiffness exists: the first harmonic close to an integer
        contact ratio, where the computed wave has one from its rounded flanks and the rectangular one has hardly any.
        """
        c = self.contact_ratio
        d = float(stiff_fraction(c))
        epsilon = float(np.subtract(*self.transverse.extremes[::-1])) / (2 * self.mean)
        if keep == "first harmonic":
            factor = 4 * np.sin(np.pi * d) / np.pi
            first = np.hypot(*self.transverse.fourier(1)) / self.mean
            epsilon = float(first) / factor if factor > 0 else np.inf
        elif keep == "levels":
            low, high = self.levels
            epsilon = (high - low) / (2 * self.mean) if d > 0 else 0.0
        lowest, _ = Helical(c, self.pair.overlap_ratio).extremes()
        if not 2 * epsilon * -lowest < 1:
            raise NotPossible(f"no rectangular wave of contact ratio {c:.4f} and positive stiffness keeps the {keep}")
        return RectangularReduction(self.mean, float(epsilon), c)

    def series(self, order: int) -> Fourier:
        """The waveform cut off after the harmonic ``order``; mean and epsilon stay those of this mesh."""
        sin, cos = zip(*(self.waveform.fourier(s) for s in range(1, order + 1)), strict=True)
        return Fourier(np.array(sin, dtype=float), np.array(cos, dtype=float))


def contact_stiffness(pair: Pair, x: Array | float, model: StiffnessModel = PLAIN) -> tuple[Array, Array]:
    """(s, k) of every pair of teeth at the phases x, ``(..., N)`` each with N = floor(c) + 1; k = 0 out of contact.

    Their sum over the last axis is the mesh stiffness, of the transverse section of helical gears, so that k over it is
    the share of the load of a pair of spur teeth.
    """
    s, touching = pair.contacts(x)
    k = np.where(touching, single_stiffness(pair, np.clip(s, *pair.path), model), 0.0)
    k = k * model.shared(np.sum(touching, axis=-1, keepdims=True))
    if model.variation is None:
        return s, k
    plain = mesh_stiffness(pair, replace(model, variation=None))
    total = np.sum(k, axis=-1, keepdims=True)
    factor = model.variation / (2 * plain.epsilon) if plain.epsilon > 0 else 0.0
    return s, k * (plain.mean + factor * (total - plain.mean)) / total


def single_stiffness(pair: Pair, s: Array, model: StiffnessModel) -> Array:
    """Return the stiffness of a pair of teeth by itself that touches at s, N/m, of the shape of s."""
    measured = model.single_pair_stiffness
    if pair.wheel.internal and measured is not None:
        return np.full(s.shape, measured)
    k = pair_stiffness(pair, s, model.foundation)
    return k if measured is None else k * (measured / pair_stiffness(pair, pair.pitch_point, model.foundation))


def resolved(edges: Array, values: Callable[[Array], Sequence[Array]]) -> list[Piecewise]:
    """Return polynomials on the pieces that begin at edges, ``(B,)``, through functions of the phases ``(B, P)``.

    All have one degree, high enough for each of them, or the highest.
    """
    for degree in DEGREES:
        curves = [through(edges, found) for found in values(nodes(edges, degree))]
        sizes = [np.max(np.abs(curve.coefficients), axis=0) for curve in curves]
        if all(len(size) <= degree or np.max(size[-2:]) < RESOLVED * np.max(size) for size in sizes):
            break
    return curves


@lru_cache(maxsize=4096)
def mesh_stiffness(pair: Pair, model: StiffnessModel = PLAIN) -> MeshStiffness:
    """The mesh stiffness of a pair over its cycle, along the transverse line of action.

    Raises NotPossible for a total contact ratio below 1 (contact breaks off), and for a ``variation`` that makes the
    stiffness negative.
    """
    c = pair.contact_ratio
    if pair.total_contact_ratio < 1:
        raise NotPossible(f"contact breaks off: contact ratio {pair.total_contact_ratio:.4f}")
    edges = np.array([0.0, stiff_fraction(c)])
    (curve,) = resolved(edges, lambda x: (np.sum(contact_stiffness(pair, x, model)[1], axis=-1),))
    mesh = MeshStiffness(pair, model, curve)
    if model.variation is not None and not mesh.extremes[0] > 0:
        raise NotPossible(f"variation {model.variation} takes the mesh stiffness down to {mesh.extremes[0]:.4g} N/m")
    return mesh
