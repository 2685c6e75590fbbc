"""The response that the section ``respond`` of a configuration asks for: computed, and as a result file.

The theory is in :mod:`gearstab.response`; one file here for each sort of response.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gearstab.config.sections.respond_pair import PairRespond
from gearstab.results import write_result

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.response import Response
    from gearstab.response.rotating_pair import PairResponse


def respond(config: Config, out: Path) -> Response | PairResponse:
    """Compute the response and write the result file ``out``; raises ConfigError and OSError."""
    from gearstab.respond import pair, system

    if config.respond is None:
        raise ValueError("the configuration has no section respond")
    found: Response | PairResponse
    if isinstance(config.respond, PairRespond):
        found, tree = pair.response(config, config.respond)
    else:
        found, tree = system.response(config, config.respond)
    write_result(out, tree)
    return found


__all__ = ["respond"]
