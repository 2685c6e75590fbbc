"""A sweep whose method is slow, logs what it computes, and fails where told to; as a script it is a process to kill.

    python sweep_faults.py CONFIG OUT JOBS FOLDER

OUT is "memory" for a sweep in memory, whose interrupt is that of Python.

Files in FOLDER tell what happens at the block with the stiffness k0 = K: ``kill-K`` holds how often its process dies;
``raise-K``: an error; ``memory-K``: no memory. ``hold`` holds a stiffness: blocks from there on wait until the file is
gone. Blocks are single stiffnesses; ``log`` gets a line for each one begun, ``processes`` the process that began it.
"""

import os
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenes import scene_text

from gearstab.config import load
from gearstab.errors import Interrupted, SweepError
from gearstab.methods import Outcome
from gearstab.methods.floquet import Floquet
from gearstab.sweep import Plan, Reporter, plan, pool, run, run_in_memory
from gearstab.sweep.storage import store

CONFIG = scene_text("sweep_faults")

FOLDER = "GEARSTAB_TEST_FOLDER"


def value(stiffness: float) -> np.ndarray:
    """Value of the method."""
    return np.sin(stiffness * np.array([1.0, 2.0, 3.0]))


class Faulty(Floquet):
    """Computes one row and does what the files tell. Never run it in threads."""

    parallel = False

    def run(self, mesh_frequency: np.ndarray) -> Outcome:
        return computed(float(np.squeeze(self.system.stiffness[..., 0, 0])))


def computed(stiffness: float) -> Outcome:
    """Outcome of the method for a row, unless the files tell otherwise."""
    folder = Path(os.environ[FOLDER])
    name = f"{stiffness:g}"
    with open(folder / "log", "a") as log:
        log.write(f"{name}\n")
    with open(folder / "processes", "a") as processes:
        processes.write(f"{os.getpid()}\n")
    while held(folder / "hold", stiffness):
        time.sleep(0.01)
    kill = folder / f"kill-{name}"
    if kill.exists() and (left := int(kill.read_text())):
        kill.write_text(str(left - 1))
        os.kill(os.getpid(), signal.SIGKILL)
    if (folder / f"raise-{name}").exists():
        raise ArithmeticError(f"no luck with {name}")
    if (folder / f"memory-{name}").exists():
        raise MemoryError
    growth = value(stiffness)[None]
    return Outcome({"growth_rate": growth, "stable": (growth <= 0).astype("i1"), "status": np.zeros((1, 3), "i2")})


def held(path: Path, stiffness: float) -> bool:
    """Whether a block has to wait."""
    try:
        return stiffness >= float(path.read_text())
    except FileNotFoundError:
        return False


def faulty(path: Path) -> Plan:
    """The plan of a configuration with this method, in blocks of one row."""
    planned = plan(load(path))
    (layout,) = planned.layouts
    fake = Faulty(layout.method.options, layout.method.system)
    return replace(planned, layouts=(replace(layout, chunk=(1, 3), method=fake),))


class Spoken(Reporter):
    """Messages on standard error, and a line for each block on standard output."""

    def message(self, text: str) -> None:
        sys.stderr.write(text + "\n")

    def advance(self, points: int, unstable: int, failed: int) -> None:
        if points:
            sys.stdout.write("block\n")
            sys.stdout.flush()


def main(config: str, out: str, jobs: str, folder: str) -> int:
    """Run the sweep as the command does: the exit code."""
    os.environ[FOLDER] = folder
    pool.WORTH_PROCESSES = 0.0
    store.MOST_SECONDS = 0.0
    if out == "memory":
        return in_memory(faulty(Path(config)), int(jobs))
    try:
        summary = run(faulty(Path(config)), out, int(jobs), progress=Spoken())
    except (SweepError, Interrupted) as error:
        sys.stderr.write(f"{error}\n")
        return 130 if isinstance(error, Interrupted) else 1
    sys.stderr.write(f"{summary.reused} of {summary.blocks} blocks reused\n")
    return 0


def in_memory(planned: Plan, jobs: int) -> int:
    """Run the sweep as the function of Python does."""
    try:
        run_in_memory(planned, jobs, Spoken())
    except KeyboardInterrupt:
        sys.stderr.write("KeyboardInterrupt\n")
        return 130
    except SweepError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
