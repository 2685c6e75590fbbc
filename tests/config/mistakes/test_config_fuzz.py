"""Mutated configurations: valid, or one line for each mistake; and what is valid can be planned and built.

The mutations keep much of a configuration right, so that what is wrong is looked at deep inside: values, keys, units,
types, axes, and the text itself.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_documents import trees
from ruamel.yaml import YAML
from scenes import CONFIGS, CONFIGURATIONS, examples, scene_text, succeeds

from gearstab.config import Config, ConfigError, load
from gearstab.config.document import CODES
from gearstab.config.document.yaml import write
from gearstab.config.readers import check_options
from gearstab.sweep.plan import plan
from gearstab.systems import build

LARGE = {"train13.yaml", "drive_train.yaml", "fig4.yaml"}
"""Configurations that take long to read."""
TEXTS = [path.read_text() for path in CONFIGURATIONS if path.name not in LARGE]
TREES = [YAML(typ="safe", pure=True).load(text) for text in TEXTS]
FORMS = YAML(typ="safe", pure=True).load(scene_text("config_sweep"))
"""A configuration with every form of an axis, and a response."""
FORMS["respond"] = {"mesh_frequency": 1, "cycles": 1, "initial": {"displacement": [1]}}
FORMS["sweep"] |= {
    "case": [{"label": "a", "contact_ratio": 1.2}],
    "both": {"targets": ["damping_ratio"], "values": [1, 2]},
    "meshes.0.damping": {"start": 0, "stop": 1, "step": 0.5},
}
TREES.append(FORMS)

VALUES: list[Any] = [
    None, 0, 1, -1, 2, 3, 0.5, 1e-3, 1e3, 1e12, 1e29, 1e-29, 1e31, 1e-300, 10**20, -0.0, True, False, "", "x", "²",
    float("nan"), float("inf"), -float("inf"), "5%", "90 deg", "20 mm", "3 N m", "600 rpm", "1,5", "3/5", "1/9999999",
    "none", "SI", "m", "rad", "planar", "rotational", "elastic", "rigid", "dimensionless", "energy_conserving", "tooth",
    "fourier", "pair", "sampled", "gearbox", "matrices", "planetary", "two_stage", "gear_pair", "mesh_stiffness.csv",
    [], {}, [1], [1, 2, 3], [[1, 2], [3, 4]], {"a": 1}, {"start": 0, "stop": 1, "num": 3}, {"start": 1, "stop": 0},
    {"start": 1, "stop": 1e9, "step": 1}, {"start": 0.1, "stop": 10, "num": 4, "spacing": "log"},
    {"targets": ["epsilon", "contact_ratio"], "values": [[0.1, 0.2], [1.5, 1.6]]}, [{"label": "a", "epsilon": 0.1}],
]  # fmt: skip
FACTORS = [0, -1, 0.1, 0.5, 2, 10, 1e3, 1e-3, 1e9, 1e-9, 1e20, 1e-20]
TOKENS = [
    '"\\U00110000"', '"\\uD800"', "%YAML 1.2\n", "---\n", "...\n", "&a ", "*a", "!!int ", "!x ", "!<", "? ", "- ", ": ",
    "{", "}", "[", "]", "#", "|\n", ">\n", "\t", "\n", '"', "'", "@", "`", "²", "\u2028", "\x85", "\ufeff", "<<: ", "~",
    ".nan", "0x" + "f" * 5000, "1e400", "5%", "1,5", "\\", "\r", "\x07", "??", ",,", "[a, b]: 1",
]  # fmt: skip


def paths(tree: Any, path: tuple = ()) -> list[tuple]:
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    return [path, *(inner for key, item in items for inner in paths(item, (*path, key)))]


def at(tree: Any, path: tuple) -> Any:
    for key in path:
        tree = tree[key]
    return tree


KEYS = sorted({str(key) for tree in TREES for path in paths(tree) for key in path if isinstance(key, str)})


def mutated(draw: Any, tree: Any) -> None:
    """Change one place of a document."""
    places = [path for path in paths(tree) if path]
    path = draw(st.sampled_from(places))
    container, key = at(tree, path[:-1]), path[-1]
    value, kind = container[key], draw(st.integers(0, 7))
    if kind == 0:
        container[key] = copy.deepcopy(draw(st.sampled_from(VALUES)))
    elif kind == 1:
        del container[key]
    elif kind == 7:
        container[key] = draw(trees())
    elif kind == 2 and isinstance(value, int | float):
        container[key] = value * draw(st.sampled_from(FACTORS))
    elif kind == 3 and isinstance(container, dict):
        container[draw(st.sampled_from(KEYS))] = container.pop(key)
    elif kind == 4 and isinstance(container, dict):
        container[draw(st.sampled_from(KEYS))] = copy.deepcopy(draw(st.sampled_from(VALUES)))
    elif kind == 5:
        container[key] = copy.deepcopy(at(tree, draw(st.sampled_from(places))))
    else:
        container[key] = [copy.deepcopy(value)] * draw(st.integers(0, 3))


def with_axis(draw: Any, tree: Any) -> None:
    """Sweep some number of the system, in one of the forms of an axis."""
    system, sweep = tree.get("system"), tree.get("sweep")
    places = [path for path in paths(system) if path]
    if not places or not isinstance(sweep, dict):
        return
    path = draw(st.sampled_from(places))
    name, value = ".".join(map(str, path)), at(system, path)
    forms = [
        [value, 1], [value, value], [value, 1e20], [value, 1e-20], [0.0, 1e3], {"start": 0.5, "stop": 2, "num": 3},
        {"targets": [name, "epsilon"], "values": [0.1, 0.2]},
        [{"label": "a", name: value}, {"label": "b", name: 1}, {"label": "c"}],
    ]  # fmt: skip
    sweep[name if draw(st.booleans()) else "free"] = copy.deepcopy(draw(st.sampled_from(forms)))


@st.composite
def documents(draw: Any, most: int = 4) -> str:
    """A configuration of the repository with some changes, as text."""
    tree = copy.deepcopy(draw(st.sampled_from(TREES)))
    for _ in range(draw(st.integers(0, most))):
        mutated(draw, tree)
        if not isinstance(tree, dict) or not tree:
            break
    if isinstance(tree, dict) and draw(st.booleans()):
        with_axis(draw, tree)
    return write(tree)


@st.composite
def texts(draw: Any) -> str:
    """The text of a configuration with a few characters or words changed."""
    text = draw(st.sampled_from(TEXTS))
    for _ in range(draw(st.integers(1, 3))):
        place, kind = draw(st.integers(0, len(text) - 1)), draw(st.integers(0, 3))
        end = place + draw(st.integers(0, 8))
        put = draw(st.characters(codec="utf-8")) if kind == 0 else "" if kind == 1 else draw(st.sampled_from(TOKENS))
        text = text[:place] + put + text[end if kind < 3 else place :]
    return text


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where a configuration is written, beside the files that some of them name."""
    folder = tmp_path_factory.mktemp("fuzz")
    for file in (*CONFIGS.rglob("*.csv"), *CONFIGS.rglob("*.npz")):
        (folder / file.name).write_bytes(file.read_bytes())
    return folder / "scene.yaml"


