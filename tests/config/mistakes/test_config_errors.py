"""Wrong configurations: each mistake is one line with place, path and remedy, and all come at once."""

import os
from pathlib import Path

import pytest
from scenes import problems, scene_text, written

from gearstab.config import ConfigError, load

GOOD = scene_text("config_errors")


def changed(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


BROKEN_FILES = {
    "empty": (b"", 1, "empty"),
    "comments only": (b"# nothing\n", 1, "empty"),
    "list": (b"- a\n- b\n", 1, "wrong_type"),
    "text": (b"hello\n", 1, "wrong_type"),
    "not UTF-8": (b"title: ok\n# caf\xe9\n", 2, "encoding"),
    "control character": (b"title: ok\nsystem: \x01\n", 2, "character"),
    "tab": (b"system:\n\tkind: two_stage\n", 2, "syntax"),
    "open bracket": (b"system:\n  inertias: [1, 2\n  kind: x\n", 3, "syntax"),
    "open quote": (b'title: "a\nsystem: {}\n', 3, "syntax"),
    "colon in a text": (b"title: a: b\n", 1, "syntax"),
    "unknown alias": (b"system: *base\n", 1, "syntax"),
    "alias of itself": (b"system: &a [*a]\n", 1, "alias"),
    "reserved character": (b"title: @a\n", 1, "syntax"),
    "second document": (b"title: a\n---\ntitle: b\n", 2, "syntax"),
    "duplicate key": (b"title: a\nsystem: {}\ntitle: b\n", 3, "duplicate_key"),
    "key that is a list": (b"title: a\n? [1, 2]\n: 3\n", 2, "syntax"),
    "unknown tag": (b"title: !python a\n", 1, "tag"),
    "merge of a text": (b"title: a\n<<: b\n", 1, "syntax"),
    "unknown tag of a mapping": (
        b"title: a\nsystem: !!set {a}\n",
        2,
        "tag",
    ),
    "escape beyond Unicode": (b'title: a\nsystem: "\\U00110000"\n', 2, "syntax"),
    "escape far beyond": (b'title: "\\UFFFFFFFF"\n', 1, "syntax"),
    "half of a character": (b'title: "\\uD800"\nsystem: {}\n', 1, "character"),
    "half of a character as a key": (b'title: a\n"\\uDFFF": {}\n', 2, "character"),
    "end of a text": (b'title: "a\\0b"\nsystem: {}\n', 1, "character"),
    "directive inside": (b"title: a\n%YAML 1.2\nsystem: {}\n", 3, "syntax"),
    "directive without document": (b"%YAML 1.2\nsystem: {}\n", 2, "syntax"),
    "too deep": (b"a: " + b"[" * 3000, None, "nesting"),
}


BOMB = "a0: &a0 [1, 2]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 30))
MERGES = "a0: &a0 {x: 1}\n" + "".join(f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}\n" for i in range(1, 30))
LADDER = "a0: &a0 [1]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}]\n" for i in range(1, 1200))
CIRCLES = "a: &a\n  b: &b [*a, *b]\n  c: [*b, *a]\n"
ALIASES = {
    "lists": (BOMB, None, "alias"),
    "merges": (MERGES, None, "alias"),
    "ladder": (LADDER, None, "nesting"),
    "circles": (CIRCLES, 1, "alias"),
}


@pytest.mark.parametrize(("text", "line", "code"), ALIASES.values(), ids=ALIASES)
def test_aliases_that_grow_without_bounds(tmp_path: Path, text: str, line: int | None, code: str) -> None:
    (found,) = problems(tmp_path, text)
    assert (found.line, found.code) == (line, code)
    assert found.hint
    assert "\n" not in str(found)


@pytest.mark.parametrize(("content", "line", "code"), BROKEN_FILES.values(), ids=BROKEN_FILES)
def test_broken_file(tmp_path: Path, content: bytes, line: int, code: str) -> None:
    found = [p for p in problems(tmp_path, content) if p.code == code]
    assert [p.line for p in found] == [line]
    assert found[0].hint


LONG_NUMBERS = {"hexadecimal": "0x" + "f" * 5000, "octal": "0o" + "7" * 5000, "decimal": "9" * 5000}


