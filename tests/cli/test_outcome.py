"""Outcome of a sweep for machines: ``--json``, ``--fail-if``, ``info RESULT --json``, and ``gearstab diff``."""

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import CONFIGS, code, ran, refused, scene_text, succeeds, written

from gearstab.info import outcome

CONFIG = scene_text("outcome")


def swept(folder: Path, name: str, *overrides: str) -> Path:
    """A result, made from a file of its name beside it."""
    out = folder / f"{name}.h5"
    words = [word for text in overrides for word in ("--set", text)]
    succeeds("sweep", written(folder, CONFIG, f"{name}.yaml"), "-o", out, "-q", *words)
    return out


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept(tmp_path_factory.mktemp("outcome"), "train")


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
    assert "quantities: unstable, growth, flagged, failed, regions" in refused(
        "sweep", path, "-o", tmp_path / "out.h5", "--fail-if", text
    )
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


@pytest.fixture(scope="module")
def results(result: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The result, and one of a train whose stiffness is 1 % larger: frequencies grow by sqrt(1.01)."""
    stiffer = [f"system.meshes.{k}.mean_stiffness=1.01" for k in (0, 1)] + ["system.input_shaft_stiffness=0.505"]
    return result, swept(tmp_path_factory.mktemp("stiffer"), "train", *stiffer)


def test_a_result_is_the_same_as_itself(results: tuple[Path, Path]) -> None:
    found = succeeds("diff", results[0], results[0])
    assert found.stdout == f"{results[0]} and {results[0]} are the same\n"


def test_what_changed_is_told(results: tuple[Path, Path]) -> None:
    found = ran("diff", *results, "--json")
    assert found.exit_code == 1
    told = json.loads(found.stdout)
    with h5py.File(results[0]) as a, h5py.File(results[1]) as b:
        stable = [file["floquet/stable"][:] for file in (a, b)]
        growth = [file["floquet/growth_rate"][:] for file in (a, b)]
    own = told["verdicts"]["floquet"]
    assert own["changed"] == np.sum(stable[0] != stable[1]) > 0
    assert own["to_unstable"] == np.sum((stable[0] == 1) & (stable[1] == 0))
    assert own["to_unstable"] + own["to_stable"] == own["changed"]
    largest = np.abs(growth[0] - growth[1]).max() / max(np.abs(item).max() for item in growth)
    assert told["variables"]["/floquet/growth_rate"] == largest
    # The smaller of two frequencies is the reference of the first file.
    moved = [item["largest_shift"] for item in told["edges"]["moved"] if item["label"] == "2w3"]
    assert_allclose(moved, np.sqrt(1.01) - 1, rtol=1e-6)
    text = ran("diff", *results).stdout
    assert "became unstable" in text
    assert "region 2w3" in text


def test_tolerances(results: tuple[Path, Path]) -> None:
    loose = ("--tolerance", "2", "--edges", "0.02", "--verdicts", "82")
    told = json.loads(ran("diff", *results, *loose, "--json").stdout)
    opened = told["edges"]["only_first"] + told["edges"]["only_second"]
    assert (not told["same"]) == bool(opened)
    for strict in (("--verdicts", "0"), ("--edges", "0.001"), ("--tolerance", "0.001")):
        assert ran("diff", *results, *loose, *strict).exit_code == 1


def test_other_axes_are_told(results: tuple[Path, Path], tmp_path: Path) -> None:
    other = swept(tmp_path, "c", "sweep.epsilon=[0.1, 0.31]")
    longer = swept(tmp_path, "d", "sweep.epsilon=[0.1, 0.2, 0.3]")
    assert "axis epsilon: other values" in ran("diff", results[0], other).stdout
    assert "axis epsilon: 2 values, 3 in the second" in ran("diff", results[0], longer).stdout


def test_a_file_that_cannot_be_read(results: tuple[Path, Path], tmp_path: Path) -> None:
    found = ran("diff", results[0], tmp_path / "none.h5")
    assert (found.exit_code, found.stderr.count("\n")) == (2, 1)


def test_folders_are_compared_by_the_names_of_their_results(results: tuple[Path, Path], tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    for folder, names in ((first, {"same": 0, "other": 0, "old": 0}), (second, {"same": 0, "other": 1, "new": 0})):
        folder.mkdir()
        for name, k in names.items():
            shutil.copy(results[k], folder / f"{name}.h5")
    found = ran("diff", first, second)
    assert found.exit_code == 1
    assert found.stdout.startswith(f"{first / 'other.h5'} and {second / 'other.h5'} are different\n")
    assert found.stdout.splitlines()[-3:] == [
        "only in the first: old.h5", "only in the second: new.h5", "2 results in both, 1 of them different",
    ]  # fmt: skip
    told = json.loads(ran("diff", first, second, "--json").stdout)
    assert (told["same"], told["only_first"], told["only_second"]) == (False, ["old.h5"], ["new.h5"])
    alone = json.loads(ran("diff", *results, "--json").stdout)
    assert told["results"]["other.h5"].items() <= alone.items()
    assert told["results"]["same.h5"]["same"]
    succeeds("diff", first, first)
    none = ran("diff", first, tmp_path)
    assert (none.exit_code, none.stderr.count("\n")) == (2, 1)
