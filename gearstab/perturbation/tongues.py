"""Instability tongues: which ones exist, what they are called, and the arrays that describe them.

A tongue is one instability region, rooted at epsilon = 0 where an excitation frequency nu meets the sum of two natural
frequencies; with periodic terms that are not symmetric also where it meets their difference. The list of tongues
depends on the structure of a system only (its modes and the ratios of its mesh frequencies), never on the numbers of a
row, so that every row of a sweep has the same one; only modes that grow by themselves are listed where there are some.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from gearstab.grouping import Columns
from gearstab.modal import Modes, significant_deflection
from gearstab.system import Array, GearSystem
from gearstab.waveforms.base import harmonic


@dataclass(frozen=True)
class ParametricExcitation:
    """One frequency of parametric excitation, nu = ratio * Omega, and all the mesh harmonics that share it.

    parts: pairs (mesh number from 0, harmonic s_i) with s_i r_i = ratio, in the order of the meshes; none for
        frequencies that only periodic terms have, and for sums and differences of harmonics of different meshes, which
        act in second and higher order of epsilon only.
    """

    ratio: Fraction | float
    parts: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Tongue:
    """Identity of a tongue: nu = frequency_ratio * Omega near w_p + w_q, or near w_q - w_p where ``difference``.

    mode_p, mode_q: mode numbers from 1, by ascending natural frequency; p <= q.
    harmonic: s of the first contributing mesh; 0 where no mesh has a harmonic of that frequency.
    mesh: names of the contributing meshes, joined by ``+``; all of them where none has that frequency.
    kind: see :func:`kind_of`. label: see :func:`label_of`.
    frequency_ratio: nu/Omega.
    """

    mode_p: int
    mode_q: int
    harmonic: int
    mesh: str
    kind: str
    label: str
    frequency_ratio: float

    @property
    def difference(self) -> bool:
        """Whether it is rooted at a difference of natural frequencies."""
        return self.kind in DIFFERENCES


DIFFERENCES = ("difference", "higher difference")
"""The kinds of tongues at differences of natural frequencies: harmonic 1, and all others."""
SELF_EXCITED = "self-excited"
"""The kind of a mode that grows by itself."""


@dataclass(frozen=True)
class Tongues:
    """Predicted instability regions in terms of Omega, where mesh i runs at r_i Omega (the first at Omega itself).

    index: the tongues; their attributes are also at hand as tuples (``mode_p``, ``label``, ...).
    center_frequency: ``(tongue, ...)``, Omega at the root of the tongue, by the natural frequencies without what
        damping and the means of periodic terms do to them; NaN where it does not exist in a row: one of its modes is a
        rigid-body mode or has negative stiffness there, or it belongs to a degenerate group whose tongue is carried by
        the first pair of modes of that group; and of a mode that grows by itself.
    half_width: ``(tongue, ...)``, half of the unstable range of Omega; 0 where there is none; infinite where
        first-order theory has no boundary because only one of the two modes is damped (see
        :mod:`gearstab.perturbation.damped`) or grows by itself. With periodic terms see
        :mod:`gearstab.perturbation.unsymmetric`; NaN where it is not known: of modes of one frequency without damping.
    boundary_frequency: ``(tongue, 2, ...)``, the lower and upper end; NaN where damping closes the tongue and where
        ``half_width`` is infinite or NaN. An undamped tongue of width zero has both ends at its centre. Periodic terms
        shift both from the root.
    threshold: ``(tongue, ...)``, the factor on every epsilon (at constant mean stiffness), and on whatever else varies
        about its mean, at which the tongue opens: 0 for undamped modes, above 1 where the tongue is closed, infinite
        where damped modes are not excited at all.

    Of second order only, else None:

    first_order_boundary: the shape of ``boundary_frequency``, what first order gives.
    boundary_error: the same shape, an estimate of the error of ``boundary_frequency``.
    status: ``(tongue, ...)``, flags, see :mod:`gearstab.perturbation.second_order`.
    """

    index: tuple[Tongue, ...]
    center_frequency: Array
    half_width: Array
    boundary_frequency: Array
    threshold: Array
    first_order_boundary: Array | None = None
    boundary_error: Array | None = None
    status: Array | None = None

    @property
    def label(self) -> tuple[str, ...]:
        """Label of each tongue."""
        return tuple(t.label for t in self.index)


def overlapping(tongues: Tongues) -> Array:
    """``(tongue, ...)``, whether a region shares mesh frequencies with another one; touching counts, absence does not.

    There first-order theory, which treats every tongue by itself, may be wrong in first order.
    """
    lower, upper = np.moveaxis(tongues.boundary_frequency, 1, 0)
    open_ = upper > lower
    found = np.zeros(open_.shape, dtype=bool)
    for k in range(len(tongues.index)):
        meets = open_ & open_[k] & (lower <= upper[k]) & (upper >= lower[k])
        meets[k] = False
        found[k] = meets.any(axis=0)
    return found


def excitations(system: GearSystem, harmonics: int) -> tuple[ParametricExcitation, ...]:
    """Every nu = s r_i Omega with s <= ``harmonics`` for some mesh or term i, each once, with *all* its mesh harmonics.

    A mesh whose own harmonic number exceeds ``harmonics`` still contributes to a frequency that another mesh
    brings in: leaving it out would give that tongue a wrong width. A weak tooth brings in the first lines of its shaft
    and as many beside every harmonic of its mesh: the others are as many as the gear has teeth.
    """
    found = dict.fromkeys(s * r for r in system.frequency_ratios for s in range(1, harmonics + 1))
    ratios = {mesh.name: mesh.frequency_ratio for mesh in system.meshes}
    for part in (mesh for mesh in system.meshes if mesh.part_of):
        whole, side = ratios[part.part_of], range(-harmonics, harmonics + 1)
        lines = (s * whole + n * part.frequency_ratio for s in range(1, harmonics + 1) for n in side)
        found |= dict.fromkeys(nu for nu in lines if nu > 0)
    return tuple(ParametricExcitation(nu, sharing(system, nu)) for nu in found)


def products(system: GearSystem, harmonics: int) -> tuple[ParametricExcitation, ...]:
    """Every nu = |s_i r_i +- s_j r_j| Omega with s_i + s_j <= ``harmonics`` that is no harmonic of a mesh, each once.

    Of meshes whose frequencies differ by an exact ratio; these frequencies excite in second order of epsilon.
    """
    ratios = list(dict.fromkeys(m.frequency_ratio for m in system.meshes if isinstance(m.frequency_ratio, Fraction)))
    found = {
        abs(s * one + sign * t * other)
        for k, one in enumerate(ratios)
        for other in ratios[:k]
        for s in range(1, harmonics)
        for t in range(1, harmonics - s + 1)
        for sign in (-1, 1)
    }
    return tuple(ParametricExcitation(nu, ()) for nu in sorted(found) if nu and not sharing(system, nu))


def sharing(system: GearSystem, ratio: Fraction | float) -> tuple[tuple[int, int], ...]:
    """Pairs (mesh from 0, harmonic s) of all meshes that have a harmonic at the frequency ratio * Omega."""
    order = [(i, harmonic_at(ratio, mesh.frequency_ratio)) for i, mesh in enumerate(system.meshes)]
    return tuple((i, s) for i, s in order if s)


def harmonic_at(ratio: Fraction | float, own: Fraction | float) -> int:
    """Return s with s * own = ratio, of what varies with the frequency own * Omega; 0 where there is none."""
    s = round(ratio / own)
    return s if s > 0 and s * own == ratio else 0


def kind_of(p: int, q: int, harmonic: int, difference: bool = False) -> str:
    """Name the kind: primary (Omega near 2 w_p), secondary (w_p), combination (w_p + w_q), difference or higher.

    Beyond these: ``higher`` (p = q, s >= 3), ``higher combination`` and ``higher difference`` (p != q, s >= 2). Source:
    Lin & Parker 2002, section 3, which has no names for the last two, and no differences.
    """
    if difference:
        return DIFFERENCES[harmonic != 1]
    if p == q:
        return {1: "primary", 2: "secondary"}.get(harmonic, "higher")
    return "combination" if harmonic == 1 else "higher combination"


def label_of(p: int, q: int, harmonic: int, difference: bool = False) -> str:
    """The mesh frequency at the root of a tongue: ``2w3``, ``w3``, ``2w3/3``, ``w2+w3``, ``(w2+w3)/2``, ``w3-w2``."""
    if p != q:
        total = _total(p, q, difference)
        return total if harmonic == 1 else f"({total})/{harmonic}"
    factor = Fraction(2, harmonic)
    times = f"{factor.numerator}w{p}" if factor.numerator > 1 else f"w{p}"
    return times if factor.denominator == 1 else f"{times}/{factor.denominator}"


def _total(p: int, q: int, difference: bool) -> str:
    return f"w{q}-w{p}" if difference else f"w{p}+w{q}"


def _label_at(p: int, q: int, ratio: Fraction | float, difference: bool) -> str:
    """Omega at the root: ``3(w1+w2)/2``, ``6w2/5``, ``2w3/0.618034``."""
    total = f"w{p}" if p == q else f"({_total(p, q, difference)})"
    times = Fraction(2 if p == q else 1)
    if not isinstance(ratio, Fraction):
        return f"{'2' * (p == q)}{total}/{ratio:.6g}"
    times /= ratio
    factor = "" if times.numerator == 1 else str(times.numerator)
    return f"{factor}{total}" + ("" if times.denominator == 1 else f"/{times.denominator}")


def self_excited(system: GearSystem, p: int) -> Tongue:
    """Return the tongue of a mode (from 1) that negative damping makes grow at any mesh frequency, without a root."""
    everything = "+".join(mesh.name for mesh in system.meshes)
    return Tongue(p, p, 0, everything, SELF_EXCITED, f"mode {p} self-excited", 0.0)


def tongue(system: GearSystem, excitation: ParametricExcitation, p: int, q: int, difference: bool = False) -> Tongue:
    """The tongue of modes p <= q (from 1) under one excitation.

    Its harmonic, kind and label refer to the first contributing mesh. Where that mesh runs at another frequency than
    the first mesh of the system, the label names the contributing meshes: ``2w3 (second)`` is where the second mesh's
    frequency is 2 w3. Where no mesh has that frequency, it gives Omega itself: ``6w2/5``.
    """
    if not excitation.parts:
        everything = "+".join(mesh.name for mesh in system.meshes)
        label = _label_at(p, q, excitation.ratio, difference)
        return Tongue(p, q, 0, everything, kind_of(p, q, 0, difference), label, float(excitation.ratio))
    first, harmonic = excitation.parts[0]
    mesh = "+".join(system.meshes[i].name for i, _ in excitation.parts)
    label = label_of(p, q, harmonic, difference)
    if system.meshes[first].frequency_ratio != system.meshes[0].frequency_ratio:
        label += f" ({mesh})"
    return Tongue(p, q, harmonic, mesh, kind_of(p, q, harmonic, difference), label, float(excitation.ratio))


@dataclass(frozen=True)
class ModalTerms(Columns):
    """Terms of all rows, with the batch flattened.

    left, right: ``(rows, n, terms)``, Phi^T u and Phi^T v, what is rounding exactly zero; of no terms where there are
    none. stiffness, damping: ``(rows, n, n)``, S = sum_j mean(a_j) Phi^T u_j v_j^T Phi and the same with the means of
    c_j.
    """

    left: Array
    right: Array
    stiffness: Array
    damping: Array


def modal_terms(system: GearSystem, modes: Modes) -> ModalTerms:
    """Return the terms of a system in the modes of its mean system."""
    left, right = (
        _projected(system, modes, [getattr(term, end) for term in system.terms]) for end in ("left", "right")
    )
    means = []
    for kind in ("stiffness", "damping"):
        mean = np.zeros((system.rows, len(system.terms)))
        for j, term in enumerate(system.terms):
            mean[:, j] = _coefficient(system, getattr(term, kind), 0).real
        means.append(np.einsum("rpt,rt,rqt->rpq", left, mean, right))
    return ModalTerms(left, right, *means)


def _projected(system: GearSystem, modes: Modes, vectors: list[Array]) -> Array:
    """Phi^T u of all vectors, ``(rows, n, vectors)``."""
    if not vectors:
        return np.zeros((system.rows, system.size, 0))
    parts = np.zeros((*system.batch, system.size, len(vectors)))
    for j, vector in enumerate(vectors):
        parts[..., j] = np.einsum("...np,...n->...p", modes.shapes, vector)
    return system.flat(np.where(significant_deflection(replace(modes, mesh_deflection=parts)), parts, 0.0), 2)


def _coefficient(system: GearSystem, profile: object, order: int) -> Array:
    """The Fourier coefficient of a profile in each row, ``(rows,)``; zeros of none."""
    found = np.zeros(()) if profile is None else harmonic(profile, order)  # type: ignore[arg-type]
    return np.broadcast_to(found, system.batch).reshape(-1).astype(complex)


def harmonics(system: GearSystem, ratio: Fraction | float, rows: Array) -> Iterator[tuple[int, Array, Array]]:
    """Yield (number of the term, a, c) of all terms that excite at ratio * Omega; a, c: complex ``(rows,)``.

    Of exp(i nu t) in a_j(t) and c_j(t), lags included.
    """
    for j, term in enumerate(system.terms):
        s = harmonic_at(ratio, term.frequency_ratio)
        if s:
            turn = np.broadcast_to(np.exp(-2j * np.pi * s * np.asarray(term.lag)), system.batch).reshape(-1)
            a, c = (_coefficient(system, profile, s) * turn for profile in (term.stiffness, term.damping))
            yield j, a[rows], c[rows]
