"""Whether the systems of a grid can exist, and are what was likely meant."""

from __future__ import annotations

import numpy as np

from gearstab.config.checks.plausibility import doubts
from gearstab.config.configuration import Config
from gearstab.config.document.problems import Problem
from gearstab.config.document.tree import Document
from gearstab.system import GearSystem

LARGEST_PHASE = 1e14
"""Radians; of larger ones double precision does not hold a hundredth."""


def check(document: Document, config: Config) -> list[Problem]:
    """Report what cannot exist anywhere on the grid, or at the base values where a response asks for them.

    Returns what can, and is hardly what was meant.
    """
    config.system.check_feasible(document, config)
    if document.problems:
        return []
    system = config.system.build()
    _check_phases(document, config, system)
    return doubts(document, config, system)


def _check_phases(document: Document, config: Config, system: GearSystem) -> None:
    """Mesh frequencies so low that phase and decay of a vibration after a period are beyond double precision."""
    if not system.commensurate:
        return
    found = [(("sweep", axis.name), float(np.min(m.values))) for axis in config.axes if (m := axis.mesh_frequency)]
    if config.respond is not None:
        key = config.respond.frequency_key
        found.append((("respond", key), float(getattr(config.respond, key))))
    factor = np.linalg.inv(np.linalg.cholesky(system.mass))
    elastic = np.abs(np.linalg.eigvalsh(factor @ system.mean_stiffness_matrix() @ factor.T))
    viscous = np.abs(np.linalg.eigvals(factor @ system.damping_matrix @ factor.T))
    fastest = float(max(np.sqrt(elastic.max()), viscous.max()))
    lowest = 2 * np.pi * float(system.common_period()[0]) * fastest / LARGEST_PHASE
    for path, frequency in found:
        if frequency < lowest:
            message = (
                f"is too low for double precision at {frequency:.6g}: the fastest vibration or decay, at the rate "
                f"{fastest:.6g}, does not stand out from rounding over a period"
            )
            document.report(path, "impossible", message, f"choose mesh frequencies above {lowest:.2g}")
