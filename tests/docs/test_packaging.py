"""Requirements of an installation: dependencies, lock, version, build with and without a compiler, make targets."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.metadata import requires
from importlib.util import find_spec
from pathlib import Path

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version
from ruamel.yaml import YAML

import gearstab

MODULES = {
    "ruamel-yaml": {"ruamel"},
    "matplotlib": {"matplotlib", "mpl_toolkits"},
    "pydantic": {"pydantic", "pydantic_core"},
}
"""The top-level modules of a distribution where they are not just its name."""
ENGINES = {"h5netcdf"}
"""Dependencies that another one imports by name: xarray's engine."""


@pytest.fixture(scope="module")
def project(root: Path) -> dict:
    return tomllib.loads((root / "pyproject.toml").read_text())["project"]


def requirements(lines: list[str]) -> dict[str, Requirement]:
    return {canonicalize_name(r.name): r for r in map(Requirement, lines)}


def imported_modules(folder: Path) -> set[str]:
    found = set()
    for file in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                found.add(node.module.split(".")[0])
    return found


def locked(root: Path, lock: str = "requirements") -> dict[str, list[tuple[str, str]]]:
    """Name -> [(version, environment marker)] of a lock."""
    pins: dict[str, list[tuple[str, str]]] = {}
    for line in (root / "scripts" / f"{lock}.lock").read_text().splitlines():
        if found := re.match(r"([A-Za-z0-9._-]+)==(\S+)(?: ; (.*?))? \\$", line):
            pins.setdefault(canonicalize_name(found[1]), []).append((found[2], found[3] or ""))
    return pins


def test_imports_are_declared_and_dependencies_are_used(root: Path, project: dict) -> None:
    declared = {name: MODULES.get(name, {name}) for name in requirements(project["dependencies"])}
    used = imported_modules(root / "gearstab") - set(sys.stdlib_module_names) - {"gearstab"}
    extras = project["optional-dependencies"]
    # dask comes with distributed, and flint is the name of python-flint
    optional = {*requirements(extras["html"]), *requirements(extras["cluster"]), "dask", "flint"}
    assert used <= optional.union(*declared.values())
    assert {name for name, modules in declared.items() if not modules & used} <= ENGINES


def test_each_dependency_has_its_reason(root: Path) -> None:
    text = (root / "pyproject.toml").read_text()
    block = text[text.index("\ndependencies = [") : text.index("[project.scripts]")]
    lines = [line for line in block.splitlines() if line.startswith('    "')]
    assert lines
    assert all(re.search(r'",\s+# \w+', line) for line in lines)


def test_lock_pins_what_the_project_asks_for(root: Path, project: dict) -> None:
    pins = locked(root)
    extras = project["optional-dependencies"]
    wanted = requirements([*project["dependencies"], *extras["dev"], *extras["build"]])
    assert wanted.keys() <= pins.keys()
    for name, requirement in wanted.items():
        assert all(requirement.specifier.contains(version) for version, _ in pins[name]), name


def test_the_oldest_versions_allowed_are_those_tested(root: Path, project: dict) -> None:
    lines = (root / "scripts" / "oldest.txt").read_text().splitlines()
    tested = requirements([line for line in lines if line and not line.startswith("#")])
    for name, requirement in requirements(project["dependencies"]).items():
        (floor,), (pin,) = requirement.specifier, tested[name].specifier
        assert (floor.operator, pin.operator) == (">=", "=="), name
        assert Version(floor.version) == Version(pin.version), name


CONDA = {"python-isal": "isal", "matplotlib-base": "matplotlib"}
"""Names that conda-forge has for what pyproject.toml names otherwise."""


