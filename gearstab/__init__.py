"""Stability maps of gear systems with periodic mesh stiffness.

    import gearstab as gs

    config = gs.load("train.yaml", epsilon=0.2)
    tree = gs.sweep(config)
    gs.plot(tree)

The functions below are the public ones; docs/api.md describes them. They are imported when they are first used, so that
``import gearstab`` takes no time. Some have the name of a room of the package (``gearstab.sweep``): as an attribute of
``gearstab`` it means the function, and what is in the room is imported from it, ``from gearstab.sweep import plan``.
"""

from __future__ import annotations

import sys
from types import ModuleType

from gearstab.version import __version__ as __version__

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from gearstab.api import boundaries, build, floquet, info, load, perturbation
    from gearstab.api.runs import design, plot, respond, save, sweep
    from gearstab.exchange import dump, export_matrices, from_matrices
    from gearstab.exchange.programs import from_opentorsion, from_ross

ROOMS = {
    "api": ("boundaries", "build", "floquet", "info", "load", "perturbation"),
    "api.runs": ("design", "plot", "respond", "save", "sweep"),
    "exchange": ("dump", "export_matrices", "from_matrices"),
    "exchange.programs": ("from_opentorsion", "from_ross"),
}
"""Module -> the public functions in it."""
PLACES = {name: f"gearstab.{module}" for module, names in ROOMS.items() for name in names}

__all__ = [
    "boundaries", "build", "design", "dump", "export_matrices", "floquet", "from_matrices", "from_opentorsion",
    "from_ross", "info", "load", "perturbation", "plot", "respond", "save", "sweep",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import a public function when it is first used."""
    if name not in PLACES:
        raise AttributeError(f"module 'gearstab' has no attribute {name!r}")
    from importlib import import_module

    found = getattr(import_module(PLACES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Package(ModuleType):
    """This module, in which a public name stays that of the function when the room of that name is imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in PLACES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
