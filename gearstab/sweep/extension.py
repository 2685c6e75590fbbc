"""A sweep that goes on from an earlier result, ``--extend``: what of it need not be computed again.

All that numbers depend on must be the same in both: the system, gearstab and NumPy. Axes may have further
values, and methods may be added or changed. Blocks are those of the whole sweep; each computes only the points that the
earlier result lacks, and takes the others over as they are. The result is then that of the whole sweep: bit for bit
where values do not depend on what is computed with them, as those of undamped piecewise constant systems, and else
within the tolerance of the method, which controls its steps, or brackets its roots, for many points together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gearstab.config import Axis, Config, ConfigError, load
from gearstab.config.configuration import without_files
from gearstab.config.document import mapping
from gearstab.errors import ResultError, one_line
from gearstab.methods import RANGE
from gearstab.results.read import SWEEP, attributes, is_sealed, refuse_hollow
from gearstab.results.tree import FORMAT
from gearstab.sweep.plan import Layout, Plan
from gearstab.sweep.storage.previous import Previous, identity, misshapen
from gearstab.system import Array
from gearstab.version import __version__

VARIED = ("title", "sweep", "methods")
"""Sections of a configuration that may differ."""


def extended(plan: Plan, path: Path) -> tuple[Plan, list[str]]:
    """Return the plan that takes over what it can from the result at ``path``, and what to tell of every method.

    Raises ResultError where the file is no result that was computed in the same way, or has nothing to take over.
    """
    before = identity(path)
    found = _checked(path)
    old = _configuration(path, found, plan.config)
    _refuse_another_grid(path, old, plan)
    places, words = {}, []
    for layout in plan.layouts:
        name = layout.method.name
        found_places = _places(plan, layout, old)
        if not isinstance(found_places, str):
            _refuse_misshapen(path, layout, old)
        if isinstance(found_places, str):
            words.append(f"{name}: computed anew: {found_places}")
            continue
        count = int(np.prod([np.count_nonzero(place >= 0) for place in found_places]))
        words.append(f"{name}: {count:,} of {layout.points:,} points are taken over from {path}")
        if count:
            places[name] = found_places
    if not places or before is None:
        raise _refused(path, f"nothing of it can be taken over ({'; '.join(words)})")
    return replace(plan, taken=Previous(path.resolve(), before, places)), words


def _refused(path: Path, reason: str) -> ResultError:
    return ResultError(f"{path}: cannot be extended: {reason}")


def _checked(path: Path) -> dict[str, str]:
    """The attributes of an unchanged result of a sweep by this program."""
    whole = is_sealed(path)
    if whole is False:  # not even opened, as HDF5 may read a damaged file for ever
        raise _refused(path, "it is damaged")
    found = attributes(path)
    if found["command"] != SWEEP:
        raise _refused(path, f"it is a result of gearstab {found['command']}, not of a sweep")
    if not whole:
        raise _refused(path, "it was changed after it was written")
    mine = {
        "format_version": str(FORMAT), "gearstab_version": __version__, "numpy_version": np.__version__,
    }  # fmt: skip
    for name, value in mine.items():
        if found.get(name) != value:
            what = name.replace("_", " ")
            raise _refused(path, f"its {what} is {found.get(name, 'unknown')}, and here it is {value}")
    refuse_hollow(path)
    return found


def _configuration(path: Path, found: Mapping[str, str], new: Config) -> Config:
    """The configuration of a result, which must differ from the new one in axes and methods only."""
    from gearstab.config.document.yaml import parse

    try:
        old = load(parse(found["config"], str(path)).data, source=new.source)
    except (ConfigError, KeyError) as error:
        raise _refused(path, f"its configuration cannot be read here: {str(error).splitlines()[0]}") from None
    there, here = ({k: v for k, v in without_files(c.tree).items() if k not in VARIED} for c in (old, new))
    if difference := differing(there, here):
        raise _refused(path, f"{difference}; only axes and methods may differ")
    if old.digest != found.get("config_digest"):
        raise _refused(path, "files that its configuration refers to have changed")
    return old


def differing(old: Any, new: Any, where: str = "") -> str:
    """Say where two trees of plain data differ first; "" where they do not."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [(key, old.get(key), new.get(key)) for key in dict.fromkeys([*old, *new])]
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        keys = [(str(k), *pair) for k, pair in enumerate(zip(old, new, strict=True))]
    else:
        return "" if old == new else f"{where} is {_short(old)} there, and {_short(new)} here"
    return next((text for k, a, b in keys if (text := differing(a, b, f"{where}.{k}".lstrip(".")))), "")


def _short(value: Any) -> str:
    text = "not given" if value is None else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _refuse_another_grid(path: Path, old: Config, plan: Plan) -> None:
    """Raise ResultError where the axes are others, or set other parameters."""
    axes = [{axis.name: [item.path for item in axis.assignments] for axis in c.axes} for c in (old, plan.config)]
    if list(axes[0].items()) != list(axes[1].items()):
        raise _refused(path, f"its axes are {', '.join(axes[0])}, and here they are {', '.join(axes[1])}")


def _places(plan: Plan, layout: Layout, old: Config) -> tuple[Array, ...] | str:
    """Where the points of a method's axes stand in the earlier result; or why nothing is taken over."""
    method, name = layout.method, layout.method.name
    there, here = (mapping(mapping(c.tree.get("methods")).get(name)) for c in (old, plan.config))
    if name not in old.methods.chosen:
        return "it is not in the earlier result"
    if difference := differing(there, here):
        return f"{name}.{difference}"
    if not method.reused:
        return "its regions are listed for all systems together"
    known = {axis.name: axis for axis in old.axes}
    axes = {axis.name: axis for axis in plan.config.axes}
    fast = None if plan.fast is None else axes[plan.fast.name]
    if fast is not None and method.frequency == RANGE and known[fast.name].span != fast.span:
        return "the range of the mesh frequency is another"
    found = tuple(_indices(known[dim], axes[dim]) for dim in layout.dims)
    inner = plan.inner(layout)
    if method.singly and inner is not None:
        place = found[inner]
        if not np.array_equal(place, np.arange(len(place))) or len(place) != known[layout.dims[inner]].size:
            return "values at one mesh frequency go on from those at others, which have changed"
    return found


def _refuse_misshapen(path: Path, layout: Layout, old: Config) -> None:
    """Raise ResultError where a method's variables are not those of its axes: a seal says nothing of who made it."""
    sizes = {axis.name: axis.size for axis in old.axes}
    try:
        wrong = misshapen(path, layout.method.name, layout.method.results, [sizes[dim] for dim in layout.dims])
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:  # h5py's, for what cannot be
        raise _refused(path, f"it is damaged ({one_line(error)})") from None
    if wrong:
        raise _refused(path, f"{wrong} is not as a sweep writes it")


def _indices(old: Axis, new: Axis) -> Array:
    """Where each point of an axis stands on an earlier one, -1 where all that is set there occurs nowhere on it."""
    places = {point: k for k, point in reversed(list(enumerate(_points(old))))}
    return np.array([places.get(point, -1) for point in _points(new)])


def _points(axis: Axis) -> list[tuple[Any, ...]]:
    """Numbers that every point of an axis sets, number by number with all bits."""
    labels = axis.values if isinstance(axis.values, list) else [""] * axis.size
    columns = [
        [repr(value) for value in item.values] if item.structural else np.asarray(item.values, dtype=float).tolist()
        for item in axis.assignments
    ]
    return list(zip(labels, *columns, strict=True))
