"""Models of other programs as the section ``system`` of kind ``matrices``: from matrices in memory or in files.

Besides, the matrices of a system as a file for other programs.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from gearstab.api import Source, as_config, as_system
from gearstab.config.model.files import DataFileError, arrays, numbers
from gearstab.errors import NotPossible, OutputError
from gearstab.floquet.truncation import modes_basis
from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.results.output import OTHERS, RESULTS, TABLES, Content, write_bytes
from gearstab.system import Array, GearSystem
from gearstab.systems.matrix_parts import (
    MOST_COORDINATES,
    OF_ROTATION,
    antisymmetric_terms,
    read_market,
    read_matrices,
    symmetric,
)
from gearstab.waveforms import Constant
from gearstab.waveforms.sampled import NARROWEST


class Model(dict[str, Any]):
    """The section ``system`` of a configuration, of kind ``matrices``, with arrays in the place of lists.

    basis: ``(n, m)``, B of q = B y where the model is reduced to m of its n coordinates; None where it is not.
    note: what the reduction keeps and neglects; "" without one.
    """

    basis: Array | None = None
    note: str = ""


def linear_model(
    mass: Array,
    stiffness: Array,
    damping: Array | None,
    meshes: Sequence[Mapping[str, Any]],
    modes: int | None = None,
    **more: Any,
) -> Model:
    """Return M q'' + C q' + [K0 + sum_i k_i(t) g_i g_i^T] q = 0 as a section.

    Parameters
    ----------
    mass, stiffness, damping: ``(n, n)``; ``stiffness`` is K0, without the meshes. The antisymmetric parts of stiffness
        and damping (bearings, gyroscopic effects) become ``terms``.
    meshes: entries of the section ``meshes``.
    modes: how many of the lowest modes of the mean system to keep, default all.
    more: further keys of the section.

    Raises NotPossible for a number of modes that the model does not have, and ConfigError for what is wrong otherwise.
    """
    found = Model(kind="matrices", mass=symmetric(mass), stiffness=symmetric(stiffness), **more)
    damping = np.zeros_like(mass) if damping is None else damping
    if np.any(damping):
        found["damping"] = {"matrix": symmetric(damping)}
    terms = [
        *antisymmetric_terms("circulatory", "stiffness", stiffness),
        *antisymmetric_terms("gyroscopic", "damping", damping),
    ]
    found |= {"terms": terms} if terms else {}
    found["meshes"] = [dict(mesh) for mesh in meshes]
    return found if modes is None else reduced(found, modes)


def reduced(found: Model, modes: int) -> Model:
    """Return a model in the coordinates of the lowest modes of its mean system (Galerkin), normalised by the mass."""
    from gearstab import config

    system = config.load({"system": found}).system.build()
    if not 1 <= modes <= system.size:
        raise NotPossible(f"modes is {modes}, and the model has {system.size} coordinates", "keep some of them")
    basis = modes_basis(system, range(1, modes + 1))
    small = system.projected(basis)
    kept = {key: value for key, value in found.items() if key not in ("coordinates", "coordinate_units")}
    result = Model(kept | {"mass": small.mass, "stiffness": small.stiffness})
    if "damping" in found:
        result["damping"] = {"matrix": small.damping}
    if "terms" in found:
        ends = [{"left": term.left, "right": term.right} for term in small.terms]
        result["terms"] = [term | end for term, end in zip(found["terms"], ends, strict=True)]
    if "rotation" in found:
        turning = zip(found["rotation"], small.rotations, strict=True)
        result["rotation"] = [
            part | {name: getattr(own, name) for name in OF_ROTATION if name in part} for part, own in turning
        ]
    pairs = zip(found["meshes"], small.meshes, strict=True)
    result["meshes"] = [entry | {"direction": mesh.direction} for entry, mesh in pairs]
    result["coordinates"] = [f"mode{k + 1}" for k in range(modes)]
    result.basis, result.note = basis, _note(system, basis)
    return result


def _note(system: GearSystem, basis: Array) -> str:
    """Return a note on the part that the lowest modes leave out of the compliance of each mesh, sum_p (g . phi_p)^2 /
    w_p^2 of the others.
    """
    modes, size = mean_modes(system), basis.shape[1]
    frequency = modes.natural_frequency
    if size == system.size:
        return f"all {size} modes are kept: nothing is neglected"
    elastic = frequency > 0
    parts = np.zeros(modes.mesh_deflection.shape)
    parts[elastic] = (modes.mesh_deflection[elastic] / frequency[elastic, None]) ** 2
    share = parts[size:].sum(axis=0) / parts.sum(axis=0)
    listed = ", ".join(f"{100 * s:.2g} % at {mesh.name}" for s, mesh in zip(share, system.meshes, strict=True))
    return (
        f"{size} of {system.size} modes are kept, up to {frequency[size - 1]:.6g} rad/s; the next one is at "
        f"{frequency[size]:.6g} rad/s; neglected of the compliance of the meshes: {listed}"
    )


def merged(
    known: Sequence[Mapping[str, Any]], given: Sequence[Mapping[str, Any]] | None, what: str
) -> list[dict[str, Any]]:
    """Return the meshes of a model, completed by what the user gives for each of them, and further ones of the user.

    known: what the program knows of each mesh, its direction among it. what: the kind of model, for messages.

    Raises NotPossible where a mesh has nothing that varies, or a further one no direction.
    """
    entries = [{**one, **other} for one, other in zip(known, given or ({},) * len(known), strict=False)]
    entries += [dict(item) for item in (given or ())[len(known) :]]
    if not entries:
        raise NotPossible(f"the {what} has no elastic mesh", "give meshes, each with direction and mean_stiffness")
    if given is not None and len(given) < len(known):
        names = ", ".join(str(item["name"]) for item in known)
        message = f"meshes has {len(given)} entries, and the {what} has the meshes {names}"
        raise NotPossible(message, "give one for each")
    for number, entry in enumerate(entries, 1):
        name = entry.setdefault("name", f"mesh{number}")
        if "direction" not in entry:
            raise NotPossible(f"mesh '{name}' has no direction", "give direction, one number per coordinate")
        if not entry.keys() & {"epsilon", "amplitude", "waveform"}:
            message = f"nothing says how the stiffness of mesh '{name}' varies"
            raise NotPossible(message, "give epsilon and contact_ratio")
    return entries


MODELS = (".mat", ".npz")
INSIDE = 1e-9
"""Distance from a breakpoint, in periods, at which its limits are taken."""
MESHES = ("direction", "mean_stiffness", "epsilon", "frequency_ratio", "phase", "mesh_stiffness")
"""Names of the mesh data in a file of :func:`export_matrices`."""
LARGEST_DENOMINATOR = 10_000
"""Largest denominator of an exact frequency ratio that a file holds as a decimal number."""
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
        A file of :func:`export_matrices` holds meshes of its own, which are taken where none are given: waves of two
        levels exactly, piecewise linear ones but for 1e-9 of a period at jumps, others interpolated.
    modes: how many of the lowest modes to keep, default all; ``note`` of the result says what that neglects.
    more: further keys of the section, such as ``coordinates``.

    Raises NotPossible, ConfigError and OSError.
    """
    if stiffness is None:
        if not isinstance(mass, str | Path):
            raise NotPossible("stiffness is missing", "give it, or the path of a file with all matrices alone")
        held = read_matrices(Path(mass))
        meshes = list(_meshes(Path(mass))) if meshes is None else meshes
        mass, stiffness, damping = held["mass"], held["stiffness"], held.get("damping")
    matrices = [None if part is None else dense(part) for part in (mass, stiffness, damping)]
    first, second, third = matrices
    if first is None or second is None:
        raise NotPossible("mass is missing")
    return linear_model(first, second, third, merged((), meshes, "model"), modes, **more)


