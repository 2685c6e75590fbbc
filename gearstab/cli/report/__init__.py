"""``gearstab report``: what was found out, put on pages, as HTML or PDF."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from gearstab.cli import terminal
from gearstab.cli.terminal import is_quiet, note, warn

ENDINGS = (".html", ".pdf")


@click.command(name="report", short_help="Write a report to forward.")
@terminal.config
@click.option("-o", "--output", type=terminal.FILE, required=True, help="Report: .html or .pdf, one file.")
@terminal.overrides
@terminal.unit
@terminal.quiet
def command(config: Path, output: Path, overrides: tuple[str, ...], unit: tuple[str, ...]) -> None:
    """Write a page on the instability of CONFIG over its operating range: what it is, what closes it, how sure that is.

    The range is that of the section `design`, whose best design is searched and proposed, else that of the sweep.
    """
    from gearstab.cli.report.content import page
    from gearstab.cli.report.page import html
    from gearstab.cli.report.pdf import pdf
    from gearstab.config import load
    from gearstab.errors import OutputError
    from gearstab.results.output import FIGURES, RESULTS, TABLES, Content, write_bytes

    ending = output.suffix.lower()
    if ending not in ENDINGS:
        raise OutputError(f"{output}: a report has a name that ends in {' or '.join(ENDINGS)}")
    others = tuple(name for name in (*TABLES, *FIGURES, *RESULTS) if name not in ENDINGS)
    content = Content("a report", "/".join(ENDINGS), no_report, others, streams=False)
    content.refuse(output, config)
    loaded = load(config, overrides)
    warn(loaded)
    with shown() as step:
        found = page(loaded, step, *unit[-1:])
    write_bytes(output, memoryview((html if ending == ".html" else pdf)(found)), content.refuse)
    note(f"report: {output}")


@contextmanager
def shown() -> Iterator[Callable[[str], None]]:
    """Give the function that shows which step begins: on a bar where standard error is a terminal, else nowhere."""
    from gearstab.cli.report.content import STEPS
    from gearstab.sweep.progress import bar

    with bar(disable=is_quiet() or not sys.stderr.isatty()) as progress:
        task = progress.add_task("report", total=len(STEPS), speed="", unstable="")

        def step(text: str) -> None:
            done = STEPS.index(text) if text in STEPS else None
            progress.update(task, description=text, completed=done, refresh=True)

        yield step


def no_report(path: Path) -> str:
    """Return what a file is instead of a report, "" for one."""
    with open(path, "rb") as file:
        head = file.read(512)
    made = b'content="gearstab"' in head if head.startswith(b"<!DOCTYPE html>") else head.startswith(b"%PDF-")
    return "" if made else "is no report"
