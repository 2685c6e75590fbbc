"""Steady forces of meshes of several frequencies, one frequency at a time, where the common period is long or none.

What varies or drives with a frequency makes the force of a mesh deviate from the static one; to first order in the
variations the deviations of all frequencies add up. Their largest values bound the force, as they need not coincide.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil

import numpy as np

from gearstab.floquet.frequencies.per_mesh import FrequencyGroup, alone, groups
from gearstab.modal import mean_modes
from gearstab.response.linear.equilibrium import static_mesh_force
from gearstab.response.linear.speeds import speed_response
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Fourier

SAMPLES = 4
"""Samples per period of the fastest mode, between which a polynomial of degree nine gives the extremes."""
MOST_SAMPLES = 8000
"""Largest number of samples per period of a mesh."""


@dataclass(frozen=True)
class ForceBounds:
    """Mesh forces in the sense of the static ones, ``(rows, P, meshes)``, by the sums of all deviations from these.

    static: ``(rows, meshes)``, at least 0.
    """

    static: Array
    least: Array
    greatest: Array

    @property
    def load_factor(self) -> Array:
        """The greatest force over the static one, NaN where that is 0."""
        static = np.where(self.static > 0, self.static, np.nan)[:, None]
        return np.maximum(self.greatest, -self.least) / static


def force_bounds(system: GearSystem, mesh_frequency: Array) -> ForceBounds:
    """Bound the mesh forces of every row of a system at mesh frequencies ``(P,)`` of the first mesh."""
    system = _oriented(system.over(system.batch))
    static = system.flat(static_mesh_force(system), 1)
    omega = np.asarray(mesh_frequency, dtype=float)
    least = np.tile(static[:, None], (1, len(omega), 1))
    greatest = least.copy()
    fastest = float(np.nanmax(mean_modes(system).natural_frequency))
    for one, ratio in _driven_apart(system):
        samples = int(np.clip(ceil(SAMPLES * fastest / (ratio * omega.min())), 100, MOST_SAMPLES))
        found = speed_response(one, ratio * omega, samples)
        least -= static[:, None] - found.mesh_force_min
        greatest += found.mesh_force_peak - static[:, None]
    return ForceBounds(static, least, greatest)


def _oriented(system: GearSystem) -> GearSystem:
    """The system with the direction of every mesh such that its static force is not negative."""
    forces, names = static_mesh_force(system), [mesh.name for mesh in system.whole_meshes]
    meshes = []
    for mesh in system.meshes:
        # A part turns with its mesh.
        sense = np.where(forces[..., names.index(mesh.part_of or mesh.name)] < 0, -1.0, 1.0)[..., None]
        error = mesh.transmission_error
        if error is not None:
            error = _times(error, sense)
        turns = tuple(replace(one, profile=_times(one.profile, sense)) for one in mesh.revolution_errors)
        direction = mesh.direction * sense
        meshes.append(replace(mesh, direction=direction, transmission_error=error, revolution_errors=turns))
    return replace(system, meshes=tuple(meshes))


def _times(wave: Fourier, sense: Array) -> Fourier:
    """Return a series with a sign."""
    return replace(wave, sin=wave.sin * sense, cos=wave.cos * sense)


def _driven_apart(system: GearSystem) -> Iterator[tuple[GearSystem, float]]:
    """The system with what varies and drives with each frequency alone, and that frequency over Omega."""
    ratios = {group.ratio: group for group in groups(system)}
    ratios |= {f.frequency_ratio: FrequencyGroup(f.name, f.frequency_ratio) for f in system.forces}
    ratios |= {
        one.frequency_ratio: FrequencyGroup(one.name, one.frequency_ratio)
        for mesh in system.meshes for one in mesh.revolution_errors if one.frequency_ratio not in ratios
    }  # fmt: skip
    for ratio, group in ratios.items():
        meshes = tuple(
            replace(
                mesh, transmission_error=mesh.transmission_error if mesh.frequency_ratio == ratio else None,
                revolution_errors=tuple(
                    replace(one, frequency_ratio=Fraction(1))
                    for one in mesh.revolution_errors if one.frequency_ratio == ratio
                ),
            )
            for mesh in system.meshes
        )  # fmt: skip
        forces = tuple(
            replace(force, frequency_ratio=Fraction(1)) for force in system.forces if force.frequency_ratio == ratio
        )
        yield alone(replace(system, meshes=meshes, forces=forces), group), float(ratio)
