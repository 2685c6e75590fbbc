"""Killed processes, interrupts, full disks, damaged parts: what is finished is kept, and a second run completes it."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import pytest
from scenes import ROOT, SweepFolder, until, written
from sweep_faults import CONFIG, FOLDER, faulty, value

from gearstab.results import OutputError, open_result
from gearstab.sweep import Interrupted, Reporter, SweepError, pool, run
from gearstab.sweep.storage import merge, store
from gearstab.sweep.storage.parts import PartFolder, read_part

SCRIPT = ROOT / "tests" / "reference" / "sweep_faults.py"
ROWS = [f"{k}" for k in range(1, 9)]


@dataclass
class Scene(SweepFolder):
    """A sweep of the faulty method."""

    processes: list[subprocess.Popen[str]] = field(default_factory=list)

    @property
    def config(self) -> Path:
        return self.folder / "train.yaml"

    def tell(self, **files: object) -> None:
        for name, content in files.items():
            (self.folder / name.replace("_", "-")).write_text(str(content))

    def log(self) -> list[str]:
        """The rows that were computed, in any order, and forget them."""
        path = self.folder / "log"
        rows = path.read_text().split() if path.exists() else []
        path.unlink(missing_ok=True)
        return sorted(rows)

    def begun(self) -> list[str]:
        """The rows that were begun so far."""
        path = self.folder / "log"
        return path.read_text().split() if path.exists() else []

    def workers(self) -> set[int]:
        """The processes that ever computed a block."""
        return {int(line) for line in (self.folder / "processes").read_text().split()}

    def start(self, jobs: int) -> subprocess.Popen[str]:
        command = [sys.executable, str(SCRIPT), str(self.config), str(self.out), str(jobs), str(self.folder)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.processes.append(process)
        return process

    def finish(self, jobs: int) -> tuple[int, str]:
        process = self.start(jobs)
        _, said = process.communicate(timeout=120)
        return process.returncode, said

    def run(self, **options: object) -> None:
        run(faulty(self.config), self.out, **{"jobs": 1, **options})  # type: ignore[arg-type]

    def check(self) -> None:
        """The result is whole, and nothing else is left."""
        with open_result(self.out) as tree:
            expected = np.stack([value(float(k)) for k in ROWS])
            np.testing.assert_array_equal(tree["floquet"]["growth_rate"].values, expected)
        assert not (self.folder / "out.h5.parts").exists()
        assert not list(self.folder.glob("*.tmp"))


@pytest.fixture(autouse=True)
def ctrl_c_interrupts() -> Iterator[None]:
    """Where the tests run in the background of a shell, Ctrl-C is ignored, also in the processes they start."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Scene]:
    found = Scene(tmp_path)
    found.config.write_text(CONFIG)
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr(store, "MOST_SECONDS", 0.0)
    yield found
    for process in found.processes:
        process.kill()
        process.communicate()


def ended(process: int) -> bool:
    """Whether a process has ended, be it that nobody has asked for its exit code yet."""
    try:
        os.kill(process, 0)
        return ") Z " in Path(f"/proc/{process}/stat").read_text()
    except ProcessLookupError:
        return True
    except OSError:
        return False  # a system without /proc


def wait_for_blocks(process: subprocess.Popen[str], count: int) -> None:
    assert process.stdout is not None
    for _ in range(count):
        assert process.stdout.readline() == "block\n"


def data_of(path: Path) -> dict[str, bytes]:
    """The stored bytes of all arrays."""
    with h5py.File(path) as file:
        group = file["floquet"]
        return {f"{name}{c}": group[name].id.read_direct_chunk((c, 0))[1] for name in group for c in range(8)}


@pytest.mark.slow
def test_a_killed_worker_costs_nothing(scene: Scene) -> None:
    scene.tell(kill_3=1)
    code, said = scene.finish(jobs=2)
    assert code == 0, said
    scene.check()


