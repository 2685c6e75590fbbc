"""SIGINT, SIGTERM and SIGHUP end every command with exit code 130, without a traceback and without temporary files."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Event

import pytest
from scenes import ROOT, TRAIN, heed, scene_text

from gearstab import interrupts
from gearstab.config import load
from gearstab.methods import Outcome
from gearstab.sweep import Interrupted, plan, pool, run
from gearstab.sweep.plan import GridBlock, Plan
from gearstab.sweep.storage.parts import FinishedBlock

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs signals of POSIX")

CONFIG = scene_text("interrupts")
SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


def each_with(commands: list[str]) -> pytest.MarkDecorator:
    """All commands with all signals; one signal per command, another one each, where time is short."""
    number = len(SIGNALS)
    return pytest.mark.parametrize(
        ("command", "number"),
        [
            pytest.param(command, SIGNALS[k], marks=[] if k == place % number else pytest.mark.slow)
            for place, command in enumerate(commands)
            for k in range(number)
        ],
    )


COMMANDS = {
    "plot": ["plot", "map.h5", "-o", "out.png", "--dpi", "600"],
    "export": ["export", "map.h5", "-o", "out.csv"],
    "respond": ["respond", "train.yaml", "-o", "out.h5"],
    "bench": ["bench", "train.yaml", "-o", "out.h5"],
    "info": ["info", "train.yaml"],
    "sweep": ["sweep", "train.yaml", "-o", "out.h5", "--set", "sweep.epsilon.num=20000", "-j", "1"],
}

WRITING = """
import os, sys, time
from gearstab.results import output
write = output.Writer.write
def slow(self, data):
    count = write(self, data)
    print("writing", flush=True)
    time.sleep(30)
    return count
output.Writer.write = slow
"""
"""Stops in the middle of the first output that is written, and says so."""

CREATING = """
import time
from gearstab.results import output
new = output._new
def slow(path):
    handle = new(path)
    print("writing", flush=True)
    time.sleep(30)
    return handle
output._new = slow
"""
"""Stops when the first file is there and empty: that which tries the place of an output, where one is tried."""

NAMED = "import os\nvars(os).pop('O_TMPFILE', None)\n"
"""On a disk where a file has a name from the beginning."""

IMPORTING = """
import sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "numpy.linalg":
            print("importing", flush=True)
            import time
            time.sleep(30)
        return None
sys.meta_path.insert(0, Finder())
"""
"""Stops in the middle of the import of NumPy."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("interrupts")
    (path / "train.yaml").write_text(CONFIG)
    process = start(path, ["sweep", "train.yaml", "-o", "map.h5", "-q"])
    _, said = process.communicate(timeout=120)
    assert process.returncode == 0, said
    return path


def start(folder: Path, args: list[str], before: str = "") -> subprocess.Popen[str]:
    """Start a command as its entry point does; ``before``: code that runs first."""
    code = f"{before}\nimport sys\nfrom gearstab.__main__ import main\nsys.argv[0] = 'gearstab'\nmain()"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen(
        [sys.executable, "-c", code, *args], cwd=folder, env=environment, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, preexec_fn=heed,
    )  # fmt: skip


def interrupted(process: subprocess.Popen[str], number: int) -> str:
    """Send a signal; what the process says on standard error before it ends, as it should."""
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    return said


def leaves_the_old(folder: Path, command: str, number: int, moment: str) -> None:
    """A command that a signal ends at a moment takes its output away, and the old one stays."""
    out = folder / COMMANDS[command][3]
    out.write_bytes(b"")  # an empty file may be replaced
    process = start(folder, COMMANDS[command], NAMED + moment)
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    assert list(folder.glob(".*.tmp"))
    assert interrupted(process, number) == "interrupted\n"
    assert not list(folder.glob(".*.tmp"))
    assert out.read_bytes() == b""
    out.unlink()


@each_with(["plot", "export", "respond"])
def test_an_output_half_written_goes_and_the_old_one_stays(folder: Path, command: str, number: int) -> None:
    leaves_the_old(folder, command, number, WRITING)


@each_with(["export"])  # one place creates the files of all
def test_an_output_that_is_still_empty_goes_and_the_old_one_stays(folder: Path, command: str, number: int) -> None:
    leaves_the_old(folder, command, number, CREATING)


