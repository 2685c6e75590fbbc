"""Page on first steps: its commands run, its names are those of a result."""

import re
import shlex
from pathlib import Path

import h5py
import pytest
from scenes import DOCS, TRAIN, ran

PAGE = (DOCS / "first_steps.md").read_text()
SWEPT = TRAIN + (
    "sweep:\n  mesh_frequency: [4.0, 5.0, 6.0]\n  epsilon: [0.1, 0.3]\nmethods: {floquet: {}, boundaries: {}}\n"
)


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.M | re.S)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With a result, as the first block of the page makes it."""
    path = tmp_path_factory.mktemp("steps")
    (path / "train.yaml").write_text(SWEPT)
    assert ran("sweep", path / "train.yaml", "-o", path / "results" / "train.h5").exit_code == 0
    return path


def test_the_first_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for line in blocks("sh")[0].splitlines():
        words, _, target = line.partition("#")[0].partition(">")
        command = shlex.split(words)[1:]
        few = ["--set", "sweep.mesh_frequency.num=5", "--set", "sweep.epsilon.num=2"] if command[0] == "sweep" else []
        done = ran(*command, *few)
        assert done.exit_code == 0, line
        if target:
            Path(target.strip()).write_text(done.stdout)
    assert Path("results/train.png").exists()


def test_the_exports_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    lines = [line.partition("#")[0] for block in blocks("sh") for line in block.splitlines() if " export " in line]
    assert len(lines) == 2
    for line in lines:
        assert ran(*shlex.split(line)[1:]).exit_code == 0
    assert {"mesh_frequency", "epsilon", "growth_rate"} <= set(Path("train.csv").read_text().splitlines()[0].split(","))


def test_names_and_dimensions_of_the_matlab_snippet_are_those_of_a_result(folder: Path) -> None:
    (snippet,) = blocks("matlab")
    names = re.findall(r"h5read\(file, '([^']+)'\)", snippet)
    assert names == ["/mesh_frequency", "/epsilon", "/floquet/growth_rate", "/boundaries/boundary_frequency"]
    with h5py.File(folder / "results" / "train.h5") as file:
        growth, edges = file["/floquet/growth_rate"], file["/boundaries/boundary_frequency"]
        assert growth.shape[::-1] == (2, 3)  # epsilon x mesh_frequency, as MATLAB lists dimensions
        assert edges.shape[::-1][:2] == (2, 2)  # epsilon x side x tongue
        assert all(name in file for name in names)
