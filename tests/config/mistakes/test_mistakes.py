"""A mistake in a configuration is told at its place, with its code and what to do; tables in tests/data/config/."""

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from scenes import CONFIGS, DATA, ran, read, scene_text, written

from gearstab.config import Config, ConfigError, load
from gearstab.config.readers import check_options

TABLES = sorted((DATA / "config" / "mistakes").glob("*.toml"))
SCENES = [
    pytest.param(scene, id=f"{path.stem} {number}")
    for path in TABLES
    for number, scene in enumerate(tomllib.loads(path.read_text())["scene"])
]
CASES = [
    pytest.param(scene, case, id=f"{item.id} {case.get('name', number)}")
    for item in SCENES
    for scene in item.values
    for number, case in enumerate(scene["mistakes"])
]


def text_of(scene: dict[str, Any], folder: Path) -> str:
    """The right configuration of a scene, whose files are written beside it."""
    for name, content in scene.get("files", {}).items():
        written(folder, content, name)
    if "config" in scene:
        return (CONFIGS / scene["config"]).read_text()
    return scene_text(scene["scene"]) if "scene" in scene else scene["right"]


def checked(folder: Path, text: str, *overrides: str) -> Config:
    """Load a configuration and look whether the options of its methods fit its system, as ``check`` does."""
    config = read(folder, text, *overrides)
    if config.methods.chosen:
        check_options(config, config.system.build())
    return config


@pytest.mark.parametrize("scene", SCENES)
def test_the_right_ones_are_read(tmp_path: Path, scene: dict[str, Any]) -> None:
    checked(tmp_path, text_of(scene, tmp_path))


@pytest.mark.parametrize(("scene", "case"), CASES)
def test_a_mistake_is_told(tmp_path: Path, scene: dict[str, Any], case: dict[str, Any]) -> None:
    """Each in one line, all at once, and nothing that follows from them."""
    text = text_of(scene, tmp_path) if "files" not in case else text_of(scene | {"files": case["files"]}, tmp_path)
    for old, new in case.get("changes", [[case["old"], case["new"]]] if "old" in case else []):
        assert text.count(old) == 1
        text = text.replace(old, new)
    with pytest.raises(ConfigError) as caught:
        checked(tmp_path, text, *case.get("set", ()))
    found, expected = caught.value.problems, case.get("problems", [case])
    assert [(p.path, p.code, p.line) for p in found] == [(p["path"], p["code"], p.get("line")) for p in expected]
    lines = "\n".join(map(str, found))
    assert lines.count("\n") == len(expected) - 1
    assert all(problem.hint for problem in found)
    assert [words for words in case.get("says", []) if words not in lines] == []


# --- ``gearstab check`` as a user runs it: exit codes, streams, one line for each mistake


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


# --- a wrong value is told once, and nothing that depends on it; design variables need no base value


GONE = object()


def changed(name: str, *path: Any, to: Any = GONE) -> dict[str, Any]:
    """Return one of the configurations with another value at a path, or without what is there."""
    data: dict[str, Any] = YAML(typ="safe", pure=True).load(CONFIGS / name)
    place: Any = data
    for key in path[:-1]:
        place = place[key]
    if to is GONE:
        del place[path[-1]]
    else:
        place[path[-1]] = to
    return data


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("design/planetary.yaml", ("teeth", "planet")),
        ("design/countershaft.yaml", ("input_shaft_stiffness",)),
        ("design/countershaft.yaml", ("meshes", 0, "contact_ratio")),
    ],
)
@pytest.mark.parametrize("to", [GONE, None])
def test_design_variables_need_no_base_value(name: str, path: tuple[Any, ...], to: Any) -> None:
    config = load(changed(name, "system", *path, to=to))
    value, variables = config.tree["system"], config.tree["design"]["variables"]
    for key in path:
        value = value[key]
    spec = next(spec for key, spec in variables.items() if key.endswith(str(path[-1])))
    limits = spec["integers"] if isinstance(spec, dict) else spec
    assert limits[0] <= value <= limits[1]