@pytest.mark.parametrize("text", LONG_NUMBERS.values(), ids=LONG_NUMBERS)
@pytest.mark.parametrize("key", ["input_shaft_stiffness: 0.5", "tooth_ratio: 1", "title: A train", "num: 40"])
def test_numbers_of_thousands_of_digits(tmp_path: Path, key: str, text: str) -> None:
    (found,) = problems(tmp_path, GOOD.replace(key, f"{key.partition(':')[0]}: {text}"))
    assert len(str(found)) < 1000


def test_an_index_is_made_of_digits(tmp_path: Path) -> None:
    (found,) = problems(tmp_path, GOOD.replace("sweep:\n", "sweep:\n  inertias.²: [1, 2]\n"))
    assert found.path == "sweep.inertias.²"
    with pytest.raises(ConfigError):
        load(tmp_path / "case.yaml", ["inertias.²=1"])


def test_a_configuration_has_a_few_megabytes_at_most(tmp_path: Path) -> None:
    (found,) = problems(tmp_path, b"#" * 64_000_000)
    assert (found.line, found.path) == (None, "")
    assert "64 MB" in found.message


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name")
def test_a_pipe_is_no_configuration(tmp_path: Path) -> None:
    """Reading one would wait for ever."""
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(ConfigError, match="no regular file"):
        load(tmp_path / "pipe.yaml")


def test_file_that_is_not_there(tmp_path: Path) -> None:
    for name, message in (("none.yaml", "no such file"), (".", "is a folder")):
        with pytest.raises(ConfigError, match=message) as caught:
            load(tmp_path / name)
        assert str(caught.value).startswith(str(tmp_path / name) + ": ")


def test_methods_that_need_an_axis(tmp_path: Path) -> None:
    text = changed(GOOD, "  mesh_frequency: {start: 0.35, stop: 7.0, num: 40}\n", "")
    found = problems(tmp_path, text + "  required_damping: {}\n  perturbation: {}\n")
    needing = ["floquet", "boundaries", "required_damping"]
    assert [(p.line, p.path) for p in found] == [(14 + k, f"methods.{name}") for k, name in enumerate(needing)]
    assert {p.code for p in found} == {"missing"}


@pytest.mark.parametrize(
    ("section", "path"), [("sweep:\n  epsilon: [0.1]\n", "methods"), ("methods: {floquet: }\n", "sweep")]
)
def test_sweep_and_methods_go_together(tmp_path: Path, section: str, path: str) -> None:
    text = GOOD[: GOOD.index("sweep:")] + section
    assert (1, path, "missing") in [(p.line, p.path, p.code) for p in problems(tmp_path, text)]


def test_sections_that_a_command_needs(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    load(path, needs=("sweep", "methods"))
    with pytest.raises(ConfigError, match="respond: is missing; add the section respond"):
        load(path, needs=("respond",))


def test_all_mistakes_at_once_by_line(tmp_path: Path) -> None:
    text = GOOD
    for old, new in [
        ("A train", "5"),
        ("0.3, 4.0", "-1, .nan"),
        ("damping_ratio", "dampng_ratio"),
        ("name: second, mean_stiffness: 1.0", "name: first"),
        ("epsilon: {", "epsilom: {"),
        ("floquet: {}", "floquet: {tolerance: 2}"),
    ]:
        text = changed(text, old, new)
    found = [(p.line, p.path) for p in problems(tmp_path, text)]
    assert found == [
        (1, "title"),
        (4, "system.inertias.1"),
        (4, "system.inertias.2"),
        (7, "system.dampng_ratio"),
        (10, "system.meshes.1"),
        (10, "system.meshes.1.name"),
        (13, "sweep.epsilom"),
        (15, "methods.floquet.tolerance"),
    ]


def test_a_pair_of_gears_has_no_meshes_and_says_what_it_has(tmp_path: Path) -> None:
    text = (
        "system:\n  kind: gear_pair\n  formulation: energy_conserving\n"
        "  teeth: [24, 96]\n  inertias: [2.89e-3, 0.7402]\n"
        "  meshes: [{mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}]\n"
    )
    found = problems(tmp_path, text)
    assert {p.path for p in found} == {"system", "system.torsional_stiffness", "system.torque", "system.meshes"}
    (meshes,) = [p for p in found if p.path == "system.meshes"]
    assert "torsional_stiffness" in meshes.hint


def test_long_values_are_shortened(tmp_path: Path) -> None:
    found = problems(tmp_path, changed(GOOD, "kind: two_stage", "kind: " + "x" * 500))[0]
    assert len(str(found)) < len(str(tmp_path)) + 250
