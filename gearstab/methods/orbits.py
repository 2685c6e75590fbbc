"""Floquet analysis in sweeps of gear pairs whose mesh stiffness depends on their rotation: that of periodic orbits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gearstab.methods.base import OptionError, Outcome
from gearstab.methods.floquet import Floquet
from gearstab.results.variables import ORBITS, Variable, flagged
from gearstab.rotating_pair import RotatingPair
from gearstab.system import Array

COST = 800.0
"""Of an orbit, in points of a linear system of three coordinates."""


class Orbits(Floquet):
    """Of a pair in its nonlinear formulations the stability of periodic orbits.

    A pair in any formulation has the same variables, so that a sweep can put the formulations side by side.
    """

    system: RotatingPair

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.floquet import STATUS_FLAGS
        from gearstab.response.rotating_pair.stability import FLAGS

        return (*flagged(super().variables(), {**STATUS_FLAGS, **FLAGS}), *ORBITS)

    def run(self, mesh_frequency: Array) -> Outcome:
        if not self.system.is_classical:
            return self._orbits(mesh_frequency)
        found = super().run(mesh_frequency)
        nothing = np.full(found.values["growth_rate"].shape, np.nan)
        return replace(found, values={**found.values, **{v.name: nothing for v in ORBITS}})

    def _orbits(self, mesh_frequency: Array) -> Outcome:
        from gearstab.floquet.kernel import choice as kernel
        from gearstab.response.rotating_pair.stability import stability

        kernel.record("numpy")
        found = stability(self.system, mesh_frequency)
        unit = np.ravel(np.broadcast_to(self.system.numbers.k0, self.system.batch))[:, None]
        values = {
            "growth_rate": found.growth_rate, "stable": found.stable, "status": found.status,
            "speed_exponent": found.speed_exponent, "holding_torque": found.drive * unit,
        }  # fmt: skip
        if self.options.exponents:
            values |= {"exponent_real": found.exponents.real, "exponent_imag": found.exponents.imag}
        return Outcome(values)

    def cost(self) -> float:
        return super().cost() if self.system.is_classical else COST

    def report(self) -> Mapping[str, Any]:
        if self.system.is_classical:
            return super().report()
        return {"orbits": "periodic orbits of the mean mesh frequency, held by an unbalanced torque where damping asks"}

    def check(self) -> None:
        for name in ("modes", "block"):
            if not self.system.is_classical and getattr(self.options, name) is not None:
                raise OptionError((name,), "a periodic orbit has no modes to choose from", "remove it")
        super().check()
