"""Contracts of periodic functions, of waves made from a stiffness, and of their keys in a configuration.

Periodic functions made of others follow.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from gearstab.config.document import Code
from gearstab.config.model.conflicts import Conflict
from gearstab.config.model.fields import Quantity, Section

Array = np.ndarray

POSITION = Quantity(turns=True)
"""A fraction of the mesh period."""
SAMPLED = Quantity("N/m", ("N m",))
"""A stiffness of samples."""

WrongSample = tuple[int | None, Code, str, str]
"""Index of the first wrong sample, None where it is all of them; code, message, remedy."""


class Profile(Protocol):
    """A function of period 1 whose parameters may be arrays (a batch)."""

    @property
    def piecewise_constant(self) -> bool:
        """Whether it is constant between its breakpoints, whatever its parameters."""
        ...

    @property
    def batch(self) -> tuple[int, ...]:
        """The shape of the parameters."""
        ...

    def value(self, x: Array) -> Array:
        """The function at the phase x (in periods), which broadcasts against the batch; continuous from the right."""
        ...

    def breakpoints(self) -> Array:
        """``(..., B)``: the phases in [0, 1), jumps and kinks, between which the function is analytic."""
        ...


class Keys(Section):
    """Keys that a wave takes in the section ``waveform`` ; each but ``kind`` is None where it is not given.

    A key that several waves take is declared once, in a class that theirs inherit.
    """

    kind: str = "rectangular"


class Waveform(Profile):
    """The shape w of a mesh stiffness, k_v = 2 k_a w: period 1 and zero mean; a :class:`Profile`.

    Its peak-to-peak is 1, so that 2 k_a is that of the stiffness, but for a Fourier series, which keeps the
    coefficients that were given.

    A wave overrides ``build``, what :class:`Profile` asks for, ``extremes`` and ``fourier``, and says with the class
    attributes what it takes in a configuration.
    """

    said: ClassVar[str] = ""
    """Text on it in the documentation of the key ``kind``."""
    keys: ClassVar[type[Keys]] = Keys
    required: ClassVar[tuple[str, ...]] = ()
    """Keys that must be given."""
    sources: ClassVar[tuple[str, ...]] = ()
    """Keys of which exactly one says where the wave comes from."""
    columns: ClassVar[Mapping[str, Quantity]] = {"phase": POSITION, "stiffness": SAMPLED}
    """Columns of a file of samples, and what each may be, for waves that take one."""
    has_contact_ratio: ClassVar[bool] = True
    """Whether the mesh gives a contact ratio."""
    own_variation: ClassVar[bool] = False
    """Whether it is made from a stiffness, with a mean and an amplitude of its own when the mesh gives none."""
    of_teeth: ClassVar[bool] = False
    """Whether it is computed from the teeth of a gearbox, and not by ``build``."""
    fraction_sets_levels: ClassVar[bool] = False
    """Whether its levels are 1 - d and -d, d = c - floor(c), so that the ends of an axis of d hold the worst ones."""
    worst_at_ends: ClassVar[tuple[str, ...]] = ()
    """Keys along which the least value of the wave is monotonic or concave: the ends of an axis hold the worst one."""

    @classmethod
    def build(cls, spec: Any, contact_ratio: Any = None) -> Self:
        """Return the wave of a validated section ``waveform``, any number of which may be an array of batch shape."""
        raise NotImplementedError

    @classmethod
    def conflicts(cls, section: Any) -> Iterator[Conflict]:
        """Yield what contradicts itself in the section, beyond keys that are missing or another wave's."""
        yield from ()

    @classmethod
    def has_own_mean(cls, section: Any) -> bool:
        """Whether the section says how stiff the mesh is."""
        return False

    @classmethod
    def wrong_phase(cls, phase: Sequence[float], interpolation: str) -> WrongSample | None:
        """Return what is wrong with the phases of samples, for waves that take samples."""
        return None

    @classmethod
    def from_file(cls, columns: Array) -> dict[str, Array]:
        """Return what ``build`` finds of the columns of a file."""
        return dict(zip(cls.columns, columns, strict=True))

    @classmethod
    def measured(cls, columns: Array) -> tuple[Array, Array, str]:
        """Return which rows of a file count, in order, their phases, and what is doubtful about them."""
        return np.arange(columns.shape[-1]), columns[list(cls.columns).index("phase")], ""

    @classmethod
    def wrong_samples(cls, columns: Sequence[Sequence[float]], interpolation: str) -> WrongSample | None:
        """Return what is wrong with the columns of a file."""
        return cls.wrong_phase(columns[0], interpolation)

    @property
    def piecewise_constant(self) -> bool:
        """Whether it is constant between its breakpoints, whatever its parameters."""
        return False

    def extremes(self) -> tuple[Array, Array]:
        """Return the least and the greatest value of w, ``(...)`` each."""
        raise NotImplementedError

    def fourier(self, order: int) -> tuple[Array, Array]:
        """Return (a_s, b_s) of w(x) = sum_s a_s sin 2 pi s x + b_s cos 2 pi s x."""
        raise NotImplementedError

    def levels(self) -> Array:
        """Return ``(..., L)``, the values of a wave that is piecewise constant; here the least and the greatest."""
        return np.stack(np.broadcast_arrays(*self.extremes()), axis=-1)

    def level_at(self, x: Array) -> Array:
        """Return which of :meth:`levels` the wave has at the phase x: here the greatest where it is positive."""
        return (self.value(x) > 0).astype(np.int64)

    @property
    def stiffer_level(self) -> Array:
        """The level that ``max_stiffness`` keeps, above the mean and in units of 2 k_a."""
        return self.extremes()[1]

    @property
    def mean_stiffness(self) -> Array:
        """Mean of the stiffness that the wave was made from, for meshes that do not give it; zeros of other waves."""
        return np.zeros(self.batch)

    @property
    def amplitude(self) -> Array:
        """Half the peak-to-peak of that stiffness; zeros for other waves."""
        return np.zeros(self.batch)


