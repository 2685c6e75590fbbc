"""Outcome of a sweep for machines: ``--json``, ``--fail-if``, ``info RESULT --json``."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import CONFIGS, TRAIN, code, ran, written

from gearstab.info import outcome

CONFIG = (
    TRAIN
    + """\
sweep:
  mesh_frequency: {start: 4.0, stop: 6.0, num: 41}
  epsilon: [0.1, 0.3]
methods: {floquet: {}, boundaries: {}}
"""
)


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("outcome")
    assert ran("sweep", written(folder, CONFIG, "train.yaml"), "-o", folder / "train.h5", "-q").exit_code == 0
    return folder / "train.h5"


def test_the_numbers_are_those_of_the_file(result: Path) -> None:
    # The file is read by h5py alone.
    told = json.loads(ran("info", result, "--json").stdout)["outcome"]
    with h5py.File(result) as file:
        stable, growth = file["floquet/stable"][:], file["floquet/growth_rate"][:]
        frequency, epsilon = file["mesh_frequency"][:], file["epsilon"][:]
        edges, labels = file["boundaries/boundary_frequency"][:], file["boundaries/label"][:]
        proved = file["boundaries/proved_share"][:]
    assert 0 < np.sum(stable == 0) < stable.size
    assert (told["points"], told["unstable"], told["failed"]) == (stable.size, np.sum(stable == 0), 0)
    assert told["share_unstable"] == np.mean(stable == 0)
    at = np.unravel_index(growth.argmax(), growth.shape)
    place = {"mesh_frequency": frequency[at[0]], "epsilon": epsilon[at[1]]}
    assert told["worst"] == {"growth_rate": growth.max(), "at": place}
    assert told["flagged"] == {"points": 0, "share": 0}
    wanted = {name.decode(): own for name, own in zip(labels, edges, strict=True) if np.isfinite(own).all(axis=0).any()}
    assert {region["label"] for region in told["regions"]} == set(wanted)
    for region in told["regions"]:
        own = wanted[region["label"]][:, np.isfinite(wanted[region["label"]]).all(axis=0)]
        assert_allclose([[edge["lower"], edge["upper"]] for edge in region["edges"]], own.T, rtol=0)
    assert told["proved"]["stable"] == proved.mean()


def test_a_sweep_prints_it(result: Path) -> None:
    again = ran("sweep", result.with_suffix(".yaml"), "-o", result, "--json", "-q")
    told = json.loads(again.stdout)
    assert told.pop("result") == str(result)
    assert told == json.loads(ran("info", result, "--json").stdout)["outcome"]


@pytest.mark.parametrize(
    ("conditions", "expected"),
    [
        (["unstable"], 3), (["unstable > 0.9"], 0), (["growth > 0.05"], 3), (["growth>=5"], 0), (["flagged"], 0),
        (["failed"], 0), (["regions >= 1"], 3), (["unstable > 0.9", "regions"], 3),
    ],
)  # fmt: skip
def test_a_condition_decides_the_exit_code(
    result: Path, conditions: list[str], expected: int, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [word for text in conditions for word in ("--fail-if", text)]
    assert code("sweep", str(result.with_suffix(".yaml")), "-o", str(result), "-q", *options) == expected
    said = capsys.readouterr().err
    assert (conditions[-1] in said) == (expected == 3)
    assert said.count("\n") == (expected == 3)


@pytest.mark.parametrize("text", ["unstabl", "unstable < 1", "growth > fast", "growth > nan", ""])
def test_a_condition_must_be_one(tmp_path: Path, text: str) -> None:
    path = written(tmp_path, CONFIG)
    found = ran("sweep", path, "-o", tmp_path / "out.h5", "--fail-if", text)
    assert found.exit_code == 2
    assert "quantities: unstable, growth, flagged, failed, regions" in found.stderr
    assert found.stderr.count("\n") == 1
    assert not (tmp_path / "out.h5").exists()


def test_a_condition_must_be_told_by_a_method(tmp_path: Path) -> None:
    path = written(tmp_path, CONFIG.replace("boundaries: {}", "perturbation: {}"))
    found = ran("sweep", path, "-o", tmp_path / "out.h5", "--fail-if", "regions")
    assert (found.exit_code, found.stderr.count("\n")) == (2, 1)
    assert "add methods: boundaries" in found.stderr
    assert not (tmp_path / "out.h5").exists()


def test_a_doubtful_point_counts_as_flagged(tmp_path: Path) -> None:
    # A window of a few periods leaves the sign of a small exponent open.
    out, short = tmp_path / "out.h5", ("--set", "methods.floquet.lyapunov.cycles=50")
    grid = ("--set", "sweep.mesh_frequency={start: 1.5, stop: 6, num: 8}", "--set", "sweep.epsilon=[0.1]")
    words = ("sweep", CONFIGS / "many_frequencies" / "golden.yaml", "-o", out, "-q", *short, *grid)
    assert ran(*words, "--fail-if", "flagged").exit_code == 3
    told = json.loads(ran("info", out, "--json").stdout)["outcome"]
    with h5py.File(out) as file:
        status = file["floquet/status"]
        masks = dict(zip(status.attrs["flag_meanings"].split(), status.attrs["flag_masks"], strict=True))
        count = int(np.sum(status[:] & masks["undecided"] != 0))
    assert told["flagged"]["points"] == told["flags"]["floquet"]["undecided"] == count > 0
    assert told["regions"] is None


@pytest.mark.parametrize("shape", [(), (5,), (3, 4), (2, 3, 7), (1, 1, 50), (50, 1)])
def test_pieces_hold_every_value_once(shape: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outcome, "AT_ONCE", 6)
    seen = np.zeros(shape, dtype=int)
    for part in outcome.pieces(shape):
        assert seen[part].size <= 6
        seen[part] += 1
    assert (seen == 1).all()
