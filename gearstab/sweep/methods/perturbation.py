"""Boundaries by perturbation theory, and uncoupled Mathieu equations to compare with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gearstab.perturbation import PERTURBATION_FLAGS, Tongues, first_order, second_order, uncoupled
from gearstab.results.variables import FIRST_ORDER, SECOND_ORDER, TONGUE, Variable
from gearstab.sweep.errors import OptionError
from gearstab.sweep.methods.base import FEWEST, Method, Outcome, sides
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Rectangular


def _tongue_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    return (*TONGUE, *FIRST_ORDER)


def _from_tongues(found: Tongues) -> Outcome:
    names = ("boundary_frequency", "center_frequency", "half_width", "threshold")
    return Outcome({name: getattr(found, name) for name in names}, tuple((tongue, 0) for tongue in found.index))


def _modes_and_harmonics(options: Any, system: GearSystem) -> float:
    return 4.0 * system.size**2 * options.harmonics


def _perturbation_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    if options.order == 1:
        return _tongue_variables(options, system)
    flags = {"flag_masks": list(PERTURBATION_FLAGS.values()), "flag_meanings": " ".join(PERTURBATION_FLAGS)}
    return (*TONGUE, *(replace(v, attributes=flags) if v.name == "status" else v for v in SECOND_ORDER))


def _perturbation(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    if options.order == 1:
        return _from_tongues(first_order(system, options.harmonics))
    found = second_order(system, options.harmonics)
    outcome = _from_tongues(found)
    further = {
        "first_order_boundary_frequency": found.first_order_boundary, "boundary_error": found.boundary_error,
        "status": found.status,
    }  # fmt: skip
    return replace(outcome, values={**outcome.values, **{name: np.asarray(a) for name, a in further.items()}})


def _perturbation_cost(options: Any, system: GearSystem) -> float:
    work = _modes_and_harmonics(options, system)
    # Sums over all modes and some hundred harmonics for every pair of modes: 2 ms for three modes, 6 s for fifty-nine.
    # Rows that differ by their epsilons alone share them, so that an eighth of it is taken for a row.
    return work if options.order == 1 else work * 10 * system.size


def _perturbation_together(options: Any) -> int:
    return FEWEST if options.order == 1 else 8 * FEWEST


def _perturbation_check(options: Any, system: GearSystem) -> None:
    if system.terms:
        names = ", ".join(term.name for term in system.terms)
        message = f"takes periodic mesh stiffness only, and this system has {names} as well"
        raise OptionError(("perturbation",), message, "use floquet, which takes these too")


def _uncoupled_check(options: Any, system: GearSystem) -> None:
    other = [mesh.name for mesh in system.meshes if not isinstance(mesh.waveform, Rectangular)]
    if other or system.terms:
        names = ", ".join(other or [term.name for term in system.terms])
        message = f"averages the contact ratios of rectangular waves, which {names} does not have"
        raise OptionError(("uncoupled",), message, "use floquet instead")


def _uncoupled(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    return _from_tongues(uncoupled(system, options.harmonics))


METHOD = Method(
    name="perturbation", frequency=None, variables=_perturbation_variables, constants=sides,
    cost=_perturbation_cost, run=_perturbation, check=_perturbation_check, together=_perturbation_together,
)  # fmt: skip
UNCOUPLED = Method(
    name="uncoupled", frequency=None, variables=_tongue_variables, constants=sides, cost=_modes_and_harmonics,
    run=_uncoupled, check=_uncoupled_check,
)  # fmt: skip
