"""Models of other programs as the section ``system`` of kind ``matrices``, and systems as files for other programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet.truncation import modes_basis
from gearstab.modal import mean_modes
from gearstab.system import Array, GearSystem
from gearstab.systems.matrix_parts import OF_ROTATION, antisymmetric_terms, symmetric


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