def dense(part: Any) -> Array:
    """Return a matrix as an array. Raises NotPossible where it is none."""
    if isinstance(part, str | Path):
        try:
            return read_market(Path(part))
        except DataFileError as error:
            raise NotPossible(f"{part}: {error}", error.hint) from None
    if np.ma.is_masked(part):
        raise NotPossible("a matrix has masked entries, which have no value", "fill them")
    found = np.asarray(part.toarray() if hasattr(part, "toarray") else part)
    if found.ndim != 2 or found.shape[0] != found.shape[1] or found.dtype.kind not in "fiu":
        raise NotPossible(f"a matrix has the shape {found.shape} and the type {found.dtype}", "give square real ones")
    return found.astype(float)


def _meshes(path: Path) -> Iterator[dict[str, Any]]:
    """The meshes in a file of :func:`export_matrices`; none in another file."""
    held = arrays(path, MESHES, MOST_COORDINATES)
    if any(held.get(name) is None for name in MESHES):
        return
    values = {name: np.atleast_2d(numbers(name, held[name])) for name in MESHES}
    each = zip(values["direction"], values["phase"], values["mesh_stiffness"], strict=True)
    for k, (direction, phase, stiffness) in enumerate(each):
        mean, epsilon, ratio = (float(values[name].flat[k]) for name in MESHES[1:4])
        exact = Fraction(ratio).limit_denominator(LARGEST_DENOMINATOR)
        entry: dict[str, Any] = {"name": f"mesh{k + 1}", "direction": direction}
        entry |= (
            {"frequency_ratio": str(exact)} if float(exact) == ratio else {"frequency_ratio": ratio, "exact": False}
        )
        levels = np.unique(stiffness)
        if len(levels) > 2:
            yield entry | {"waveform": _sampled(phase, stiffness)}
            continue
        stiff = stiffness == levels[-1]
        rises, falls = (phase[1:][stiff[1:] & ~stiff[:-1]], phase[1:][~stiff[1:] & stiff[:-1]])
        begin, end = (float(edge[0]) if len(edge) else 0.0 for edge in (rises, falls))
        yield entry | {
            "mean_stiffness": mean, "epsilon": epsilon, "contact_ratio": 1 + (end - begin) % 1.0, "lag": begin,
        }  # fmt: skip


