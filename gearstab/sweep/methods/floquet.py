"""Exact stability at every point of the grid: ``methods.floquet``."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet import STATUS_FLAGS, Floquet, solve
from gearstab.floquet.frequencies import choice
from gearstab.floquet.kernel import choice as kernel
from gearstab.floquet.report import reduction
from gearstab.floquet.truncation import modes_basis, neglected, restricted, torn, type_basis
from gearstab.results.variables import ERROR_ESTIMATE, EXPONENTS, FLOQUET, Variable
from gearstab.sweep.errors import OptionError
from gearstab.sweep.methods import frequencies
from gearstab.sweep.methods.base import POINTS, Method, Outcome
from gearstab.sweep.methods.pairs import knowing_pairs
from gearstab.system import Array, GearSystem


def _floquet_variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    flags = {"flag_masks": list(STATUS_FLAGS.values()), "flag_meanings": " ".join(STATUS_FLAGS)}
    table = [replace(v, attributes=flags) if v.name == "status" else v for v in FLOQUET]
    part = _chosen_part(options, system)
    more = frequencies.variables(options, part)
    # An interval says more of a Lyapunov exponent, and the error of the steps is part of it.
    estimate = () if _exact(part) or frequencies.way(options, part) == choice.LYAPUNOV else (ERROR_ESTIMATE,)
    return (*table, *estimate, *(EXPONENTS if options.exponents else ()), *more)


def _exact(system: GearSystem) -> bool:
    """Whether propagation over a period is exact, so that all error is rounding."""
    return system.piecewise_constant and not system.terms


def _basis(options: Any, system: GearSystem) -> Array | None:
    """What the options restrict the system to, None where they do not. Raises ValueError."""
    if options.modes is not None:
        return modes_basis(system, options.modes)
    return None if options.block is None else type_basis(system, options.block)


def _chosen_part(options: Any, system: GearSystem) -> GearSystem:
    """The system that is solved."""
    basis = _basis(options, system)
    return system if basis is None else restricted(system, basis)


def _floquet(system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    part = _chosen_part(options, system)

    def exact(one: GearSystem, omega: Array) -> Floquet:
        return solve(one, omega, exponents=options.exponents, tolerance=options.tolerance)

    found = frequencies.solved(options, part, mesh_frequency, exact)
    values = {"growth_rate": found.growth_rate, "stable": found.stable, "status": found.status}
    # Systems of other ratios than the base system may be solved in a way that has no estimate.
    none = np.full(found.growth_rate.shape, np.nan)
    values["error_estimate"] = none if found.error_estimate is None else found.error_estimate
    if isinstance(found, Floquet) and found.exponents is not None:
        values |= {"exponent_real": found.exponents.real, "exponent_imag": found.exponents.imag}
    return Outcome(values | frequencies.values(options, part, found))


def _floquet_cost(options: Any, system: GearSystem) -> float:
    def exact(part: GearSystem) -> float:
        work = max(1.0, sum(p.segments * p.size**3 for p in reduction(part).parts) / 108)
        return work * (5 if options.exponents or part.damping is not None else 1)

    return frequencies.cost(options, _chosen_part(options, system), exact)


def _floquet_constants(options: Any, system: GearSystem) -> dict[str, Any]:
    part = _chosen_part(options, system)
    numbers = {"exponent": np.arange(1, 2 * part.size + 1)} if options.exponents else {}
    return numbers | frequencies.constants(options, part)


def _floquet_report(options: Any, system: GearSystem) -> dict[str, Any]:
    """What of the base system was solved, and what that saved."""
    found = reduction(_chosen_part(options, system))
    said: dict[str, Any] = {"reduction": found.text(), **frequencies.report(options, _chosen_part(options, system))}
    if np.isfinite(found.saving) and found.saving > 1:
        said["reduction_saving"] = found.saving
    basis = _basis(options, system)
    if basis is None:
        return said
    what = f"modes {', '.join(map(str, options.modes))}" if options.modes is not None else f"type {options.block}"
    coupling = neglected(system, basis)
    left_out = (
        f"neglects couplings of up to {coupling:.2g} of w_p w_q" if coupling else "which nothing couples to others"
    )
    return said | {"restriction": f"{what} of the base system: {basis.shape[-1]} of {system.size} modes, {left_out}"}


def _floquet_check(options: Any, system: GearSystem) -> None:
    if options.modes is not None and options.block is not None:
        raise OptionError(
            ("floquet", "modes"), "stands beside block: both block and modes restrict", "keep one of them"
        )
    try:
        _basis(options, system)
    except NotPossible as error:
        key = "block" if options.modes is None else "modes"
        raise OptionError(("floquet", key), error.message, error.remedy) from None
    if options.modes is not None and (group := torn(system, options.modes)):
        message = f"modes {', '.join(map(str, group))} have equal frequencies"
        raise OptionError(("floquet", "modes"), message, "name all of them or none")
    try:
        taken = frequencies.way(options, _chosen_part(options, system))
    except NotPossible as error:
        raise OptionError(("floquet", "frequencies"), error.message, error.remedy) from None
    if options.exponents and taken != "common_period":
        message = f"there are none without a common period ({taken} was chosen)"
        remedy = "remove it, or choose frequencies: common_period" if system.commensurate else "remove it"
        raise OptionError(("floquet", "exponents"), message, remedy)


def _floquet_note(options: Any, system: GearSystem) -> str | None:
    return frequencies.note(options, _chosen_part(options, system))


def _floquet_outlook(options: Any, system: GearSystem) -> str | None:
    return frequencies.outlook(options, _chosen_part(options, system))


def _compiled_kernel(options: Any, system: GearSystem) -> bool:
    return kernel.name() == "c" and frequencies.way(options, _chosen_part(options, system)) != "lyapunov"


METHOD = knowing_pairs(
    Method(
        name="floquet", frequency=POINTS, variables=_floquet_variables, constants=_floquet_constants, run=_floquet,
        cost=_floquet_cost, parallel=_compiled_kernel, report=_floquet_report, check=_floquet_check,
        note=_floquet_note, outlook=_floquet_outlook,
    )
)  # fmt: skip
