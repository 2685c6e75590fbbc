"""Settings of the documentation site: ``make docs`` builds it from docs/ into build/docs with Sphinx and MyST."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "scripts"))

import figures  # noqa: E402  (of scripts/: what `make figures` draws, and where)

from gearstab.version import __version__  # noqa: E402

project = "gearstab"
author = "the gearstab authors"
release = version = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
exclude_patterns = ["images"]
nitpicky = True
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = "gearstab"
highlight_language = "none"
suppress_warnings = ["misc.highlighting_failure"]  # a Snakefile in a block of Python, so that editors colour it
autodoc_typehints = "none"  # signatures say what a function takes in words; types are in the source and in editors
autodoc_default_options = {"exclude-members": "__init__"}


def gallery() -> str:
    """Return the body of the gallery: for every configuration its pictures, where drawn, and its text."""
    parts = []
    for figure in figures.every(ROOT / "results"):
        drawn = [path for path in figure.every_picture if path.exists()]
        pictures = [f"![{path.stem}](../../{path.relative_to(ROOT).as_posix()})" for path in drawn]
        missing = f"*Not drawn in this build: `make figures FIGURES={figure.name}` draws it.*"
        parts += [
            f"## {figure.name}",
            *(pictures or [missing]),
            f"```{{literalinclude}} ../../configs/{figure.name}.yaml\n:language: yaml\n```",
        ]
    return "\n\n".join(parts)


def add_gallery(app: Sphinx, name: str, source: list[str]) -> None:
    """Append the gallery to the page that introduces it, as it is read."""
    if name == "guide/gallery":
        source[0] += f"\n{gallery()}\n"


def typeset_paper(app: Sphinx, name: str, source: list[str]) -> None:
    """Turn the paper, written for the tools of the Journal of Open Source Software, into a page of this site."""
    if name != "paper/paper":
        return
    (title,) = re.findall(r'^title: "(.*)"$', source[0], re.M)
    entries = dict(
        re.findall(r"^@\w+\{(\w+),(.*?)^\}", (Path(__file__).parent / "paper" / "paper.bib").read_text(), re.M | re.S)
    )
    body = re.sub(r"^# ", "## ", source[0].split("---\n", 2)[2], flags=re.M)
    cited = dict.fromkeys(re.findall(r"\[@(\w+)\]", body))
    body = re.sub(
        r"\[@(\w+)\]", lambda found: f"({authors(entries[found[1]])} {field(entries[found[1]], 'year')})", body
    )
    source[0] = f"# {title}\n{body}\n" + "\n".join(reference(entries[key]) for key in sorted(cited))


def field(entry: str, name: str) -> str:
    """Return a field of an entry of the bibliography as plain text, "" where there is none."""
    found = re.search(rf"^ *{name} *= \{{(.*)\}},?$", entry, re.M)
    return re.sub(r"[{}]", "", found[1]).replace("--", "-").replace("\\'o", "ó").replace("\\'u", "ú") if found else ""


def authors(entry: str) -> str:
    """Return the family names of an entry, as a text cites them."""
    names = [name.split(",")[0] for name in field(entry, "author").split(" and ")]
    return " & ".join(names) if len(names) < 3 and names[-1] != "others" else f"{names[0]} et al."


def reference(entry: str) -> str:
    """Return an entry as an item of a list."""
    place = field(entry, "journal") or field(entry, "booktitle") or field(entry, "publisher") or field(entry, "note")
    doi = field(entry, "doi")
    link = f" [doi:{doi}](https://doi.org/{doi})" if doi else ""
    where = " ".join(part for part in (place, field(entry, "volume")) if part)
    return f"* {authors(entry)} ({field(entry, 'year')}): {field(entry, 'title')}. *{where}*.{link}"


def list_parameters(app: Sphinx, what: str, name: str, object: object, options: object, lines: list[str]) -> None:
    """Turn the parameters of a docstring, ``name: text`` and indented lines that go on, into a list."""
    if "Parameters" not in lines:
        return
    start = lines.index("Parameters")
    end = lines.index("", start)
    entries = [f"  {line.strip()}" if line[0] == " " else f"* {line}" for line in lines[start + 2 : end]]
    lines[start:end] = ["**Parameters**", "", *entries]


def setup(app: Sphinx) -> None:
    """Connect the gallery, the paper and the docstrings."""
    app.connect("source-read", add_gallery)
    app.connect("source-read", typeset_paper)
    app.connect("autodoc-process-docstring", list_parameters)
