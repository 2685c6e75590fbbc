"""sweep --extend: what an earlier result has is taken over, the rest computed, and the data are those of the whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scenes import TRAIN, refused, succeeds, written

from gearstab.config import load
from gearstab.errors import ResultError, SweepError
from gearstab.results import open_result
from gearstab.results.hdf5 import LENGTH, append_seal
from gearstab.results.write import rewrite_attributes
from gearstab.sweep import Interrupted, Plan, compute, plan, run
from gearstab.sweep.extension import extended
from gearstab.sweep.plan import chunk_shape
from gearstab.sweep.storage import previous, store

COARSE = {"mesh_frequency": [0.6, 1.9, 3.0, 4.4, 5.2, 6.5], "epsilon": [0.0, 0.3, 0.5]}
METHODS = "{floquet: {}, boundaries: {}, perturbation: {}}"


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = written(tmp_path, TRAIN, "train.yaml")
    return path


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """Methods that were run, each with its number of points."""
    found: list[tuple[str, int]] = []
    run_rows = compute.run_rows

    def counting(plan: Plan, layout: object, rows: object, count: int, columns: np.ndarray) -> object:
        found.append((layout.method.name, count * len(columns)))  # type: ignore[attr-defined]
        return run_rows(plan, layout, rows, count, columns)  # type: ignore[arg-type]

    monkeypatch.setattr(compute, "run_rows", counting)
    return found


def planned(config: Path, axes: object, methods: str = METHODS, *more: str) -> Plan:
    """A plan in several blocks."""
    whole = plan(load(config, [f"sweep={axes}", f"methods={methods}", *more]))
    layouts = []
    for layout in whole.layouts:
        inner = whole.inner(layout)
        layouts.append(replace(layout, chunk=chunk_shape(layout.shape, inner, 8 if inner is not None else 2)))
    return replace(whole, layouts=tuple(layouts))


def result(planned: Plan, out: Path) -> Path:
    run(planned, out, jobs=1, overwrite=True)
    return out


NEAR = {"boundaries/boundary_frequency": 2e-10}
"""Edges: each search is right to 1e-10, and begins at the edges of the row before it."""
FREE = {"boundaries/tolerance", "boundaries/evaluations"}
"""How it came to them."""


def assert_same(path: Path, other: Path) -> None:
    """All variables of two results, bit for bit but for those that are near each other."""
    variables: dict[str, list[np.ndarray]] = {}
    for name in (path, other):
        with h5py.File(name, "r", locking=False) as file:

            def keep(key: str, item: object) -> None:
                if isinstance(item, h5py.Dataset):
                    values = item.asstr()[...].astype("U") if item.dtype.kind == "O" else item[...]
                    variables.setdefault(key, []).append(values)

            file.visititems(keep)
    assert variables
    assert [key for key, found in variables.items() if len(found) != 2 or not alike(key, *found)] == []


def alike(key: str, a: np.ndarray, b: np.ndarray) -> bool:
    if a.shape != b.shape or key in FREE:
        return a.shape == b.shape
    near = NEAR.get(key)
    return a.tobytes() == b.tobytes() if near is None else np.allclose(a, b, rtol=near, atol=0, equal_nan=True)


GROWN = {
    "finer and longer": {
        "mesh_frequency": [0.6, 1.0, 1.9, 3.0, 4.4, 5.0, 5.2, 6.5], "epsilon": [0.0, 0.1, 0.3, 0.5, 0.6],
    },
    "turned round": {"mesh_frequency": COARSE["mesh_frequency"][::-1], "epsilon": [0.5, 0.4, 0.3, 0.0]},
    "a part of it": {"mesh_frequency": COARSE["mesh_frequency"], "epsilon": [0.3]},
}  # fmt: skip


@pytest.mark.parametrize("axes", GROWN.values(), ids=list(GROWN))
def test_the_data_are_those_of_the_whole_sweep(config: Path, tmp_path: Path, axes: dict[str, list[float]]) -> None:
    old = result(planned(config, COARSE), tmp_path / "old.h5")
    before = old.read_bytes()
    grown, _ = extended(planned(config, axes), old)
    assert_same(result(grown, tmp_path / "grown.h5"), result(planned(config, axes), tmp_path / "whole.h5"))
    assert old.read_bytes() == before


def test_only_what_is_new_is_computed(config: Path, tmp_path: Path, computed: list[tuple[str, int]]) -> None:
    old = result(planned(config, COARSE), tmp_path / "old.h5")
    computed.clear()
    grown, words = extended(planned(config, GROWN["finer and longer"]), old)
    result(grown, tmp_path / "grown.h5")
    points = {name: sum(n for method, n in computed if method == name) for name, _ in computed}
    assert points["floquet"] == 8 * 5 - 6 * 3
    assert points["boundaries"] == 5 - 3
    assert "floquet: 18 of 40 points are taken over" in " ".join(words)


def test_another_method_leaves_the_first_one_alone(
    config: Path, tmp_path: Path, computed: list[tuple[str, int]]
) -> None:
    old = result(planned(config, COARSE, "{floquet: {}}"), tmp_path / "old.h5")
    computed.clear()
    more = planned(config, COARSE, "{floquet: {}, boundaries: {}}")
    grown = result(extended(more, old)[0], tmp_path / "grown.h5")
    assert {method for method, _ in computed} == {"boundaries"}
    assert_same(grown, result(more, tmp_path / "whole.h5"))


def test_a_method_with_another_output_is_computed_anew(config: Path, tmp_path: Path) -> None:
    old = result(planned(config, COARSE, "{floquet: {}, boundaries: {}}"), tmp_path / "old.h5")
    more = planned(config, COARSE, "{floquet: {exponents: true}, boundaries: {}}")
    grown, words = extended(more, old)
    assert any(text.startswith("floquet: computed anew: floquet.exponents") for text in words)
    assert_same(result(grown, tmp_path / "grown.h5"), result(more, tmp_path / "whole.h5"))


def test_cases_are_the_same_by_all_that_they_set(config: Path, tmp_path: Path) -> None:
    def axes(*cases: tuple[str, float, str]) -> dict[str, object]:
        listed = [{"label": a, "meshes.first.contact_ratio": b, "tooth_ratio": c} for a, b, c in cases]
        return {"case": listed, "mesh_frequency": COARSE["mesh_frequency"]}

    old = result(planned(config, axes(("a", 1.5, "3/5"), ("b", 1.2, "1"), ("c", 1.7, "1"))), tmp_path / "old.h5")
    # b has the same label and another contact ratio.
    more = planned(config, axes(("c", 1.7, "1"), ("b", 1.3, "1"), ("a", 1.5, "3/5"), ("d", 1.5, "2/5")))
    grown, words = extended(more, old)
    assert "floquet: 12 of 24 points are taken over" in " ".join(words)
    assert_same(result(grown, tmp_path / "grown.h5"), result(more, tmp_path / "whole.h5"))


def test_boundaries_of_another_range_are_computed_anew(config: Path, tmp_path: Path) -> None:
    old = result(planned(config, COARSE), tmp_path / "old.h5")
    longer = COARSE | {"mesh_frequency": [*COARSE["mesh_frequency"], 7.0]}
    grown, words = extended(planned(config, longer), old)
    assert "boundaries: computed anew: the range of the mesh frequency is another" in words
    assert_same(result(grown, tmp_path / "grown.h5"), result(planned(config, longer), tmp_path / "whole.h5"))


def test_an_interrupted_extension_goes_on(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, computed: list[tuple[str, int]]
) -> None:
    old = result(planned(config, COARSE), tmp_path / "old.h5")
    before, axes, out = old.read_bytes(), GROWN["finer and longer"], tmp_path / "grown.h5"
    monkeypatch.setattr(store, "MOST_SECONDS", 0.0)
    with monkeypatch.context() as patched:
        read, calls = previous.Previous.outcome, iter(range(9))

        def interrupted(*words: object) -> object:
            if next(calls) == 2:
                raise KeyboardInterrupt
            return read(*words)  # type: ignore[arg-type]

        patched.setattr(previous.Previous, "outcome", interrupted)
        with pytest.raises(Interrupted, match="blocks are kept"):
            run(extended(planned(config, axes), old)[0], out, jobs=1)
    assert not out.exists()
    assert old.read_bytes() == before
    kept = len(computed)
    again = run(extended(planned(config, axes), old)[0], out, jobs=1)
    assert again.reused
    assert len(computed) > kept
    assert_same(out, result(planned(config, axes), tmp_path / "whole.h5"))


def test_a_result_can_take_the_place_of_the_one_it_extends(config: Path, tmp_path: Path) -> None:
    text = TRAIN + "sweep: {mesh_frequency: {start: 1, stop: 6, num: 9}}\nmethods: {floquet: {}}\n"
    config.write_text(text)
    out = tmp_path / "train.h5"
    succeeds("sweep", config, "-o", out)
    config.write_text(text.replace("num: 9", "num: 17"))
    found = succeeds("sweep", config, "-o", out, "--extend", out)
    assert "floquet: 9 of 17 points are taken over" in found.stderr
    succeeds("sweep", config, "-o", tmp_path / "whole.h5")
    assert_same(out, tmp_path / "whole.h5")
    with open_result(out) as tree:
        assert tree.attrs["extended_from"] == str(out.resolve())


def test_a_result_that_changes_meanwhile_ends_the_sweep(config: Path, tmp_path: Path) -> None:
    old = result(planned(config, COARSE), tmp_path / "old.h5")
    grown, _ = extended(planned(config, GROWN["finer and longer"]), old)
    result(planned(config, COARSE, METHODS, "epsilon=0.1"), old)
    with pytest.raises(SweepError, match="was changed while the sweep took its points over"):
        run(grown, tmp_path / "grown.h5", jobs=1)


def test_values_that_cannot_be_read_are_blamed_on_the_file(config: Path, tmp_path: Path) -> None:
    """Where a seal was made anew over damaged values."""
    long = {"mesh_frequency": {"start": 0.6, "stop": 6.5, "num": 200}, "epsilon": [0.0, 0.3, 0.5]}
    old = result(planned(config, long, "{floquet: {}}"), tmp_path / "old.h5")
    with h5py.File(old) as file:
        chunk = file["floquet/growth_rate"].id.get_chunk_info(0)
    data = bytearray(old.read_bytes()[:-LENGTH])
    data[chunk.byte_offset : chunk.byte_offset + 8] = b"\xff" * 8
    old.write_bytes(data)
    append_seal(old)
    grown, _ = extended(planned(config, long | {"epsilon": [0.0, 0.3, 0.4, 0.5]}, "{floquet: {}}"), old)
    with pytest.raises(ResultError, match=r"floquet in it cannot be read \(.*; compute it again"):
        run(grown, tmp_path / "grown.h5", jobs=1)
    axes = ("--set", f"sweep={long | {'epsilon': [0.0, 0.3, 0.4, 0.5]}}", "--set", "methods={floquet: {}}")
    refused("sweep", config, "-o", tmp_path / "new.h5", "--extend", old, "-q", *axes)
    assert not (tmp_path / "new.h5").exists()


REFUSED = {
    "another system": (["system.damping_ratio=0.01"], "system.damping_ratio is 0.0 there, and 0.01 here"),
    "other axes": (["sweep={mesh_frequency: [1, 2]}"], "its axes are mesh_frequency, epsilon, and here"),
    "nothing alike": (["sweep={mesh_frequency: [1, 2], epsilon: [0.2]}"], "nothing of it can be taken over"),
}


@pytest.mark.parametrize(("changes", "said"), REFUSED.values(), ids=list(REFUSED))
def test_what_cannot_be_extended_is_one_line(config: Path, tmp_path: Path, changes: list[str], said: str) -> None:
    old = result(planned(config, COARSE), tmp_path / "old.h5")
    settings = [f"sweep={GROWN['finer and longer']}", f"methods={METHODS}", *changes]
    words = [word for text in settings for word in ("--set", text)]
    told = refused("sweep", config, "-o", tmp_path / "new.h5", "--extend", old, "-q", *words)
    assert not (tmp_path / "new.h5").exists()
    assert said in told


def test_results_computed_otherwise_are_refused(config: Path, tmp_path: Path) -> None:
    old, more = result(planned(config, COARSE), tmp_path / "old.h5"), planned(config, GROWN["a part of it"])
    for name, value in (("gearstab_version", "0.0.1"), ("numpy_version", "0.1")):
        other = tmp_path / f"{name}.h5"
        other.write_bytes(old.read_bytes())
        rewrite_attributes(other, {name: value})
        with pytest.raises(ResultError, match=f"its {name.replace('_', ' ')} is {value}, and here"):
            extended(more, other)
    with pytest.raises(ResultError, match="there is no such file"):
        extended(more, tmp_path / "nothing.h5")


def test_a_damaged_result_is_not_even_opened(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HDF5 may go round in circles in it."""
    old, more = result(planned(config, COARSE), tmp_path / "old.h5"), planned(config, GROWN["a part of it"])
    data = bytearray(old.read_bytes())
    data[len(data) // 2] ^= 1
    old.write_bytes(data)
    opened: list[object] = []
    monkeypatch.setattr(h5py, "File", lambda *given, **_: opened.extend(given))
    with pytest.raises(ResultError, match="damaged"):
        extended(more, old)
    assert not opened


def without(file: h5py.File) -> None:
    del file["floquet"]


def transposed(file: h5py.File) -> None:
    values = file["floquet/growth_rate"][()].T
    del file["floquet/growth_rate"]
    file["floquet/growth_rate"] = values


def of_another_type(file: h5py.File) -> None:
    del file["floquet/stable"]
    file["floquet/stable"] = np.zeros((6, 3))


def leading_nowhere(file: h5py.File) -> None:
    del file["floquet/status"]
    file["floquet/status"] = h5py.SoftLink("/nowhere")


@pytest.mark.parametrize("change", [without, transposed, of_another_type, leading_nowhere])
def test_a_result_that_somebody_sealed_anew_is_refused_in_one_line(
    config: Path, tmp_path: Path, change: Callable[[h5py.File], None]
) -> None:
    old = result(planned(config, COARSE), tmp_path / "old.h5")
    with h5py.File(old, "r+") as file:
        change(file)
    append_seal(old)
    with pytest.raises(ResultError, match=r"cannot be extended: floquet/\w+ is not as a sweep writes it") as raised:
        extended(planned(config, GROWN["finer and longer"]), old)
    assert "\n" not in str(raised.value)


def test_a_list_of_regions_that_somebody_cut_is_one_line(config: Path, tmp_path: Path) -> None:
    old = result(planned(config, COARSE), tmp_path / "old.h5")
    with h5py.File(old, "r+") as file:
        del file["boundaries/mode_p"]
    append_seal(old)
    grown, _ = extended(planned(config, GROWN["finer and longer"]), old)
    with pytest.raises(ResultError, match="boundaries in it is not as a sweep writes it"):
        run(grown, tmp_path / "grown.h5", jobs=1)


def test_files_that_a_system_is_made_of_must_not_have_changed(tmp_path: Path) -> None:
    config, table = tmp_path / "pair.yaml", written(tmp_path, "0,1\n0.25,1.2\n0.5,0.8\n0.75,1.1\n", "k.csv")
    config.write_text(
        "system:\n  kind: gear_pair\n  equivalent_mass: 1.0\n"
        "  meshes: [{name: mesh, waveform: {kind: sampled, file: k.csv}}]\n"
        "sweep: {mesh_frequency: {start: 0.5, stop: 3, num: 6}}\nmethods: {floquet: {}}\n"
    )
    old = result(plan(load(config)), tmp_path / "old.h5")
    longer = "sweep.mesh_frequency={start: 0.5, stop: 4, num: 8}"
    assert "6 of 8 points" in extended(plan(load(config, [longer])), old)[1][0]
    table.write_text("0,1\n0.25,1.3\n0.5,0.8\n0.75,1.1\n")
    with pytest.raises(ResultError, match="files that its configuration refers to have changed"):
        extended(plan(load(config, [longer])), old)


def test_motions_with_backlash_are_taken_over_by_whole_rows(tmp_path: Path) -> None:
    config = written(
        tmp_path,
        "system:\n  kind: gear_pair\n  equivalent_mass: 1.0\n  damping_ratio: 0.05\n"
        "  units: none\n  load: [0.5]\n"
        "  meshes: [{name: mesh, mean_stiffness: 1.0, epsilon: 0.2, contact_ratio: 1.5, backlash: 1.0}]\n",
        "pair.yaml",
    )

    def own(frequencies: list[float], damping: list[float]) -> Plan:
        axes = {"damping_ratio": damping, "mesh_frequency": frequencies}
        return plan(load(config, [f"sweep={axes}", "methods={response: {cycles: 20, discard: 10}}"]))

    old = result(own([0.8, 0.9], [0.05]), tmp_path / "old.h5")
    grown, words = extended(own([0.8, 0.9], [0.05, 0.1]), old)
    assert "response: 2 of 4 points are taken over" in words[0]
    assert_same(result(grown, tmp_path / "grown.h5"), result(own([0.8, 0.9], [0.05, 0.1]), tmp_path / "whole.h5"))
    with pytest.raises(ResultError, match="go on from those at others"):
        extended(own([0.8, 0.85, 0.9], [0.05]), old)