@pytest.mark.parametrize(("command", "moment"), [("export", CREATING), ("respond", WRITING)])
def test_a_killed_process_leaves_nothing(folder: Path, command: str, moment: str) -> None:
    try:
        os.close(os.open(folder, os.O_WRONLY | os.O_TMPFILE))
    except (AttributeError, OSError):
        pytest.skip("needs files without a name")
    before = sorted(folder.iterdir())
    process = start(folder, COMMANDS[command], moment)
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    process.kill()
    process.communicate()
    assert sorted(folder.iterdir()) == before


@each_with(["export", "info", "plot"])
def test_an_import_is_left_without_a_word_of_python(folder: Path, command: str, number: int) -> None:
    process = start(folder, COMMANDS[command], IMPORTING)
    assert process.stdout is not None
    assert process.stdout.readline() == "importing\n"
    assert interrupted(process, number) == "interrupted\n"


LONG = {
    "sweep": (1.5, ["sweep", "train.yaml", "-o", "out.h5", "--set", "sweep.epsilon.num=60000", "-j", "1", "--yes"]),
    "plot": (1.5, ["plot", "map.h5", "-o", "out.png", "--dpi", "2400"]),
    "report": (1.2, ["report", "planets.yaml", "-o", "out.html"]),
    "design": (1.2, ["design", "train.yaml", "-o", "out.h5"]),
    "respond": (1.2, ["respond", "train.yaml", "-o", "out.h5"]),
    "info": (1.2, ["info", "planets.yaml"]),
    "check": (0.6, ["check", "long.yaml"]),
    "bench": (1.5, ["bench", "planets.yaml", "-o", "out.h5"]),
}
"""Commands at work, and the processor time (s) after their start at which they are; imports take less."""

WORKING = """
import os, signal, sys, threading, time
def end():
    while time.process_time() < {0}:
        time.sleep(0.01)
    sys.stdout.write(str(time.process_time()))
    sys.stdout.flush()
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=end, daemon=True).start()
"""


@pytest.fixture(scope="module")
def work(folder: Path) -> Path:
    """Configurations that keep every command busy for seconds."""
    fig3 = (ROOT / "configs" / "parker_2009" / "fig3.yaml").read_text()
    (folder / "planets.yaml").write_text(fig3)
    points = ", ".join(f"{1 + k * 1e-5:.5f}" for k in range(200_000))
    (folder / "long.yaml").write_text(f"{TRAIN}sweep: {{mesh_frequency: [{points}]}}\nmethods: {{floquet: {{}}}}\n")
    return folder


@pytest.mark.parametrize(
    "command", [pytest.param(name, marks=[] if name in ("report", "check") else pytest.mark.slow) for name in LONG]
)
def test_a_command_at_work_ends_within_a_second(work: Path, command: str) -> None:
    """A second of processor time, whatever else the machine does. The file that was there before stays."""
    after, args = LONG[command]
    out = work / args[3] if "-o" in args else None
    if out is not None and command != "sweep":
        out.write_bytes(b"")  # an empty file may be replaced
    with start(work, args, WORKING.format(after)) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        begun = process.stdout.read()
        said = process.stderr.read()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    assert used.ru_utime + used.ru_stime - float(begun) < 1.0
    assert not list(work.glob(".*.tmp"))
    if command == "sweep":
        assert re.search(r"[1-9]\d* of \d+ blocks are kept in out.h5.parts", said)
        shutil.rmtree(work / "out.h5.parts")
    elif out is not None:
        assert out.read_bytes() == b""
        out.unlink()


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("again", [False, True])
def test_at_any_moment(folder: Path, command: str, number: int, again: bool) -> None:
    """Once the signals are handled a command ends with 0 or 130, whenever they come, and if they come twice."""
    for delay in (0.0, 0.03, 0.1, 0.2, 0.3, 0.5, 0.8, 1.3, 2.0):
        for path in folder.glob("out.*"):
            if path.is_file():
                path.unlink()
        process = start(folder, COMMANDS[command], "print('begun', flush=True)\nimport gearstab.__main__\n"
                        "from gearstab.interrupts import install\ninstall()\nprint('ready', flush=True)")  # fmt: skip
        assert process.stdout is not None
        while process.stdout.readline() != "ready\n":
            pass
        time.sleep(delay)
        process.send_signal(number)
        if again:
            time.sleep(0.05)
            process.send_signal(number)
        _, said = process.communicate(timeout=120)
        assert process.returncode in (0, 130), (delay, said)
        assert "Traceback" not in said, delay
        assert not list(folder.glob(".*.tmp")), delay


