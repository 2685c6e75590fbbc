"""Base class of the methods of a sweep: options, needs, declarations and computation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Protocol

import numpy as np
from pydantic import AfterValidator, Field

from gearstab.config.model.fields import Quantity, Section, Whole
from gearstab.config.model.units import wrong
from gearstab.errors import NotPossible
from gearstab.results.variables import SIDE, Variable
from gearstab.system import Array, Feature, GearSystem, unsupported

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from gearstab.config.document import Document
    from gearstab.config.model import Axis
    from gearstab.perturbation import Tongue
    from gearstab.systems.base import System
    from gearstab.tolerance import SamplingDesign

POINTS, RANGE = "points", "range"
"""Part of the mesh-frequency axis that a method needs: every point of the grid or the ends of its axis; None for
neither."""

FEWEST = 4
"""Points of a block, however costly."""

Tolerance = Annotated[float, Field(gt=0, lt=1), Quantity()]
WidthFloor = Annotated[float, Field(ge=1e-12, lt=1), Quantity()]
"""Width of a region, relative to the mesh frequency; the least is ``floquet.boundaries.LEAST_FLOOR``."""

Key = tuple["Tongue", int]
"""Coordinates that identify regions along the dimension ``tongue``: where a region is rooted and, as there can be
several of one root, which one of them it is."""


class OptionError(ValueError):
    """The options of a method do not fit the system: ``path`` below the method, what is wrong, what to do."""

    def __init__(self, path: tuple[str, ...], message: str, remedy: str) -> None:
        super().__init__(message)
        self.path, self.remedy = path, remedy


@dataclass(frozen=True)
class Outcome:
    """Values of a method for a batch of systems, one per row.

    values: by variable, with GRID as ``(rows, P)`` and ROWS as ``(rows,)`` (one row may stand for all).
    tongues: what the dimension ``tongue`` consists of, for methods that have it.
    """

    values: Mapping[str, Array]
    tongues: tuple[Key, ...] = ()


class Method(ABC):
    """A method, for its options and a system.

    What a sweep declares, and how it divides its grid, goes by the method of the base system. Each block runs
    :meth:`of` its own batch of systems. A subclass sets the attributes, and overrides :meth:`variables`, :meth:`run`
    and :meth:`cost`, and of the others those that have more to say than the ones here.

    name: its key in ``methods`` of a configuration, and its group in the result. Options: its section there.
    frequency: what it needs of the mesh frequency; its results stand over all axes if that is POINTS, else over all but
        the mesh frequency. A method with RANGE gets it as an array of the two ends.
    cheap: whether it runs before the others. fewest: the least number of points of its own in a block.
    singly: whether it runs on one system at a time, with all its mesh frequencies, as it goes from one to the next.
    bounded: whether its cost is that of the most it does, so that it counts where not even a sample is done in time.
    reused: whether ``sweep --extend`` takes over what an earlier result has: points, or rows where it runs singly.
    relief: what to do where it takes very long.
    flag_notes: what is said at the end of a sweep of ``{points}`` that carry a flag of ``status``, by flag.
    supports: features of systems that it takes; a system with any other is refused. remedies: what to do then.
    """

    name: ClassVar[str]
    Options: ClassVar[type[Section]]
    frequency: ClassVar[str | None] = POINTS
    cheap: ClassVar[bool] = False
    singly: ClassVar[bool] = False
    bounded: ClassVar[bool] = False
    reused: ClassVar[bool] = False
    relief: ClassVar[str] = ""
    flag_notes: ClassVar[Mapping[str, str]] = {}
    supports: ClassVar[Collection[Feature]] = frozenset()
    remedies: ClassVar[Mapping[Feature, str]] = {}

    def __init__(self, options: Any, system: GearSystem) -> None:
        self.options, self.system = options, system

    @classmethod
    def on(cls, options: Any, system: GearSystem) -> Method:
        """Return the method for a base system: another class where that takes another theory."""
        return cls(options, system)

    @classmethod
    def sets(cls, section: Any) -> Collection[str]:
        """Return the names of parameters that its section, as written, gives values to, so that no axis must."""
        return ()

    @classmethod
    def over_range(cls, options: Any) -> str:
        """Say what happens over a range of mesh frequencies, for which one alone is too few; "" where it is not."""
        return ""

    @classmethod
    def completed(cls, options: Any, document: Document, source: FilePath, axes: Sequence[Axis]) -> Any:
        """Return options with what files and axes say of them; report problems.

        source: path of the configuration, to whose folder names of files are relative.
        """
        return options

    def of(self, system: GearSystem) -> Method:
        """Return the same method for another system, or a batch of systems."""
        return type(self)(self.options, system)

    def made_of(self, section: System) -> Method:
        """Return the same method for the system of a section ``system``."""
        return self.of(section.build())

    @property
    def left_out(self) -> str:
        """The axis of the sweep over which it does not stand, besides that of the mesh frequency; "" for none."""
        return ""

    @abstractmethod
    def variables(self) -> tuple[Variable, ...]:
        """Return what it computes, coordinates included."""

    @abstractmethod
    def run(self, mesh_frequency: Array) -> Outcome:
        """Compute the system at mesh frequencies ``(P,)`` or ``(rows, 1)``."""

    @abstractmethod
    def cost(self) -> float:
        """Return about how many points of an undamped system of three coordinates and four segments a point takes."""

    def once(self) -> tuple[Method, int]:
        """Return what runs on one system, and how many of these runs a row takes."""
        return self, 1

    def constants(self) -> Mapping[str, Any]:
        """Return the values of those coordinates that are the same everywhere."""
        return {}

    def check(self) -> None:
        """Raise OptionError if the system has a feature that is not supported, or the options do not fit it."""
        self.require(self.supports, self.remedies)
        self.check_options()

    def check_options(self) -> None:  # noqa: B027  # most options fit every system
        """Raise OptionError if the options do not fit a system whose features are supported."""

    def require(
        self, supported: Collection[Feature], remedies: Mapping[Feature, str], path: tuple[str, ...] = ()
    ) -> None:
        """Raise OptionError if the system has a feature that is not ``supported``.

        path: of the option that does not support it.
        """
        if found := unsupported(self.system, supported, remedies):
            raise OptionError(path, *found)

    def report(self) -> Mapping[str, Any]:
        """Return attributes that say what it makes of the system."""
        return {}

    def note(self) -> str | None:
        """Return what the user should know before it runs, None for nothing."""
        return None

    def outlook(self) -> str | None:
        """Return what there is to say of its cost besides the estimated time, None for nothing."""
        return None

    @property
    def parallel(self) -> bool:
        """Whether threads of one process can run it side by side: where it spends its time outside of Python."""
        return False

    @property
    def fewest(self) -> int:
        """The least number of points of its own in a block, however costly; more where they share work."""
        return FEWEST

    @classmethod
    def unite(cls, indices: Iterable[Sequence[Key]]) -> tuple[Key, ...]:
        """Return the list of all regions, from those of the blocks: each once, in order of first appearance.

        Searches of a range find different regions in every system: these are in the order of their roots.
        """
        if cls.frequency == RANGE:
            from gearstab.floquet.boundaries import union

            return union(indices)
        return tuple(dict.fromkeys(key for index in indices for key in index))

    @cached_property
    def results(self) -> tuple[Variable, ...]:
        """The variables that its blocks hold: all but coordinates."""
        return tuple(variable for variable in self.variables() if not variable.coordinate)

    @property
    def over_tongues(self) -> bool:
        """Whether its results stand over instability regions, a list that differs from system to system."""
        return self.frequency != POINTS

    def attributes(self) -> dict[str, Any]:
        """Return what the group in the result says of the options and of the system."""
        return flat(self.options.model_dump(exclude_none=True)) | dict(self.report())


class TongueMethod(Method):
    """A method whose results stand over instability regions and both of their edges."""

    frequency: ClassVar[str | None] = None

    def constants(self) -> Mapping[str, Any]:
        return {SIDE.name: ["lower", "upper"]}


class UncertainSpeed(Protocol):
    """A mesh frequency that is not known exactly; ``present``, ``factor``: what it deviates from, and its unit."""

    def below(self, x: Array, present: Any, factor: float) -> Array:
        """Return the probability of less than x."""

    def values(self, u: Array, present: Any, factor: float) -> Array:
        """Return the values for u, uniform in (0, 1)."""


class SampledMethod(Method):
    """A method that runs on samples of uncertain parameters: on batches of ``rows * samples`` systems.

    ``run`` gets the samples of a row next to each other, and gives one value for each row.
    """

    MOST_AT_ONCE: ClassVar[int] = 1 << 20
    """Samples times points that are treated together."""

    @property
    @abstractmethod
    def design(self) -> SamplingDesign:
        """The samples, the same for all systems."""

    @property
    def integrates(self) -> bool:
        """Whether the mesh frequency is integrated rather than drawn, so that ``integrated`` is called, not ``run``."""
        return False

    def integrated(self, present: Array, speed: UncertainSpeed, factor: float) -> Outcome:
        """Compute a batch whose mesh frequency is uncertain beside the ``present`` ones."""
        raise NotImplementedError

    def portions(self, rows: int, points: int) -> Iterator[slice]:
        """Divide rows of so many points into those whose samples are treated together."""
        step = max(1, self.MOST_AT_ONCE // (self.design.size * max(1, points)))
        for first in range(0, rows, step):
            yield slice(first, min(rows, first + step))


def flat(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return options as attributes: without truth values, those of a section after its name."""
    found: dict[str, Any] = {}
    for name, value in options.items():
        if isinstance(value, Mapping):
            found |= {f"{name}_{inner}": one for inner, one in flat(value).items()}
        else:
            found[name] = int(value) if isinstance(value, bool) else value
    return found


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
