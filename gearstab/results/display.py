"""The units in which a reader sees a result: what was typed in rpm is shown in rpm, while files hold SI numbers.

A coordinate carries ``display_units`` and ``display_scale``, how many of its own unit one of those is, where the
configuration gave all its values in another unit. The frequencies of a spectrum carry ``order_scale`` where the
teeth are known: an order counts cycles per turn of the input shaft.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.config.model.units import MEANING, NUMBER, UnitError, scale
from gearstab.errors import ResultError, listed
from gearstab.results.variables import Variable
from gearstab.system import GearSystem

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray

FREQUENCY, SPECTRAL = "mesh_frequency", "frequency"
SPEED_RATIOS = "speed_ratios"
"""Attribute of natural frequencies that follow the speed: of the rotations, to the mesh frequency."""
SPEEDS = (FREQUENCY, "input_speed")
"""Axes along which the mesh frequency varies."""
FACTOR = "mesh_frequency_factor"
"""Attribute of an axis of SPEEDS: mesh frequency over its values."""
CYCLES = "cycles_of_input"
"""Attribute of an axis of SPEEDS, or of a response: cycles of the first mesh in a turn of the input shaft."""
OPERATING_RANGE = "operating_range"
"""Attribute of an axis of SPEEDS: the lowest and the highest speed of each operating range, in the unit of the axis."""
RATIOS = "frequency_ratios"
"""Attribute of a group: frequency of each mesh over the mesh frequency, that of the first one."""
OF_MESH = (
    "boundary_frequency", "first_order_boundary_frequency", "boundary_error", "center_frequency", "half_width",
    "proved_frequency", "certificate_frequency",
)  # fmt: skip
"""Variables that are mesh frequencies, or distances of them."""
ASIDE = "mesh_frequency_axis"
"""Dimension of the axis mesh_frequency in the root where a group has a variable of that name: xarray would hand the
axis down to the group as the index of what is none. Groups over the axis have it themselves."""
SI = "SI"
ORDER, ORDER_SCALE = "order", "order_scale"
"""The unit of frequencies over the speed of the input shaft, and the attribute that holds this speed."""
SHOWN_SCALE = "shown_scale"
"""Attribute of what is shown in another unit: how many of its own unit one of that is."""
AS_FREQUENCY = ("peak_frequency",)
"""Variables that are shown in the unit of the frequencies of a spectrum."""


def typed(units: str, si: str) -> dict[str, Any]:
    """Return the attributes of a coordinate in the SI unit ``si`` whose values were typed in another one."""
    return {"display_units": units, "display_scale": scale(units, si)} if units not in ("", si) else {}


def with_orders(table: Sequence[Variable], shaft: float | None) -> tuple[Variable, ...]:
    """Return a table of variables whose frequencies know what one order is.

    shaft: speed of the input shaft, in the unit of the frequencies; None where no teeth are known.
    """
    if shaft is None:
        return tuple(table)
    said = {ORDER_SCALE: shaft}
    return tuple(replace(v, attributes={**v.attributes, **said}) if v.name == SPECTRAL else v for v in table)


def is_axis(item: xr.DataArray) -> bool:
    """Return whether a coordinate is that of an axis, or of another dimension with numbers of its own."""
    return item.dims in ((item.name,), (ASIDE,))


def in_display_units(tree: xr.DataTree, wanted: Sequence[str] = ()) -> xr.DataTree:
    """Return the result with its coordinates in the units that were typed, or in those asked for.

    wanted: ``UNIT``, for all coordinates that it fits; ``AXIS=UNIT``, for one; ``SI``, for none but these; ``order``,
        for the frequencies of a spectrum.
    Raises ResultError for a unit that fits none, or not the axis.
    """
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    chosen = _chosen(groups, wanted)
    if not chosen:
        return tree
    return type(tree).from_dict({path: _shown(data, chosen) for path, data in groups.items()}, name=tree.name)


def _chosen(groups: Mapping[str, xr.Dataset], wanted: Sequence[str]) -> dict[str, tuple[str, float]]:
    """Name of a coordinate -> unit to show it in, and how many of its own one of that is."""
    known = {
        str(name): item.attrs
        for data in groups.values()
        for name, item in data.coords.items()
        if is_axis(item) and item.dtype.kind in "fiu"
    }
    found = {
        name: (str(attrs["display_units"]), float(attrs["display_scale"]))
        for name, attrs in known.items()
        if "display_units" in attrs and SI not in wanted
    }
    # Whoever types speeds in rpm or Hz reads frequencies in Hz.
    own = str(known.get(SPECTRAL, {}).get("units"))
    if own == "rad/s" and any(name in SPEEDS for name in found):
        found.setdefault(SPECTRAL, ("Hz", scale("Hz", own)))
    for text in wanted:
        axis, _, unit = (part.strip() for part in text.rpartition("="))
        fitting = {name: one for name in known if axis in ("", name) and (one := _scale_of(unit, known[name]))}
        if unit == ORDER and not fitting:
            raise ResultError(f"--unit {text}: {_no_orders(known)}")
        if unit != SI and not fitting:
            there = listed(f"{name} ({attrs.get('units', '1')})" for name, attrs in known.items())
            raise ResultError(f"--unit {text}: is no unit of {axis or 'an axis of this result'}; there is {there}")
        found |= {name: (unit, one) for name, one in fitting.items()}
    return found


def _scale_of(unit: str, attributes: Mapping[str, Any]) -> float:
    """How many of its own unit one of another unit is, for a coordinate; 0 where the unit does not fit."""
    if unit == ORDER:
        return float(attributes.get(ORDER_SCALE, 0.0))
    own = str(attributes.get("units", "1"))
    return scale(unit, own) if _fits(unit, own) else 0.0


def _no_orders(known: Mapping[str, Mapping[str, Any]]) -> str:
    """Why nothing of a result can be shown in orders, and what can be."""
    if SPECTRAL in known:
        return "the speed of the input shaft is not known; give teeth in the configuration and run respond again"
    if any(name in known for name in SPEEDS):
        return (
            "a mesh has the same order at every speed (see gearstab info); orders are for spectra of gearstab respond"
        )
    return "orders are for spectra of gearstab respond, and this result has none"


def _fits(unit: str, si: str) -> bool:
    try:
        return bool(unit) and si != "1" and bool(scale(unit, si))
    except UnitError:
        return False


def _shown(data: xr.Dataset, chosen: Mapping[str, tuple[str, float]]) -> xr.Dataset:
    """A group with the chosen coordinates in their units."""
    order = list(data.coords)
    for name, (unit, one) in chosen.items():
        # Branches have a mesh frequency of each motion under the name of the axis.
        if name not in data.coords or not is_axis(data[name]):
            continue
        own = data[name]
        attributes = {key: value for key, value in own.attrs.items() if not key.startswith("display_")}
        attributes |= {"units": unit, "si_units": own.attrs.get("units", "1"), SHOWN_SCALE: one}
        if name in SPEEDS:
            attributes[FACTOR] = float(own.attrs.get(FACTOR, 1.0)) * one
        data = data.assign_coords({name: (own.dims, shown_as(own.values, one), attributes)})
    if SPECTRAL in chosen:
        unit, one = chosen[SPECTRAL]
        for name in (name for name in AS_FREQUENCY if name in data.data_vars):
            own = data[name]
            shown = {**own.attrs, "units": unit, "si_units": own.attrs.get("units", "1")}
            data = data.assign({name: (own.dims, shown_as(own.values, one), shown)})
    # In their order, which is that of the sweep and changes where one is assigned.
    return type(data)(data.data_vars, {name: data.coords[name] for name in order}, data.attrs)


def in_speeds(tree: xr.DataTree, group: str) -> xr.Dataset:
    """A group whose mesh frequencies are in the unit in which the axis that sets them is shown, or are input speeds."""
    dataset = tree[group].to_dataset()
    axis = next((tree[name] for name in SPEEDS if name in tree.coords and "si_units" in tree[name].attrs), None)
    if axis is None:
        return dataset
    for name in OF_MESH:
        if name in dataset:
            data = dataset[name] / axis.attrs[FACTOR]
            data.attrs = dataset[name].attrs | {key: axis.attrs[key] for key in ("units", "si_units")}
            # In the place of the variable, under the name of what it is now.
            new = name.replace("frequency", str(axis.name).removeprefix("mesh_"))
            dataset = dataset.assign({name: data}).rename({name: new})
    return dataset


def shown_as(values: Array, one: float) -> Array:
    """Return values in a unit of which one is ``one`` SI units, to 14 digits: 600 rpm come back as 600."""
    numbers = np.asarray(values, dtype=float) / one
    return np.reshape([float(f"{x:.14g}") for x in numbers.flat], numbers.shape)


def number_of(text: str, units: str) -> float:
    """Return the number of a text, ``10000 rpm`` or without a unit, in the units of what it is compared with.

    Raises ValueError for what is no number, or no quantity of the kind.
    """
    found = NUMBER.match(text)
    if not found:
        raise ValueError(f"{text!r} is no number")
    value, unit = float(found[1]), found[2]
    if unit in ("", units):
        return value
    si = next((si for si in MEANING if _fits(unit, si) and _fits(units, si)), None)
    if si is None:
        raise ValueError(f"{text!r} is not in {units}")
    return value * scale(unit, si) / scale(units, si)


ROTATION = {"m": "rad", "m/s": "rad/s", "kg^-1/2": "kg^-1/2 m^-1"}
"""Units of a displacement, a velocity and an entry of a mode normalised by the mass matrix: the same of a rotation.

