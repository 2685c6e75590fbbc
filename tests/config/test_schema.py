"""The JSON schema: complete, and true of every configuration of the repository."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from scenes import CONFIGURATIONS, ROOT, plain, scene_text, table, written

from gearstab.cli.configurations import schema as command
from gearstab.config import load
from gearstab.config.document.yaml import parse
from gearstab.config.schema import schema

SCHEMA = schema()
TYPES: dict[str, Any] = {
    "object": dict,
    "array": list,
    "string": str,
    "boolean": bool,
    "null": type(None),
    "number": (int, float),
    "integer": int,
}


def resolved(node: dict[str, Any]) -> dict[str, Any]:
    return resolved(SCHEMA["$defs"][node["$ref"].removeprefix("#/$defs/")]) if "$ref" in node else node


def of_type(value: Any, names: str | list[str]) -> bool:
    wanted = [names] if isinstance(names, str) else names
    return any(isinstance(value, TYPES[n]) and (n == "boolean" or not isinstance(value, bool)) for n in wanted)


def errors(value: Any, node: dict[str, Any], path: str = "$") -> Iterator[str]:
    """The part of JSON schema, draft 2020-12, that is used here."""
    node = resolved(node)
    if "type" in node and not of_type(value, node["type"]):
        yield f"{path}: no {node['type']}"
        return
    if "enum" in node and value not in node["enum"]:
        yield f"{path}: not in {node['enum']}"
    if "const" in node and value != node["const"]:
        yield f"{path}: not {node['const']}"
    for keyword, matches in (("anyOf", lambda n: n > 0), ("oneOf", lambda n: n == 1)):
        if keyword in node:
            found = [list(errors(value, option, path)) for option in node[keyword]]
            if not matches(sum(not e for e in found)):
                yield f"{path}: {keyword} of {found}"
    if isinstance(value, int | float) and not isinstance(value, bool):
        yield from number_errors(value, node, path)
    if isinstance(value, str) and "pattern" in node and not re.search(node["pattern"], value):
        yield f"{path}: not {node['pattern']}"
    if isinstance(value, list):
        yield from list_errors(value, node, path)
    if isinstance(value, dict):
        yield from mapping_errors(value, node, path)


def number_errors(value: float, node: dict[str, Any], path: str) -> Iterator[str]:
    good = {
        "minimum": value >= node.get("minimum", value),
        "maximum": value <= node.get("maximum", value),
        "exclusiveMinimum": value > node.get("exclusiveMinimum", value - 1),
        "exclusiveMaximum": value < node.get("exclusiveMaximum", value + 1),
    }
    yield from (f"{path}: {keyword}" for keyword, right in good.items() if not right)


def list_errors(value: list[Any], node: dict[str, Any], path: str) -> Iterator[str]:
    if not node.get("minItems", 0) <= len(value) <= node.get("maxItems", len(value)):
        yield f"{path}: {len(value)} items"
    first = node.get("prefixItems", [])
    for i, item in enumerate(value):
        if i < len(first) or "items" in node:
            yield from errors(item, first[i] if i < len(first) else node["items"], f"{path}.{i}")


def mapping_errors(value: dict[str, Any], node: dict[str, Any], path: str) -> Iterator[str]:
    yield from (f"{path}: no {name}" for name in node.get("required", []) if name not in value)
    for name, others in node.get("dependentRequired", {}).items():
        if name in value:
            yield from (f"{path}: no {other}" for other in others if other not in value)
    known = node.get("properties", {})
    for name, item in value.items():
        rule = known.get(name, node.get("additionalProperties", True))
        if rule is False:
            yield f"{path}: {name} is unknown"
        elif rule is not True:
            yield from errors(item, rule, f"{path}.{name}")


def test_every_configuration_of_the_repository_fits() -> None:
    assert CONFIGURATIONS
    for source in CONFIGURATIONS:
        assert list(errors(parse(source.read_text(), source.name).data, SCHEMA)) == [], source.name


def test_resolved_configurations_fit() -> None:
    """They stand in every result, and can be run again."""
    for source in CONFIGURATIONS:
        assert list(errors(parse(load(source).resolved, source.name).data, SCHEMA)) == [], source.name


@pytest.mark.parametrize(
    ("force", "fits"), [("1.5", 1), ("2 kN", 1), ("[1.5]", 1), ("[1, 2]", 0), ("[]", 0), ("{}", 0)]
)
def test_the_load_of_one_coordinate_may_be_a_number(force: str, fits: int) -> None:
    mesh = "{mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}"
    text = f"system: {{kind: gear_pair, equivalent_mass: 1, meshes: [{mesh}], load: {force}}}"
    assert (list(errors(parse(text, "x").data, SCHEMA)) == []) == bool(fits)


FORMS = scene_text("schema_forms")


def test_every_form_fits() -> None:
    assert list(errors(parse(FORMS, "x").data, SCHEMA)) == []


@pytest.mark.parametrize(("old", "new"), table("changes")["do_not_fit"])
def test_mistakes_do_not_fit(old: str, new: str) -> None:
    assert FORMS.count(old) == 1
    assert list(errors(parse(FORMS.replace(old, new), "x").data, SCHEMA))


def nodes(node: Any) -> Iterator[dict[str, Any]]:
    if isinstance(node, dict):
        yield node
    for inner in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from nodes(inner)


def test_every_reference_resolves_and_every_field_is_described() -> None:
    assert SCHEMA["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    for node in nodes(SCHEMA):
        if "$ref" in node:
            assert node["$ref"].removeprefix("#/$defs/") in SCHEMA["$defs"]
    for name, definition in SCHEMA["$defs"].items():
        assert definition["description"], name
        for field, spec in definition.get("properties", {}).items():
            assert spec.get("description"), f"{name}.{field}"


def test_the_command_prints_it() -> None:
    result = CliRunner().invoke(command)
    assert result.exit_code == 0
    assert json.loads(result.stdout) == SCHEMA


# --- the configurations and documents of the repository are what the program accepts


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