def _sampled(phase: Array, stiffness: Array) -> dict[str, Any]:
    """A wave through samples: a spline where nothing stands twice, else straight lines, with steep ones for jumps."""
    again = np.flatnonzero(np.diff(phase) <= 0)
    level = stiffness[again] == stiffness[again + 1]
    keep = np.ones(len(phase), dtype=bool)
    keep[again[level]] = False
    place = phase.copy()
    place[again[~level]] -= NARROWEST
    place[again[~level] + 1] += NARROWEST
    if stiffness[0] == stiffness[-1]:
        keep[-1] = False  # phase 1 is phase 0 again
    else:
        place[-1] -= 2 * NARROWEST
    if not len(again):
        keep[-1] = False
    kind = "linear" if len(again) else "cubic"
    return {"kind": "sampled", "phase": place[keep], "stiffness": stiffness[keep], "interpolation": kind}


def export_matrices(system: GearSystem | Source, path: str | Path) -> None:
    """Write the matrices of a system, or of a configuration, to a ``.mat`` or ``.npz`` file.

    ``mass``, ``stiffness`` (K0, without the meshes) and ``damping`` (zeros without any) ``(n, n)``; ``direction``
    ``(meshes, n)``; of each mesh ``mesh_name``, ``mean_stiffness``, ``epsilon``, ``frequency_ratio`` Omega_i/Omega and
    ``mesh_stiffness`` ``(meshes, samples)`` over ``phase`` ``(meshes, samples)``: k_i(t) at Omega_i t = 2 pi phase,
    in which a jump is two samples of one phase, so that linear interpolation gives piecewise linear waves exactly;
    ``coordinate``: names. Where teeth are weak, what a mesh lacks while they carry is a mesh of negative stiffness, and
    ``part_of`` names the mesh that it is part of, "" of whole ones.

    The file can be the ``file`` of a system of kind ``matrices``, and :func:`from_matrices` takes the meshes from it,
    too. Constant terms (gyroscopic and circulatory ones, say) are part of ``stiffness`` and ``damping``, which then are
    not symmetric. Raises NotPossible for a batch of systems, or one with further periodic terms, and OutputError where
    something else is at the path.
    """
    out, system = Path(path), as_system(system)
    if out.suffix.lower() not in MODELS:
        wrong = f"the ending {out.suffix} is not known" if out.suffix else "the name of a model needs an ending"
        raise OutputError(f"{out}: {wrong}; use .mat or .npz")
    if system.batch:
        raise NotPossible(f"this is a batch of systems of shape {system.batch}", "export one of them")
    periodic = [
        term.name
        for term in system.terms
        if not all(part is None or isinstance(part, Constant) for part in (term.stiffness, term.damping))
    ]
    if periodic:
        names = ", ".join(periodic)
        hint = "the file has no place for them"
        raise NotPossible(f"the system has periodic terms besides its meshes ({names})", hint)
    data, file = _contents(system), io.BytesIO()
    if out.suffix.lower() == ".npz":
        np.savez_compressed(file, allow_pickle=False, **data)
    else:
        from scipy.io import savemat

        savemat(file, {name: a.astype(object) if a.dtype.kind == "U" else a for name, a in data.items()})
    CONTENT.refuse(out)
    write_bytes(out, file.getvalue(), CONTENT.refuse)


