"""Damaged, cut, changed and forged results: one line that names the file and exit code 2, never a traceback.

A result whose seal was broken is not read at all. One that a program changed, which takes the seal away, is read as far
as possible: mutations of structure are drawn at random, and every command either works or says one line.
"""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from scenes import code, opened, scene_text

from gearstab.cli import main
from gearstab.results import ResultError, open_result
from gearstab.results.hdf5 import LENGTH, append_seal
from gearstab.results.read import is_sealed

CONFIGS = {
    "sweep": scene_text("damaged_results"),
    "respond": scene_text("config_pair") + "respond: {mesh_frequency: 5, cycles: 20, initial: {velocity: [1]}}\n",
}
COMMANDS = {
    "plot": ["plot", "-o", "out.png", "--dpi", "50"],
    "export": ["export", "-o", "out.csv"],
    "info": ["info"],
}


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("originals")
    for command, text in CONFIGS.items():
        (folder / f"{command}.yaml").write_text(text)
        assert code(command, str(folder / f"{command}.yaml"), "-o", str(folder / f"{command}.h5"), "-q") == 0
    return folder


@pytest.fixture
def folder(originals: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(originals, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def said(capsys: pytest.CaptureFixture[str], command: str, name: str) -> tuple[int, str]:
    """The exit code of a command on a result, and its messages. An exception that is not caught fails the test."""
    capsys.readouterr()
    first, *rest = COMMANDS[command]
    return code(first, name, *rest), capsys.readouterr().err


def refused(capsys: pytest.CaptureFixture[str], command: str, name: str) -> str:
    code, text = said(capsys, command, name)
    assert code == 2, text
    assert text.count("\n") == 1, text
    assert text.startswith(f"{name}: "), text
    assert not Path("out.png").exists()
    assert not Path("out.csv").exists()
    return text


def test_a_result_is_sealed_and_other_programs_can_read_it(folder: Path) -> None:
    for name in ("sweep.h5", "respond.h5"):
        assert is_sealed(name) is True
        with h5py.File(name) as file:
            assert file.attrs["format_version"] == 1
        assert is_sealed(name) is True


@pytest.mark.parametrize("kind", CONFIGS)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_byte_that_is_not_as_it_was_written_is_found(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str, kind: str
) -> None:
    path = folder / f"{kind}.h5"
    data = path.read_bytes()
    rng = random.Random(1)
    # The signature, at random, and the last bytes before the seal.
    for place in (9, *(rng.randrange(8, len(data) - LENGTH) for _ in range(8)), len(data) - LENGTH - 1):
        path.write_bytes(data[:place] + bytes([data[place] ^ (1 << rng.randrange(8))]) + data[place + 1 :])
        assert "is damaged" in refused(capsys, command, path.name)


@pytest.mark.parametrize("kind", CONFIGS)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_cut_file_is_found(folder: Path, capsys: pytest.CaptureFixture[str], command: str, kind: str) -> None:
    path = folder / f"{kind}.h5"
    data = path.read_bytes()
    for length in (8, 9, 100, len(data) // 2, len(data) - LENGTH - 1):
        path.write_bytes(data[:length])
        refused(capsys, command, path.name)
    for length in (0, 7):
        path.write_bytes(data[:length])
        if command != "info":  # which takes it for a configuration
            refused(capsys, command, path.name)
    # Nothing but the seal is missing.
    path.write_bytes(data[: len(data) - LENGTH // 2])
    assert said(capsys, command, path.name)[0] == 0


def test_a_damaged_result_is_not_complete(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One inverted byte, a group or a variable taken away: the sweep is computed again, to the same data."""
    path = folder / "sweep.h5"
    data = path.read_bytes()
    expected = opened(path)["floquet"]["growth_rate"].values

    def flip() -> None:
        place = len(data) // 2
        path.write_bytes(data[:place] + bytes([data[place] ^ 255]) + data[place + 1 :])

    def without(name: str) -> Callable[[], None]:
        def change() -> None:
            with h5py.File(path, "r+") as file:
                del file[name]

        return change

    for spoil, text in ((flip, "is damaged"), (without("floquet"), "was changed"), (without("response/status"), "was")):
        path.write_bytes(data)
        spoil()
        capsys.readouterr()
        assert code("sweep", "sweep.yaml", "-o", "sweep.h5") == 0
        first, second, *notes = capsys.readouterr().err.splitlines()
        assert text in first
        assert "54 points" in second
        assert all(note.startswith("note: ") for note in notes)
        assert is_sealed(path)
        with open_result(path) as tree:
            np.testing.assert_array_equal(tree["floquet"]["growth_rate"].values, expected)
    assert code("sweep", "sweep.yaml", "-o", "sweep.h5") == 0
    assert "already complete" in capsys.readouterr().err


def test_another_version_of_the_format_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "sweep.h5"
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 99
    for sealed in (False, True):
        if sealed:
            append_seal(path)
        for command in COMMANDS:
            assert "version 99 of the format" in refused(capsys, command, path.name)
    # A sweep of the same configuration computes it again.
    assert code("sweep", "sweep.yaml", "-o", "sweep.h5", "-q") == 0
    assert said(capsys, "info", "sweep.h5")[0] == 0


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("sealed", [False, True])
@pytest.mark.parametrize("name", ["floquet/growth_rate", "perturbation/boundary_frequency", "mesh_frequency"])
def test_a_variable_of_terabytes_is_not_read(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str, sealed: bool, name: str
) -> None:
    path = folder / "sweep.h5"
    with h5py.File(path, "r+") as file:
        rank = file[name].ndim
        attributes = dict(file[name].attrs)
        del file[name]
        shape = (10**7,) * rank if rank > 1 else (10**13,)
        chunk = (1, *(100,) * (rank - 1)) if rank > 1 else (100,)
        huge = file.create_dataset(name, shape=shape, chunks=chunk, dtype="f8", compression="gzip")
        huge[(0,) * rank] = 1.0
        huge.attrs["units"] = attributes["units"]
    if sealed:
        append_seal(path)
    assert f"{name} declares" in refused(capsys, command, path.name)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("sealed", [False, True])
def test_numbers_that_are_taken_for_lists_are_not_read(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str, sealed: bool
) -> None:
    """HDF5 takes anything for lengths and addresses: it crashes."""
    path = folder / "sweep.h5"
    with h5py.File(path, "r+") as file:
        del file["modes/mode"]
        file.create_dataset("modes/mode", (3,), dtype=h5py.vlen_dtype("f8"))
    if sealed:
        append_seal(path)
    assert "modes/mode consists of lists" in refused(capsys, command, path.name)


def datasets(file: h5py.File) -> list[str]:
    found: list[str] = []
    file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
    return found


KINDS = ("drop group", "drop variable", "drop attribute", "shape", "type", "values", "attribute", "link")


def mutate(path: Path, rng: random.Random) -> str:
    """Change the structure of a result at random; what was done."""
    with h5py.File(path, "r+") as file:
        kind = rng.choice(KINDS)
        name = rng.choice(datasets(file))
        if kind == "drop group":
            name = rng.choice(list(file))
            del file[name]
        elif kind == "drop variable":
            del file[name]
        elif kind == "drop attribute":
            owner = rng.choice([file, file[name], *(file[key] for key in file)])
            if not owner.attrs:
                return "nothing"
            name = rng.choice(sorted(owner.attrs))
            del owner.attrs[name]
        elif kind == "attribute":
            owner = rng.choice([file, file[name]])
            if not owner.attrs:
                return "nothing"
            name = rng.choice(sorted(owner.attrs))
            owner.attrs[name] = rng.choice(["", 7, [1.0, float("nan")], b"\xff\xfe"])
        elif kind == "link":
            del file[name]
            file[name] = h5py.SoftLink("/nowhere")
        else:
            old = file[name]
            shape = old.shape
            values = np.zeros(shape, dtype=old.dtype)
            if kind == "shape":
                shape = rng.choice([(), (0,), (3,), (2, 2), (*shape, 1), shape[:-1]])
                values = np.ones(shape)
            elif kind == "type":
                values = rng.choice([np.zeros(shape, "c16"), np.zeros(shape, "S3"), np.zeros(shape, "u1"),
                                     np.zeros(shape, "f4"), np.zeros(shape, [("a", "f8")])])  # fmt: skip
            elif old.dtype.kind == "f":
                values = np.full(shape, rng.choice([np.nan, np.inf, -1e300, 0.0]))
            attributes = dict(old.attrs)
            scales = [dim.values() for dim in old.dims]
            del file[name]
            new = file.create_dataset(name, data=values)
            for key, value in attributes.items():
                if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME", "_Netcdf4Dimid"):
                    new.attrs[key] = value
            for k, found in enumerate(scales):
                if k < new.ndim and found and found[0].name != new.name:
                    new.dims[k].attach_scale(found[0])
        return f"{kind} {name}"


SEEDS = 8


def mutations(folder: Path, kind: str, seeds: range) -> Iterator[str]:
    """One mutation of a result at a time."""
    data = (folder / f"{kind}.h5").read_bytes()
    for seed in seeds:
        path = folder / "mutant.h5"
        path.write_bytes(data)
        try:
            yield f"{seed}: {mutate(path, random.Random(seed))}"
        except (OSError, RuntimeError, ValueError, TypeError, KeyError) as error:
            # What h5py itself refuses is no test.
            yield f"{seed}: nothing ({error})"


@pytest.mark.parametrize("kind", CONFIGS)
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    "seeds", [range(SEEDS), pytest.param(range(SEEDS, 12 * SEEDS), marks=pytest.mark.slow)], ids=["some", "many"]
)
@pytest.mark.filterwarnings("ignore")  # of values that no method computes
def test_changed_results_are_drawn_or_refused_in_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str, kind: str, seeds: range
) -> None:
    worked = 0
    for what in mutations(folder, kind, seeds):
        Path("out.png").unlink(missing_ok=True)
        Path("out.csv").unlink(missing_ok=True)
        code, text = said(capsys, command, "mutant.h5")
        assert code in (0, 2), (what, text)
        if code == 2:
            assert text.count("\n") == 1, (what, text)
        worked += code == 0
    assert worked


def test_a_fault_of_the_program_keeps_its_traceback(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the file's only where somebody changed the file."""
    from gearstab.results import export

    def wrong(*args: object) -> None:
        raise ZeroDivisionError("in the program")

    monkeypatch.setattr(export, "led_by", wrong)
    with pytest.raises(ZeroDivisionError):
        main(["export", "sweep.h5", "-o", "out.csv"])
    with h5py.File("sweep.h5", "r+") as file:
        file.attrs["note"] = "mine"
    assert code("export", "sweep.h5", "-o", "out.csv") == 2


def test_a_result_that_was_changed_can_be_read(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with h5py.File("sweep.h5", "r+") as file:
        file.attrs["title"] = "Another title"
        file["floquet/growth_rate"][0, 0, 0] = 7.0
    assert is_sealed("sweep.h5") is None
    for command in COMMANDS:
        assert said(capsys, command, "sweep.h5")[0] == 0
    with open_result("sweep.h5") as tree:
        assert tree["floquet"]["growth_rate"].values[0, 0, 0] == 7.0


def test_what_is_no_result_says_so(folder: Path) -> None:
    (folder / "empty.h5").write_bytes(b"")
    for name in ("empty.h5", "sweep.yaml", ".", "missing.h5"):
        with pytest.raises(ResultError, match=r"no result file|is a folder|no such file"):
            open_result(name)
