"""Several sweeps of one output, changed configurations, old and forged parts: nothing is lost, nothing is wrong."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import ROOT, Told
from sweep_faults import CONFIG, FOLDER, faulty, value

from gearstab.errors import UserError
from gearstab.results import OutputError, open_result
from gearstab.results.read import attributes
from gearstab.sweep import run
from gearstab.sweep.storage import store
from gearstab.sweep.storage.parts import (
    CHECKSUM,
    MAGIC,
    FinishedBlock,
    PartFolder,
    checksum,
    from_bytes,
    head_of,
)  # fmt: skip
from gearstab.sweep.storage.previous import identity, replaced
from gearstab.sweep.storage.store import Hold

SCRIPT = ROOT / "tests" / "reference" / "sweep_faults.py"
OTHER = CONFIG.replace("7.0, 8.0]", "7.0, 9.0]")
ROWS = 8


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr(store, "MOST_SECONDS", 0.0)
    (tmp_path / "train.yaml").write_text(CONFIG)
    (tmp_path / "other.yaml").write_text(OTHER)
    return tmp_path


stops = pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs signals of POSIX")


def swept(folder: Path, name: str = "train.yaml", **options: Any) -> list[str]:
    """Run the sweep of a configuration in this process; what it said."""
    told = Told()
    run(faulty(folder / name), folder / "out.h5", 1, progress=told, **options)
    return told.messages


def check(folder: Path, last: float = 8.0) -> None:
    with open_result(folder / "out.h5") as tree:
        expected = np.stack([value(k) for k in (1, 2, 3, 4, 5, 6, 7, last)])
        np.testing.assert_array_equal(tree["floquet"]["growth_rate"].values, expected)


def parts(folder: Path) -> list[Path]:
    return sorted((folder / "out.h5.parts").rglob("*.part"))


def interrupted(folder: Path, at: int = 5) -> None:
    """Leave the parts of all rows but one."""
    (folder / f"raise-{at}").touch()
    with pytest.raises(ArithmeticError):
        swept(folder)
    (folder / f"raise-{at}").unlink()
    assert len(parts(folder)) == ROWS - 1


def start(folder: Path, name: str) -> subprocess.Popen[str]:
    command = [sys.executable, str(SCRIPT), str(folder / name), str(folder / "out.h5"), "1", str(folder)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def held(folder: Path, processes: list[subprocess.Popen[str]], name: str, blocks: int) -> subprocess.Popen[str]:
    """A sweep in a process of its own, one more of those, stopped after so many blocks."""
    (folder / "hold").write_text(str(blocks + 1))
    process = start(folder, name)
    processes.append(process)
    assert process.stdout is not None
    for _ in range(blocks):
        assert process.stdout.readline() == "block\n"
    process.send_signal(signal.SIGSTOP)
    (folder / "hold").unlink()
    return process


@pytest.fixture
def processes() -> Iterator[list[subprocess.Popen[str]]]:
    found: list[subprocess.Popen[str]] = []
    yield found
    for process in found:
        process.kill()
        process.communicate()


def test_two_equal_sweeps_at_once_end_well(folder: Path, processes: list[subprocess.Popen[str]]) -> None:
    (folder / "hold").write_text("2")
    processes += [start(folder, "train.yaml"), start(folder, "train.yaml")]
    while not (folder / "log").exists() or (folder / "log").read_text().split().count("2") < 2:
        assert None in [process.poll() for process in processes]
        sleep(0.01)
    (folder / "hold").unlink()
    for process in processes:
        _, said = process.communicate(timeout=120)
        assert process.returncode == 0, said
    check(folder)
    assert not (folder / "out.h5.parts").exists()
    assert not list(folder.rglob("*.tmp"))


@stops
def test_the_first_of_two_equal_sweeps_leaves_the_parts_to_the_other(
    folder: Path, processes: list[subprocess.Popen[str]]
) -> None:
    slow = held(folder, processes, "train.yaml", 2)
    assert "going on with" in swept(folder)[0]
    check(folder)
    # Nothing of what the slower one needs is gone.
    assert len(parts(folder)) == ROWS
    slow.send_signal(signal.SIGCONT)
    _, said = slow.communicate(timeout=60)
    assert slow.returncode == 0, said
    check(folder)
    assert not (folder / "out.h5.parts").exists()


@stops
def test_a_short_sweep_leaves_the_parts_of_one_begun_later(
    folder: Path, processes: list[subprocess.Popen[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has no part files of its own, and so has told nobody that it is there."""
    monkeypatch.setattr(store, "MOST_SECONDS", 1e9)

    class Overtaken(Told):
        """Begins an equal sweep after the first block, which stops when it has written some."""

        def advance(self, points: int, unstable: int, failed: int) -> None:
            if not points or processes:
                return
            held(folder, processes, "train.yaml", 2)

    run(faulty(folder / "train.yaml"), folder / "out.h5", 1, progress=Overtaken())
    check(folder)
    assert len(parts(folder)) == 2
    (later,) = processes
    later.send_signal(signal.SIGCONT)
    _, said = later.communicate(timeout=60)
    assert later.returncode == 0, said
    check(folder)
    assert not (folder / "out.h5.parts").exists()


