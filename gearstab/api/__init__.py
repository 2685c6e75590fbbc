"""The functions that ``import gearstab as gs`` offers.

Here: configurations, systems, and what is known of them before anything is computed. Whole runs in memory, and the
theories one by one, are beside.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from gearstab import config as configuration
from gearstab.config import Config
from gearstab.errors import DoubtWarning, NotPossible
from gearstab.system import GearSystem

Source = Config | Mapping[str, Any] | str | Path
"""A configuration: loaded, as data, or the path of its file; or the section ``system`` alone as data."""


def load(source: Source, overrides: Mapping[str, Any] | None = None, **values: Any) -> Config:
    """Read and check a configuration from a YAML file or from data.

    Parameters
    ----------
    source: the path of a file, or a mapping that holds what the file would hold; arrays of NumPy and sparse matrices of
        SciPy stand for lists. The section ``system`` alone will do for what needs no other.
    overrides, values: values that replace those of the configuration, by path: ``epsilon=0.2`` is that of every mesh,
        ``{"meshes.first.contact_ratio": 1.6}`` one number, ``sweep={...}`` a whole section.

    Raises ConfigError, a ValueError, with a line for each mistake; warns with DoubtWarning of what is right and hardly
    meant.
    """
    given = {**(overrides or {}), **values}
    if isinstance(source, Config):
        again = configuration.load(source.document.data, given, source=source.source)
        found = replace(again, overrides=(*source.overrides, *again.overrides))
    elif isinstance(source, Mapping) and "kind" in source and "system" not in source:
        found = configuration.load({"system": source}, given)
    else:
        found = configuration.load(source, given)
    for doubt in found.doubts:
        warnings.warn(str(doubt), DoubtWarning, stacklevel=2)
    return found


def as_config(source: Source, *needs: str) -> Config:
    """Return the configuration that is meant, which must have the sections ``needs``. Raises ConfigError."""
    found = source if isinstance(source, Config) else load(source)
    configuration.require(found, *needs)
    return found


def build(source: Source, overrides: Mapping[str, Any] | None = None, **values: Any) -> GearSystem:
    """Build the gear system of a configuration: M, C, K0 and the meshes.

    Parameters
    ----------
    source: as in :func:`load`.
    overrides, values: numbers of the system by path, as in :func:`load`; arrays stand for as many systems as they have
        entries. They broadcast against each other, and their shape is the batch of what is built.

    Raises ConfigError, and ValueError for arrays whose shapes do not go together.
    """
    config = as_config(source)
    given = {**(overrides or {}), **values}
    if "mesh_frequency" in given:
        raise NotPossible("mesh_frequency is no number of a system", "give it to the function that analyses the system")
    return (configuration.system_with(config, given) if given else config.system).build()


def as_system(source: GearSystem | Source) -> GearSystem:
    """Return the gear system that is meant."""
    return source if isinstance(source, GearSystem) else build(source)


class Info(dict[str, Any]):
    """Facts about a configuration or a result: numbers, texts and lists by name; ``text`` says it all.

    The keys are those of ``gearstab info --json``.
    """

    def __init__(self, facts: Mapping[str, Any], text: str) -> None:
        super().__init__(facts)
        self.text = text

    def __str__(self) -> str:
        return self.text

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        """Show the text in a notebook."""
        printer.text(self.text)


def info(source: Source, harmonics: int | None = None) -> Info:
    """Return natural frequencies, modes, reductions and the tongues that perturbation theory predicts.

    Parameters
    ----------
    source: a configuration, as in :func:`load`, or the path of a result file.
    harmonics: list tongues up to this one, default as the configuration asks.

    Raises ConfigError, and ResultError for a file that is no result.
    """
    from gearstab.info import configuration as base
    from gearstab.info import plain, result, text

    if isinstance(source, str | Path) and result.is_result(Path(source)):
        known = result.describe(Path(source))
        return Info(known, result.report(known))
    facts = base.describe(as_config(source), harmonics)
    return Info(plain(facts), text.report(facts))
