"""``gearstab info``, ``diff``, ``export`` and ``verify``: what a result holds and a configuration promises.

Two results compared, one as CSV, its certificates proved again.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import StandardOutput, note, say, tell, warn
from gearstab.errors import FAILED, ResultError

if TYPE_CHECKING:
    from gearstab.sweep.certificates import ProvedRow

FRACTION = click.FloatRange(min=0)
SHOWN = 5
"""Names of files that are listed."""


@click.command(name="info")
@click.argument("config", metavar="CONFIG|RESULT", type=terminal.FILE)
@terminal.overrides
@click.option(
    "--harmonics", type=click.IntRange(1, 50), help="List tongues up to this harmonic [default: as in CONFIG]."
)
@terminal.unit
@click.option("--all", "every", is_flag=True, help="List all predicted tongues, however many and closed.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def info_command(
    config: Path, overrides: tuple[str, ...], harmonics: int | None, unit: tuple[str, ...], every: bool, as_json: bool
) -> None:
    """Show natural frequencies, modes and the tongues that perturbation theory predicts for CONFIG.

    Of a file RESULT: where it comes from, its groups, axes and variables.
    """
    from gearstab.info import result

    if result.is_result(config):
        if overrides or harmonics:
            raise click.UsageError(f"{config} is a result, which --set and --harmonics do not change")
        known = result.describe(config, unit, as_json)
        say(json.dumps(known, indent=2, allow_nan=False) if as_json else result.report(known))
        return
    from gearstab.config import load
    from gearstab.info import plain, shown_in
    from gearstab.info.configuration import describe
    from gearstab.info.text import report

    loaded = load(config, overrides)
    warn(loaded)
    facts = describe(loaded, harmonics)
    if unit:
        facts = shown_in(facts, unit[-1])
    if as_json:
        say(json.dumps(plain(facts), indent=2, allow_nan=False))
    else:
        say(report(facts, every or harmonics is not None))


@click.command(name="diff", short_help="Compare two results, or two folders of them.")
@click.argument("first", metavar="A", type=terminal.FILE)
@click.argument("second", metavar="B", type=terminal.FILE)
@click.option("--tolerance", type=FRACTION, default=1e-9, show_default=True, help="Of a variable's largest magnitude.")
@click.option("--edges", type=FRACTION, default=1e-9, show_default=True, help="Of edges of regions, relative to them.")
@click.option("--verdicts", type=click.IntRange(min=0), default=0, show_default=True, help="Points that may change.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def diff_command(first: Path, second: Path, tolerance: float, edges: float, verdicts: int, as_json: bool) -> None:
    """Compare the results A and B: verdicts and edges that changed, the largest difference of each variable.

    Of two folders, all results (.h5) of the same name are compared.

    Exit code 0: the same within the tolerances; 1: different; 2: one of them cannot be read.
    """
    from gearstab.info.difference import Tolerances, difference, report
    from gearstab.results.read import reading

    tolerances = Tolerances(tolerance, edges, verdicts)

    def compared(old_path: Path, new_path: Path) -> dict[str, Any]:
        with reading(old_path) as old, reading(new_path) as new:
            return difference(old, new, tolerances)

    if first.is_dir() and second.is_dir():
        common, alone = _names(first, second)
        found = {name: compared(first / name, second / name) for name in common}
        told: dict[str, Any] = {"same": not any(alone.values()) and all(own["same"] for own in found.values())}
        told |= alone | {"results": found}
        differ = {name: own for name, own in found.items() if not own["same"]}
        texts = [report(own, (str(first / name), str(second / name)), tolerances) for name, own in differ.items()]
        texts += [f"only in the {key.removeprefix('only_')}: {_listed(names)}" for key, names in alone.items() if names]
        texts.append(f"{len(common):,} results in both, {len(differ):,} of them different")
    else:
        told = compared(first, second)
        texts = [report(told, (str(first), str(second)), tolerances)]
    if as_json:
        say(json.dumps({"first": str(first), "second": str(second), **told}, indent=2, allow_nan=False))
    else:
        say("\n".join(texts))
    if not told["same"]:
        raise click.exceptions.Exit(FAILED)


def _names(first: Path, second: Path) -> tuple[list[str], dict[str, list[str]]]:
    """Return the names of the results that both folders hold, and those that only one of them has."""
    old, new = ({path.name for path in folder.glob("*.h5")} for folder in (first, second))
    if not old & new:
        raise ResultError(f"{first} and {second}: no result (.h5) has the same name in both folders")
    return sorted(old & new), {"only_first": sorted(old - new), "only_second": sorted(new - old)}


def _listed(names: list[str]) -> str:
    """Return the first names, and how many there are."""
    more = f", ... ({len(names):,} in all)" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


@click.command(name="export", short_help="Write a result file as tidy CSV.")
@click.argument("result", type=terminal.FILE)
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path, allow_dash=True),
    help="CSV file; - for standard output.",
)
@click.option(
    "--group", metavar="NAME", help="Which group of the file [default: floquet, else the first one over the sweep]."
)
@click.option(
    "--over",
    metavar="DIM,..",
    help="The dimensions of the rows where there are several tables: of a response time,dof; time,mesh; frequency.",
)
@terminal.select
@terminal.unit
@terminal.quiet
def export_command(
    result: Path, output: Path, group: str | None, over: str | None, select: tuple[str, ...], unit: tuple[str, ...]
) -> None:  # fmt: skip
    """Write the file RESULT as tidy CSV: one row per grid point, one column per axis or variable.

    Units other than SI units stand behind the names of their columns.
    """
    from gearstab.results.export import export

    out = None if str(output) == "-" else output
    rows, notes = export(result, out, StandardOutput(), group, over, terminal.selections(select), unit)
    if out is not None:
        note(f"{out}: {rows:,} rows")
    for text in notes:
        note(f"note: {text}")


@click.command(name="verify", short_help="Prove the certificates of a result again.")
@click.argument("result", type=terminal.FILE)
@click.option("-j", "--jobs", type=click.IntRange(min=1), default=1, show_default=True, help="Processes.")
@terminal.quiet
def verify_command(result: Path, jobs: int) -> None:
    """Prove the certificates of the file RESULT in ball arithmetic, from its configuration alone.

    Exit code 0: every one is a theorem; 1: some are not, each is named. An interrupted run goes on where it was.
    """
    from gearstab.cli.messages import reporter

    if find_spec("flint") is None:
        raise click.UsageError("verify needs python-flint; install it: pip install 'gearstab[verify]'")
    from gearstab.sweep.certificates import verify

    rows = verify(result, jobs, reporter())
    for row in rows:
        place = "".join(f"{name} {value}: " for name, value in row.place.items())
        for piece in row.refused:
            what = "unstable" if piece.outside else "stable"
            tell(f"{place}not proved {what} from {piece.low:.9g} to {piece.high:.9g}")
        if not row.agrees and not row.refused:
            tell(f"{place}not proved: what is stored about the certified share or the edges is not what its pieces say")
    total, refused = sum(row.pieces for row in rows), sum(len(row.refused) for row in rows)
    earlier = sum(row.earlier for row in rows)
    told = f", {earlier:,} of all as an interrupted run left them: verify again to prove these too" if earlier else ""
    say(f"{result}: {total - refused:,} of {total:,} certificates proved{told}")
    pieces, points = ([row for row in rows if bool(row.points) == of] for of in (False, True))
    if pieces:
        widest = max(row.widest for row in pieces)
        say(
            f"{_mean(pieces)} of the mesh frequencies are a theorem about the model as stored; of the rest no part is "
            f"wider than {widest:.2g} of them"
        )
    if points:
        say(f"the verdict at {_mean(points)} of the points of the grid is a theorem about the model as stored")
    if refused or not all(row.agrees for row in rows):
        raise click.exceptions.Exit(FAILED)


def _mean(rows: Sequence[ProvedRow]) -> str:
    return f"{100 * sum(row.share for row in rows) / len(rows):.6g} %"
