"""A disk that is full: exit code 1, one line with the name of the file, and the old file intact.

The limit of the size of a file stands for the end of the disk, as tests can set it for one process.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from scenes import TRAIN

resource = pytest.importorskip("resource")

CONFIG = (
    TRAIN
    + """\
sweep:
  mesh_frequency: {start: 4.0, stop: 6.0, num: 200}
  epsilon: {start: 0.0, stop: 0.4, num: 100}
methods: {floquet: {}}
respond: {mesh_frequency: 5, cycles: 50, initial: {velocity: [1, 0, 0]}}
"""
)
COMMANDS = {
    "sweep": ["sweep", "other.yaml", "-o", "out.h5", "--overwrite"],
    "respond": ["respond", "train.yaml", "-o", "response.h5"],
    "bench": ["bench", "train.yaml", "-o", "bench.h5", "--points", "1", "--seconds", "0", "--no-plot", "-q"],
    "png": ["plot", "out.h5", "-o", "out.png"],
    "pdf": ["plot", "out.h5", "-o", "out.pdf"],
    "svg": ["plot", "out.h5", "-o", "out.svg"],
    "export": ["export", "out.h5", "-o", "out.csv"],
}


def call(folder: Path, args: list[str], limit: int | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command; ``limit``: bytes of the largest file that the disk takes."""

    def confine() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.run(
        [sys.executable, "-m", "gearstab", *args], cwd=folder, capture_output=True, text=True, preexec_fn=confine,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("full")
    (path / "train.yaml").write_text(CONFIG)
    (path / "other.yaml").write_text(CONFIG.replace("stop: 0.4", "stop: 0.5"))
    done = call(path, ["sweep", "train.yaml", "-o", "out.h5"])
    assert done.returncode == 0, done.stderr
    return path


OLD = {"png": b"\x89PNG old", "pdf": b"%PDF-old", "svg": b"<svg></svg>", "export": b"epsilon,growth_rate\n"}
"""What may be replaced; the sweep has the result of an earlier one."""


@pytest.mark.parametrize(
    "command", [pytest.param(name, marks=pytest.mark.slow) if name == "svg" else name for name in COMMANDS]
)
def test_a_full_disk_is_one_line_and_the_old_file_stays(folder: Path, command: str) -> None:
    args = COMMANDS[command]
    out = folder / args[3]
    if command in OLD:
        out.write_bytes(OLD[command])
    before = out.read_bytes() if out.exists() else None
    done = call(folder, args, limit=2000)
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"{out.name}: file too large") or command == "sweep"
    assert out.name in done.stderr
    assert (out.read_bytes() if out.exists() else None) == before
    assert not [path for path in folder.rglob("*.tmp") if "parts" not in str(path)]


def test_a_sweep_goes_on_when_there_is_room_again(folder: Path) -> None:
    """Finished blocks that fit are kept: here the result alone does not fit."""
    sizes = ["--set", "sweep.epsilon.num=2000", "--set", "sweep.mesh_frequency.num=300"]
    args = ["sweep", "train.yaml", "-o", "large.h5", *sizes]
    done = call(folder, args, limit=900_000)
    assert done.returncode == 1, done.stderr
    assert done.stderr.startswith("large.h5: file too large; ")
    assert done.stderr.count("\n") == 1
    done = call(folder, args)
    assert done.returncode == 0, done.stderr
    assert not (folder / "large.h5.parts").exists()