def test_a_block_that_kills_twice_is_named_and_the_others_are_kept(scene: Scene) -> None:
    scene.tell(kill_3=2)
    code, said = scene.finish(jobs=2)
    assert code == 1
    assert said.count("\n") == 1
    assert "floquet-000002" in said
    assert "killed twice" in said
    assert len(scene.parts) == 7
    assert not scene.out.exists()
    scene.log()
    code, said = scene.finish(jobs=2)
    assert code == 0, said
    assert scene.log() == ["3"]
    scene.check()


def test_a_killed_sweep_goes_on_where_it_was(scene: Scene) -> None:
    code, said = scene.finish(jobs=1)
    assert code == 0, said
    whole = data_of(scene.out)
    scene.out.unlink()
    scene.log()

    scene.tell(hold=4)
    (scene.folder / "processes").unlink()
    process = scene.start(jobs=2)
    wait_for_blocks(process, 3)
    until(lambda: len(scene.begun()) == 5, "two workers at the blocks that are held")
    process.kill()
    _, said = process.communicate()
    # What is left of it says nothing, and workers without a parent end by themselves.
    assert said == ""
    until(lambda: all(ended(number) for number in scene.workers()), "workers to end")
    assert not scene.out.exists()
    finished = {path.stem for path in scene.parts}
    assert len(finished) == 3
    (scene.folder / "hold").unlink()
    scene.log()
    code, said = scene.finish(jobs=2)
    assert code == 0, said
    assert len(scene.log()) == 8 - len(finished)
    assert f"going on with {len(finished)} of 8 blocks" in said
    scene.check()
    assert data_of(scene.out) == whole


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_an_interrupted_sweep_keeps_what_is_finished(scene: Scene, number: int, jobs: int) -> None:
    scene.tell(hold=3)
    process = scene.start(jobs)
    wait_for_blocks(process, 2)
    until(lambda: len(scene.begun()) == 2 + jobs, "blocks that are held")
    process.send_signal(number)
    # Blocks that workers are at have a second to end; these do not.
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert said.count("\n") == 1
    assert "--resume" in said
    assert not scene.out.exists()
    kept = len(scene.parts)
    assert kept == 2
    (scene.folder / "hold").unlink(missing_ok=True)
    scene.log()
    code, said = scene.finish(jobs)
    assert code == 0, said
    assert len(scene.log()) == 8 - kept
    scene.check()


@pytest.mark.parametrize("spoil", ["truncate", "flip", "empty", "rename", "foreign"])
def test_damaged_parts_are_computed_again(scene: Scene, spoil: str) -> None:
    scene.tell(raise_8="")
    with pytest.raises(ArithmeticError):
        scene.run()
    (scene.folder / "raise-8").unlink()
    scene.log()
    victim, other = scene.parts[0], scene.parts[1]
    data = victim.read_bytes()
    if spoil == "truncate":
        victim.write_bytes(data[:-10])
    elif spoil == "flip":
        victim.write_bytes(data[:200] + bytes([data[200] ^ 1]) + data[201:])
    elif spoil == "empty":
        victim.write_bytes(b"")
    elif spoil == "rename":
        victim.write_bytes(other.read_bytes())
    else:
        victim.write_bytes(data)
        digest = PartFolder(scene.out, "another sweep")
        assert read_part(victim, digest.digest) is None
        victim.unlink()
    scene.run()
    assert scene.log() == ["1", "8"]
    scene.check()


def test_an_error_in_one_block_ends_no_sweep(scene: Scene) -> None:
    scene.tell(raise_2="")
    with pytest.raises(ArithmeticError, match="no luck with 2") as raised:
        scene.run()
    assert "floquet-000001" in raised.value.__notes__[0]
    assert len(scene.parts) == 7


@pytest.mark.parametrize(("most", "kept"), [(1, "1"), (2, "1 3"), (None, "1 3 6 7 8")])
def test_how_many_failures_a_sweep_bears(scene: Scene, most: int | None, kept: str) -> None:
    scene.tell(raise_2="", raise_4="", raise_5="")
    with pytest.raises(ArithmeticError, match="no luck with 2"):
        scene.run(most_failures=most)
    assert [path.stem for path in scene.parts] == [f"floquet-{int(k) - 1:06d}" for k in kept.split()]


