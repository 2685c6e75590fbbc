"""The configurations and documents of the repository are what the program accepts."""

import re
from pathlib import Path

import pytest
from scenes import CONFIGURATIONS, ROOT, plain, written

from gearstab.config import load
from gearstab.config.schema import schema

DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
RUN = {"walks.md", "pipelines.md"}
"""Pages whose own tests run their configurations, beside the files that these need."""


def yaml_blocks(document: Path) -> list[str]:
    return re.findall(r"^```yaml\n(.*?)^```", document.read_text(), re.M | re.S)


def scenes() -> list[tuple[str, str]]:
    """The complete configurations among the YAML blocks of the documents."""
    blocks = [(f"{d.name}:{k}", b) for d in DOCUMENTS if d.name not in RUN for k, b in enumerate(yaml_blocks(d))]
    return [(name, block) for name, block in blocks if re.search(r"^system:", block, re.M)]


def properties(node: object) -> set[str]:
    """All names of properties in a JSON schema."""
    if isinstance(node, list):
        return set().union(*map(properties, node)) if node else set()
    if not isinstance(node, dict):
        return set()
    return set(node.get("properties", {})) | set().union(*map(properties, node.values()), set())


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_configuration_is_valid(path: Path) -> None:
    config = load(path)
    assert config.title
    assert sum([bool(config.axes), config.respond is not None, config.design is not None]) == 1


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_configuration_says_what_it_shows(path: Path) -> None:
    assert path.read_text().startswith("# ")


def test_all_figures_of_the_paper_are_there() -> None:
    found = {p.stem for p in CONFIGURATIONS if p.parent.name == "lin_parker_2002"}
    assert found == {f"fig{n}" for n in ("3", "5", "6a", "6b", "7a", "7b", "8a", "8b", "9a", "9b")}


def test_the_gear_of_parker_2009_is_that_of_table_1() -> None:
    """Everything as printed but k_cu, which is 1e11 N/m."""
    paths = [path for path in CONFIGURATIONS if path.parent.name == "parker_2009"]
    assert {"table1", "fig3", "fig4", "contact_ratio", "gamma_sr", "ring_harmonics", "rigid_ring"} == {
        p.stem for p in paths
    }
    for path in paths:
        p = plain(load(path).system)
        assert p["masses"] == {"ring": 6.35, "carrier": 5.43, "sun": 0.4, "planet": 4.0}, path
        assert p["inertias"] == {"carrier": 6.0, "sun": 2.5, "planet": 2.0}, path
        stiff = {"carrier", "sun", "planet", "sun_rotation"}
        assert {name for name, k in p["supports"].items() if k == 5e11} == stiff, path
        assert p["supports"]["carrier_rotation"] == 1e11, path
        assert [p["meshes"][gear]["contact_ratio"] for gear in ("sun", "ring")] == [1.4, 1.6], path
        assert p["phases"]["sun"] == ([0, 0.25, 0.5, 0.75] if path.stem == "fig4" else [0, 0, 0, 0]), path


def test_the_parameters_are_those_of_table_1() -> None:
    for path in CONFIGURATIONS:
        if path.parent.name == "lin_parker_2002":
            parameters = plain(load(path).system)
            assert parameters["inertias"] == [1.0, 0.3, 4.0], path
            assert parameters["input_shaft_stiffness"] == 0.5, path


def test_the_documents_show_configurations() -> None:
    assert {name.split(":")[0] for name, _ in scenes()} >= {"README.md", "configuration.md"}


@pytest.mark.parametrize(("name", "block"), scenes(), ids=[name for name, _ in scenes()])
def test_configurations_in_the_documents_are_valid(name: str, block: str, tmp_path: Path) -> None:
    path = written(tmp_path, block, "scene.yaml")
    load(path)


def test_every_key_is_documented() -> None:
    text = (ROOT / "docs" / "configuration.md").read_text()
    quoted = re.findall(r"```.*?```|`[^`]+`", text, re.S)
    written = set(re.findall(r"\w+", " ".join(quoted)))
    assert properties(schema()) <= written


def test_links_in_the_documents_lead_somewhere() -> None:
    for document in DOCUMENTS:
        for target in re.findall(r"\]\(([^)#]+)\)", document.read_text()):
            if "://" not in target:
                assert (document.parent / target).exists(), f"{document.name}: {target}"
