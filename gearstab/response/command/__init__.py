"""The response that the section ``respond`` of a configuration asks for: computed, and as a result file.

The theory is in :mod:`gearstab.response`; one file here for each sort of response.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from gearstab.results import ResultTree, write_result
from gearstab.systems.respond import PairRespond

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.response import RampResponse, Response
    from gearstab.response.rotating_pair import PairResponse


def respond(
    config: Config, out: Path, say: Callable[[str], None] | None = None
) -> Response | RampResponse | PairResponse:
    """Compute the response and write the result file ``out``; raises ConfigError and OSError.

    say: is told beforehand what takes long.
    """
    found, tree = computed(config, say)
    write_result(out, tree)
    return found


def computed(
    config: Config, say: Callable[[str], None] | None = None
) -> tuple[Response | RampResponse | PairResponse, ResultTree]:
    """Compute the response, and the result to be written; say as for :func:`respond`. Raises ConfigError."""
    from gearstab.response.command import pair, system

    if config.respond is None:
        raise ValueError("the configuration has no section respond")
    if isinstance(config.respond, PairRespond):
        return pair.response(config, config.respond)
    return system.response(config, config.respond, say)


__all__ = ["computed", "respond"]
