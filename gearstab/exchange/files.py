"""Matrices from files of other programs, and the matrices of a system as a file."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gearstab.api.configurations import Source, as_system
from gearstab.errors import NotPossible, OutputError
from gearstab.exchange.model import Model, merged, model
from gearstab.results.output import OTHERS, RESULTS, TABLES, Content, write_bytes
from gearstab.system import Array, GearSystem, Mesh
from gearstab.systems.matrices.file import read_matrices

MODELS = (".mat", ".npz")
INSIDE = 1e-9
"""Distance from a breakpoint, in periods, at which its limits are taken."""
SAMPLES = 256
"""Phases of a mesh period at which the stiffness is written, those of its breakpoints besides."""


def from_matrices(
    mass: Any,
    stiffness: Any = None,
    damping: Any = None,
    meshes: Sequence[Mapping[str, Any]] | None = None,
    modes: int | None = None,
    **more: Any,
) -> Model:
    """Turn matrices into the section ``system`` of a configuration.

    Parameters
    ----------
    mass, stiffness, damping: arrays, sparse matrices of SciPy, or paths of Matrix Market files (``.mtx``); or the path
        of one ``.mat``, ``.npz`` or ``.h5`` file with ``mass``, ``stiffness`` and perhaps ``damping`` as the first
        alone. Antisymmetric parts of stiffness and damping become ``terms``.
    meshes: entries of ``meshes``, each with ``direction`` and ``mean_stiffness``; the stiffness matrix is without them.
    modes: how many of the lowest modes to keep, default all; ``note`` of the result says what that neglects.
    more: further keys of the section, such as ``coordinates``.

    Raises NotPossible, ConfigError and OSError.
    """
    if stiffness is None:
        if not isinstance(mass, str | Path):
            raise NotPossible("stiffness is missing", "give it, or the path of a file with all matrices alone")
        held = read_matrices(Path(mass))
        mass, stiffness, damping = held["mass"], held["stiffness"], held.get("damping")
    matrices = [None if part is None else dense(part) for part in (mass, stiffness, damping)]
    first, second, third = matrices
    if first is None or second is None:
        raise NotPossible("mass is missing")
    return model(first, second, third, merged((), meshes, "model"), modes, **more)


def dense(part: Any) -> Array:
    """Return a matrix as an array. Raises NotPossible where it is none."""
    if isinstance(part, str | Path):
        from scipy.io import mmread

        if Path(part).suffix.lower() not in (".mtx", ".mm", ".gz"):
            raise NotPossible(f"{part}: is no Matrix Market file", "name it .mtx")
        part = mmread(part)
    found = np.asarray(part.toarray() if hasattr(part, "toarray") else part)
    if found.ndim != 2 or found.shape[0] != found.shape[1] or found.dtype.kind not in "fiu":
        raise NotPossible(f"a matrix has the shape {found.shape} and the type {found.dtype}", "give square real ones")
    return found.astype(float)


def export_matrices(system: GearSystem | Source, path: str | Path) -> None:
    """Write the matrices of a system, or of a configuration, to a ``.mat`` or ``.npz`` file.

    ``mass``, ``stiffness`` (K0, without the meshes) and ``damping`` (zeros without any) ``(n, n)``; ``direction``
    ``(meshes, n)``; of each mesh ``mesh_name``, ``mean_stiffness``, ``epsilon``, ``frequency_ratio`` Omega_i/Omega and
    ``mesh_stiffness`` ``(meshes, samples)`` over ``phase`` ``(meshes, samples)``: k_i(t) at Omega_i t = 2 pi phase,
    in which a jump is two samples of one phase, so that linear interpolation gives piecewise linear waves exactly;
    ``coordinate``: names.

    The file can be the ``file`` of a system of kind ``matrices``. Raises NotPossible for a batch of systems, or one
    with further periodic terms, and OutputError where something else is at the path.
    """
    out, system = Path(path), as_system(system)
    if out.suffix.lower() not in MODELS:
        raise OutputError(f"{out}: the ending {out.suffix or 'missing'!r} is not known; use .mat or .npz")
    if system.batch:
        raise NotPossible(f"this is a batch of systems of shape {system.batch}", "export one of them")
    if system.terms:
        names = ", ".join(term.name for term in system.terms)
        raise NotPossible(f"the system has terms besides its meshes ({names})", "the file has no place for them")
    data, file = _contents(system), io.BytesIO()
    if out.suffix.lower() == ".npz":
        np.savez_compressed(file, allow_pickle=False, **data)
    else:
        from scipy.io import savemat

        savemat(file, {name: a.astype(object) if a.dtype.kind == "U" else a for name, a in data.items()})
    CONTENT.refuse(out)
    write_bytes(out, file.getvalue(), CONTENT.refuse)


CONTENT = Content(
    "a model", ".mat or .npz", lambda path: "" if path.suffix.lower() in MODELS else "is no model", TABLES + RESULTS
    + tuple(ending for ending in OTHERS if ending not in MODELS), streams=False,
)  # fmt: skip


def _contents(system: GearSystem) -> dict[str, Array]:
    size = system.size
    courses = [_course(mesh) for mesh in system.meshes]
    longest = max(len(phase) for phase, _ in courses)
    filled = [[np.pad(a, (0, longest - len(a)), mode="edge") for a in course] for course in courses]
    return {
        "mass": np.asarray(system.mass, dtype=float),
        "stiffness": np.asarray(system.stiffness, dtype=float),
        "damping": np.zeros((size, size)) if system.damping is None else np.asarray(system.damping, dtype=float),
        "direction": np.array([mesh.direction for mesh in system.meshes], dtype=float),
        "mesh_name": np.array([mesh.name for mesh in system.meshes]),
        "mean_stiffness": np.array([mesh.mean_stiffness for mesh in system.meshes], dtype=float),
        "epsilon": np.array([mesh.epsilon for mesh in system.meshes], dtype=float),
        "frequency_ratio": np.array([float(mesh.frequency_ratio) for mesh in system.meshes]),
        "phase": np.array([phase for phase, _ in filled]),
        "mesh_stiffness": np.array([values for _, values in filled]),
        "coordinate": np.array(list(system.coordinates) or [f"q{k + 1}" for k in range(size)]),
    }


def _course(mesh: Mesh) -> tuple[Array, Array]:
    """Phases from 0 to 1 and the stiffness there; at a breakpoint both limits, at the ends those inside."""
    lag = float(mesh.lag)
    jumps = np.unique(np.mod(np.ravel(mesh.waveform.breakpoints()) + lag, 1.0))
    jumps = jumps[(jumps > INSIDE) & (jumps < 1 - INSIDE)]
    even = np.linspace(0.0, 1.0, SAMPLES + 1)
    even = even[np.abs(even[:, None] - jumps).min(axis=1, initial=1.0) > INSIDE]
    phase = np.sort(np.concatenate([even, jumps, jumps]))
    shift = np.zeros(len(phase))
    shift[0], shift[-1] = INSIDE / 2, -INSIDE / 2
    twice = np.flatnonzero(phase[1:] == phase[:-1])
    shift[twice], shift[twice + 1] = -INSIDE / 2, INSIDE / 2
    values = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(phase + shift - lag))
    return phase, np.asarray(values, dtype=float)
