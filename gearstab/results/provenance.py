"""What every result says about where it comes from: attributes of the root, and the modes of the base system."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab import __version__
from gearstab.modal import mean_modes, mode_types
from gearstab.results.tree import Group, fields_of
from gearstab.results.variables import MODES

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.system import GearSystem


def root_attributes(config: Config, kernel: str) -> dict[str, Any]:
    """Title, configuration as run, versions, time; ``kernel``: which one of the Floquet kernels ran, "none" without."""
    import h5py

    return {
        "Conventions": "CF-1.11",
        "title": config.title,
        "source": f"gearstab {__version__}",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "gearstab_version": __version__,
        "numpy_version": np.__version__,
        "h5py_version": h5py.__version__,
        "hdf5_version": h5py.version.hdf5_version,
        "python_version": platform.python_version(),
        "kernel": kernel,
        "config_digest": config.digest,
        "config": config.resolved,
    }


def modes_group(system: GearSystem) -> Group:
    """The group ``/modes`` of a single system."""
    modes = mean_modes(system)
    values = {
        "mode": np.arange(1, system.size + 1),
        "dof": list(system.coordinates) or [f"q{i + 1}" for i in range(system.size)],
        "mesh": [mesh.name for mesh in system.meshes],
        "natural_frequency": modes.natural_frequency,
        "mode_shape": np.swapaxes(modes.shapes, -1, -2),
        "mesh_deflection": modes.mesh_deflection,
        "mode_type": [str(kind) for kind in mode_types(modes)],
    }
    return Group(
        fields_of(MODES, values), {"comment": "modes of the mean system at the base values of the configuration"}
    )
