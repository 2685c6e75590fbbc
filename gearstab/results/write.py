"""Result files: netCDF-4/HDF5 with dimension scales and explicit types, complete from the moment they have their name.

HDF5 writes to memory, or what comes as chunks to the file through :mod:`gearstab.results.hdf5`, so that a full disk is
an ordinary OSError (inside the HDF5 library it can end in a crash).
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from gearstab.errors import ResultError
from gearstab.results.hdf5 import FILTER, Sink, append_seal, decode, seal_of
from gearstab.results.output import Look, move, naming, sync, temporary_file, writing
from gearstab.results.read import result_of
from gearstab.results.tree import FORMAT, NO_VARIABLE, Chunked, Field, Group, ResultTree, octets
from gearstab.results.variables import TEXT, Variable

if TYPE_CHECKING:
    import h5py
    import xarray as xr

COMPRESSED_FROM = 1 << 16
"""Arrays of more bytes than this are compressed."""
COMPLEX = "complex"
"""Name of the type of complex numbers in the root of a file."""
OF_THE_VARIABLES_TYPE = ("flag_values", "flag_masks")
"""Attributes that the conventions want in the type of their variable."""


def write_result(path: Path, tree: ResultTree, look: Look | None = None) -> None:
    """Write a result; ``path`` then holds all of it, or what it held before.

    look: as in :func:`gearstab.results.output.writing`, default: a result replaces one of the same command only.
    Raises what it raises, and OSError with the name ``path``.
    """
    look = look or result_of(tree.root.attributes.get("command")).refuse
    with writing(path, look) as file:
        with naming(path), Sink(file.fileno()) as sink:
            if in_memory(tree):
                sink.write(image(tree))
                sink.settle()
            else:
                with sink.hdf5() as target:
                    fill(target, tree)
            mark = seal_of(sink, sink.seek(0, os.SEEK_END))
        file.write(mark)


def result_tree(tree: xr.DataTree) -> ResultTree:
    """Turn an xarray tree back into a result that can be written. Raises ResultError for what no file can hold."""
    if "gearstab_version" not in tree.attrs:
        raise ResultError("this tree is no result of gearstab: its attribute gearstab_version is missing")
    groups = {node.path.strip("/"): _group(node) for node in tree.subtree}
    root = groups.pop(tree.path.strip("/"))
    return ResultTree(root, groups)


def _group(node: xr.DataTree) -> Group:
    """Return one group without what it inherits."""
    data = node.to_dataset(inherit=False)
    fields = tuple(Field(_variable(node.path, data[name]), data[name].values) for name in data.variables)
    return Group(fields, _storable(node.path, data.attrs))


def _variable(path: str, data: xr.DataArray) -> Variable:
    if data.dtype.kind not in "fciuOUST":
        raise ResultError(f"{path}: {data.name} has the type {data.dtype}; a result holds numbers and texts")
    said = _storable(f"{path}: {data.name}", data.attrs)
    units, words = str(said.pop("units", "1")), str(said.pop("long_name", data.name))
    dtype = data.dtype.str[1:] if data.dtype.kind in "fciu" else TEXT
    dims = tuple(str(dim) for dim in data.dims)
    return Variable(str(data.name), dims, dtype, units, words, said, str(data.name) in data.coords)


def _storable(where: str, attributes: Mapping[Any, Any]) -> dict[str, Any]:
    """Return attributes of a tree. Raises ResultError for one that is neither text nor numbers."""
    for name, value in attributes.items():
        if not isinstance(value, str | bytes) and np.asarray(value).dtype.kind not in "biuf":
            kind = type(value).__name__
            raise ResultError(f"{where}: the attribute {name} is of the type {kind}; a result holds numbers and texts")
    # A group names its coordinates itself, and counts as of this program's format.
    return {str(name): value for name, value in attributes.items() if name not in ("coordinates", "format_version")}


def in_memory(tree: ResultTree) -> bool:
    """Whether all values are there, as of every command but sweep: then HDF5 need not see the disk at all."""
    fields = (item for group in (tree.root, *tree.groups.values()) for item in group.fields)
    return not any(isinstance(item.values, Chunked) for item in fields)


def image(tree: ResultTree) -> memoryview:
    """The bytes of the file."""
    import h5py

    # The name is never opened; HDF5 only refuses two open files of one name.
    with h5py.File(f"{uuid4()}.h5", "w", driver="core", backing_store=False, track_order=True) as file:
        fill(file, tree)
        file.flush()
        return memoryview(file.id.get_file_image())


def rewrite_attributes(path: Path, attributes: Mapping[str, Any], look: Look | None = None) -> None:
    """Change attributes of a result's root in a copy that then takes its place.

    look: as in :func:`gearstab.results.output.writing`. Raises what it raises, and OSError.
    """
    import h5py

    with naming(path), temporary_file(path) as temporary:
        shutil.copyfile(path, temporary)
        with h5py.File(temporary, "r+") as file:
            file.attrs.update(attributes)
        append_seal(temporary)
        sync(temporary)
        move(temporary, path, look)


def fill(file: h5py.File, tree: ResultTree) -> None:
    """Write all groups of a result into an empty file."""
    file.attrs["format_version"] = FORMAT
    scales = _fill_group(file, tree.root, {})
    for name, group in tree.groups.items():
        _fill_group(file.create_group(name, track_order=True), group, scales)


def _fill_group(target: h5py.Group, group: Group, inherited: Mapping[str, Any]) -> dict[str, Any]:
    """Write one group; the scales of its dimensions and of those it inherits."""
    scales = dict(inherited)
    sizes = {dim: n for item in group.fields for dim, n in zip(item.variable.dims, item.shape, strict=True)}
    own = {item.variable.name for item in group.fields if item.variable.dims == (item.variable.name,)}
    for dim, size in sizes.items():
        if dim not in inherited and dim not in own:
            scales[dim] = target.create_dataset(dim, shape=(size,), dtype=">f4")
            scales[dim].make_scale(f"{NO_VARIABLE}.{size:10d}")
            _write_attributes(scales[dim], {"long_name": f"number along the dimension {dim}", "units": "1"})
    # Coordinates first: they are the scales of all others.
    for item in sorted(group.fields, key=lambda item: item.variable.name not in own):
        name = item.variable.name
        dataset = _create(target, item)
        _write_attributes(
            dataset,
            {"long_name": item.variable.long_name, "units": item.variable.units} | dict(item.variable.attributes),
        )
        if name in own:
            dataset.make_scale(name)
            scales[name] = dataset
        else:
            for k, dim in enumerate(item.variable.dims):
                dataset.dims[k].attach_scale(scales[dim])
    beside = [item.variable.name for item in group.fields if item.variable.coordinate and item.variable.name not in own]
    _write_attributes(target, dict(group.attributes) | ({"coordinates": " ".join(beside)} if beside else {}))
    return scales


def _create(target: h5py.Group, item: Field) -> h5py.Dataset:
    import h5py

    name = item.variable.name
    if item.variable.dtype == TEXT:
        return target.create_dataset(name, data=item.array(), dtype=h5py.string_dtype("utf-8"))
    packed = {**FILTER, "fillvalue": np.asarray(item.variable.fill, item.variable.dtype)}
    dtype = _stored(target.file, np.dtype(item.variable.dtype))
    if not isinstance(item.values, Chunked):
        values = item.array()
        options = packed if values.nbytes > COMPRESSED_FROM else {}
        return target.create_dataset(name, data=values, dtype=dtype, **options)
    if item.values.shape == ():
        # One number, which HDF5 does not divide.
        ((_, data),) = item.values.pieces()
        return target.create_dataset(name, data=decode(octets(data), (), item.variable.dtype))
    if not prod(item.values.shape):
        return target.create_dataset(name, shape=item.values.shape, dtype=dtype)
    dataset = target.create_dataset(name, shape=item.values.shape, dtype=dtype, chunks=item.values.chunk, **packed)
    for offset, data in item.values.pieces():
        dataset.id.write_direct_chunk(offset, octets(data, last=True))
    return dataset


def _stored(file: h5py.File, dtype: np.dtype[Any]) -> Any:
    """Return the type as the file has it: that of complex numbers, pairs r and i, by a name, as netCDF asks for."""
    if dtype.kind != "c":
        return dtype
    if COMPLEX not in file:
        file[COMPLEX] = dtype
    return file[COMPLEX]


def _write_attributes(target: Any, attributes: Mapping[str, Any]) -> None:
    """Texts, numbers and lists of numbers."""
    for name, value in attributes.items():
        kind = getattr(target, "dtype", None)
        if name in OF_THE_VARIABLES_TYPE and kind is not None:
            target.attrs[name] = np.asarray(value, dtype=kind)
        else:
            target.attrs[name] = np.asarray(value) if isinstance(value, list | tuple) else value
