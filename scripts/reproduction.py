"""docs/reproduction.md: what the papers state, and what comes out here.

python scripts/reproduction.py                   prints the page
python scripts/reproduction.py lin_parker_2002   prints what is said of this paper
python scripts/reproduction.py --write           writes the page
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

import kuria_kihiu_2008
import turning_carriers

import lin_parker_2002
import oh_grosh_barber_2005
import parker_2009
from statements import Paper, Runs, Statement

PAGE = Path(__file__).parent.parent / "docs" / "reproduction.md"

PACKAGES = (lin_parker_2002, oh_grosh_barber_2005, kuria_kihiu_2008, parker_2009, turning_carriers)
PAPERS = {package.__name__: package.PAPER for package in PACKAGES}

HEAD = """\
# What is reproduced of the papers

`make reproduction` makes this page: it runs the configurations in `configs/` with the values named below and reads
their result files. All numbers under "here" are computed; the tests make the page again and compare it. "First order"
is the perturbation theory of this program, "Floquet" its exact boundaries: two independent ways. `2w3` names the region
at twice the third natural frequency, and so on; a star marks a width of a region that has merged with another one.

Every verdict is computed from the numbers under "here" by the rule under "agrees if". "In part" is said only where that
rule names a second bound; all else differs. The overlap of a region is what first order and Floquet theory both call
unstable, over what either does: 1 where they coincide, 0 where they have nothing in common.
"""

VERDICT = {True: "agrees", False: "**differs**", None: "*in part*"}


def row(statement: Statement) -> str:
    """One line of the table."""
    verdict = VERDICT[statement.agrees]
    cells = [statement.place, statement.claim, statement.ours, verdict, statement.rule, statement.why]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def part(paper: Paper, runs: Runs) -> str:
    """Part of the page about one paper."""
    found = {title: [s for check in checks for s in check(runs)] for title, checks in paper.sections.items()}
    count = Counter(s.agrees for statements in found.values() for s in statements)
    text = [
        f"\n## {paper.name}\n\n{paper.reference}\n\n{paper.remarks}\n",
        f"{count.total()} statements: {count[True]} agree, {count[None]} in part, {count[False]} differ.",
    ]
    for title, statements in found.items():
        text += [
            f"\n### {title}\n",
            "| place | the paper | here | | agrees if | why |",
            "| --- | --- | --- | --- | --- | --- |",
            *map(row, statements),
        ]
    return "\n".join(text) + "\n"


def parts(papers: Iterable[str]) -> str:
    """Parts of the page about some papers."""
    with TemporaryDirectory() as folder:
        runs = Runs(Path(folder))
        return "".join(part(PAPERS[name], runs) for name in papers)


if __name__ == "__main__":
    asked = sys.argv[1:]
    if asked == ["--write"]:
        PAGE.write_text(HEAD + parts(PAPERS))
    else:
        sys.stdout.write(parts(asked) if asked else HEAD + parts(PAPERS))
