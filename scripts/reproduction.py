"""docs/reproduction.md: what Lin & Parker (2002) state, and what comes out here.

python scripts/reproduction.py           prints the page
python scripts/reproduction.py --write   writes it
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from lin_parker_2002 import SECTIONS
from statements import Runs, Statement

PAGE = Path(__file__).parent.parent / "docs" / "reproduction.md"

HEAD = """\
# What is reproduced of Lin & Parker (2002)

J. Lin and R. G. Parker, "Mesh stiffness variation instabilities in two-stage gear systems", *Journal of Vibration and
Acoustics* 124 (2002), 68-76.

`make reproduction` makes this page: it runs the configurations in `configs/` with the values named below and reads
their result files. All numbers under "here" are computed; the tests make the page again and compare it. "First order"
is the perturbation theory of this program, "Floquet" its exact boundaries: two independent ways. `2w3` names the region
at twice the third natural frequency, and so on; a star marks a width of a region that has merged with another one.

The figures carry no numbers beside their axes, so statements are checked, not curves. The results of Tordion & Gauvin
(1977) in Fig. 8 are not checked: the paper does not give their equations.

"""

VERDICT = {True: "agrees", False: "**differs**", None: "*in part*"}


def row(statement: Statement) -> str:
    """One line of the table."""
    cells = [statement.place, statement.claim, statement.ours, VERDICT[statement.agrees], statement.why]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def page() -> str:
    """The whole page."""
    with TemporaryDirectory() as folder:
        runs = Runs(Path(folder))
        found = {title: [s for check in checks for s in check(runs)] for title, checks in SECTIONS.items()}
    count = Counter(s.agrees for statements in found.values() for s in statements)
    text = [HEAD + f"{count.total()} statements: {count[True]} agree, {count[None]} in part, {count[False]} differ.\n"]
    for title, statements in found.items():
        text += [
            f"\n## {title}\n",
            "| place | the paper | here | | why |",
            "| --- | --- | --- | --- | --- |",
            *map(row, statements),
        ]
    return "\n".join(text) + "\n"


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        PAGE.write_text(page())
    else:
        sys.stdout.write(page())
