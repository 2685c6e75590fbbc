"""The section ``methods``."""

from __future__ import annotations

from typing import Any

from pydantic import Field, create_model

from gearstab.config.model.fields import Section
from gearstab.methods import METHODS


class _Chosen(Section):
    """Methods computed at every point of the grid; a method that is not named is not run."""

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the methods to run."""
        return tuple(name for name in METHODS if getattr(self, name) is not None)


def _field(name: str) -> tuple[Any, Any]:
    options = METHODS[name].Options
    return options | None, Field(default=None, title=name.replace("_", " "), description=options.__doc__)


FIELDS: dict[str, Any] = {name: _field(name) for name in METHODS}
Methods: Any = create_model("Methods", __base__=_Chosen, __doc__=_Chosen.__doc__, **FIELDS)
"""A section with the options of each method, in the order of the table."""
