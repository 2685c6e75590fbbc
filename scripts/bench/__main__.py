"""Run benchmarks by name: ``python -m bench kernel smooth``, or all of ``NAMES`` without one."""

from __future__ import annotations

import sys
from importlib import import_module

NAMES = ("kernel", "blocks", "boundaries", "smooth", "tolerance")
ON_REQUEST = ("laws", "scale")
"""Benchmarks that take minutes."""


def main(arguments: list[str]) -> None:
    """Run the benchmarks named; a number after a name goes to it (rounds, rows, or the largest power of ten)."""
    chosen = [word for word in arguments if not word.isdigit()] or list(NAMES)
    if unknown := set(chosen) - {*NAMES, *ON_REQUEST}:
        raise SystemExit(f"no benchmark {', '.join(sorted(unknown))}; there is {', '.join((*NAMES, *ON_REQUEST))}")
    for name in chosen:
        place = arguments.index(name) + 1 if name in arguments else len(arguments)
        import_module(f"bench.{name}").main(*(int(word) for word in arguments[place : place + 1] if word.isdigit()))


if __name__ == "__main__":
    main(sys.argv[1:])
