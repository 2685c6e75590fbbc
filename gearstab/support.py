"""Comparison of the features of a system with those that a theory supports; the default is to refuse."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from gearstab.errors import NotPossible
from gearstab.system import Feature, GearSystem

ANY_LINEAR = frozenset({Feature.PERIODIC_TERMS, Feature.IRRATIONAL_RATIO})
"""The features of linear systems."""
WHIRLING = frozenset({Feature.ROTATION, Feature.UNSYMMETRIC_DAMPING})
"""The features of systems whose motions are no real modes, and may go with the mesh frequency."""
ONLY_MESHES = frozenset({Feature.IRRATIONAL_RATIO, Feature.FOLLOWS_ROTATION})
"""The features of systems with symmetric damping of which only the mesh stiffness varies, with time or, where it
follows the rotation, as in the classical formulation."""

_MESSAGES = {
    Feature.PERIODIC_TERMS: "supports only periodic mesh stiffness, and this system also has {terms}",
    Feature.UNSYMMETRIC_DAMPING: "needs a symmetric damping matrix, and that of this system is not",
    Feature.ROTATION: "does not support gyroscopic and other matrices that act with a speed of rotation",
    Feature.IRRATIONAL_RATIO: "mesh frequencies of irrational ratio have no common period",
    Feature.FOLLOWS_ROTATION: "supports only linear systems, and the mesh stiffness of this pair follows its rotation",
}
_REMEDIES = {
    Feature.PERIODIC_TERMS: "use floquet, which takes these too",
    Feature.UNSYMMETRIC_DAMPING: "use floquet or boundaries, which take it too",
    Feature.ROTATION: "use floquet or boundaries, which take these too",
    Feature.IRRATIONAL_RATIO: "remove it, or give exact ratios",
    Feature.FOLLOWS_ROTATION: "set formulation: classical",
}


def unsupported(
    system: GearSystem, supports: Collection[Feature], remedies: Mapping[Feature, str] | None = None
) -> tuple[str, str] | None:
    """Return why a theory does not apply to a system and what to do, or None if it does.

    supports: the features that the theory takes. remedies: what to do about others, where the usual one does not fit.
    """
    for feature in Feature:
        if feature in system.features and feature not in supports:
            message = _MESSAGES[feature].format(terms=", ".join(term.name for term in system.terms))
            return message, {**_REMEDIES, **(remedies or {})}[feature]
    return None


def whirls(system: GearSystem) -> bool:
    """Return whether the motions of a system are no real modes: modes of its symmetric part say little of them."""
    return bool(system.features & WHIRLING)


def require(system: GearSystem, supports: Collection[Feature], theory: str) -> None:
    """Raise NotPossible where a theory, given by its name, does not apply to a system."""
    if found := unsupported(system, supports):
        raise NotPossible(f"{theory} {found[0]}", found[1])