def test_no_memory_is_one_line(scene: Scene) -> None:
    scene.tell(memory_2="")
    with pytest.raises(SweepError, match="not enough memory for block floquet-000001") as raised:
        scene.run()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("room", "said"),
    [
        (3, "3 finished blocks are kept in "), (1, "1 finished block is kept in "),
        (0, "no block was kept: the next call begins from the start"),
    ],
)  # fmt: skip
def test_a_disk_that_fills_up_during_the_sweep(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, room: int, said: str
) -> None:
    write = PartFolder.write

    def full(self: PartFolder, part: object) -> object:
        if len(scene.parts) == room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "part")
        return write(self, part)  # type: ignore[arg-type]

    monkeypatch.setattr(PartFolder, "write", full)
    with pytest.raises(SweepError, match=f"no space left on device; {said}"):
        scene.run()
    assert (scene.folder / "out.h5.parts").exists() is (room > 0)
    monkeypatch.undo()
    monkeypatch.setenv(FOLDER, str(scene.folder))
    scene.log()
    scene.run()
    assert scene.log() == [str(k) for k in range(room + 1, 9)]
    scene.check()


def test_a_folder_that_vanishes_during_the_sweep(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    write, out = PartFolder.write, scene.folder / "deep" / "out.h5"

    def gone(self: PartFolder, part: object) -> object:
        if len(list(out.parent.rglob("*.part"))) == 3:
            shutil.rmtree(out.parent)
        return write(self, part)  # type: ignore[arg-type]

    monkeypatch.setattr(PartFolder, "write", gone)
    with pytest.raises(SweepError, match="no such file or directory") as raised:
        run(faulty(scene.config), out)
    assert "\n" not in str(raised.value)
    monkeypatch.undo()
    monkeypatch.setenv(FOLDER, str(scene.folder))
    run(faulty(scene.config), out)
    with open_result(out) as found:
        np.testing.assert_array_equal(found["floquet"]["growth_rate"], [value(k) for k in range(1, 9)])


def test_a_disk_that_is_full_in_the_end(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*args: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(scene.out))

    monkeypatch.setattr(merge, "write_result", full)
    with pytest.raises(SweepError, match="no space left on device; 8 finished blocks are kept"):
        scene.run()
    assert not scene.out.exists()
    assert len(scene.parts) == 8
    monkeypatch.undo()
    scene.log()
    scene.run()
    assert scene.log() == []
    scene.check()


def test_a_result_from_parts_is_the_same_as_one_from_memory(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MOST_SECONDS", 60.0)
    scene.run()
    held = data_of(scene.out)
    scene.out.unlink()
    monkeypatch.setattr(store, "MOST_SECONDS", 0.0)
    scene.run()
    scene.check()
    assert data_of(scene.out) == held


def test_a_result_that_does_not_fit_is_one_line(scene: Scene) -> None:
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    scene.run()
    whole = scene.out.stat().st_size
    scene.out.unlink()
    scene.tell(raise_8="")
    with pytest.raises(ArithmeticError):
        scene.run()
    (scene.folder / "raise-8").unlink()
    # The part of a block still fits, the result does not.
    part = max(path.stat().st_size for path in scene.parts)
    assert whole > 3 * part
    limit = (part + whole) // 2
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        with pytest.raises(SweepError, match="8 finished blocks are kept") as raised:
            scene.run()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert "\n" not in str(raised.value)
    assert not scene.out.exists()
    assert len(scene.parts) == 8
    scene.run()
    scene.check()


def test_a_short_sweep_writes_no_parts(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MOST_SECONDS", 60.0)
    monkeypatch.setattr(PartFolder, "write", None)
    scene.run()
    scene.check()


def test_an_interrupt_saves_what_was_in_memory_only(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MOST_SECONDS", 60.0)

    class Impatient(Reporter):
        done = 0

        def advance(self, points: int, unstable: int, failed: int) -> None:
            self.done += points
            if self.done == 9:
                raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="3 of 8 blocks are kept"):
        scene.run(progress=Impatient())
    assert len(scene.parts) == 3


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("again", [False, True])
def test_an_interrupt_after_the_result_has_its_name_is_too_late(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, number: int, again: bool
) -> None:
    """Also where an older result had that name."""
    if again:
        scene.run()
    rename = os.replace

    def interrupted(source: Path, target: Path) -> None:
        rename(source, target)
        if Path(target) == scene.out:
            os.kill(os.getpid(), number)

    monkeypatch.setattr(os, "replace", interrupted)
    handlers = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    scene.run(overwrite=again)
    scene.check()
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers


def test_an_interrupt_while_the_result_is_written_keeps_everything(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename = os.replace

    def interrupted(source: Path, target: Path) -> None:
        if Path(target) == scene.out:
            os.kill(os.getpid(), signal.SIGINT)
            threading.Event().wait(60)  # where it is handled
        rename(source, target)

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(Interrupted, match="8 of 8 blocks are kept"):
        scene.run()
    assert not scene.out.exists()
    monkeypatch.undo()
    monkeypatch.setenv(FOLDER, str(scene.folder))
    scene.log()
    scene.run()
    assert scene.log() == []
    scene.check()


def test_threads_compute_the_same(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "WORTH_THREADS", 0.0)
    planned = faulty(scene.config)
    (layout,) = planned.layouts
    object.__setattr__(layout.method, "parallel", lambda options, system: True)
    run(planned, scene.out, jobs=3)
    scene.check()


def test_a_complete_result_is_left_alone_but_for_its_time_stamp(scene: Scene) -> None:
    scene.run()
    scene.log()
    before, data = scene.out.stat().st_mtime_ns, scene.out.read_bytes()
    assert run(faulty(scene.config), scene.out).complete
    assert scene.log() == []
    assert scene.out.stat().st_mtime_ns > before
    assert scene.out.read_bytes() == data
    scene.run(overwrite=True)
    assert scene.log() == ROWS


def test_overwrite_starts_anew(scene: Scene) -> None:
    scene.tell(raise_8="")
    with pytest.raises(ArithmeticError):
        scene.run()
    (scene.folder / "raise-8").unlink()
    scene.log()
    scene.run(overwrite=True)
    assert scene.log() == ROWS
    scene.check()


def test_what_is_something_else_is_not_overwritten(scene: Scene) -> None:
    scene.out.write_text("my notes")
    for overwrite in (False, True):
        with pytest.raises(OutputError, match="choose another output or delete it"):
            scene.run(overwrite=overwrite)
    assert scene.out.read_text() == "my notes"
    scene.out.unlink()
    scene.run()
    before = scene.out.read_bytes()
    other = written(scene.folder, CONFIG.replace("epsilon: 0.3", "epsilon: 0.2"), "other.yaml")
    with pytest.raises(OutputError, match=r"another configuration, train\.yaml"):
        run(faulty(other), scene.out)
    assert scene.out.read_bytes() == before
    assert sorted(p.name for p in scene.folder.iterdir()) == ["log", "other.yaml", "out.h5", "processes", "train.yaml"]
    run(faulty(other), scene.out, overwrite=True)
    assert scene.out.read_bytes() != before


@pytest.mark.parametrize("where", ["folder", "below a file", "read-only"])
def test_an_impossible_output_is_refused_before_anything_is_computed(scene: Scene, where: str) -> None:
    out = scene.folder / "deep" / "out.h5"
    if where == "folder":
        out.mkdir(parents=True)
    elif where == "below a file":
        out.parent.write_text("")
    else:
        if os.geteuid() == 0:
            pytest.skip("nothing is read-only for root")
        out.parent.mkdir(mode=0o500)
    with pytest.raises(OutputError) as raised:
        run(faulty(scene.config), out)
    assert str(raised.value).startswith(str(out))
    assert scene.log() == []
