"""``gearstab check`` as a user runs it: exit codes, streams, one line for each mistake."""

import subprocess
import sys
from pathlib import Path

import pytest
from scenes import CONFIGS, ran, scene_text, written

RUN = [sys.executable, "-W", "error", "-c", "import sys; from gearstab.cli import main; main(sys.argv[1:])", "check"]

WRONG = scene_text("config_check_wrong")


def test_a_valid_configuration() -> None:
    path = CONFIGS / "gear_pair.yaml"
    done = ran("check", path, "--set", "sweep.contact_ratio.num=3")
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout == (
        f"{path}: valid gear_pair; "
        "damping_ratio (3) x contact_ratio (3) x mesh_frequency (500) = 4,500 points; "
        "methods floquet, perturbation, boundaries\n"
    )


def test_mistakes(tmp_path: Path, root: Path) -> None:
    path = written(tmp_path, WRONG, "wrong.yaml")
    done = subprocess.run([*RUN, path, "--set", "tooth_ratio=0.6667"], cwd=root, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines() == [
        f"{path}:3: system.inertias.1: must be > 0 (got -0.3); choose a value > 0",
        f"{path}:8: system.meshes.1.contact_ration: unknown key; did you mean 'contact_ratio'?",
        "--set tooth_ratio: system.tooth_ratio: is no short decimal, and the ratio must be exact (got 0.6667); "
        'write a fraction such as "2/3"',
    ]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("name", "message"), [("none.yaml", "there is no such file"), (".", "is a folder")])
def test_no_configuration(tmp_path: Path, name: str, message: str) -> None:
    done = ran("check", tmp_path / name)
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith(f"{tmp_path / name}: {message}; ")
    assert done.stderr.count("\n") == 1
