"""A mistake in a configuration is told at its place, with its code and what to do; tables in tests/data/config/."""

import tomllib
from pathlib import Path
from typing import Any

import pytest
from scenes import CONFIGS, DATA, read, scene_text, written

from gearstab.config import Config, ConfigError
from gearstab.config.sections.methods import check_options

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
