"""Boundaries by perturbation theory, uncoupled Mathieu equations to compare with, and natural frequencies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from gearstab.config.model.fields import Choice, Section, Whole
from gearstab.methods.base import FEWEST, POINTS, Key, Method, OptionError, Outcome, TongueMethod
from gearstab.results.display import SPEED_RATIOS
from gearstab.results.variables import (
    FIRST_ORDER,
    NATURAL_FREQUENCIES,
    NATURAL_FREQUENCIES_WITH_TERMS,
    SECOND_ORDER,
    TONGUE,
    WHIRL,
    Variable,
    flagged,
)
from gearstab.system import ANY_LINEAR, WHIRLING, Array, Feature, GearSystem, whirls

if TYPE_CHECKING:
    from gearstab.perturbation import Tongues

ROWS = 128
"""Rows of a block at least to first order. A result has a chunk for each region and block, and a chunk of a few numbers
takes more room and time than the numbers: blocks of four rows of 59 coordinates made 74,000 chunks of 32 bytes."""

Harmonics = Annotated[int, Field(ge=1, le=1000), Whole]


class PerturbationOptions(Section):
    """Instability boundaries by perturbation theory."""

    order: Annotated[int, Choice("order", (1, 2))] = 1
    """Order of the expansion in epsilon: 1 gives straight boundaries; 2 also shifts and curves them, opens tongues by
    products of harmonics, and estimates the error, but takes periodic mesh stiffness only."""
    harmonics: Harmonics = 3
    """Up to which harmonic of each mesh, and of each periodic term."""


class UncoupledOptions(Section):
    """Uncoupled Mathieu equations (Benton & Seireg 1980), to compare with."""

    harmonics: Harmonics = 3
    """Up to which harmonic of the mesh stiffness."""


class TonguePerturbation(TongueMethod):
    """A method that gives straight boundaries."""

    cheap = True

    @property
    def fewest(self) -> int:
        return ROWS

    def variables(self) -> tuple[Variable, ...]:
        return (*TONGUE, *FIRST_ORDER)

    def cost(self) -> float:
        # Differences besides sums, and both directions of every coupling.
        own = 4.0 * self.system.size**2 * self.options.harmonics * (4 if self.system.terms else 1)
        if not whirls(self.system):
            return own
        # Natural frequencies at hundreds of speeds, and some ten more for each root.
        return (600 + 10 * own) * (2.0 * self.system.size) ** 3 / 100

    def outcome(self, found: Tongues) -> Outcome:
        """Return the results as variables."""
        names = ("boundary_frequency", "center_frequency", "half_width", "threshold")
        return Outcome({name: getattr(found, name) for name in names}, tuple((tongue, 0) for tongue in found.index))


class Perturbation(TonguePerturbation):
    """First and second order, ``methods.perturbation``."""

    name = "perturbation"
    Options = PerturbationOptions
    supports = ANY_LINEAR | WHIRLING

    @property
    def fewest(self) -> int:
        return super().fewest if self.options.order == 1 else 8 * FEWEST

    def variables(self) -> tuple[Variable, ...]:
        if self.options.order == 1:
            return super().variables()
        from gearstab.perturbation import PERTURBATION_FLAGS

        return (*TONGUE, *flagged(SECOND_ORDER, PERTURBATION_FLAGS))

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.perturbation import first_order, second_order

        if self.options.order == 1:
            return self.outcome(first_order(self.system, self.options.harmonics))
        found = second_order(self.system, self.options.harmonics)
        outcome = self.outcome(found)
        further = {
            "first_order_boundary_frequency": found.first_order_boundary, "boundary_error": found.boundary_error,
            "status": found.status,
        }  # fmt: skip
        return replace(outcome, values={**outcome.values, **{name: np.asarray(a) for name, a in further.items()}})

    def cost(self) -> float:
        # Sums over all modes and some hundred harmonics for every pair of modes: 2 ms for three modes, 6 s for
        # fifty-nine. Rows that differ by their epsilons alone share them, so that an eighth of it is taken for a row.
        return super().cost() * (1 if self.options.order == 1 else 10 * self.system.size)

    def check_options(self) -> None:
        if self.options.order > 1:
            from gearstab.perturbation.second_order import SUPPORTS

            further = (Feature.PERIODIC_TERMS, Feature.UNSYMMETRIC_DAMPING, Feature.ROTATION)
            remedies = dict.fromkeys(further, "choose order: 1, which takes these too")
            self.require(SUPPORTS, remedies, ("order",))

    @classmethod
    def unite(cls, indices: Iterable[Sequence[Key]]) -> tuple[Key, ...]:
        # Which modes grow by themselves differs from block to block; all else is in every block.
        from gearstab.perturbation.tongues import SELF_EXCITED

        found = super().unite(indices)
        alone = {key for key in found if key[0].kind == SELF_EXCITED}
        return (*(key for key in found if key not in alone), *sorted(alone, key=lambda key: key[0].mode_p))


class Uncoupled(TonguePerturbation):
    """Every mode by itself, ``methods.uncoupled``."""

    name = "uncoupled"
    Options = UncoupledOptions
    supports = frozenset({Feature.IRRATIONAL_RATIO})

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.perturbation import uncoupled

        return self.outcome(uncoupled(self.system, self.options.harmonics))

    def check_options(self) -> None:
        from gearstab.waveforms import Rectangular

        if other := [mesh.name for mesh in self.system.meshes if not isinstance(mesh.waveform, Rectangular)]:
            message = f"averages the contact ratios of rectangular waves, which {', '.join(other)} does not have"
            raise OptionError((), message, "use floquet instead")


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
        from gearstab.floquet.general.mean import whirl_motions

        order = np.argsort(mesh_frequency, kind="stable")
        found = whirl_motions(self.system, mesh_frequency[order])
        back = np.argsort(order, kind="stable")
        return Outcome({name: values[back][None] for name, values in vars(found).items()})

    def cost(self) -> float:
        """Measured: 0.1 ms a speed of four coordinates, 1.5 ms of 21."""
        return 10.0 * self.system.size**2