def test_the_recipe_for_conda_asks_for_the_same(root: Path, project: dict) -> None:
    recipe = YAML(typ="safe").load((root / "scripts" / "conda" / "recipe.yaml").read_text())
    assert recipe["context"]["version"] == gearstab.__version__
    assert (recipe["about"]["license"], recipe["about"]["summary"]) == (project["license"], project["description"])
    assert recipe["build"]["skip"] == f'match(python, "<{project["requires-python"].removeprefix(">=")}")'
    (built,) = tomllib.loads((root / "pyproject.toml").read_text())["build-system"]["requires"]
    assert built.replace(">=", " >=") in recipe["requirements"]["host"]
    run = [entry["then"] if isinstance(entry, dict) else entry for entry in recipe["requirements"]["run"]]
    asked = {CONDA.get(name, name): floor for name, _, floor in (line.partition(" ") for line in run)}
    assert asked.pop("python") == ""
    wanted = {
        name.replace("ruamel-yaml", "ruamel.yaml"): r for name, r in requirements(project["dependencies"]).items()
    }
    assert asked == {name: str(requirement.specifier) for name, requirement in wanted.items()}
    (some,) = (entry["if"] for entry in recipe["requirements"]["run"] if isinstance(entry, dict))
    assert str(wanted["isal"].marker).split('"')[1].lower().replace("amd64 ", "").split() == some.split(" or ")


def entries(root: Path, lock: str) -> list[str]:
    """The pinned packages of a lock, each with its hashes."""
    text = (root / "scripts" / f"{lock}.lock").read_text()
    return [entry.strip() for entry in re.split(r"\n(?=\S)", text) if "==" in entry.splitlines()[0]]


@pytest.mark.parametrize("lock", ["requirements", "runtime"])
def test_lock_is_hashed_and_names_no_host(root: Path, lock: str) -> None:
    assert entries(root, lock)
    assert all("--hash=sha256:" in entry for entry in entries(root, lock))
    assert "://" not in (root / "scripts" / f"{lock}.lock").read_text()


def test_the_lock_of_the_program_is_a_part_of_the_whole_one(root: Path) -> None:
    assert set(entries(root, "runtime")) < set(entries(root, "requirements"))


def test_the_lock_of_the_program_holds_what_it_needs_and_no_more(root: Path, project: dict) -> None:
    """By the requirements that the installed packages declare."""
    asked = [*project["dependencies"], *project["optional-dependencies"]["build"]]
    needed: set[str] = set()
    while asked:
        requirement = Requirement(asked.pop())
        name = canonicalize_name(requirement.name)
        if name not in needed and (requirement.marker is None or requirement.marker.evaluate({"extra": ""})):
            needed.add(name)
            asked += requires(name) or []
    pins = locked(root, "runtime")
    here = {name for name in pins if any(not marker or Marker(marker).evaluate() for _, marker in pins[name])}
    assert here == needed


def test_version_stands_once(root: Path, project: dict) -> None:
    assert "version" in project["dynamic"]
    assert re.fullmatch(r"\d+\.\d+\.\d+\S*", gearstab.__version__)
    copies = [f for f in (root / "gearstab").rglob("*.py") if re.search(r"^__version__ =", f.read_text(), re.M)]
    assert copies == [root / "gearstab" / "version.py"]


def test_the_citation_is_that_of_this_version(root: Path, project: dict) -> None:
    cited = YAML(typ="safe").load((root / "CITATION.cff").read_text())
    assert (cited["cff-version"], cited["version"]) == ("1.2.0", gearstab.__version__)
    assert cited["license"] == project["license"]
    assert set(cited) >= {"message", "title", "authors"}
    assert f"\n## {gearstab.__version__}" in (root / "docs" / "changelog.md").read_text()


HOOK = "import sys; from setuptools import build_meta; print(build_meta.{hook}(sys.argv[1]))"


