"""Motions of the mean system as a whole: its damping and the means of its periodic terms included.

    M q'' + [C + sum_j mean(c_j) u_j v_j^T] q' + [K0 + sum_i k_gi g_i g_i^T + sum_j mean(a_j) u_j v_j^T] q = 0

and what acts with speeds of rotation besides.

The natural frequencies of :func:`gearstab.modal.mean_modes` are those of its symmetric part without damping. Cross
coupling and negative damping may let the whole grow by itself, without any variation of the mesh stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.dispatch import in_modes
from gearstab.propagation.elastic import ElasticForm, elastic_forms, mean_levels
from gearstab.system import Array, GearSystem

ROUNDING = 1e-11
"""A growth rate below this part of the largest exponent is rounding: an eigensolver leaves n eps ~ 1e-14 of it."""


@dataclass(frozen=True)
class MeanMotions:
    """Motions of the mean system, ``(rows, n)`` each, by ascending frequency.

    frequency: |Im| of a pair of exponents, rad per unit time, 0 for motions that do not oscillate. growth_rate: its
    real part, the larger one of two real exponents, 1/time; exactly 0 where only rounding is left. mode: position of
    the mode of the symmetric mean system that a motion resembles most; each mode has one motion.
    """

    frequency: Array
    growth_rate: Array
    mode: Array

    @property
    def unstable(self) -> Array:
        """``(rows, n)``, whether a motion grows by itself."""
        return self.growth_rate > 0

    @property
    def frequency_by_mode(self) -> Array:
        """``(rows, n)``, the frequencies in the order of the modes of the symmetric mean system."""
        return np.take_along_axis(self.frequency, np.argsort(self.mode, axis=1), 1)


def mean_motions(system: GearSystem, mesh_frequency: Array | float = 0.0) -> MeanMotions:
    """Return the motions of the mean system of every row of the flattened batch: one eigenproblem each.

    mesh_frequency: ``()`` or ``(rows,)``, which speeds of rotation follow; they are at rest at 0.
    """
    speed = np.broadcast_to(np.asarray(mesh_frequency, dtype=float), (system.rows,))
    forms = [own.at_speed(omega) for own, omega in zip(elastic_forms(system), speed, strict=True)]
    rows = [_row(own, level, system.size) for own, level in zip(forms, mean_levels(system), strict=True)]
    frequency, growth, mode = (np.stack(values) for values in zip(*rows, strict=True))
    return MeanMotions(frequency, growth, mode)


def frequencies_beyond_modes(system: GearSystem) -> Array | None:
    """``(rows, n)``: damped natural frequencies of the whole mean system in the order of the modes of its symmetric
    part; None where that is all of it but for symmetric damping, so that its modes tell the natural frequencies.
    """
    return None if in_modes(system) else mean_motions(system).frequency_by_mode


def _row(own: ElasticForm, level: Array, size: int) -> tuple[Array, Array, Array]:
    """(frequency, growth rate, mode) of one row's pairs of exponents: conjugate ones, or two real ones, the largest
    ones first.
    """
    from scipy.optimize import linear_sum_assignment  # takes as long to load as a small sweep to run

    values, vectors = np.linalg.eig(own.generators(level))
    swinging = values.imag > 0
    exponents = np.concatenate([own.rate * values, own.rigid_exponents])
    real = np.sort(exponents[exponents.imag == 0].real)[::-1][::2]
    frequency = np.concatenate([np.zeros(len(real)), own.rate * values[swinging].imag])
    growth = np.concatenate([real, own.rate * values[swinging].real])
    shares = np.zeros((size, size))
    along = np.abs(vectors[: len(own.elastic), swinging].T) ** 2
    shares[len(real) :, own.elastic] = along / along.sum(axis=1, keepdims=True)
    order = np.lexsort((-growth, frequency))
    mode = linear_sum_assignment(shares[order], maximize=True)[1]
    rounding = ROUNDING * np.abs(exponents).max(initial=0.0)
    return frequency[order], np.where(np.abs(growth) <= rounding, 0.0, growth)[order], mode
