"""Wrong configurations: each mistake is one line with place, path and remedy, and all come at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearstab.config import ConfigError, Problem, load

GOOD = """\
title: A train
system:
  kind: two_stage
  inertias: [1.0, 0.3, 4.0]
  input_shaft_stiffness: 0.5
  tooth_ratio: 1
  damping_ratio: 0
  meshes:
    - {name: first, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}
    - {name: second, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5, phasing: 0.0}
sweep:
  mesh_frequency: {start: 0.35, stop: 7.0, num: 40}
  epsilon: {start: 0.0, stop: 0.5, num: 11}
methods:
  floquet: {}
  boundaries: {}
"""

MATRICES = """\
system:
  kind: matrices
  mass: [[2, 0], [0, 1]]
  stiffness:
    - [3, -1]
    - [-1, 1]
  meshes:
    - {direction: [1, 1], mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}
sweep:
  mesh_frequency: [1, 2]
methods: {floquet: {}}
"""

RESPOND = """\
system: {kind: gear_pair, equivalent_mass: 1, meshes: [{mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}]}
respond:
  mesh_frequency: 2.0
  cycles: 3
  initial:
    displacement: [0.1]
"""

FIRST_MESH = "name: first, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5"
RANGE = "{start: 0.0, stop: 0.5, num: 11}"


def problems(folder: Path, text: str | bytes, *overrides: str) -> list[Problem]:
    path = folder / "case.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ConfigError) as caught:
        load(path, overrides)
    return caught.value.problems


def changed(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


# What is replaced by what, and where the one problem is reported with which words of message and remedy.
WRONG_VALUES = {
    "unknown section": ("methods:", "method: {}\nmethods:", 14, "method", "unknown key", "'methods'"),
    "section of a later version": ("methods:", "design: {}\nmethods:", 14, "design", "not available", "available: title"),
    "title": ("A train", "[1]", 1, "title", "must be a text", "quotes"),
    "unknown kind": ("two_stage", "two_stages", 3, "system.kind", "no kind", "'two_stage'"),
    "kind of a later version": ("two_stage", "planetary", 3, "system.kind", "'planetary' is not available", "gear_pair"),
    "missing kind": ("  kind: two_stage\n", "", 2, "system.kind", "is missing", "two_stage"),
    "missing key": ("  tooth_ratio: 1\n", "", 2, "system.tooth_ratio", "is missing", "Z2/Z4"),
    "empty number": ("tooth_ratio: 1", "tooth_ratio:", 6, "system.tooth_ratio", "must be a ratio", '"3/5"'),
    "misspelt key": ("damping_ratio", "damping_ration", 7, "system.damping_ration", "unknown key", "'damping_ratio'"),
    "truth value": ("stiffness: 0.5", "stiffness: true", 5, "system.input_shaft_stiffness", "must be a number", "N/m"),
    "text": ("stiffness: 0.5", "stiffness: soft", 5, "system.input_shaft_stiffness", "must be a number", "without"),
    "quoted number": ("stiffness: 0.5", "stiffness: '0.5'", 5, "system.input_shaft_stiffness", "without a unit", "N/m"),
    "wrong unit": ("0.5\n", '"5 kg"\n', 5, "system.input_shaft_stiffness", "wrong dimension", "a stiffness in N/m"),
    "unknown unit": ("0.5\n", '"5 foo"\n', 5, "system.input_shaft_stiffness", "unknown unit 'foo'", "N/m"),
    "unit without need": ("damping_ratio: 0", "damping_ratio: 2 m", 7, "system.damping_ratio", "dimensionless", "write 2"),
    "NaN": ("0.3, 4.0", ".nan, 4.0", 4, "system.inertias.1", "finite", "write a number"),
    "infinity": ("0.3, 4.0", "-.inf, 4.0", 4, "system.inertias.1", "finite", "write a number"),
    "overflow": ("0.3, 4.0", "1e999, 4.0", 4, "system.inertias.1", "finite", "write a number"),
    "huge integer": ("0.3, 4.0", "1" + "0" * 400 + ", 4.0", 4, "system.inertias.1", "finite", "write a number"),
    "negative mass": ("0.3, 4.0", "-0.3, 4.0", 4, "system.inertias.1", "must be > 0", "> 0"),
    "too few masses": ("[1.0, 0.3, 4.0]", "[1.0, 0.3]", 4, "system.inertias", "has 2 entries", "exactly 3"),
    "too many masses": ("4.0]", "4.0, 5.0]", 4, "system.inertias", "has 4 entries", "exactly 3"),
    "no list": ("[1.0, 0.3, 4.0]", "1.0", 4, "system.inertias", "must be a list", "[ ... ]"),
    "no mapping": ("- {" + FIRST_MESH + "}", "- first", 9, "system.meshes.0", "must be a mapping", "{ ... }"),
    "ratio that is no decimal": ("ratio: 1\n", "ratio: 0.66667\n", 6, "system.tooth_ratio", "exact", '"2/3"'),
    "ratio of zero": ("ratio: 1\n", "ratio: 0\n", 6, "system.tooth_ratio", "must be > 0", '"3/5"'),
    "ratio by zero": ("ratio: 1\n", "ratio: 3/0\n", 6, "system.tooth_ratio", "two integers", '"3/5"'),
    "negative ratio": ("ratio: 1\n", "ratio: -3/5\n", 6, "system.tooth_ratio", "two integers", '"3/5"'),
    "two ways of damping": (
        "  damping_ratio: 0\n",
        "  damping_ratio: 0\n  damping: {rayleigh: [0, 1]}\n",
        8,
        "system.damping",
        "given already",
        "keep one",
    ),
    "two forms of damping": (
        "damping_ratio: 0",
        "damping: {rayleigh: [0, 1], modal: [0, 0, 0]}",
        7,
        "system.damping.rayleigh",
        "modal is given already",
        "keep one",
    ),
    "no form of damping": ("damping_ratio: 0", "damping: {}", 7, "system.damping", "is missing", "add modal"),
    "too few modal ratios": ("damping_ratio: 0", "damping: {modal: [0.1]}", 7, "system.damping.modal", "1 entries", "3"),
    "contact ratio below 1": (
        FIRST_MESH, FIRST_MESH.replace("1.5", "0.9"), 9, "system.meshes.0.contact_ratio", "must be >= 1", ">= 1",
    ),
    "both stiffnesses": (
        FIRST_MESH, FIRST_MESH + ", max_stiffness: 2", 9, "system.meshes.0.max_stiffness", "given already", "keep one",
    ),
    "no stiffness": (
        FIRST_MESH, "epsilon: 0.3, contact_ratio: 1.5", 9, "system.meshes.0", "is missing", "mean_stiffness or max_stiffness",
    ),
    "epsilon and amplitude": (
        FIRST_MESH, FIRST_MESH + ", amplitude: 0.1", 9, "system.meshes.0.amplitude", "given already", "keep one",
    ),
    "waveform of a later version": (
        FIRST_MESH, FIRST_MESH + ", waveform: {kind: trapezoidal, ramp: 0.1}", 9, "system.meshes.0.waveform.kind",
        "'trapezoidal' is not available", "rectangular",
    ),
    "unknown waveform": (
        FIRST_MESH, FIRST_MESH + ", waveform: {kind: rectangle}", 9, "system.meshes.0.waveform.kind", "no waveform",
        "'rectangular'",
    ),
    "phasing of the first mesh": (
        FIRST_MESH, FIRST_MESH + ", phasing: 0.5", 9, "system.meshes.0.phasing", "unknown key", "only the second",
    ),
    "lag in a two-stage train": ("phasing: 0.0", "lag: 0.0", 10, "system.meshes.1.lag", "unknown key", "phasing = -lag"),
    "two meshes of one name": ("name: second", "name: first", 10, "system.meshes.1.name", "two meshes", "of its own"),
    "name with a dot": ("name: second", "name: a.b", 10, "system.meshes.1.name", "path", "without '.'"),
    "name that is an index": ("name: second", 'name: "1"', 10, "system.meshes.1.name", "path", "with a letter"),
    "flag that is no flag": (
        "  damping_ratio: 0\n", "  allow_negative_stiffness: maybe\n", 7, "system.allow_negative_stiffness",
        "must be true or false", "without quotes",
    ),
    "empty axis": (RANGE, "[]", 13, "sweep.epsilon", "without values", "give a list"),
    "axis without a value": (RANGE, "", 13, "sweep.epsilon", "without values", "give a list"),
    "unknown parameter": ("  epsilon:", "  epsilonn:", 13, "sweep.epsilonn", "unknown parameter", "'epsilon'"),
    "unknown mesh": (
        "  epsilon:", "  meshes.secnd.epsilon:", 13, "sweep.meshes.secnd.epsilon", "no mesh 'secnd'", "'meshes.second.epsilon'",
    ),
    "unknown entry": ("  epsilon:", "  inertias.3:", 13, "sweep.inertias.3", "no entry 3", "0 to 2"),
    "path to a list": ("  epsilon:", "  inertias:", 13, "sweep.inertias", "is a list", "inertias.0"),
    "path to a text": ("  epsilon:", "  kind:", 13, "sweep.kind", "not a number", "available"),
    "path into a number": ("  epsilon:", "  tooth_ratio.1:", 13, "sweep.tooth_ratio.1", "unknown", "'tooth_ratio'"),
    "no base value": ("  epsilon:", "  damping.modal.0:", 13, "sweep.damping.modal.0", "no such entry", "a base value"),
    "short name of no mesh": ("  epsilon:", "  lag:", 13, "sweep.lag", "no mesh", "phasing"),
    "rival of the short name": ("  epsilon:", "  amplitude:", 13, "sweep.amplitude", "no mesh has", "epsilon"),
    "zero values": (RANGE, "{start: 0, stop: 1, num: 0}", 13, "sweep.epsilon.num", "must be >= 1", ">= 1"),
    "half a value": (RANGE, "{start: 0, stop: 1, num: 2.5}", 13, "sweep.epsilon.num", "whole number", "decimal point"),
    "too many values": (RANGE, "{start: 0, stop: 1, num: 1e12}", 13, "sweep.epsilon.num", "<= 1e+08", "<="),
    "no stop": (RANGE, "{start: 0, num: 3}", 13, "sweep.epsilon.stop", "is missing", "add stop"),
    "neither num nor step": (RANGE, "{start: 0, stop: 1}", 13, "sweep.epsilon", "num or step is missing", "num"),
    "num and step": (RANGE, "{start: 0, stop: 1, num: 3, step: 1}", 13, "sweep.epsilon", "num and step are given", "num"),
    "unknown key of a range": (RANGE, "{start: 0, stop: 1, nun: 3, step: 1}", 13, "sweep.epsilon.nun", "unknown", "'num'"),
    "step of wrong sign": (RANGE, "{start: 0, stop: 1, step: -0.1}", 13, "sweep.epsilon.step", "lead from 0 to 1", "positive"),
    "zero step": (RANGE, "{start: 0, stop: 1, step: 0}", 13, "sweep.epsilon.step", "lead from 0 to 1", "positive"),
    "tiny step": (RANGE, "{start: 0, stop: 1, step: 1e-12}", 13, "sweep.epsilon.step", "more than", "larger"),
    "log from zero": (
        RANGE, "{start: 0, stop: 1, num: 3, spacing: log}", 13, "sweep.epsilon.start", "> 0 with log", "spacing: linear",
    ),
    "log with step": (
        RANGE, "{start: 1, stop: 2, step: 1, spacing: log}", 13, "sweep.epsilon.step", "takes no step", "num",
    ),
    "unknown spacing": (
        RANGE, "{start: 1, stop: 2, num: 1, spacing: logg}", 13, "sweep.epsilon.spacing", "no spacing", "'log'",
    ),
    "end out of range": (RANGE, "{start: -0.1, stop: 1, num: 3}", 13, "sweep.epsilon.start", "must be >= 0", ">= 0"),
    "entry out of range": (RANGE, "\n  - 0.1\n  - 0.2\n  - -1\n", 16, "sweep.epsilon.2", "must be >= 0", ">= 0"),
    "entry that is no number": (RANGE, "[0.1, [0.2]]", 13, "sweep.epsilon.1", "must be a number", "write a number"),
    "frequency of zero": ("start: 0.35", "start: 0", 12, "sweep.mesh_frequency.start", "must be > 0", "> 0"),
    "frequency in metres": ("start: 0.35", "start: 1 m", 12, "sweep.mesh_frequency.start", "dimension", "rad/s"),
    "range of a ratio": ("  epsilon:", "  tooth_ratio:", 13, "sweep.tooth_ratio", "has no range", "give a list"),
    "axes that set the same": (
        f"  epsilon: {RANGE}", "  epsilon: [0.1]\n  meshes.1.epsilon: [0.1]", 14, "sweep.meshes.1.epsilon",
        "sets meshes.1.epsilon, as sweep.epsilon", "one of the two",
    ),
    "tie without targets": (f"  epsilon: {RANGE}", "  a: {values: [1]}", 13, "sweep.a.targets", "list of", "targets:"),
    "tie of an unknown parameter": (
        f"  epsilon: {RANGE}", "  a: {targets: [inertias.0, inertia.1], values: [1]}", 13, "sweep.a.targets.1",
        "unknown parameter", "'inertias.1'",
    ),
    "tie with values for one target": (
        f"  epsilon: {RANGE}", "  a: {targets: [inertias.0, inertias.1], values: [[1, 2]]}", 13, "sweep.a.values",
        "2 targets, but values for 1", "one list for each",
    ),
    "tie of different lengths": (
        f"  epsilon: {RANGE}", "  a: {targets: [inertias.0, inertias.1], values: [[1, 2], [1]]}", 13, "sweep.a.values",
        "2, 1 values", "as many",
    ),
    "tie of the mesh frequency": (
        f"  epsilon: {RANGE}", "  a: {targets: [mesh_frequency], values: [1]}", 13, "sweep.a.targets.0", "on its own", "axis",
    ),
    "name of an axis": (
        f"  epsilon: {RANGE}", "  a/b: {targets: [epsilon], values: [0.1]}", 13, "sweep.a/b", "cannot be", "another name",
    ),
    "name that results use": (
        f"  epsilon: {RANGE}", "  tongue: {targets: [epsilon], values: [0.1]}", 13, "sweep.tongue", "cannot be", "another",
    ),
    "label used twice": (
        f"  epsilon: {RANGE}", "  case:\n  - {label: a, epsilon: 0}\n  - {label: a, epsilon: 1}", 15, "sweep.case.1.label",
        "used twice", "of its own",
    ),
    "case that sets nothing": (f"  epsilon: {RANGE}", "  case: [{label: a}]", 13, "sweep.case", "set nothing", "set par"),
    "case of an unknown parameter": (
        f"  epsilon: {RANGE}", "  case:\n  - {label: a, epsilon: 0}\n  - {label: b, epsilon: 0, eps: 1}", 15,
        "sweep.case.1.eps", "unknown parameter", "'epsilon'",
    ),
    "case out of range": (
        f"  epsilon: {RANGE}", "  case:\n  - {label: a, epsilon: 0}\n  - {label: b, epsilon: -1}", 15,
        "sweep.case.1.epsilon", "must be >= 0", ">= 0",
    ),
    "no axes": (f"  mesh_frequency: {{start: 0.35, stop: 7.0, num: 40}}\n  epsilon: {RANGE}", "", 11, "sweep", "no axes", "add"),
    "unknown method": ("  floquet:", "  floquett:", 15, "methods.floquett", "unknown key", "'floquet'"),
    "unknown option": ("floquet: {}", "floquet: {exponent: true}", 15, "methods.floquet.exponent", "unknown", "'exponents'"),
    "order of a later version": ("  floquet: {}", "  perturbation: {order: 2}", 15, "methods.perturbation.order", "'2' is not", "1"),
    "order that does not exist": ("  floquet: {}", "  perturbation: {order: 7}", 15, "methods.perturbation.order", "no order", "1"),
    "no harmonics": ("  floquet: {}", "  perturbation: {harmonics: 0}", 15, "methods.perturbation.harmonics", ">= 1", "1"),
    "tolerance of zero": ("boundaries: {}", "boundaries: {tolerance: 0}", 16, "methods.boundaries.tolerance", "> 0", "> 0"),
    "text for a number": (
        "boundaries: {}", "boundaries: {width_floor: '1e-6'}", 16, "methods.boundaries.width_floor", "not a text", "quotes",
    ),
    "no methods": ("  floquet: {}\n  boundaries: {}\n", "", 14, "methods", "names no method", "floquet"),
    "softer level": (
        "stop: 0.5", "stop: 1.25", 13, "sweep.epsilon", "'first' has the softer level -0.25 <= 0 at epsilon 1.25",
        "allow_negative_stiffness",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "path", "message", "hint"), WRONG_VALUES.values(), ids=WRONG_VALUES)
def test_wrong_value(tmp_path: Path, old: str, new: str, line: int, path: str, message: str, hint: str) -> None:
    first = problems(tmp_path, changed(GOOD, old, new))[0]
    assert (first.line, first.path) == (line, path)
    assert message in first.message
    assert hint in first.hint
    assert str(first).startswith(f"{tmp_path / 'case.yaml'}:{line}: {path}: ")
    assert "\n" not in str(first)


BROKEN_FILES = {
    "empty": (b"", 1, "is empty", "write the sections"),
    "comments only": (b"# nothing\n", 1, "is empty", "write the sections"),
    "list": (b"- a\n- b\n", 1, "must be a mapping", "write the sections"),
    "text": (b"hello\n", 1, "must be a mapping", "write the sections"),
    "not UTF-8": (b"title: ok\n# caf\xe9\n", 2, "not UTF-8", "save the file in UTF-8"),
    "control character": (b"title: ok\nsystem: \x01\n", 2, "control character 0x1", "remove"),
    "tab": (b"system:\n\tkind: two_stage\n", 2, "no valid YAML", "spaces, not tabs"),
    "open bracket": (b"system:\n  inertias: [1, 2\n  kind: x\n", 3, "flow sequence that begins in line 2", "brackets"),
    "open quote": (b'title: "a\nsystem: {}\n', 3, "no valid YAML", "quotes"),
    "colon in a text": (b"title: a: b\n", 1, "mapping values are not allowed", "quote texts"),
    "unknown alias": (b"system: *base\n", 1, "undefined alias", "with &"),
    "alias of itself": (b"system: &a [*a]\n", 1, "an alias stands inside", "write the values out"),
    "reserved character": (b"title: @a\n", 1, "cannot start any token", "quotes"),
    "second document": (b"title: a\n---\ntitle: b\n", 2, "second document", "one configuration a file"),
    "duplicate key": (b"title: a\nsystem: {}\ntitle: b\n", 3, "duplicate key, given in line 1", "remove one"),
    "key that is a list": (b"title: a\n? [1, 2]\n: 3\n", 2, "a key is a list", "plain text"),
    "unknown tag": (b"title: !python a\n", 1, "tag !python is not known", "remove"),
    "merge of a text": (b"title: a\n<<: b\n", 1, "merges mappings only", "refer to a mapping"),
    "too deep": (b"a: " + b"[" * 3000, None, "nested too deeply", "flatter"),
}


@pytest.mark.parametrize(("content", "line", "message", "hint"), BROKEN_FILES.values(), ids=BROKEN_FILES)
def test_broken_file(tmp_path: Path, content: bytes, line: int, message: str, hint: str) -> None:
    found = [p for p in problems(tmp_path, content) if message in p.message]
    assert [p.line for p in found] == [line]
    assert hint in found[0].hint


def test_file_that_is_not_there(tmp_path: Path) -> None:
    for name, message in (("none.yaml", "no such file"), (".", "is a folder")):
        with pytest.raises(ConfigError, match=message) as caught:
            load(tmp_path / name)
        assert str(caught.value).startswith(str(tmp_path / name) + ": ")


WRONG_MATRICES = {
    "not symmetric": ("[-1, 1]\n", "[-2, 1]\n", 5, "system.stiffness.0.1", "not symmetric", "1.0 equal"),
    "not square": ("[-1, 1]\n", "[-1]\n", 6, "system.stiffness.1", "has 1 entries", "give 2"),
    "of another size": ("[3, -1]\n    - [-1, 1]", "[3]", 4, "system.stiffness", "has 1 rows", "2 rows of 2"),
    "singular mass": ("[0, 1]]", "[0, 0]]", 3, "system.mass", "not positive definite", "positive mass"),
    "negative stiffness": ("[3, -1]", "[-3, -1]", 4, "system.stiffness", "negative eigenvalue", "allow_negative"),
    "direction": ("[1, 1],", "[1, 1, 1],", 8, "system.meshes.0.direction", "has 3 entries", "give 2"),
    "direction of zeros": ("[1, 1],", "[0, 0],", 8, "system.meshes.0.direction", "only zeros", "move"),
    "phasing": ("contact_ratio: 1.5", "contact_ratio: 1.5, phasing: 0", 8, "system.meshes.0.phasing", "unknown", "lag ="),
    "no matrix": ("  mass: [[2, 0], [0, 1]]\n", "", 1, "system", "mass is missing", ".npz"),
    "text in a matrix": ("[[2, 0]", "[[2, x]", 3, "system.mass.0.1", "must be a number", "quotes"),
    "damping": ("meshes:", "damping: [[1, 0]]\n  meshes:", 7, "system.damping.matrix", "has 1 rows", "2 rows"),
    "coordinates": ("meshes:", "coordinates: [a, a]\n  meshes:", 7, "system.coordinates", "same name", "its own"),
    "no meshes": (
        "meshes:\n    - {direction: [1, 1], mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}", "meshes: []", 7,
        "system.meshes", "has 0 entries", "at least 1",
    ),
    "mass along an axis": (
        "mesh_frequency: [1, 2]", "mesh_frequency: [1, 2]\n  mass.0.1: {start: 0, stop: 2, num: 9}", 3, "system.mass",
        "not positive definite along the axis mass.0.1", "positive mass",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "path", "message", "hint"), WRONG_MATRICES.values(), ids=WRONG_MATRICES)
def test_wrong_matrices(tmp_path: Path, old: str, new: str, line: int, path: str, message: str, hint: str) -> None:
    first = problems(tmp_path, changed(MATRICES, old, new))[0]
    assert (first.line, first.path) == (line, path)
    assert message in first.message
    assert hint in first.hint


WRONG_RESPONSES = {
    "no frequency": ("  mesh_frequency: 2.0\n", "", 2, "respond.mesh_frequency", "is missing", "rad/s"),
    "frequency of zero": ("2.0", "0", 3, "respond.mesh_frequency", "must be > 0", "> 0"),
    "no length": ("  cycles: 3\n", "", 2, "respond", "duration or cycles is missing", "add"),
    "two lengths": ("cycles: 3", "cycles: 3\n  duration: 1", 4, "respond.cycles", "duration is given", "keep one"),
    "rest": ("[0.1]", "[0]", 5, "respond.initial", "stays at rest", "not zero"),
    "size": ("[0.1]", "[0.1, 0.2]", 6, "respond.initial.displacement", "has 2 entries", "give 1"),
    "samples": ("cycles: 3", "cycles: 3\n  samples_per_cycle: 1", 5, "respond.samples_per_cycle", ">= 2", ">= 2"),
    "unit": ("[0.1]", '["1 kg"]', 6, "respond.initial.displacement.0", "wrong dimension", "a length in m"),
    "softer level at the base values": (
        "epsilon: 0.1", "epsilon: 1.5", 1, "system.meshes.0.epsilon", "softer level -0.5", "allow_negative",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "line", "path", "message", "hint"), WRONG_RESPONSES.values(), ids=WRONG_RESPONSES
)
def test_wrong_response(tmp_path: Path, old: str, new: str, line: int, path: str, message: str, hint: str) -> None:
    first = problems(tmp_path, changed(RESPOND, old, new))[0]
    assert (first.line, first.path) == (line, path)
    assert message in first.message
    assert hint in first.hint


WRONG_OVERRIDES = {
    "no value": ("epsilon", "no PATH=VALUE", "write for example"),
    "unknown key": ("damping_ratoi=1", "unknown key", "'damping_ratio'"),
    "out of range": ("epsilon=-1", "must be >= 0", ">= 0"),
    "broken YAML": ("epsilon=[1", "no valid YAML", "brackets"),
    "unknown mesh": ("meshes.third.epsilon=1", "no entry 'third'", "first, second"),
    "unknown index": ("meshes.2.epsilon=1", "no entry '2'", "0 to 1"),
    "into a number": ("tooth_ratio.x=1", "single value", "set system.tooth_ratio itself"),
    "mesh frequency": ("mesh_frequency=1", "no part of the system", "sweep.mesh_frequency"),
    "rival": ("amplitude=1", "no mesh has amplitude", "epsilon"),
    "axis": ("sweep.epsilon.num=0", "must be >= 1", ">= 1"),
    "new axis": ("sweep.meshes.first.epsiln=[0]", "unknown parameter", "'meshes.first.epsilon'"),
}


@pytest.mark.parametrize(("override", "message", "hint"), WRONG_OVERRIDES.values(), ids=WRONG_OVERRIDES)
def test_wrong_override(tmp_path: Path, override: str, message: str, hint: str) -> None:
    first = problems(tmp_path, GOOD, override)[0]
    assert str(first).startswith(f"--set {override.partition('=')[0]}: ")
    assert message in first.message
    assert hint in first.hint


def test_methods_that_need_an_axis(tmp_path: Path) -> None:
    text = changed(GOOD, "  mesh_frequency: {start: 0.35, stop: 7.0, num: 40}\n", "")
    found = problems(tmp_path, text)
    assert [(p.line, p.path) for p in found] == [(14, "methods.floquet"), (15, "methods.boundaries")]
    assert all("needs a mesh_frequency axis" in p.message for p in found)


@pytest.mark.parametrize(
    ("section", "path"), [("sweep:\n  epsilon: [0.1]\n", "methods"), ("methods: {floquet: }\n", "sweep")]
)
def test_sweep_and_methods_go_together(tmp_path: Path, section: str, path: str) -> None:
    text = GOOD[: GOOD.index("sweep:")] + section
    assert (1, path, "is missing") in [(p.line, p.path, p.message) for p in problems(tmp_path, text)]


def test_sections_that_a_command_needs(tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    path.write_text(GOOD)
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


def test_an_option_of_a_later_version_hides_what_follows_from_it(tmp_path: Path) -> None:
    text = (
        "system:\n  kind: gear_pair\n  formulation: energy_conserving\n  teeth: [24, 96]\n  inertias: [2.89e-3, 0.7402]\n"
        "  meshes: [{mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}]\n"
    )
    assert [(p.line, p.path) for p in problems(tmp_path, text)] == [(3, "system.formulation")]


def test_long_values_are_shortened(tmp_path: Path) -> None:
    found = problems(tmp_path, changed(GOOD, "kind: two_stage", "kind: " + "x" * 500))[0]
    assert len(str(found)) < len(str(tmp_path)) + 250
