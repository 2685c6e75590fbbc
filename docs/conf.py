"""Settings of the documentation site: ``make docs`` builds it from docs/ into build/docs with Sphinx and MyST."""

from __future__ import annotations

import re
import sys
from html import escape
from pathlib import Path

import ziamath
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "scripts"))

import figures  # noqa: E402  (of scripts/: what `make figures` draws, and where)

from gearstab.version import __version__  # noqa: E402

project = "gearstab"
author = "the gearstab authors"
release = version = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc"]
html_math_renderer = "drawn"
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


ziamath.config.svg2 = False  # every formula by itself: in parts that pages share, the first one would serve them all
LETTERS = 17
"""Size of formulas in pixels, beside text of 16."""


def write_formula(writer: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """Draw a formula as SVG, so that a page needs neither a network nor scripts or fonts for it."""
    block = isinstance(node, nodes.math_block)
    formula = ziamath.Latex(node.astext(), size=LETTERS, color="currentColor", inline=not block)
    label = f'role="img" aria-label="{escape(node.astext())}" style="vertical-align: {formula.getyofst():.2f}px"'
    drawn = formula.svg().replace("<svg ", f"<svg {label} ", 1)
    frame = '<div class="math" style="overflow-x: auto; text-align: center; margin: 1em 0">{}</div>'
    writer.body.append((frame if block else '<span class="math">{}</span>').format(drawn))
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Connect the formulas, the gallery, the paper and the docstrings."""
    app.add_html_math_renderer("drawn", (write_formula, None), (write_formula, None))
    app.connect("source-read", add_gallery)
    app.connect("source-read", typeset_paper)
    app.connect("autodoc-process-docstring", list_parameters)