@stops
def test_of_two_different_sweeps_the_later_says_so_and_keeps_its_parts(
    folder: Path, processes: list[subprocess.Popen[str]]
) -> None:
    slow = held(folder, processes, "other.yaml", 1)
    swept(folder)
    check(folder)
    slow.send_signal(signal.SIGCONT)
    _, said = slow.communicate(timeout=60)
    assert slow.returncode == 1, said
    last = said.splitlines()[-1]
    assert "meanwhile" in last
    assert f"{ROWS} finished blocks are kept" in last
    check(folder)
    # It goes on with them where it may write.
    assert len(parts(folder)) == ROWS
    (folder / "log").unlink()
    (folder / "out.h5").unlink()
    told = swept(folder, "other.yaml")
    assert any("going on with 8 of 8" in text for text in told)
    assert not (folder / "log").exists()
    check(folder, last=9.0)


def test_a_result_that_vanished_meanwhile_is_no_hindrance(folder: Path) -> None:
    swept(folder)
    (folder / "train.yaml").write_text(OTHER)

    class Removing(Told):
        def advance(self, points: int, unstable: int, failed: int) -> None:
            (folder / "out.h5").unlink(missing_ok=True)

    run(faulty(folder / "train.yaml"), folder / "out.h5", 1, progress=Removing())
    check(folder, last=9.0)


def test_an_edited_comment_gives_a_new_time_stamp_only(folder: Path) -> None:
    swept(folder)
    before = (folder / "out.h5").read_bytes()
    os.utime(folder / "out.h5", (1e9, 1e9))
    (folder / "train.yaml").write_text(f"# A comment\n{CONFIG}")
    (folder / "log").unlink()
    assert swept(folder) == []
    assert not (folder / "log").exists()
    assert (folder / "out.h5").read_bytes() == before
    assert (folder / "out.h5").stat().st_mtime >= (folder / "train.yaml").stat().st_mtime


def test_an_edited_title_goes_into_the_result(folder: Path) -> None:
    swept(folder)
    (folder / "train.yaml").write_text(CONFIG.replace("A train", "Ein Zug ü"))
    (folder / "log").unlink()
    swept(folder)
    assert not (folder / "log").exists()
    check(folder)
    assert attributes(folder / "out.h5")["title"] == "Ein Zug ü"
    assert "title: Ein Zug ü" in attributes(folder / "out.h5")["config"]
    assert run(faulty(folder / "train.yaml"), folder / "out.h5", 1).complete


def test_a_changed_configuration_replaces_its_result_when_complete(folder: Path) -> None:
    swept(folder)
    (folder / "train.yaml").write_text(OTHER)
    (folder / "raise-9").touch()
    with pytest.raises(ArithmeticError):
        swept(folder)
    # The old result is there until the new one is complete, and the new one is resumed.
    check(folder)
    (folder / "raise-9").unlink()
    (folder / "log").unlink()
    told = swept(folder)
    assert "earlier state of the configuration" in told[0]
    assert "going on with 7 of 8" in told[1]
    assert (folder / "log").read_text().split() == ["9"]
    check(folder, last=9.0)
    assert not (folder / "out.h5.parts").exists()


def test_parts_of_an_earlier_state_are_kept_and_told(folder: Path) -> None:
    interrupted(folder)
    (folder / "train.yaml").write_text(OTHER)
    told = swept(folder)
    assert "1 earlier state of the configuration" in told[0]
    check(folder, last=9.0)
    (folder / "train.yaml").write_text(CONFIG)
    (folder / "log").unlink()
    swept(folder)
    assert (folder / "log").read_text().split() == ["5"]
    check(folder)


def test_another_configuration_is_refused(folder: Path) -> None:
    swept(folder)
    with pytest.raises(OutputError, match="another configuration"):
        swept(folder, "other.yaml")
    # The same file by another way is the same.
    (folder / "link.yaml").symlink_to("train.yaml")
    (folder / "train.yaml").write_text(OTHER)
    swept(folder, "link.yaml")
    check(folder, last=9.0)


