"""A disk that is full: exit code 1, one line with the name of the file, and the old file intact.

The limit of the size of a file stands for the end of the disk, as tests can set it for one process.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr
from scenes import scene_text

from gearstab.results import open_result

resource = pytest.importorskip("resource")

CONFIG = scene_text("full_disk")
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
    """Run a command; ``limit``: bytes of the largest file that the disk takes.

    It stores no byte code, which Python would leave cut off at the limit, so that later imports of the module fail.
    """

    def confine() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.run(
        [sys.executable, "-m", "gearstab", *args], cwd=folder, capture_output=True, text=True, preexec_fn=confine,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONDONTWRITEBYTECODE": "1"},
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
"""Files that may be replaced; the sweep has the result of an earlier one."""

SLOW = {"pdf", "svg"}
"""Figures that are written as those of the kind png are."""


@pytest.mark.parametrize(
    "command", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in COMMANDS]
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


def on_a_disk(folder: Path, size: str, script: str, *args: str) -> subprocess.CompletedProcess[str]:
    """Run a script of the shell in the folder ``disk``: a disk of that size, in memory and of this process alone."""
    (folder / "disk").mkdir(exist_ok=True)
    mounted = f"mount -t tmpfs -o size={size} tmpfs disk && cd disk && {script}"
    return subprocess.run(
        ["unshare", "--map-root-user", "--mount", "sh", "-c", mounted, "sh", *args],
        cwd=folder, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip


@pytest.fixture
def disk(folder: Path) -> Path:
    if shutil.which("unshare") is None or on_a_disk(folder, "64k", "true").returncode:
        pytest.skip("no disk can be mounted here")
    return folder


FILLED = (
    'cp ../*.yaml ../out.h5 . && cat ../old > "$out"; cat /dev/zero > filler 2> /dev/null; truncate -s -$left filler; '
)
LISTED = "find . -type f -exec cksum {} + | sort > ../"


@pytest.mark.slow
@pytest.mark.parametrize("left", ["0", "8K"])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_real_disk_that_is_full(disk: Path, command: str, left: str) -> None:
    """All files on it are as they were, and no other."""
    args = COMMANDS[command]
    (disk / "old").write_bytes(OLD.get(command, b""))
    given = f"left={left}; out={args[3]}; [ $out = out.h5 ] && out=none; "
    script = given + FILLED + LISTED + 'before; "$@"; code=$?; ' + LISTED + "after; exit $code"
    done = on_a_disk(disk, "2m", script, sys.executable, "-m", "gearstab", *args)
    # A sweep asks first whether there is room.
    assert done.returncode == (2 if command == "sweep" else 1), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    room = {"0": "0 B", "8K": "8.19 kB"}[left]
    assert (f" {room} are free" if command == "sweep" else f"{args[3]}: no space left on device\n") in done.stderr
    before = (disk / "before").read_text()
    assert before.count("filler") == 1
    assert (disk / "after").read_text() == before


RUN = """\
import sys
from gearstab.config import load
from gearstab.sweep import SweepError, plan, run
from gearstab.sweep.storage import store
store.MOST_SECONDS = 0.0  # each block is written when it is finished
sizes = ["sweep.epsilon.num=1500", "sweep.mesh_frequency.num=1500", "methods={floquet: {}, uncoupled: {}}"]
try:
    done = run(plan(load("train.yaml", sizes)), sys.argv[1], jobs=2)
except SweepError as error:
    sys.exit(str(error))
print(done.reused)
"""


@pytest.mark.slow
def test_a_sweep_on_a_real_disk_that_fills_up_goes_on_when_there_is_room(disk: Path) -> None:
    """With all blocks, some or none of them kept; the data are those of a sweep with room enough."""
    (disk / "run.py").write_text(RUN)
    expected = subprocess.run([sys.executable, "run.py", "whole.h5"], cwd=disk, capture_output=True, text=True)
    assert expected.stdout == "0\n", expected.stderr
    size = (disk / "whole.h5").stat().st_size
    counts = []
    for share in (0.0, 0.2, 0.6, 1.1):
        (disk / "old").write_bytes(b"")
        python = f"{sys.executable} ../run.py small.h5"
        script = (
            f"left={int(share * size) // 1024}K; out=none; {FILLED} {python}; ls -A >&2; "
            f"rm filler; {python} && ls -A >&2; cp small.h5 ../small.h5"
        )
        done = on_a_disk(disk, "64m", script)
        said, *names = done.stderr.splitlines()
        assert said.startswith("small.h5")
        assert ": no space left on device; " in said
        kept = int(done.stdout)
        counts.append(kept)
        if kept:
            assert f"; {kept} finished block{'s are' if kept > 1 else ' is'} kept in small.h5.parts" in said
        else:
            assert said.endswith("; no block was kept: the next call begins from the start")
        there = ["filler", "none", "other.yaml", "out.h5", "train.yaml"]
        assert names == sorted([*there, *(["small.h5.parts"] if kept else [])]) + sorted([*there[1:], "small.h5"])
        with open_result(disk / "small.h5") as found, open_result(disk / "whole.h5") as whole:
            for name in ("floquet", "uncoupled"):
                xr.testing.assert_identical(found[name].to_dataset(), whole[name].to_dataset())
    assert counts[0] == 0 < counts[1] < counts[2] < counts[3]
