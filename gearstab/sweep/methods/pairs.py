"""Floquet analysis in sweeps of gear pairs whose mesh stiffness depends on their rotation: that of periodic orbits."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from gearstab.floquet.kernel import choice as kernel
from gearstab.results.variables import ORBITS, Variable
from gearstab.rotating_pair import RotatingPair
from gearstab.sweep.errors import OptionError
from gearstab.sweep.methods.base import Method, Outcome
from gearstab.system import Array, GearSystem

COST = 800.0
"""Of an orbit, in points of a linear system of three coordinates."""


def knowing_pairs(method: Method) -> Method:
    """Floquet analysis that takes the orbits of pairs in their nonlinear formulations.

    A pair in any formulation has the same variables, so that a sweep can put the formulations side by side.
    """
    # Methods go to other processes with their plan: functions of a module can, inner ones cannot.
    return replace(
        method,
        variables=partial(_variables, method),
        run=partial(_run, method),
        cost=partial(_cost, method),
        report=partial(_report, method),
        check=partial(_check, method),
    )


def _variables(method: Method, options: Any, system: GearSystem) -> tuple[Variable, ...]:
    found = method.variables(options, system)
    return found if not isinstance(system, RotatingPair) else (*map(_flagged, found), *ORBITS)


def _run(method: Method, system: GearSystem, mesh_frequency: Array, options: Any) -> Outcome:
    if not isinstance(system, RotatingPair):
        return method.run(system, mesh_frequency, options)
    if system.is_classical:
        found = method.run(system, mesh_frequency, options)
        nothing = np.full(found.values["growth_rate"].shape, np.nan)
        return replace(found, values={**found.values, **{v.name: nothing for v in ORBITS}})
    return _orbits(system, mesh_frequency, options)


def _cost(method: Method, options: Any, system: GearSystem) -> float:
    return COST if _nonlinear(system) else method.cost(options, system)


def _report(method: Method, options: Any, system: GearSystem) -> dict[str, Any]:
    if not _nonlinear(system):
        return dict(method.report(options, system))
    return {"orbits": "periodic orbits of the mean mesh frequency, held by an unbalanced torque where damping asks"}


def _check(method: Method, options: Any, system: GearSystem) -> None:
    for name in ("modes", "block"):
        if _nonlinear(system) and getattr(options, name) is not None:
            raise OptionError(("floquet", name), "a periodic orbit has no modes to choose from", "remove it")
    method.check(options, system)


def _nonlinear(system: GearSystem) -> bool:
    return isinstance(system, RotatingPair) and not system.is_classical


def _flagged(variable: Variable) -> Variable:
    """The variable; ``status`` with the bits of orbits."""
    if variable.name != "status":
        return variable
    from gearstab.response.rotating_pair.stability import FLAGS

    attributes = dict(variable.attributes)
    masks = [*attributes["flag_masks"], *FLAGS.values()]
    meanings = " ".join([attributes["flag_meanings"], *FLAGS])
    return replace(variable, attributes={**attributes, "flag_masks": masks, "flag_meanings": meanings})


def _orbits(pair: RotatingPair, mesh_frequency: Array, options: Any) -> Outcome:
    from gearstab.response.rotating_pair.stability import stability

    kernel.record("numpy")
    found = stability(pair, mesh_frequency)
    unit = np.ravel(np.broadcast_to(pair.numbers.k0, pair.batch))[:, None]
    values = {
        "growth_rate": found.growth_rate, "stable": found.stable, "status": found.status,
        "speed_exponent": found.speed_exponent, "holding_torque": found.drive * unit,
    }  # fmt: skip
    if options.exponents:
        values |= {"exponent_real": found.exponents.real, "exponent_imag": found.exponents.imag}
    return Outcome(values)
