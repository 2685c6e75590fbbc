"""Result files: what h5py and xarray read is what was written, and a file with its name is complete."""

from __future__ import annotations

import errno
import io
import os
import threading
import zlib
from dataclasses import replace
from itertools import count
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gearstab.results import (
    Chunked,
    Field,
    Group,
    ResultError,
    ResultTree,
    Variable,
    coordinate,
    fields_of,
    hdf5,
    open_result,
    write_result,
)
from gearstab.results import variables as table
from gearstab.results.hdf5 import FILTER, decode, encode, holds
from gearstab.results.output import write_bytes
from gearstab.results.variables import responses
from gearstab.results.write import image

RNG = np.random.default_rng(1)
GROWTH = RNG.normal(size=(2, 10))


def tree(title: str = "t") -> ResultTree:
    axes = (
        Field(coordinate("mesh_frequency", "mesh_frequency", "f8", "rad/s", "mesh frequency"), np.linspace(1, 2, 10)),
        Field(coordinate("case", "case", table.TEXT, "1", "case"), ["a", "ü, b"]),
        Field(coordinate("meshes.second.phasing", "case", "f8", "1", "phasing"), np.array([0.0, 0.5])),
    )
    names = ["case", "mesh_frequency"], ["case"]

    def pieces():
        return iter([((0, 0), encode(GROWTH[:, :6], (2, 6))), ((0, 6), encode(GROWTH[:, 6:], (2, 6)))])

    floquet = (
        Field(table.FLOQUET[0].over(*names), Chunked((2, 10), (2, 6), pieces)),
        Field(table.FLOQUET[1].over(*names), np.ones((2, 10), dtype="i1")),
    )
    values = {"mode_p": [1, 2, 3], "label": ["2w1", "w2", "w1+w3"], "side": ["lower", "upper"]}
    values["boundary_frequency"] = np.arange(12.0).reshape(3, 2, 2)
    tongues = [v.over(*names) for v in (*table.TONGUE, table.SIDE, table.BOUNDARY)]
    groups = {"floquet": Group(floquet, {"tolerance": 1e-9}), "perturbation": Group(fields_of(tongues, values))}
    # More attributes, and a longer one, than fit into an object header.
    attributes = {
        "title": title,
        "gearstab_version": "0",
        "config": "x: 1\n" * 20000,
        **{f"a{i}": i for i in range(12)},
    }
    return ResultTree(Group(axes, attributes), groups)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_result(tmp_path / "r.h5", tree())
    return tmp_path / "r.h5"


def test_xarray_reads_dimensions_coordinates_and_values(path: Path) -> None:
    with open_result(path) as found:
        assert found["floquet"]["growth_rate"].dims == ("case", "mesh_frequency")
        np.testing.assert_array_equal(found["floquet"]["growth_rate"].values, GROWTH)
        # Coordinates of the root are inherited.
        assert found["floquet"]["growth_rate"].sel(case="ü, b", mesh_frequency=2.0) == GROWTH[1, -1]
        assert found["perturbation"]["boundary_frequency"].dims == ("tongue", "side", "case")
        assert list(found["perturbation"]["label"].values) == ["2w1", "w2", "w1+w3"]
        assert "label" in found["perturbation"].coords
        assert float(found["meshes.second.phasing"].sel(case="ü, b")) == 0.5
        assert len(found.attrs["config"]) == 100000
        assert found.attrs["a11"] == 11


def test_plain_open_datatree_reads_it_too(path: Path) -> None:
    with xr.open_datatree(path) as found:
        assert set(found.children) == {"floquet", "perturbation"}