def packed(folder: Path, out: Path, hook: str) -> Path:
    """Archive that a hook of the build makes of a source tree."""
    out.mkdir(exist_ok=True)
    command = [sys.executable, "-W", "ignore", "-c", HOOK.format(hook=hook), str(out)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return out / done.stdout.splitlines()[-1]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_a_source_distribution_is_whole_and_makes_a_wheel(root: Path, tmp_path: Path) -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True).stdout
    tracked = {name for name in listed.splitlines() if not name.startswith(".")}
    for name in tracked:
        (tmp_path / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(root / name, tmp_path / "tree" / name)
    with tarfile.open(packed(tmp_path / "tree", tmp_path / "out", "build_sdist")) as archive:
        held = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
        archive.extractall(tmp_path / "unpacked", filter="data")
    assert tracked - held == set()
    (source,) = (tmp_path / "unpacked").iterdir()
    wheel = packed(source, tmp_path / "out", "build_wheel")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        archive.extractall(tmp_path / "installed")
    package = {name for name in tracked if name.startswith("gearstab/") and name.endswith((".py", "py.typed"))}
    assert package - names == set()
    assert not any(name.startswith(("tests/", "docs/", "scripts/", "configs/")) for name in names)
    # As installed: the package of the wheel, with the kernel, and nothing of this tree.
    program = str(source / "scripts" / "try_wheel.py")
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "installed")}
    done = subprocess.run(
        [sys.executable, program], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    place, levels = done.stdout.splitlines()[-2:]
    assert Path(place).is_relative_to(tmp_path / "installed")
    assert "plain" in levels.split()


def test_ci_runs_the_tests_as_a_user_would(root: Path) -> None:
    script = (root / ".ci" / "run").read_text()
    assert re.search(r"^make test$", script, re.M)
    assert os.access(root / ".ci" / "run", os.X_OK)


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_help_lists_every_command(root: Path) -> None:
    # Run by itself or under `make test`, whose flags and level must not reach the inner make.
    clean = {k: v for k, v in os.environ.items() if k not in {"MAKEFLAGS", "MAKELEVEL", "MFLAGS"}}
    shown = subprocess.run(["make"], cwd=root, env=clean, capture_output=True, text=True, check=True).stdout
    phony = re.search(r"^\.PHONY: (.*)$", (root / "Makefile").read_text(), re.M)
    assert phony
    assert set(re.findall(r"^  make (\S+)", shown, re.M)) == set(phony[1].split())


@pytest.fixture
def source(tmp_path: Path, root: Path) -> Path:
    """A copy of the build with a C file in the kernel's place."""
    shutil.copy(root / "setup.py", tmp_path)
    (tmp_path / "scripts").mkdir()
    shutil.copy(root / "scripts" / "compiler.py", tmp_path / "scripts")
    kernel = tmp_path / "gearstab" / "ckernel" / "_kernel.c"
    kernel.parent.mkdir(parents=True)
    kernel.write_text(
        "#define PY_SSIZE_T_CLEAN\n#include <Python.h>\n"
        'static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "_kernel", 0, -1, 0};\n'
        "PyMODINIT_FUNC PyInit__kernel(void) { return PyModule_Create(&module); }\n"
    )
    return tmp_path


def build(source: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    pytest.importorskip("setuptools")
    return subprocess.run(
        [sys.executable, "setup.py", "-q", "build_ext", "--inplace"],
        cwd=source, env=os.environ | environment, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.skipif(find_spec("ziglang") is not None, reason="needs a machine without ziglang")
def test_without_a_compiler_the_build_fails_in_one_line(source: Path) -> None:
    done = build(source, CC="no-such-compiler", LDSHARED="no-such-compiler")
    assert done.returncode == 1
    (line,) = [line for line in done.stderr.splitlines() if "gearstab" in line]
    assert line.startswith("error: gearstab: its kernel cannot be compiled (")
    assert line.endswith("it needs GCC, Clang or the package ziglang, and the headers of Python")
    assert not list(source.rglob("*.so"))


@pytest.mark.skipif(shutil.which("cc") is None and shutil.which("gcc") is None, reason="needs a C compiler")
def test_a_kernel_of_before_does_not_outlive_a_failed_build(source: Path) -> None:
    assert build(source).returncode == 0
    assert list((source / "gearstab" / "ckernel").glob("_kernel*.so"))
    (source / "gearstab" / "ckernel" / "_kernel.c").write_text("no C at all")
    assert build(source, CFLAGS="-w").returncode == 1
    assert not list((source / "gearstab" / "ckernel").glob("_kernel*.so"))
