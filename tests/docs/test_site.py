"""The documentation site: pages are in its navigation, links lead somewhere, examples are valid, it builds cleanly."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from ruamel.yaml import YAML
from scenes import DOCS, ROOT, refused

import gearstab as gs
from gearstab.cli import group

PAGES = sorted(page.relative_to(DOCS).with_suffix("").as_posix() for page in DOCS.rglob("*.md"))
GUIDE = {"tour", "modelling", "reading", "gallery", "functions", "theory", "limits", "troubleshooting", "glossary",
         "programs", "contributing"}  # fmt: skip


def blocks(page: str, language: str) -> list[str]:
    """The blocks of code of a page in a language."""
    text = (DOCS / f"{page}.md").read_text()
    return re.findall(rf"^```{re.escape(language)}\n(.*?)^```$", text, re.M | re.S)


def whole(block: str) -> bool:
    """Whether a block of YAML is a configuration, not a part of one."""
    return bool(re.search(r"^system:", block, re.M) and re.search(r"^(methods|design):", block, re.M))


def commands(text: str) -> Iterator[list[str]]:
    """The words of every ``gearstab`` command in lines of a shell."""
    for line in text.splitlines():
        words = shlex.split(line.removeprefix("$ "), comments=True)
        if words and words[0].endswith("gearstab"):
            end = next((n for n, word in enumerate(words) if word in (">", "|", "&&")), len(words))
            yield words[1:end]


def test_every_page_is_in_the_navigation_once() -> None:
    trees = re.findall(r"^```\{toctree\}\n(.*?)^```$", (DOCS / "index.md").read_text(), re.M | re.S)
    listed = [line for tree in trees for line in tree.splitlines() if line and not line.startswith(":")]
    assert sorted([*listed, "index"]) == PAGES
    assert {f"guide/{name}" for name in GUIDE} <= set(PAGES)


@pytest.mark.parametrize("page", PAGES)
def test_links_to_files_lead_somewhere(page: str) -> None:
    text = re.sub(r"^```.*?^```$", "", (DOCS / f"{page}.md").read_text(), flags=re.M | re.S)
    targets = [target for target in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in target]
    missing = [t for t in targets if t[0] != "#" and not (DOCS / page).parent.joinpath(t.split("#")[0]).exists()]
    assert missing == []


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "sh") + blocks(page, "")])
def test_commands_are_understood(page: str) -> None:
    for block in blocks(page, "sh") + [b for b in blocks(page, "") if b.startswith("$ ")]:
        for words in commands(block):
            command = group.get_command(click.Context(group), words[0])
            assert command is not None, words
            command.make_parser(click.Context(command)).parse_args(words[1:])  # raises for an option it does not have


RUN = {"guide/walks", "guide/pipelines"}
"""Pages whose own tests run their configurations, beside the files that these need."""


@pytest.mark.parametrize("page", [page for page in PAGES if page not in RUN and any(map(whole, blocks(page, "yaml")))])
def test_whole_configurations_are_valid(page: str, tmp_path: Path) -> None:
    for block in filter(whole, blocks(page, "yaml")):
        (tmp_path / "train.yaml").write_text(block)
        gs.load(tmp_path / "train.yaml")


def test_what_the_modelling_page_says_of_its_example() -> None:
    (block,) = blocks("guide/modelling", "yaml")
    known = gs.info(YAML(typ="safe").load(block))
    # w^2 = k (r1^2/J1 + r2^2/J2) of the rigid gears on their mesh; the other mode is the rotation of the train.
    (elastic,) = [m["natural_frequency"] for m in known["modes"] if m["natural_frequency"] > 1]
    assert elastic == pytest.approx((3e8 * (0.04**2 / 0.02 + 0.08**2 / 0.05)) ** 0.5, rel=1e-12)


def test_it_builds_without_warnings(tmp_path: Path) -> None:
    pytest.importorskip("furo")
    pytest.importorskip("myst_parser")
    pytest.importorskip("ziamath")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", str(DOCS), str(tmp_path)],
        cwd=ROOT, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert [page for page in PAGES if not (tmp_path / f"{page}.html").exists()] == []
    # Every formula is drawn in the page, and no page loads anything from elsewhere.
    theory = re.sub(r"`[^`]*`", "", (DOCS / "guide/theory.md").read_text())
    drawn = (tmp_path / "guide/theory.html").read_text().count('<svg role="img" aria-label=')
    assert drawn == len(re.findall(r"\$\$?[^$]+\$\$?", theory)) > 50
    loads = (
        r'<(?:script|img|iframe|link rel="stylesheet")[^>]*(?:src|href)="(?:https?:)?//[^"]*"|url\(["\']?(?:https?:)?//'
    )
    files = [path for path in tmp_path.rglob("*") if path.suffix in {".html", ".css"}]
    assert [found for path in files for found in re.findall(loads, path.read_text())] == []
    functions = (tmp_path / "guide/functions.html").read_text()
    assert [name for name in gs.__all__ if f'id="gearstab.{name}"' not in functions] == []
    shown = (tmp_path / "guide/gallery.html").read_text()
    configs = [p for p in (ROOT / "configs").rglob("*.yaml") if p.parent.name != "benchmarks"]
    assert shown.count("<h2>") == len(configs)


LIMITS = re.findall(r"^\| [^|]+ \| (`\S+=[^|]+`) \| (.+) \|$", (DOCS / "guide/limits.md").read_text(), re.M)


@pytest.mark.parametrize(("cell", "message"), LIMITS, ids=[cell.strip("`") for cell, _ in LIMITS])
def test_what_is_not_modelled_is_refused_as_the_page_says(cell: str, message: str, tmp_path: Path) -> None:
    # The second file is for the rows behind it.
    pair, rotor = blocks("guide/limits", "yaml")
    text = (DOCS / "guide/limits.md").read_text()
    (tmp_path / "train.yaml").write_text(rotor if text.index(rotor) < text.index(cell) else pair)
    overrides = [word for setting in re.findall(r"`([^`]+)`", cell) for word in ("--set", setting)]
    said = refused("sweep", tmp_path / "train.yaml", "--dry-run", *overrides)
    (line,) = said.splitlines()
    assert line.endswith(f": {message}")


def test_the_page_of_limits_lists_them() -> None:
    assert len(LIMITS) >= 10
