"""The functions that ``import gearstab as gs`` offers.

Here: configurations, systems, what is known of them before anything is computed, and the theories one by one: a system
or a batch of systems in, arrays out. Whole runs in memory are beside.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gearstab import config as configuration
from gearstab.config import Config, ConfigError
from gearstab.config.document import document_of
from gearstab.errors import DoubtWarning, NotPossible
from gearstab.methods import METHODS, Method, OptionError, Outcome
from gearstab.results.variables import GRID, TEXT, TONGUE
from gearstab.system import Array, GearSystem

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


class Found(dict[str, Any]):
    """Arrays by name, as keys and as attributes: ``found["stable"]`` is ``found.stable``."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"there is no {name!r} among {', '.join(self)}") from None


class Stability(Found):
    """Stability over the batch of a system and mesh frequencies, ``(*batch, *mesh frequencies)``.

    growth_rate: largest real part of the characteristic exponents, 1/time; rigid-body modes that do not grow take no
        part. stable: int8, 1, 0, or -1 where nothing could be computed. status: bits, see docs/methods.md.
    Further arrays as in ``/floquet`` of a result.
    """

    growth_rate: Array
    stable: Array
    status: Array


class Regions(Found):
    """Instability regions: a list of tongues, and arrays over them, ``(tongue, *batch)``.

    label, kind, mesh: texts; mode_p, mode_q, harmonic: integers; all ``(tongue,)``.
    boundary_frequency: ``(tongue, 2, *batch)``, the lower and upper edge, as mesh frequency; NaN where it is closed.
    Further arrays as in ``/boundaries`` and ``/perturbation`` of a result.
    """

    label: Array
    kind: Array
    mesh: Array
    mode_p: Array
    mode_q: Array
    harmonic: Array
    boundary_frequency: Array


def floquet(system: GearSystem | Source, mesh_frequency: ArrayLike, **options: Any) -> Stability:
    """Decide stability and compute growth rates by Floquet theory.

    Parameters
    ----------
    system: a system, possibly a batch of systems, or a configuration.
    mesh_frequency: Omega of the first mesh, rad per unit time, positive; of any shape, the same for every system.
    options: those of ``methods.floquet``: ``tolerance``, ``exponents``, ``modes``, ...

    Raises NotPossible, a ValueError, where the method does not fit the system, and ConfigError for wrong options.
    """
    built = as_system(system)
    omega: Array = np.asarray(mesh_frequency, dtype=float)
    # A masked entry has no value, whatever lies under the mask.
    if np.ma.is_masked(mesh_frequency) or not ((omega > 0) & (omega < np.inf)).all():
        raise NotPossible("mesh frequencies must be positive numbers")
    method = _method("floquet", options, built)
    values = method.run(np.ravel(omega)).values
    names = {variable.name for variable in method.variables() if GRID in variable.dims}
    shape = (*built.batch, *omega.shape)
    return Stability({name: np.reshape(a, (*shape, *a.shape[2:])) for name, a in values.items() if name in names})


def boundaries(system: GearSystem | Source, lower: float, upper: float, **options: Any) -> Regions:
    """Find the edges of all instability regions between two mesh frequencies, however narrow they are.

    Parameters
    ----------
    system: as in :func:`floquet`.
    lower, upper: range of the mesh frequency, rad per unit time, 0 < lower < upper.
    options: those of ``methods.boundaries``: ``tolerance``, ``width_floor``.

    Raises what :func:`floquet` raises.
    """
    if not 0 < lower < upper < np.inf:
        raise NotPossible(f"mesh frequencies must satisfy 0 < lower < upper, not {lower:g}, {upper:g}")
    built = as_system(system)
    found = _method("boundaries", options, built).run(np.array([lower, upper], dtype=float))
    return _regions(found, {name: np.reshape(a, (*a.shape[:-1], *built.batch)) for name, a in found.values.items()})


def perturbation(system: GearSystem | Source, **options: Any) -> Regions:
    """Predict instability regions by perturbation theory.

    Parameters
    ----------
    system: as in :func:`floquet`.
    options: those of ``methods.perturbation``: ``order`` (1 or 2), ``harmonics``.

    Raises what :func:`floquet` raises.
    """
    built = as_system(system)
    found = _method("perturbation", options, built).run(np.zeros(0))
    return _regions(found, {name: np.asarray(a) for name, a in found.values.items()})


def _regions(found: Outcome, values: Mapping[str, Array]) -> Regions:
    tongues = {
        v.name: np.array([getattr(t, v.name) for t, _ in found.tongues], object if v.dtype == TEXT else v.dtype)
        for v in TONGUE
    }
    occurrence = np.array([number for _, number in found.tongues], dtype=int)
    return Regions({**tongues, "occurrence": occurrence, **values})


def _method(name: str, options: Mapping[str, Any], system: GearSystem) -> Method:
    """The method for a system, its options checked as those of a configuration."""
    from gearstab.config.model.conflicts import validate

    document = document_of({name: options}, "options")
    checked = validate(document, METHODS[name].Options, (name,))
    if document.problems or checked is None:
        raise ConfigError(document.problems)
    method = METHODS[name].on(checked, system)
    try:
        method.check()
    except OptionError as error:
        raise NotPossible(f"{'.'.join((name, *error.path))} {error}", error.remedy) from None
    return method