def test_a_project_may_be_moved(folder: Path) -> None:
    swept(folder)
    moved = folder / "moved"
    moved.mkdir()
    for name in ("train.yaml", "out.h5"):
        (folder / name).rename(moved / name)
    (moved / "train.yaml").write_text(OTHER)
    run(faulty(moved / "train.yaml"), moved / "out.h5", 1)
    check(moved, last=9.0)


@pytest.mark.parametrize("kind", ["file", "link", "link inside"])
def test_a_parts_folder_that_is_none_is_refused(folder: Path, kind: str) -> None:
    place, elsewhere = folder / "out.h5.parts", folder / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "mine").write_text("mine")
    if kind == "file":
        place.write_text("mine")
    elif kind == "link":
        place.symlink_to(elsewhere)
    else:
        place.mkdir()
        (place / faulty(folder / "train.yaml").digest[:32]).symlink_to(elsewhere)
    for overwrite in (False, True):
        with pytest.raises(OutputError, match=r"out\.h5\.parts"):
            swept(folder, overwrite=overwrite)
    assert (elsewhere / "mine").read_text() == "mine"
    assert not (folder / "log").exists()


def forged(data: bytes, change: Callable[[dict[str, Any], bytes], tuple[Any, bytes]]) -> bytes:
    """A part with another header or other chunks, and the right checksum."""
    start = len(MAGIC) + 8
    end = start + int.from_bytes(data[len(MAGIC) : start], "little")
    header, chunks = change(json.loads(data[start:end]), data[end:-CHECKSUM])
    text = json.dumps(header).encode()
    body = MAGIC + len(text).to_bytes(8, "little") + text + chunks
    return body + checksum(body)


FORGERIES: dict[str, Callable[[dict[str, Any], bytes], tuple[Any, bytes]]] = {
    "no chunks": lambda h, c: (h | {"chunks": {}}, b""),
    "other variable": lambda h, c: (h | {"chunks": {"x": [len(c)]}}, c),
    "noise": lambda h, c: (h, bytes(reversed(c))),
    "long": lambda h, c: (h, c + b"more"),
    "short": lambda h, c: (h, c[:-1]),
    "negative": lambda h, c: (h | {"chunks": {k: [-n for n in v] for k, v in h["chunks"].items()}}, c),
    "texts": lambda h, c: (h | {"chunks": {k: ["a"] for k in h["chunks"]}}, c),
    "points": lambda h, c: (h | {"points": 7}, c),
    "no points": lambda h, c: ({k: v for k, v in h.items() if k != "points"}, c),
    "tongues": lambda h, c: (h | {"tongues": [[{"mode_p": []}, 0]]}, c),
    "flags": lambda h, c: (h | {"flags": [1]}, c),
    "infinite": lambda h, c: (h | {"points": float("inf")}, c),
    "fractions": lambda h, c: (h | {"chunks": {k: [float(n) for n in v] for k, v in h["chunks"].items()}}, c),
    "truths": lambda h, c: (h | {"chunks": {k: [True, n - 1] for k, (n,) in h["chunks"].items()}}, c),
    "infinite flags": lambda h, c: (h | {"flags": {"a": float("inf")}}, c),
    "list": lambda h, c: ([h], c),
    "null": lambda h, c: (None, c),
}


@pytest.mark.parametrize("how", FORGERIES)
def test_forged_parts_are_computed_again(folder: Path, how: str) -> None:
    interrupted(folder)
    victim = parts(folder)[2]
    victim.write_bytes(forged(victim.read_bytes(), FORGERIES[how]))
    (folder / "log").unlink()
    swept(folder)
    assert sorted((folder / "log").read_text().split()) == ["3", "5"]
    check(folder)


HEADER_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
KEYS = ("digest", "key", "tongues", "chunks", "points", "unstable", "failed", "flags")