def test_a_stopped_worker_keeps_no_interrupted_sweep_alive(tmp_path: Path) -> None:
    script = ROOT / "tests" / "reference" / "sweep_faults.py"
    from sweep_faults import CONFIG as SLOW

    (tmp_path / "train.yaml").write_text(SLOW)
    (tmp_path / "hold").write_text("3")
    command = [sys.executable, str(script), str(tmp_path / "train.yaml"), str(tmp_path / "out.h5"), "2", str(tmp_path)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=heed,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        for _ in range(2):
            assert process.stdout.readline() == "block\n"
        workers = [child for child in children(process.pid) if "loky.backend.popen" in command_of(child)]
        assert workers
        for worker in workers:
            os.kill(worker, signal.SIGSTOP)
        (tmp_path / "hold").unlink()
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=30)
        assert process.returncode == 130, said
    finally:
        process.kill()
        process.communicate()


def children(parent: int) -> list[int]:
    """The processes that a process started; the test is skipped where the system does not tell."""
    try:
        return [int(text) for text in Path(f"/proc/{parent}/task/{parent}/children").read_text().split()]
    except OSError:
        pytest.skip("needs /proc")


def command_of(number: int) -> str:
    return Path(f"/proc/{number}/cmdline").read_bytes().replace(b"\0", b" ").decode()


def test_what_is_ignored_stays_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """As ``nohup`` wants it."""
    before = {number: signal.getsignal(number) for number in interrupts.SIGNALS}
    monkeypatch.setattr("atexit.register", lambda function: function)
    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        interrupts.install()
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
        assert signal.getsignal(signal.SIGINT) is interrupts.leave
        with interrupts.raised(lambda: False):
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGINT) is interrupts.leave
        # An application's own treatment of Ctrl-C stays.
        own = lambda number, frame: None  # noqa: E731
        signal.signal(signal.SIGINT, own)
        with interrupts.raised(lambda: False):
            assert signal.getsignal(signal.SIGINT) is own
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("busy", [0.0, 0.1], ids=["at rest", "busy"])
def test_an_interrupt_that_python_swallows_comes_again(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, busy: float
) -> None:
    """Also on a machine so busy that the main thread stands still when the signal is to come again."""
    start = interrupts.start_new_thread

    def slowly(function: Callable[[], None], given: tuple[()]) -> None:
        start(function, given)
        time.sleep(busy)

    monkeypatch.setattr(interrupts, "start_new_thread", slowly)

    class Thing:
        pass

    thing = Thing()
    watched = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGTERM))

    def used() -> None:
        nonlocal thing
        with interrupts.raised(lambda: False):
            del thing
            assert watched() is None
            Event().wait(60)

    with pytest.raises(KeyboardInterrupt):
        used()
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize("fate", [lambda: None, lambda: int("another exception")])
def test_an_interrupt_of_which_a_library_made_something_else_comes_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fate: Callable[[], object]
) -> None:
    (tmp_path / "train.yaml").write_text(CONFIG)
    compute = pool.compute

    def interrupted(plan: Plan, block: GridBlock, taken: Outcome | None) -> FinishedBlock:
        if block.number == 1:
            with suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
            fate()
        return compute(plan, block, taken)

    monkeypatch.setattr(sys.modules["gearstab.sweep.plan"], "MOST", 1 << 13)
    with monkeypatch.context() as patch:
        patch.setattr(pool, "compute", interrupted)
        with pytest.raises(Interrupted, match="1 of 12 blocks are kept"):
            run(plan(load(tmp_path / "train.yaml")), tmp_path / "out.h5", 1)
    assert run(plan(load(tmp_path / "train.yaml")), tmp_path / "out.h5", 1).reused == 1


def test_an_exception_without_an_interrupt_stays_one() -> None:
    def used(signals: int) -> None:
        with interrupts.raised(lambda: False):
            for _ in range(signals):
                with suppress(KeyboardInterrupt):
                    signal.raise_signal(signal.SIGTERM)
            raise ValueError("mine")

    for _ in range(2):
        with pytest.raises(ValueError, match="mine"):
            used(0)
        with pytest.raises(KeyboardInterrupt):
            used(1)
