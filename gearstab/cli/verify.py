"""``gearstab verify``: the certificates of a result, proved again."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gearstab.cli.terminal import options
from gearstab.cli.terminal.console import say, tell
from gearstab.errors import FAILED

if TYPE_CHECKING:
    from gearstab.sweep.certificates import ProvedRow


@click.command(name="verify", short_help="Prove the certificates of a result again.")
@click.argument("result", type=options.FILE)
@click.option("-j", "--jobs", type=click.IntRange(min=1), default=1, show_default=True, help="Processes.")
@options.quiet
def command(result: Path, jobs: int, quiet: bool) -> None:
    """Prove the certificates of the file RESULT in ball arithmetic, from its configuration alone.

    Exit code 0: every one is a theorem; 1: some are not, each is named. An interrupted run goes on where it was.
    """
    from gearstab.cli.terminal.progress import reporter

    if find_spec("flint") is None:
        raise click.UsageError("verify needs python-flint; install it: pip install 'gearstab[verify]'")
    from gearstab.sweep.certificates import verify

    rows = verify(result, jobs, reporter(quiet))
    for row in rows:
        place = "".join(f"{name} {value}: " for name, value in row.place.items())
        for piece in row.refused:
            what = "unstable" if piece.outside else "stable"
            tell(f"{place}not proved {what} from {piece.low:.9g} to {piece.high:.9g}")
    total, refused = sum(row.pieces for row in rows), sum(len(row.refused) for row in rows)
    say(f"{result}: {total - refused:,} of {total:,} certificates proved")
    pieces, points = ([row for row in rows if bool(row.points) == of] for of in (False, True))
    if pieces:
        widest = max(row.widest for row in pieces)
        say(
            f"{_mean(pieces)} of the mesh frequencies are a theorem about the model as stored; of the rest no part is "
            f"wider than {widest:.2g} of them"
        )
    if points:
        say(f"the verdict at {_mean(points)} of the points of the grid is a theorem about the model as stored")
    if refused:
        raise click.exceptions.Exit(FAILED)


def _mean(rows: Sequence[ProvedRow]) -> str:
    return f"{100 * sum(row.share for row in rows) / len(rows):.6g} %"