@settings(max_examples=200)
@given(key=st.sampled_from(KEYS), value=HEADER_VALUES, where=st.integers(0, 200), octet=st.integers(0, 255))
def test_a_part_of_any_header_is_one_or_is_ignored(key: str, value: Any, where: int, octet: int) -> None:
    block = FinishedBlock("floquet-000000", (), {"x": [(0, 3)]}, 3, 1, 0, {"a": 1}, held=b"abc")
    head = head_of(block, "d" * 64)
    data = head + block.held + checksum(head, block.held)
    path = Path("floquet-000000.part")
    assert from_bytes(data, path, "d" * 64) is not None
    made = forged(data, lambda header, chunks: (header | {key: value}, chunks))
    spoilt = bytearray(data[:-CHECKSUM])
    spoilt[where % len(spoilt)] = octet
    for found in (made, bytes(spoilt) + checksum(spoilt), data[: where % len(data)]):
        part = from_bytes(found, path, "d" * 64)
        assert part is None or part.key == path.stem


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("kind", ["link", "pipe", "folder"])
def test_what_is_no_part_file_is_ignored(folder: Path, kind: str) -> None:
    interrupted(folder)
    victim = parts(folder)[2]
    data = victim.read_bytes()
    victim.unlink()
    if kind == "link":
        (folder / "elsewhere").write_bytes(data)
        victim.symlink_to(folder / "elsewhere")
    elif kind == "pipe":
        os.mkfifo(victim)
    else:
        victim.mkdir()
    (folder / "log").unlink()
    if kind == "folder":
        # In whose place nothing can be written: said in one line.
        with pytest.raises(OutputError, match=r"is in the way of finished blocks"):
            swept(folder)
        victim.rmdir()
    swept(folder)
    check(folder)
    if kind == "link":
        assert (folder / "elsewhere").read_bytes() == data


def test_parts_beside_a_complete_result_go_unless_somebody_holds_them(folder: Path) -> None:
    """A sweep that is killed at its very end leaves them."""
    pytest.importorskip("fcntl")
    interrupted(folder)
    shutil.copytree(folder / "out.h5.parts", folder / "copy")
    swept(folder)
    assert not (folder / "out.h5.parts").exists()
    shutil.copytree(folder / "copy", folder / "out.h5.parts")
    (folder / "log").unlink()
    held = Hold(parts(folder)[0].parent)
    held.take()
    swept(folder)
    assert len(parts(folder)) == ROWS - 1
    held.drop()
    swept(folder)
    assert not (folder / "out.h5.parts").exists()
    assert not (folder / "log").exists()


def test_what_a_killed_sweep_left_half_written_goes(folder: Path) -> None:
    interrupted(folder)
    half = parts(folder)[0].with_name("result-1.tmp")
    half.write_bytes(b"half")
    (folder / "raise-5").touch()
    with pytest.raises(ArithmeticError):
        swept(folder)
    assert not half.exists()


def test_the_last_one_removes_the_folder(tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    first, second = Hold(tmp_path / "a" / "b"), Hold(tmp_path / "a" / "b")
    first.take()
    assert first.alone()
    first.share()
    second.take()
    assert not first.alone()
    first.drop()
    assert second.alone()
    second.drop()


def test_a_folder_removed_at_that_moment_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fcntl = pytest.importorskip("fcntl")
    lock, calls = fcntl.flock, []

    def removing(handle: int, operation: int) -> None:
        lock(handle, operation)
        calls.append(operation)
        if len(calls) == 1:
            (tmp_path / "a" / "lock").unlink()

    monkeypatch.setattr(fcntl, "flock", removing)
    hold = Hold(tmp_path / "a")
    hold.take()
    assert (tmp_path / "a" / "lock").exists()
    assert len(calls) == 2
    hold.drop()


def test_a_part_that_is_written_while_its_folder_goes_goes_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a worker that outlived its sweep."""
    folder, removed = PartFolder(tmp_path / "out.h5", "0" * 64), []
    folder.path.mkdir(parents=True)

    def emptied(path: Path, **options: Any) -> None:
        removed.append(path)
        if len(removed) == 1:
            (path / "late.part").write_bytes(b"late")
        else:
            path.joinpath("late.part").unlink()
            path.rmdir()

    monkeypatch.setattr(shutil, "rmtree", emptied)
    folder.remove()
    assert removed == [folder.path] * 2
    assert list(tmp_path.iterdir()) == []


def test_all_refusals_are_for_the_user() -> None:
    assert issubclass(OutputError, UserError)
    assert OutputError.exit_code == 2


def test_another_file_at_the_output_is_told_from_another_time_stamp(tmp_path: Path) -> None:
    out, other = tmp_path / "out.h5", tmp_path / "other.h5"
    assert not replaced(out, None)
    out.write_bytes(b"one")
    assert replaced(out, None)
    before = identity(out)
    os.utime(out, (1, 1))
    assert not replaced(out, before)
    # Of the same size, as results of one grid are.
    other.write_bytes(b"two")
    os.replace(other, out)
    assert replaced(out, before)
    before = identity(out)
    with out.open("ab") as file:
        file.write(b" more")
    assert replaced(out, before)
    out.unlink()
    assert replaced(out, before)