def read(scene: Path, text: str) -> Config | None:
    """The configuration as ``gearstab check`` reads it; None where it says what is wrong, in one line a mistake."""
    scene.write_text(text, encoding="utf-8", newline="")
    try:
        config = load(scene)
        if config.methods.chosen:
            check_options(config, build(config.system))
    except ConfigError as error:
        problems = error.problems
    else:
        return config
    lines = [str(problem) for problem in problems]
    assert lines
    assert {problem.code for problem in problems} <= set(CODES)
    assert all(line and "\n" not in line and len(line) < 3000 for line in lines)
    return None


@examples(60, 3000)
@given(document=documents())
def test_changed_configurations_are_valid_or_named(scene: Path, document: str) -> None:
    read(scene, document)


@examples(150, 2000)
@given(text=texts())
def test_changed_texts_are_valid_or_named(scene: Path, text: str) -> None:
    read(scene, text)


@examples(60, 2000)
@given(document=documents(2), points=st.lists(st.floats(0, 0.999), min_size=3, max_size=3))
def test_what_is_valid_can_be_built(scene: Path, document: str, points: list[float]) -> None:
    """It has systems at all points, a plan, and a resolved form that is valid too."""
    if (config := read(scene, document)) is None:
        return
    build(config.system)
    for fraction in points:
        build(config.at({axis.name: np.array(int(fraction * axis.size)) for axis in config.axes}))
    if config.axes and config.methods.chosen:
        plan(config)
    again = read(scene, config.resolved)
    assert again is not None
    assert again.digest == config.digest


@examples(8, 200)
@given(document=documents(2))
def test_a_dry_run_of_what_is_valid(scene: Path, document: str) -> None:
    config = read(scene, document)
    if config is not None and config.axes and config.methods.chosen:
        succeeds("sweep", "-j", "1", "--dry-run", "-o", "none.h5", scene)
