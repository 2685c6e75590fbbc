"""The command line. A command is imported when it is called: ``gearstab --help`` imports nothing but click."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from io import TextIOWrapper
from typing import Any, NoReturn

import click

from gearstab.cli.terminal import tell, user_errors
from gearstab.errors import INTERRUPTED
from gearstab.version import full_version

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""The environment variables that say how many threads a BLAS library starts."""

COMMANDS = {
    "init": ("gearstab.cli.configurations:init_command", "Print a configuration to start from."),
    "sweep": ("gearstab.cli.sweep:command", "Compute stability over the grid of a configuration."),
    "plot": ("gearstab.cli.plot:command", "Draw a figure from a result file."),
    "info": ("gearstab.cli.results:info_command", "Show modes and tongues, or what a result holds."),
    "diff": ("gearstab.cli.results:diff_command", "Compare two results."),
    "check": ("gearstab.cli.configurations:check_command", "Validate a configuration; list every mistake."),
    "respond": ("gearstab.cli.runs:respond_command", "Compute a time response."),
    "design": ("gearstab.cli.runs:design_command", "Find a design without instability."),
    "report": ("gearstab.cli.runs:report_command", "Write a report to forward."),
    "verify": ("gearstab.cli.results:verify_command", "Prove the certificates of a result again."),
    "bench": ("gearstab.cli.runs:bench_command", "Compare speed and error of the methods."),
    "export": ("gearstab.cli.results:export_command", "Write a result file as tidy CSV."),
    "schema": ("gearstab.cli.configurations:schema", "Print the JSON schema of configurations."),
}
"""Command -> where it is, and what it does."""


TO_BEGIN = {
    "config": "Name its file; `gearstab init two_stage > train.yaml` writes one to start from.",
    "configs": "Name its file; `gearstab init two_stage > train.yaml` writes one to start from.",
    "result": "Name its file, results/train.h5; `gearstab sweep train.yaml` writes it.",
}
"""Message where a command lacks its configuration, or a result."""


class LazyGroup(click.Group):
    """A group of commands that knows their names and summaries and imports only the one that is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, _, attribute = COMMANDS[cmd_name][0].partition(":")
        found = getattr(import_module(module), attribute)
        if not isinstance(found, click.Command):
            raise TypeError(f"{module}:{attribute} is no command")
        return found

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            from difflib import get_close_matches

            near = get_close_matches(args[0], COMMANDS, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"the commands are {', '.join(COMMANDS)}."
            ctx.fail(f"No such command '{args[0]}'; {hint}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; mistakes of the user are a line each, whatever part of the command finds them."""
        with user_errors():
            return super().invoke(ctx)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary) for name, (_, summary) in COMMANDS.items()])


def _version(ctx: click.Context) -> None:
    """Print the version with its commit, for which files are read, and exit."""
    click.echo(f"gearstab, version {full_version()}")
    ctx.exit()


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=lambda ctx, _, wanted: _version(ctx) if wanted else None,
    help="Show the version and exit.",
)
def group() -> None:
    """Stability maps of gear systems with periodic mesh stiffness."""


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Run a command and exit: 0 done, 1 a run failed, 2 the input is wrong, 3 a condition met, 130 interrupted."""
    # Commands run threads and processes of their own on many small matrices. Threads of BLAS only get in their way: on
    # a busy machine they were seen to take 200 times as long. Read when NumPy is imported; the user's choice stands.
    for variable in BLAS_THREADS:
        os.environ.setdefault(variable, "1")
    # No plug-in of pydantic has a say in configurations, and to look for one among all installed packages takes longer
    # than to check a small configuration.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Figures go to files: which backend the user prefers for windows does not matter, even if there is no such one.
    os.environ["MPLBACKEND"] = "agg"
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # letters that a terminal does not have
    try:
        code = group.main(args=args, prog_name="gearstab", standalone_mode=False)
    except click.ClickException as error:
        if isinstance(error, click.MissingParameter) and error.param is not None and error.param.name in TO_BEGIN:
            error = click.MissingParameter(TO_BEGIN[error.param.name], error.ctx, error.param)
        error.show()
        code = error.exit_code
    except click.Abort:
        tell("interrupted")
        code = INTERRUPTED
    sys.exit(code if isinstance(code, int) else 0)