With Phi^T M Phi = I an entry is a coordinate over sqrt(kg) m, whatever the other coordinates are.
"""

TORSIONAL = {**ROTATION, "N": "N m", "N^2 s": "N^2 m^2 s", "m^2 s": "rad^2 s"}
"""Units of a mesh deflection, a mesh force and their spectra: the same of a mesh whose stiffness is torsional."""

OF_MESHES = frozenset(("mesh", "event", "peak"))
"""Dimensions of variables that concern a mesh."""

MIXED = "1"
"""Unit of values in several units: none would hold for all of them."""

LENGTHS = {"m": 1, "N": 1, "J": 2, "Pa": -1}
"""Powers of the length in a unit; kg, s and rad have none."""


def in_units_of(system: GearSystem, table: Sequence[Variable]) -> tuple[Variable, ...]:
    """A table of variables with the units that the coordinates and mesh deflections of a system have.

    Variables over ``dof`` get the unit that all coordinates give; where they differ, ``MIXED``, a comment and the
    attributes ``units_of_rad`` and ``units_of_m``. Those over ``mesh`` go by the system's mesh deflections. What has no
    unit in the system gets the unit 1.
    """
    return tuple(_in_units(variable, system) for variable in table)


def unit_of(system: GearSystem, unit: str) -> str:
    """An SI unit without what is dimensionless in the system: ``rad/s`` is 1 where times have no unit."""
    if not system.dimensionless:
        return unit
    if "length" in system.dimensionless or unit == "1":
        return "1"
    power = 0
    for sign, part in re.findall(r"(^| |/)([^ /]+)", unit):
        name, _, exponent = part.partition("^")
        if name in LENGTHS:
            power += (-1 if sign == "/" else 1) * LENGTHS[name] * int(exponent or 1)
    return "1" if power == 0 else "m" if power == 1 else f"m^{power}"


def in_brackets(system: GearSystem, unit: str) -> str:
    """`` (rad/s)`` for texts, nothing where a quantity has no unit in the system."""
    own = unit_of(system, unit)
    return "" if own == "1" else f" ({own})"


def _in_units(variable: Variable, system: GearSystem) -> Variable:
    if system.dimensionless:
        return replace(variable, units=unit_of(system, variable.units))
    if variable.coordinate:
        return variable
    if system.deflection_unit == "rad" and not OF_MESHES.isdisjoint(variable.dims):
        return replace(variable, units=TORSIONAL.get(variable.units, variable.units))
    if "dof" not in variable.dims or "rad" not in system.coordinate_units:
        return variable
    rotation = ROTATION[variable.units]
    if set(system.coordinate_units) == {"rad"}:
        return replace(variable, units=rotation)
    said = {
        "comment": f"units differ: {rotation} where dof_units is rad, {variable.units} where it is m",
        "units_of_rad": rotation,
        "units_of_m": variable.units,
    }
    return replace(variable, units=MIXED, attributes={**variable.attributes, **said})
