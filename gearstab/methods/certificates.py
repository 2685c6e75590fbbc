"""Requirements on a method for certificates of its results."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from gearstab.methods.base import Method, OptionError
from gearstab.system import Feature


def check_certificate(method: Method, restricted: str) -> None:
    """Raise OptionError where the option ``certificate`` cannot be had.

    restricted: the option that restricts the system, "" where none does.
    """
    if find_spec("flint") is None:
        message, remedy = "needs python-flint", "install it: pip install 'gearstab[verify]'"
    elif restricted:
        message, remedy = "is about the whole system, not about a part of it", f"remove {restricted}"
    elif Feature.FOLLOWS_ROTATION in method.system.features:
        message, remedy = "is about linear systems", "set formulation: classical, or remove it"
    elif not method.system.commensurate:
        message, remedy = "needs mesh frequencies with a common period", "give exact ratios, or remove it"
    elif not method.system.piecewise_constant:
        message, remedy = "needs a system that is constant between jumps", "take rectangular waves, or remove it"
    elif any(not term.held and np.any(term.softening) for turn in method.system.rotations for term in turn.terms()):
        message, remedy = "needs springs that do not give way under centrifugal forces", "hold the speed, or remove it"
    else:
        return
    raise OptionError(("certificate",), message, remedy)
