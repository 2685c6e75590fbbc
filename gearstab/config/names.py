"""Names that mean the same everywhere in a configuration: in ``sweep`` and in ``--set``."""

from __future__ import annotations

TOP_LEVEL = ("title", "system", "sweep", "methods", "respond")
"""The sections of a document."""

EVERY_MESH = ("epsilon", "amplitude", "contact_ratio")
"""Short names that mean this number of every mesh that has one."""

BUT_THE_FIRST = ("phasing", "lag")
"""Short names that mean this number of every mesh but the first, against which it counts."""

RIVALS = {"epsilon": "amplitude", "amplitude": "epsilon"}
"""A mesh that gives one of these does not have the other."""