def as_array(value: Any) -> Array:
    """Return numbers as floats."""
    return np.asarray(value, dtype=float)


def wrapped(x: Array) -> Array:
    """x modulo 1, in [0, 1): also where rounding would make it 1."""
    found = np.asarray(x) - np.floor(x)
    return np.where(found >= 1.0, 0.0, found)


def stiff_fraction(contact_ratio: Array | float) -> Array:
    """d = c - floor(c), the fraction of the period in which floor(c) + 1 pairs of teeth carry."""
    c = np.asarray(contact_ratio, dtype=float)
    return c - np.floor(c)


LEVEL = 1e-13
"""A variation below this part of the largest stiffness is rounding: the wave is taken as constant."""


class OfStiffness(Waveform):
    """w = (k - mean k)/(max k - min k) of a stiffness k(x); 0 where k is constant.

    Such a wave overrides ``stiffness_at``, ``mean_stiffness``, ``stiffness_range`` and ``stiffness_harmonic``.
    """

    own_variation: ClassVar[bool] = True

    def stiffness_at(self, x: Array) -> Array:
        """Return k at the phase x (in periods)."""
        raise NotImplementedError

    @cached_property
    def stiffness_range(self) -> tuple[Array, Array]:
        """The least and the greatest value of k, ``(...)`` each."""
        raise NotImplementedError

    def stiffness_harmonic(self, order: int) -> tuple[Array, Array]:
        """Return (a_s, b_s) of k - mean k, as :meth:`fourier` does of w."""
        raise NotImplementedError

    @cached_property
    def _size(self) -> Array:
        """max k - min k, or 0 where that is but rounding."""
        low, high = self.stiffness_range
        size = np.asarray(high) - low
        return np.where(size > LEVEL * np.maximum(np.abs(low), np.abs(high)), size, 0.0)

    def _over_size(self, values: Array) -> Array:
        return np.where(self._size > 0, values / np.where(self._size > 0, self._size, 1.0), 0.0)

    @property
    def amplitude(self) -> Array:
        """(max k - min k)/2, ``(...)``."""
        return 0.5 * self._size

    def value(self, x: Array) -> Array:
        return self._over_size(self.stiffness_at(x) - self.mean_stiffness)

    def extremes(self) -> tuple[Array, Array]:
        low, high = self.stiffness_range
        return self._over_size(low - self.mean_stiffness), self._over_size(high - self.mean_stiffness)

    def fourier(self, order: int) -> tuple[Array, Array]:
        sine, cosine = self.stiffness_harmonic(order)
        return self._over_size(sine), self._over_size(cosine)


