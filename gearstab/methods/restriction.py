"""Options that several methods share: the modes that a system is restricted to, and certificates."""

from __future__ import annotations

from functools import cached_property
from importlib.util import find_spec
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field

from gearstab.config.model.fields import Section, Whole
from gearstab.config.model.units import wrong
from gearstab.errors import NotPossible
from gearstab.methods.base import Method, OptionError
from gearstab.system import Array, Feature, GearSystem

ModeNumber = Annotated[int, Field(ge=1), Whole]


def _each_once(modes: list[int]) -> list[int]:
    """Ascending; raises a pydantic error where a mode is named twice."""
    if len(set(modes)) < len(modes):
        raise wrong("equal_values", "names a mode twice", "name each mode once")
    return sorted(modes)


class ModesOption(Section):
    """Which modes of the system a method keeps."""

    modes: Annotated[list[ModeNumber], AfterValidator(_each_once)] | None = Field(default=None, min_length=1)
    """Restrict the system to these modes, numbered from 1 by ascending natural frequency; default all."""


class Restricted(Method):
    """A method that solves its system in the modes of its option ``modes``."""

    @cached_property
    def basis(self) -> Array | None:
        """Return the subspace to which the options restrict the system, None where they do not. Raises NotPossible."""
        if self.options.modes is None:
            return None
        from gearstab.floquet.truncation import modes_basis

        return modes_basis(self.system, self.options.modes)

    @property
    def kept(self) -> str:
        """Return the modes that are kept, in words, where some are left out."""
        return f"modes {', '.join(map(str, self.options.modes))}"

    @cached_property
    def part(self) -> GearSystem:
        """The system that is solved."""
        return self.system if self.basis is None else self.system.projected(self.basis)

    def restriction(self) -> dict[str, Any]:
        """Return the attribute that says what is left out and what that neglects; none where nothing is."""
        if self.basis is None:
            return {}
        from gearstab.floquet.truncation import neglected

        coupling = neglected(self.system, self.basis)
        left_out = (
            f"neglects couplings of up to {coupling:.2g} of w_p w_q" if coupling else "which nothing couples to others"
        )
        size = self.basis.shape[-1]
        return {"restriction": f"{self.kept} of the base system: {size} of {self.system.size} modes, {left_out}"}

    def check_modes(self) -> None:
        """Raise OptionError for modes that there are not, or of which others have the same frequency."""
        if self.options.modes is None:
            return
        from gearstab.floquet.truncation import split_degenerate_group

        try:
            _ = self.basis
        except NotPossible as error:
            raise OptionError(("modes",), error.message, error.remedy) from None
        if group := split_degenerate_group(self.system, self.options.modes):
            message = f"modes {', '.join(map(str, group))} have equal frequencies"
            raise OptionError(("modes",), message, "name all of them or none")


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