def test_every_variable_has_type_units_and_name(path: Path) -> None:
    kinds = {}

    def look(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            kinds[name] = item.dtype
            assert item.attrs["units"], name
            assert item.attrs["long_name"], name
            assert all(len(dim) == 1 for dim in item.dims) or item.is_scale, name
            assert item.dtype.kind not in "cb"

    with h5py.File(path) as file:
        file.visititems(look)
        assert file["floquet/stable"].attrs["flag_values"].dtype == np.int8
        assert file["floquet/growth_rate"].dims[0][0].name == "/case"
    assert kinds["floquet/growth_rate"] == np.float64
    assert kinds["floquet/stable"] == np.int8
    assert kinds["perturbation/mode_p"] == np.int32
    assert "perturbation/tongue" in kinds
    # A dimension without coordinate stays one.
    with open_result(path) as found:
        assert found["perturbation"].sizes["tongue"] == 3
        assert "tongue" not in found["perturbation"].variables


def test_nothing_was_found_is_a_list_of_no_tongues(tmp_path: Path) -> None:
    variables = [v.over(["x"], ["x"]) for v in (*table.TONGUE, table.SIDE, table.BOUNDARY)]
    values = {"label": [], "mode_p": [], "side": ["lower", "upper"]}
    values["boundary_frequency"] = Chunked((0, 2, 3), (1, 2, 3), lambda: iter([]))
    axis = Field(coordinate("x", "x", "f8", "1", "x"), np.arange(3.0))
    empty = ResultTree(Group((axis,), {"gearstab_version": "0"}), {"boundaries": Group(fields_of(variables, values))})
    write_result(tmp_path / "r.h5", empty)
    with open_result(tmp_path / "r.h5") as found:
        assert found["boundaries"]["boundary_frequency"].shape == (0, 2, 3)


def test_values_without_a_variable_are_refused() -> None:
    with pytest.raises(KeyError, match="growth"):
        fields_of(table.FLOQUET, {"growth": np.zeros(3)})


def stored(data: bytes, chunk: tuple[int, ...], dtype: np.dtype) -> np.ndarray:
    """Read an encoded chunk by HDF5, in a file that is opened anew, as a result is."""
    with io.BytesIO() as content:
        with h5py.File(content, "w") as file:
            dataset = file.create_dataset("v", chunk, dtype, chunks=chunk, **FILTER)
            dataset.id.write_direct_chunk((0,) * len(chunk), data)
        with h5py.File(content) as file:
            return file["v"][()]


@pytest.mark.parametrize("compressor", ["isal", "zlib"])
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    values=arrays(
        st.sampled_from(["f8", "i1", "i2", "i4"]), st.tuples(*[st.integers(1, 5)] * 2), elements=st.integers(-100, 100)
    ),
    more=st.tuples(*[st.integers(0, 3)] * 2),
)
def test_chunks_are_what_hdf5_decodes(
    compressor: str, values: np.ndarray, more: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    if compressor == "zlib":
        monkeypatch.setattr(hdf5, "compress", zlib.compress)
    chunk = tuple(n + m for n, m in zip(values.shape, more, strict=True))
    data = encode(values, chunk)
    inside = tuple(slice(0, n) for n in values.shape)
    np.testing.assert_array_equal(decode(data, chunk, values.dtype.str)[inside], values)
    np.testing.assert_array_equal(stored(data, chunk, values.dtype)[inside], values)


@pytest.mark.parametrize("kind", ["noise", "zeros", "negative zeros", "smooth"])
def test_chunks_of_every_kind_keep_each_bit_and_hardly_grow(kind: str) -> None:
    rng = np.random.default_rng(7)
    values = {
        "noise": np.frombuffer(rng.bytes(8 * 3000), dtype="f8"), "zeros": np.zeros(3000),
        "negative zeros": np.full(3000, -0.0), "smooth": np.round(np.sin(np.linspace(0, 3, 3000)), 2),
    }[kind].reshape(60, 50)  # fmt: skip
    data = encode(values, values.shape)
    assert len(data) < values.nbytes * (1.001 if kind == "noise" else 0.5)
    assert holds(data, values.nbytes)
    assert decode(data, values.shape, "f8").tobytes() == values.tobytes()
    assert stored(data, values.shape, values.dtype).tobytes() == values.tobytes()


def test_a_file_on_disk_is_the_same_as_one_from_memory(tmp_path: Path, path: Path) -> None:
    (tmp_path / "d.h5").write_bytes(image(tree()))
    with open_result(tmp_path / "d.h5") as one, open_result(path) as two:
        xr.testing.assert_identical(one.to_dataset(), two.to_dataset())
        for group in one.children:
            xr.testing.assert_identical(one[group].to_dataset(), two[group].to_dataset())


def test_a_full_disk_leaves_the_old_file_and_no_other(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = path.read_bytes()

    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_result(path, tree("new"))
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_bytes_replace_a_file_at_once(tmp_path: Path) -> None:
    write_bytes(tmp_path / "a", b"one")
    write_bytes(tmp_path / "a", b"two")
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"two"]


def spoil(path: Path, how: str) -> Path:
    data = path.read_bytes()
    if how == "missing":
        path.unlink()
    elif how == "folder":
        return path.parent
    elif how == "truncated":
        path.write_bytes(data[: len(data) // 2])
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "text":
        path.write_text("title: no result\n")
    elif how == "foreign":
        with h5py.File(path, "w") as file:
            file["x"] = np.zeros(3)
    return path


REASONS = {
    "missing": "no such file", "folder": "is a folder", "truncated": "damaged or incomplete", "empty": "no result file",
    "text": "no result file", "foreign": "not written by gearstab",
}  # fmt: skip


@pytest.mark.parametrize("how", REASONS)
def test_what_is_no_result_is_named_in_one_line(path: Path, how: str) -> None:
    path = spoil(path, how)
    with pytest.raises(ResultError, match=REASONS[how]) as raised:
        open_result(path)
    assert str(raised.value).startswith(f"{path}: ")
    assert "\n" not in str(raised.value)


def test_a_result_can_be_replaced_and_locked_by_others_while_it_is_open(path: Path) -> None:
    with open_result(path) as found:
        write_result(path, tree("new"))
        np.testing.assert_array_equal(found["floquet"]["growth_rate"].values, GROWTH)
    with open_result(path) as found:
        assert found.attrs["title"] == "new"


def test_readers_see_the_old_or_the_new_result_and_never_a_mixture(path: Path) -> None:
    def uniform(value: int) -> ResultTree:
        growth = Field(table.FLOQUET[0].over(["case", "mesh_frequency"], ["case"]), np.full((2, 10), float(value)))
        return replace(tree(str(value)), groups={"floquet": Group((growth,))})

    write_result(path, uniform(0))
    done = threading.Event()

    def replacing() -> None:
        for value in count(1):
            write_result(path, uniform(value))
            if done.is_set():
                return

    writer = threading.Thread(target=replacing)
    writer.start()
    seen = []
    try:
        while len(set(seen)) < 5:
            with open_result(path) as found:
                seen.append(int(found.attrs["title"]))
                np.testing.assert_array_equal(found["floquet"]["growth_rate"].values, float(seen[-1]))
    finally:
        done.set()
        writer.join()
    assert seen == sorted(seen)


def test_the_tables_of_variables_are_sound() -> None:
    names = ("MODES", "FLOQUET", "EXPONENTS", "FIRST_ORDER", "EXACT", "TONGUE", "RESPONSE", "PAIR_RESPONSE", "ORBITS")
    for name in names:
        variables: tuple[Variable, ...] = getattr(responses if "RESPONSE" in name else table, name)
        assert len({v.name for v in variables}) == len(variables), name
        for variable in variables:
            assert variable.units, variable
            assert variable.long_name, variable
            assert variable.dtype == table.TEXT or np.dtype(variable.dtype).kind in "fi", variable
            # The status of a response is one for the whole of it.
            assert variable.coordinate or variable.dims or variable.name == "status", variable


def test_variables_can_be_dask_arrays(tmp_path: Path) -> None:
    array = pytest.importorskip("dask.array")
    path = tmp_path / "r.h5"
    write_result(path, tree())
    with open_result(path) as whole, open_result(path, chunks={}) as lazy:
        name, group = next((n, g) for g, node in whole.children.items() for n, v in node.data_vars.items() if v.ndim)
        found = lazy[group][name]
        assert isinstance(found.data, array.Array)
        xr.testing.assert_identical(found.compute(), whole[group][name].load())
