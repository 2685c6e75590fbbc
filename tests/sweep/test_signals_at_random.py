"""Real sweeps of seven kinds that are ended at random moments, again and again, and go on to the same data."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic

import h5py
import numpy as np
import pytest
from scenes import TRAIN

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs signals of POSIX"),
]

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL]
RANGE = "mesh_frequency: {start: 2.0, stop: 6.0, num: 2}"
METHODS = {
    "floquet": ("mesh_frequency: {start: 2.0, stop: 6.0, num: 4000}, epsilon: {start: 0, stop: 0.4, num: 1500}", "{}"),
    "exponents": ("mesh_frequency: {start: 2.0, stop: 6.0, num: 300}, epsilon: {start: 0, stop: 0.4, num: 300}", ""),
    "perturbation": ("epsilon: {start: 0, stop: 0.4, num: 1200}", "{}"),
    "uncoupled": ("epsilon: {start: 0, stop: 0.4, num: 2000}", "{}"),
    "boundaries": (f"{RANGE}, epsilon: {{start: 0, stop: 0.4, num: 400}}", "{}"),
    "required_damping": ("mesh_frequency: {start: 2, stop: 6, num: 99}, epsilon: {start: 0, stop: 0.4, num: 16}", "{}"),
    "tolerance": (
        "mesh_frequency: {start: 2.0, stop: 6.0, num: 60}, input_shaft_stiffness: {start: 0.4, stop: 0.6, num: 30}",
        "{samples: 128, parameters: {epsilon: {uniform: [0.2, 0.4]}}}",
    ),
}  # fmt: skip
"""By name: the sweep and the options."""
SEEDS = range(6)
MOST = 3
"""Signals to one sweep."""

HASTY = """
import sys
from gearstab.interrupts import install
install()
print("ready", flush=True)
from gearstab.sweep import pool
from gearstab.sweep.storage import store
store.MOST_SECONDS = 0.0
module = sys.modules["gearstab.sweep.plan"]
module.MOST >>= 3
from gearstab.__main__ import main
sys.argv[0] = "gearstab"
main()
"""
"""The command, with small blocks that are all kept at once."""


def heed() -> None:
    """Heed all signals, also where the tests run in the background or under nohup, which ignore some."""
    for number in SIGNALS[:3]:
        signal.signal(number, signal.SIG_DFL)


def start(config: Path, out: Path, jobs: int) -> subprocess.Popen[str]:
    words = ["sweep", str(config), "-o", str(out), "-j", str(jobs), "-q"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-c", HASTY, *words], env=environment, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, preexec_fn=heed,
    )  # fmt: skip
    # Before that Python itself answers to signals.
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def data_of(path: Path) -> dict[str, bytes]:
    """All variables of a result."""
    found: dict[str, bytes] = {}
    with h5py.File(path, "r") as file:

        def keep(name: str, item: object) -> None:
            if isinstance(item, h5py.Dataset):
                values = item.asstr()[...].astype("U") if item.dtype.kind == "O" else item[...]
                found[name] = np.asarray(values).tobytes()

        file.visititems(keep)
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[float, dict[str, bytes]]]:
    """How long each sweep takes, and its data; filled as needed."""
    return {}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", METHODS)
def test_ended_at_random_moments(
    tmp_path: Path, whole: dict[str, tuple[float, dict[str, bytes]]], name: str, seed: int
) -> None:
    axes, options = METHODS[name]
    chosen = "floquet: {exponents: true}" if name == "exponents" else f"{name}: {options}"
    config, out = tmp_path / "train.yaml", tmp_path / "out.h5"
    config.write_text(TRAIN + f"sweep: {{{axes}}}\nmethods: {{{chosen}}}\n")
    if name not in whole:
        begun = monotonic()
        process = start(config, out, 1)
        _, said = process.communicate(timeout=300)
        assert process.returncode == 0, said
        whole[name] = monotonic() - begun, data_of(out)
        out.unlink()
    seconds, expected = whole[name]
    moments = random.Random(f"{name} {seed}")
    for _ in range(moments.randint(1, MOST)):
        process, number = start(config, out, moments.choice([1, 2])), moments.choice(SIGNALS)
        try:
            _, said = process.communicate(timeout=moments.uniform(0.2, 1.0) * seconds)
        except subprocess.TimeoutExpired:
            process.send_signal(number)
            _, said = process.communicate(timeout=120)
        assert "Traceback" not in said
        assert process.returncode in (0, 130, -number), said
        # What is there under its name is whole.
        assert not out.exists() or data_of(out) == expected
    process = start(config, out, 2)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    assert data_of(out) == expected
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.h5", "train.yaml"]
