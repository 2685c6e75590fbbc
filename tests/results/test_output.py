"""Outputs: whole or not there, never in place of something else, on any kind of file."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import h5py
import pytest
from scenes import code, scene_text

from gearstab.errors import UserError
from gearstab.interrupts import temporary
from gearstab.plots.drawing.style import FIGURE
from gearstab.results import OutputError
from gearstab.results.export import TABLE
from gearstab.results.output import free_bytes, move, prepare, write_bytes, writing
from gearstab.results.read import BENCH, RESPOND, SWEEP, result_of

CONFIG = scene_text("output")

unix = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
linux = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A configuration, the result of a sweep and that of a response."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "train.yaml").write_text(CONFIG)
    for command, name in (("sweep", "sweep.h5"), ("respond", "respond.h5")):
        assert code(command, str(folder / "train.yaml"), "-o", str(folder / name), "-q") == 0
    return folder


@pytest.fixture
def folder(tmp_path: Path, results: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    for path in results.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert not list(tmp_path.rglob("*.tmp"))
    assert not temporary


def refused(capsys: pytest.CaptureFixture[str], *args: str) -> str:
    """The one line with which a command refuses."""
    capsys.readouterr()
    assert code(*args) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert said.out == ""
    return said.err


WRITERS = {
    "sweep": ["sweep", "train.yaml", "--overwrite", "-o"],
    "respond": ["respond", "train.yaml", "-o"],
    "bench": ["bench", "train.yaml", "--no-plot", "--points", "1", "--seconds", "0", "-q", "-o"],
    "plot": ["plot", "sweep.h5", "--dpi", "50", "-o"],
    "export": ["export", "sweep.h5", "-o"],
}
OWN = {"sweep": ".h5", "respond": ".h5", "bench": ".h5", "plot": ".png", "export": ".csv"}
FOREIGN = {
    "config": CONFIG.encode(), "notes": b"my notes\n", "table": b"time,speed\n0,1\n", "binary": bytes(range(256)),
    "hdf5": b"\x89HDF\r\n\x1a\n" + bytes(100),
}  # fmt: skip


@pytest.mark.parametrize("command", WRITERS)
@pytest.mark.parametrize("what", FOREIGN)
def test_a_foreign_file_stays(folder: Path, capsys: pytest.CaptureFixture[str], command: str, what: str) -> None:
    path = folder / f"mine{OWN[command]}"
    path.write_bytes(FOREIGN[what])
    assert refused(capsys, *WRITERS[command], path.name).startswith(f"{path.name}: ")
    assert path.read_bytes() == FOREIGN[what]


@pytest.mark.parametrize("command", WRITERS)
@pytest.mark.parametrize("other", ["sweep.h5", "respond.h5", "train.yaml"])
def test_what_another_command_wrote_stays(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str, other: str
) -> None:
    if other == f"{command}.h5":
        return
    before = (folder / other).read_bytes()
    assert refused(capsys, *WRITERS[command], other).startswith(f"{other}: ")
    assert (folder / other).read_bytes() == before


@pytest.mark.parametrize("command", ["sweep", "respond", "plot", "export"])
def test_its_like_is_replaced(folder: Path, command: str) -> None:
    name = f"own{OWN[command]}"
    (folder / name).touch()  # as mktemp leaves it
    for _ in range(2):
        assert code(*WRITERS[command], name) == 0
    assert (folder / name).stat().st_size


@pytest.mark.parametrize("command", WRITERS)
def test_a_name_that_promises_something_else_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    own = {".h5"} if OWN[command] == ".h5" else {OWN[command]}
    for ending in {".h5", ".csv", ".png", ".yaml", ".json"} - own:
        refused(capsys, *WRITERS[command], f"new{ending}")
        assert not (folder / f"new{ending}").exists()


@unix
@pytest.mark.parametrize("command", WRITERS)
def test_links_are_followed_and_stay(folder: Path, command: str) -> None:
    deep = folder / "deep"
    deep.mkdir()
    link = folder / f"link{OWN[command]}"
    link.symlink_to(f"deep/target{OWN[command]}")
    for _ in range(2):
        assert code(*WRITERS[command], link.name) == 0
        assert link.is_symlink()
        assert [path.suffix for path in deep.iterdir()] == [OWN[command]]


@unix
@pytest.mark.parametrize("command", WRITERS)
def test_a_device_is_never_replaced(folder: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    link = folder / f"null{OWN[command]}"
    link.symlink_to(os.devnull)
    if command in ("plot", "export"):
        assert code(*WRITERS[command], link.name) == 0
    else:
        assert "is a device" in refused(capsys, *WRITERS[command], link.name)
    assert link.is_symlink()
    assert stat.S_ISCHR(os.stat(os.devnull).st_mode)


@unix
@pytest.mark.parametrize("command", WRITERS)
def test_a_pipe_never_hangs_and_stays(folder: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    pipe = folder / f"pipe{OWN[command]}"
    os.mkfifo(pipe)
    refused(capsys, *WRITERS[command], pipe.name)
    assert pipe.is_fifo()
    if command not in ("plot", "export"):
        return
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    while code(*WRITERS[command], pipe.name) != 0:
        pass  # until the reader has opened it
    reader.join()
    assert pipe.is_fifo()
    assert read[0].startswith(b"\x89PNG" if command == "plot" else b"mesh_frequency,epsilon,")


@unix
def test_a_pipe_as_input_never_hangs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(folder / "pipe.h5")
    for args in (["plot", "pipe.h5"], ["export", "pipe.h5", "-o", "x.csv"]):
        assert refused(capsys, *args) == "pipe.h5: is no regular file\n"


@unix
def test_an_open_file_is_continued(folder: Path) -> None:
    """``-o /dev/stdout >> log`` loses nothing of the log."""
    log = folder / "log"
    log.write_text("before\n")
    with open(log, "ab") as file:
        command = [sys.executable, "-m", "gearstab", "export", "sweep.h5", "-o", "/dev/stdout"]
        subprocess.run(command, stdout=file, check=True, env=ENVIRONMENT)
    lines = log.read_text().splitlines()
    assert lines[0] == "before"
    assert len(lines) == 1 + 1 + 10


def test_a_write_protected_file_stays(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert code(*WRITERS["export"], "own.csv") == 0
    (folder / "own.csv").chmod(0o444)
    assert "write-protected" in refused(capsys, *WRITERS["export"], "own.csv")


def test_mode_and_owner_stay(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"one")
    path.chmod(0o640)
    before = path.stat()
    write_bytes(path, b"two")
    after = path.stat()
    assert (after.st_mode, after.st_uid, after.st_gid) == (before.st_mode, before.st_uid, before.st_gid)
    assert path.read_bytes() == b"two"


def test_what_comes_meanwhile_is_looked_at(tmp_path: Path) -> None:
    """A file that another process puts there after the first look stays."""
    path = tmp_path / "a.csv"

    def another() -> None:
        with writing(path, TABLE.refuse) as file:
            file.write(b"mine")
            path.write_text("my notes")

    with pytest.raises(OutputError, match="not overwritten"):
        another()
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("a.csv", "my notes")]


def test_an_exception_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"one")

    def fail(error: BaseException) -> None:
        with writing(path) as file:
            file.write(b"two")
            raise error

    for error in (KeyboardInterrupt(), OSError(errno.EIO, "bad"), ValueError()):
        with pytest.raises(type(error)):
            fail(error)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"one"]


def test_errors_carry_the_name_that_the_user_gave(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*args: object) -> None:
        raise OSError(errno.ENOSPC, "no space")

    for function in ("write", "fsync", "replace", "open"):
        with monkeypatch.context() as patch:
            patch.setattr(os, function, full)
            with pytest.raises(OSError, match="no space") as raised:
                write_bytes(tmp_path / "a", b"one")
            assert raised.value.filename == str(tmp_path / "a")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder that takes no files from anybody")
@pytest.mark.parametrize("command", WRITERS)
def test_a_folder_that_takes_no_files_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    name = f"/proc/self/own{OWN[command]}"
    assert refused(capsys, *WRITERS[command], name).startswith(f"{name}: ")


@pytest.mark.parametrize("named", [False, True])
def test_a_folder_that_vanishes_while_an_output_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: bool
) -> None:
    if named:
        monkeypatch.delattr(os, "O_TMPFILE", raising=False)
    out = tmp_path / "deep" / "a"

    def written() -> None:
        with writing(out) as file:
            file.write(b"one")
            shutil.rmtree(out.parent)

    with pytest.raises(FileNotFoundError) as raised:
        written()
    assert raised.value.filename == str(out)
    assert list(tmp_path.iterdir()) == []
    assert not temporary
    write_bytes(out, b"two")
    assert [path.read_bytes() for path in out.parent.iterdir()] == [b"two"]


def test_an_output_that_is_no_place_for_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    long = tmp_path / ("x" * 300)
    for out in (tmp_path, tmp_path / "file" / "below", long):
        with pytest.raises(OutputError, match=r"is a folder|cannot be written"):
            TABLE.refuse(out)
    with pytest.raises(OutputError, match="cannot be written"):
        prepare(tmp_path / "file" / "below")
    loop = tmp_path / "loop"
    loop.symlink_to("loop")
    with pytest.raises(OutputError, match="cannot be written"):
        TABLE.refuse(loop)


def test_folders_are_made_but_not_behind_a_link(tmp_path: Path) -> None:
    write_bytes(tmp_path / "a" / "b" / "c", b"one")
    assert (tmp_path / "a" / "b" / "c").read_bytes() == b"one"
    (tmp_path / "link").symlink_to(tmp_path / "unmounted" / "c")
    with pytest.raises(FileNotFoundError):
        write_bytes(tmp_path / "link", b"one")
    assert not (tmp_path / "unmounted").exists()


def test_room_is_that_of_the_folder_that_is_there(tmp_path: Path) -> None:
    assert free_bytes(tmp_path / "not" / "yet" / "a") > 0
    prepare(tmp_path / "not" / "yet" / "a")
    assert list(tmp_path.iterdir()) == []


def test_two_never_replace_at_once(tmp_path: Path) -> None:
    """Two processes may replace only what they saw: one sees the other's."""
    out = tmp_path / "out"
    inside, most = [0], [0]

    def look(path: Path) -> None:
        inside[0] += 1
        most[0] = max(most[0], inside[0])
        threading.Event().wait(0.02)
        inside[0] -= 1

    def one(k: int) -> None:
        source = tmp_path / f"source{k}"
        source.write_text(f"{k}")
        move(source, out, look)

    threads = [threading.Thread(target=one, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1]


def test_contents_know_their_like(folder: Path) -> None:
    """A result of unknown origin counts as what it looks like."""
    for name, command in (("sweep.h5", SWEEP), ("respond.h5", RESPOND)):
        with h5py.File(folder / name, "r+") as file:
            del file.attrs["command"]
        result_of(command).refuse(folder / name)
        result_of(None).refuse(folder / name)
        for content in (result_of(BENCH), TABLE, FIGURE):
            with pytest.raises(UserError):
                content.refuse(folder / name)


FULL = "standard output: no space left on device\n"


@linux
@pytest.mark.parametrize(
    "words",
    ["export sweep.h5 -o -", "info train.yaml", "info sweep.h5", "sweep train.yaml --dry-run", "schema",
     "check train.yaml"],
)  # fmt: skip
def test_a_full_standard_output_is_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: str
) -> None:
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert code(*words.split()) == 1
        monkeypatch.undo()
        with suppress(OSError):
            full.close()
    assert capsys.readouterr().err == FULL


@linux
def test_a_full_standard_output_of_a_process_is_one_line(folder: Path) -> None:
    with open("/dev/full", "wb") as full:
        command = [sys.executable, "-m", "gearstab", "check", "train.yaml"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT)
    assert (done.returncode, done.stderr) == (1, FULL)


@unix
def test_a_reader_that_had_enough_ends_a_command_without_a_word(folder: Path) -> None:
    command = f"set -o pipefail; {sys.executable} -m gearstab schema | head -c 1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, env=ENVIRONMENT)
    assert (done.stdout, done.stderr) == ("{", "")


@unix
@pytest.mark.parametrize("streams", [pytest.param("2>&-", marks=pytest.mark.slow), "<&- 2>&-", ">&- 2>&-"])
def test_closed_standard_streams_disturb_nothing(folder: Path, streams: str) -> None:
    for args in ("export sweep.h5 -o new.csv", "respond train.yaml -o new.h5"):
        command = f"exec {sys.executable} -m gearstab {args} {streams}"
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, env=ENVIRONMENT)
        assert done.returncode == 0
    assert (folder / "new.csv").read_text().count("\n") == 11
