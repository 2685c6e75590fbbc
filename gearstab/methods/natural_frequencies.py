"""Natural frequencies and mode shapes over the axes of a sweep: ``methods.natural_frequencies``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gearstab.config.model.fields import Section
from gearstab.methods.base import POINTS, Method, Outcome
from gearstab.methods.perturbation import ROWS
from gearstab.results.display import SPEED_RATIOS
from gearstab.results.variables import NATURAL_FREQUENCIES, NATURAL_FREQUENCIES_WITH_TERMS, WHIRL, Variable
from gearstab.support import ANY_LINEAR
from gearstab.system import Array, Feature, GearSystem


class NaturalFrequencyOptions(Section):
    """Natural frequencies (damped ones of a system with terms) and mode shapes over all axes but the mesh frequency."""


class NaturalFrequencies(Method):
    """Modes of the mean system, see :class:`gearstab.modal.Modes`."""

    name = "natural_frequencies"
    Options = NaturalFrequencyOptions
    supports = ANY_LINEAR | {Feature.UNSYMMETRIC_DAMPING, Feature.ROTATION}
    frequency: ClassVar[str | None] = None
    cheap = True

    @classmethod
    def on(cls, options: Any, system: GearSystem) -> Method:
        follows = any(rotation.speed_ratio is not None for rotation in system.rotations)
        return (WhirlFrequencies if follows else cls)(options, system)

    @property
    def fewest(self) -> int:
        return ROWS

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.floquet.dispatch import in_modes

        return NATURAL_FREQUENCIES if in_modes(self.system) else NATURAL_FREQUENCIES_WITH_TERMS

    def constants(self) -> Mapping[str, Any]:
        from gearstab.results.provenance import coordinate_names

        return {
            "mode": np.arange(1, self.system.size + 1),
            "dof": coordinate_names(self.system),
            "dof_units": list(self.system.coordinate_units),
        }

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.results.provenance import mode_frequencies
        from gearstab.symmetry import natural_modes

        modes, flat = natural_modes(self.system), self.system.flat
        frequencies = {name: flat(own, 1) for name, own in mode_frequencies(self.system, modes).items()}
        return Outcome(frequencies | {"mode_shape": flat(np.swapaxes(modes.shapes, -1, -2), 2)})

    def cost(self) -> float:
        # The numbers that a row takes in the file count as well.
        return 4.0 * self.system.size**2


class WhirlFrequencies(NaturalFrequencies):
    """Motions of the mean system over the speeds that its rotations follow, one system at a time."""

    frequency = POINTS
    singly = True

    def variables(self) -> tuple[Variable, ...]:
        return WHIRL

    def constants(self) -> Mapping[str, Any]:
        return {"mode": np.arange(1, self.system.size + 1)}

    def report(self) -> Mapping[str, Any]:
        return {SPEED_RATIOS: [float(rotation.speed_ratio or 0) for rotation in self.system.rotations]}

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.floquet.general.whirl import whirl_motions

        order = np.argsort(mesh_frequency, kind="stable")
        found = whirl_motions(self.system, mesh_frequency[order])
        back = np.argsort(order, kind="stable")
        return Outcome({name: values[back][None] for name, values in vars(found).items()})

    def cost(self) -> float:
        """Measured: 0.1 ms a speed of four coordinates, 1.5 ms of 21."""
        return 10.0 * self.system.size**2