NODES = 24
"""Gauss-Legendre nodes of a piece, besides those for the oscillation: pieces are polynomials of low degree, products of
such, or smooth."""
NODES_OF_A_HARMONIC = 4
"""Further nodes for each harmonic: exp(i z t) on [-1, 1] needs little more than z of them, and z is at most pi s."""
ROUNDING = 1e-13
"""Coefficients below this part of the function are rounding, so that harmonics that are missing are exactly zero."""


@dataclass(frozen=True)
class Scaled:
    """mean + factor w(x), for example a damping that follows the mesh stiffness."""

    profile: Profile
    mean: Array | float
    factor: Array | float

    @property
    def piecewise_constant(self) -> bool:
        return self.profile.piecewise_constant

    @property
    def batch(self) -> tuple[int, ...]:
        return np.broadcast_shapes(self.profile.batch, np.shape(self.mean), np.shape(self.factor))

    def value(self, x: Array) -> Array:
        return np.asarray(self.mean) + np.asarray(self.factor) * self.profile.value(x)

    def breakpoints(self) -> Array:
        return self.profile.breakpoints()


@dataclass(frozen=True)
class Constant:
    """The same value at every phase."""

    level: Array | float

    @property
    def piecewise_constant(self) -> bool:
        return True

    @property
    def batch(self) -> tuple[int, ...]:
        return np.shape(self.level)

    def value(self, x: Array) -> Array:
        return np.broadcast_to(self.level, np.broadcast_shapes(np.shape(self.level), np.shape(x)))

    def breakpoints(self) -> Array:
        return np.zeros((*self.batch, 0))


@dataclass(frozen=True)
class Product:
    """f(x) h(x), for example a share of the mesh stiffness."""

    first: Profile
    second: Profile

    @property
    def piecewise_constant(self) -> bool:
        return self.first.piecewise_constant and self.second.piecewise_constant

    @property
    def batch(self) -> tuple[int, ...]:
        return np.broadcast_shapes(self.first.batch, self.second.batch)

    def value(self, x: Array) -> Array:
        return self.first.value(x) * self.second.value(x)

    def breakpoints(self) -> Array:
        found = [self.first.breakpoints(), self.second.breakpoints()]
        return np.concatenate([np.broadcast_to(part, (*self.batch, part.shape[-1])) for part in found], axis=-1)


def harmonic(profile: Profile, order: int) -> Array:
    """Return c of f(x) = sum_s c_s exp(2 pi i s x), s = ``order`` >= 0, complex, of the shape of the batch.

    In closed form of the wave of a mesh, scaled or not, else by Gauss's rule between the breakpoints.
    """
    if isinstance(profile, Scaled) and isinstance(profile.profile, Waveform):
        if order == 0:
            return np.broadcast_to(profile.mean, profile.batch).astype(complex)
        a, b = profile.profile.fourier(order)
        wave = 0.5 * (np.asarray(b) - 1j * np.asarray(a))
        return np.asarray(profile.factor) * np.where(np.abs(wave) <= ROUNDING, 0.0, wave)
    breaks = np.sort(np.broadcast_to(profile.breakpoints(), (*profile.batch, profile.breakpoints().shape[-1])), axis=-1)
    ends = np.zeros((*profile.batch, 1))
    edges = np.moveaxis(np.concatenate([ends, breaks, ends + 1], axis=-1), -1, 0)
    nodes, weights = np.polynomial.legendre.leggauss(NODES + NODES_OF_A_HARMONIC * order)
    column = (-1, *[1] * edges.ndim)
    length = np.diff(edges, axis=0)
    at = edges[:-1] + length * 0.5 * (1 + nodes.reshape(column))
    part = 0.5 * length * weights.reshape(column) * profile.value(at)
    found = np.sum(part * np.exp(-2j * np.pi * order * at), axis=(0, 1))
    return np.where(np.abs(found) <= ROUNDING * np.abs(part).sum(axis=(0, 1)), 0.0, found)
