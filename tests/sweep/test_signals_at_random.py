"""Real sweeps of all methods that are ended at random moments, again and again, and go on to the same data."""

import os
import random
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep

import pytest
from scenes import TRAIN, data_of, heed, written

from gearstab.config import load
from gearstab.methods import METHODS as METHODS_OF_SWEEPS
from gearstab.sweep import plan

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs signals of POSIX"),
]

Whole = dict[str, tuple[float, dict[str, tuple[tuple[int, ...], bytes]]]]
SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL]
SMALL = 1 << 13
"""Size of a block: every sweep has many."""
FEWEST = 8
"""Blocks of a sweep at least, so that most moments lie between two of them."""
RANGE = "mesh_frequency: {start: 2.0, stop: 6.0, num: 2}"
SHAFT = "input_shaft_stiffness: {start: 0.4, stop: 0.6, num: %d}"
UNCERTAIN = "parameters: {epsilon: {uniform: [0.2, 0.4]}}"
LOADED = TRAIN + "  damping_ratio: 0.03\n  load: [0.0, 0.0, 1.0]\n"
METHODS = {
    "floquet": ("mesh_frequency: {start: 2.0, stop: 6.0, num: 4000}, epsilon: {start: 0, stop: 0.4, num: 300}", "{}"),
    "exponents": ("mesh_frequency: {start: 2.0, stop: 6.0, num: 1000}, epsilon: {start: 0, stop: 0.4, num: 150}", ""),
    "perturbation": ("epsilon: {start: 0, stop: 0.4, num: 12000}", "{}"),
    "uncoupled": ("epsilon: {start: 0, stop: 0.4, num: 6000}", "{}"),
    "natural_frequencies": ("input_shaft_stiffness: {start: 0.4, stop: 0.6, num: 12000}", "{}"),
    "boundaries": (f"{RANGE}, epsilon: {{start: 0, stop: 0.4, num: 400}}", "{}"),
    "required_damping": (f"mesh_frequency: {{start: 2, stop: 6, num: 99}}, {SHAFT % 60}", "{}"),
    "passage": ("mesh_frequency: [2.0, 3.0], epsilon: {start: 0.1, stop: 0.4, num: 32}", "{rate: [3.0]}"),
    "response": ("mesh_frequency: {start: 2.0, stop: 6.0, num: 200}, epsilon: {start: 0, stop: 0.4, num: 40}", "{}"),
    "backlash": ("mesh_frequency: {start: 2, stop: 6, num: 6}, epsilon: {start: 0.1, stop: 0.4, num: 10}",
                 "{cycles: 20, discard: 10}"),
    "tolerance": (f"mesh_frequency: {{start: 2.0, stop: 6.0, num: 64}}, {SHAFT % 64}", f"{{samples: 16, {UNCERTAIN}}}"),
    "tongue_probability": (f"mesh_frequency: [2, 5], {SHAFT % 200}",
                           f"{{samples: 32}}, tolerance: {{samples: 16, {UNCERTAIN}}}"),
}  # fmt: skip
"""By name: the sweep and the options."""
SEEDS = range(4)
MOST = 3
"""Signals to one sweep."""

HASTY = f"""
import sys
from gearstab.interrupts import install
install()
print("ready", flush=True)
from gearstab.sweep import pool
from gearstab.sweep.storage import store
store.MOST_SECONDS = 0.0
module = sys.modules["gearstab.sweep.plan"]
module.MOST = {SMALL}
from gearstab.__main__ import main
sys.argv[0] = "gearstab"
main()
"""
"""The command, with small blocks that are all kept at once."""


def start(config: Path, out: Path, jobs: int, *more: str) -> subprocess.Popen[str]:
    words = ["sweep", str(config), "-o", str(out), "-j", str(jobs), "-q", *more]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-c", HASTY, *words], env=environment, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, preexec_fn=heed, cwd=out.parent,
    )  # fmt: skip
    # Before that Python itself answers to signals.
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    assert processes_in(out.parent) or not Path("/proc").exists()
    return process


def end(process: subprocess.Popen[str], number: int, seconds: float) -> None:
    """Send a signal to a sweep that is not done after so many seconds; it ends without a traceback."""
    try:
        _, said = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.send_signal(number)
        _, said = process.communicate(timeout=120)
    assert "Traceback" not in said
    assert process.returncode in (0, 130, -number), said


def finish(process: subprocess.Popen[str]) -> None:
    """Wait for a sweep that ends well."""
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said


def processes_in(folder: Path) -> list[str]:
    """The processes that work in a folder, as all do of a sweep started there; none where the system does not tell."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        # It may end at any moment.
        with suppress(OSError):
            if (process / "cwd").readlink() == folder.resolve():
                found.append((process / "cmdline").read_text().replace("\0", " "))
    return found


def none_left(folder: Path) -> bool:
    """Whether all processes in a folder end soon: those of a killed sweep look for it every half second."""
    end = monotonic() + 30.0
    while processes_in(folder) and monotonic() < end:
        sleep(0.1)
    return not processes_in(folder)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    """How long each sweep takes, and its data; filled as needed."""
    return {}


def text_of(name: str) -> str:
    """The configuration of a sweep."""
    axes, options = METHODS[name]
    system = LOADED if name in ("response", "backlash") else TRAIN
    if name == "backlash":
        system = system.replace("1.5}", "1.5, backlash: 0.1}")
    method = {"exponents": "floquet: {exponents: true}", "backlash": f"response: {options}"}.get(name)
    return f"{system}sweep: {{{axes}}}\nmethods: {{{method or f'{name}: {options}'}}}\n"


def test_all_methods_are_ended() -> None:
    assert set(METHODS) == {*METHODS_OF_SWEEPS, "exponents", "backlash"}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", METHODS)
def test_ended_at_random_moments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Whole, name: str, seed: int
) -> None:
    config, out = written(tmp_path, text_of(name), "train.yaml"), tmp_path / "out.h5"
    if name not in whole:
        monkeypatch.setattr(sys.modules["gearstab.sweep.plan"], "MOST", SMALL)
        assert plan(load(config)).blocks >= FEWEST
        begun = monotonic()
        finish(start(config, out, 1))
        whole[name] = monotonic() - begun, data_of(out)
        out.unlink()
    seconds, expected = whole[name]
    moments = random.Random(f"{name} {seed}")
    for _ in range(moments.randint(1, MOST)):
        process, number = start(config, out, moments.choice([1, 2])), moments.choice(SIGNALS)
        end(process, number, moments.uniform(0.2, 1.0) * seconds)
        # What is there under its name is whole.
        assert not out.exists() or data_of(out) == expected
    finish(start(config, out, 2))
    assert data_of(out) == expected
    assert none_left(tmp_path), processes_in(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.h5", "train.yaml"]


@pytest.mark.parametrize("number", SIGNALS)
def test_workers_of_its_own_end_with_a_sweep(tmp_path: Path, number: int) -> None:
    pytest.importorskip("distributed")
    config, out = written(tmp_path, text_of("boundaries"), "train.yaml"), tmp_path / "out.h5"
    begun = monotonic()
    finish(start(config, out, 2, "--scheduler", "local"))
    seconds, expected = monotonic() - begun, data_of(out)
    out.unlink()
    moments = random.Random(f"workers {number}")
    for _ in range(MOST):
        process = start(config, out, 2, "--scheduler", "local")
        end(process, number, moments.uniform(0.2, 1.0) * seconds)
        assert none_left(tmp_path), processes_in(tmp_path)
    finish(start(config, out, 2))
    assert data_of(out) == expected
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.h5", "train.yaml"]