def dump(source: Source, path: str | Path) -> None:
    """Write a configuration, as run, to a YAML file.

    source: a configuration, or the section ``system`` alone, such as a model of :func:`from_matrices`.
    Raises ConfigError, NotPossible for names of files that are relative to another folder, and OutputError where
    something else is at the path.
    """
    out, config = Path(path), as_config(source)
    if config.contents and out.parent.resolve() != config.source.parent.resolve():
        message = f"the configuration names files relative to {config.source.parent}"
        raise NotPossible(message, "write it into this folder")
    CONFIGURATION.refuse(out, config.source)
    write_bytes(out, config.resolved.encode(), CONFIGURATION.refuse)


def _content(name: str, *endings: str) -> Content:
    """Return a content that takes the place of files of the same endings alone."""

    def fault(path: Path) -> str:
        return "" if path.suffix.lower() in endings else f"is not {name}"

    wrong = tuple(ending for ending in TABLES + RESULTS + OTHERS if ending not in endings)
    return Content(name, " or ".join(endings), fault, wrong, streams=False)


CONTENT = _content("a model", *MODELS)
CONFIGURATION = _content("a configuration", ".yaml", ".yml")


def _contents(system: GearSystem) -> dict[str, Array]:
    size = system.size
    courses = [_course(mesh) for mesh in system.meshes]
    longest = max(len(phase) for phase, _ in courses)
    filled = [[np.pad(a, (0, longest - len(a)), mode="edge") for a in course] for course in courses]
    stiffness = np.array(system.stiffness, dtype=float)
    damping = np.array(system.damping_matrix, dtype=float)
    for term in system.terms:
        for matrix, part in ((stiffness, term.stiffness), (damping, term.damping)):
            if part is not None:
                matrix += float(part.value(np.zeros(()))) * np.outer(term.left, term.right)
    parts = np.array([mesh.part_of for mesh in system.meshes])
    return ({"part_of": parts} if np.any(parts != "") else {}) | {
        "mass": np.asarray(system.mass, dtype=float),
        "stiffness": stiffness,
        "damping": damping,
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
