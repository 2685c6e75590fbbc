"""Provenance of a result: attributes of the root, and the modes of the base system."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from typing import Any, Protocol

import numpy as np

from gearstab.errors import SettingError
from gearstab.floquet.dispatch import in_modes
from gearstab.modal import Modes
from gearstab.results.display import RATIOS, in_units_of
from gearstab.results.tree import Group, fields_of
from gearstab.results.variables import DEFLECTION_TYPE, MODES, MODES_OVER_SPEED, MODES_WITH_TERMS, Variable
from gearstab.symmetry import deflection_types, natural_modes, type_names
from gearstab.system import Array, GearSystem, whirls
from gearstab.version import __version__


class Origin(Protocol):
    """Attributes of a result on its configuration: title, text as run, digest."""

    @property
    def title(self) -> str: ...
    @property
    def resolved(self) -> str: ...
    @property
    def digest(self) -> str: ...


def now() -> datetime:
    """Return the time, or the one that SOURCE_DATE_EPOCH sets, so that two runs give the same bytes.

    Raises SettingError where that is no number of seconds.
    """
    said = os.environ.get("SOURCE_DATE_EPOCH")
    try:
        return datetime.now(UTC) if said is None else datetime.fromtimestamp(int(said), UTC)
    except (ValueError, OverflowError, OSError):
        raise SettingError(f"SOURCE_DATE_EPOCH is {said!r}; it is a number of seconds since 1970") from None


def root_attributes(command: str, config: Origin) -> dict[str, Any]:
    """Title, configuration as run, versions, time; command: that writes the result."""
    import h5py

    return {
        "Conventions": "CF-1.11",
        "title": config.title,
        "command": command,
        "source": f"gearstab {__version__}",
        "created": now().isoformat(timespec="seconds"),
        "gearstab_version": __version__,
        "numpy_version": np.__version__,
        "h5py_version": h5py.__version__,
        "hdf5_version": h5py.version.hdf5_version,
        "python_version": platform.python_version(),
        "kernel": "c",
        "config_digest": config.digest,
        "config": config.resolved,
    }


MOST_SPEEDS, FEWEST_SPEEDS, WORK = 1000, 50, 3e5
"""Speeds at which modes are given: some that take about a second, as the time goes with the square of coordinates."""


def modes_group(system: GearSystem, speeds: Array | None = None) -> Group:
    """The group ``/modes`` of a single system.

    speeds: mesh frequencies over which the modes are followed where rotations act; some of them, where there are many.
    """
    modes = natural_modes(system)
    frequencies = mode_frequencies(system, modes)
    beyond = "symmetric_frequency" in frequencies
    table: tuple[Variable, ...] = MODES_WITH_TERMS if beyond else MODES
    values = {
        "mode": np.arange(1, system.size + 1),
        "dof": coordinate_names(system),
        "dof_units": list(system.coordinate_units),
        "mesh": [mesh.name for mesh in system.whole_meshes],
        **frequencies,
        "mode_shape": np.swapaxes(modes.shapes, -1, -2),
        "mesh_deflection": modes.mesh_deflection[..., : len(system.whole_meshes)],
        "mode_type": type_names(system, modes),
    }
    if system.symmetries:
        table, values = (*table, DEFLECTION_TYPE), values | {DEFLECTION_TYPE.name: deflection_types(system, modes)}
    if speeds is not None and whirls(system):
        over_speed = modes_over_speed(system, speeds)
        table, values = (*table, *MODES_OVER_SPEED), values | over_speed
    part = "symmetric mean system, with the frequencies of the whole one," if beyond else "mean system"
    said = {
        "comment": f"modes of the {part} at the base values of the configuration",
        RATIOS: [float(mesh.frequency_ratio) for mesh in system.whole_meshes],
    }
    return Group(fields_of(in_units_of(system, table), values), {**said, **system.drawing})


def modes_over_speed(system: GearSystem, speeds: Array) -> dict[str, Array]:
    """Return the values of MODES_OVER_SPEED, at the first and the last speed and at some in between."""
    from gearstab.floquet.general.mean import whirl_motions

    known = np.unique(speeds)
    most = int(np.clip(WORK / system.size**2, FEWEST_SPEEDS, MOST_SPEEDS))
    if len(known) > most:
        known = known[np.linspace(0, len(known) - 1, most).astype(int)]
    found = whirl_motions(system, known)
    return {
        "speed": known,
        "frequency": found.natural_frequency,
        "damping_ratio": found.damping_ratio,
        "whirl": found.whirl,
    }


def mode_frequencies(system: GearSystem, modes: Modes) -> dict[str, Array]:
    """Return the frequencies of a table of modes by name: with terms both damped ones and those of the shapes."""
    own = modes.natural_frequency
    if in_modes(system):
        return {"natural_frequency": own}
    from gearstab.floquet.general.mean import frequencies_beyond_modes  # takes as long to load as a small sweep to run

    damped = frequencies_beyond_modes(system).reshape(*system.batch, system.size)
    return {"natural_frequency": damped, "symmetric_frequency": own}


def coordinate_names(system: GearSystem) -> list[str]:
    """The names of the coordinates, numbered ones where the system has none."""
    return list(system.coordinates) or [f"q{i + 1}" for i in range(system.size)]
