"""Facts that ``gearstab info`` and the report share, once each: JSON, text and pages are written from these records."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from gearstab.config.model.units import UnitError, scale
from gearstab.errors import ResultError
from gearstab.results.display import ORDER, SI

if TYPE_CHECKING:
    from gearstab.perturbation.tongues import Tongue
    from gearstab.system import GearSystem


def plain(value: Any) -> Any:
    """Return facts as plain numbers, texts, lists and mappings, of records what they know of themselves."""
    if is_dataclass(value) and not isinstance(value, type):
        own = getattr(value, "plain", None)
        return own() if own is not None else {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value


def unit_asked(text: str, dimensionless: bool) -> tuple[str, float]:
    """Return the unit that ``--unit`` means and its size in rad/s. Raises ResultError for one of something else."""
    if dimensionless:
        raise ResultError(f"--unit {text}: this model has no units")
    unit = "rad/s" if text == SI else text
    try:
        return unit, scale(unit, "rad/s")
    except UnitError:
        raise ResultError(f"--unit {text}: is no unit of a speed; give rpm, Hz, rad/s or SI") from None


def time_unit(dimensionless: bool) -> str:
    """Return the word for the time in which vibration grows by as many e-folds as a growth rate says."""
    return "unit of time" if dimensionless else "second"


@dataclass(frozen=True)
class ShownSpeeds:
    """How speeds are written: the mesh frequency over ``scale``, with the name and unit of what was typed.

    teeth: the mesh frequency over the speed of that name, the teeth of an input gear; scale: that times the unit.
    """

    name: str
    unit: str
    scale: float
    teeth: float = 1.0

    @property
    def brackets(self) -> str:
        """The unit for a heading."""
        return f" ({self.unit})" if self.unit else ""

    def text(self, *speeds: float) -> str:
        """Return ``4.9 to 5.9`` of mesh frequencies."""
        return " to ".join(f"{speed / self.scale:.5g}" for speed in speeds)

    def with_unit(self, *speeds: float) -> str:
        """Return ``4.9 to 5.9 rpm`` of mesh frequencies."""
        return f"{self.text(*speeds)} {self.unit}".strip()


@dataclass(frozen=True)
class MeanSystem:
    """The motions of a mean system as a whole, which need not be those of its symmetric part.

    mode: number of the mode that a motion resembles. frequency, growth_rate: of each motion, by ascending frequency.
    """

    unstable: bool
    mode: list[int]
    frequency: list[float]
    growth_rate: list[float]

    @classmethod
    def of(cls, system: GearSystem) -> Self:
        """Return the motions of the mean system of a base system."""
        from gearstab.floquet.general.mean import mean_motions

        found = mean_motions(system)
        rows = ((found.mode[0] + 1).tolist(), found.frequency[0].tolist(), found.growth_rate[0].tolist())
        return cls(bool(found.unstable.any()), *rows)

    @property
    def fastest(self) -> tuple[float, float]:
        """The largest growth rate and the frequency of that motion."""
        return max(zip(self.growth_rate, self.frequency, strict=True), key=lambda motion: motion[0])


@dataclass(frozen=True)
class Remedies:
    """Remedies of a region, one by one; None where it does not, or was not tried.

    damping_ratio: of all modes. contact_ratio: by mesh, which together leave the part ``contact_ratio_leaves`` of it.
    phasing, sun_teeth_modulo: what to change, to what, and what that leaves. refuted: remedies of first order that
    exact search refutes, by name.
    """

    damping_ratio: float | None = None
    contact_ratio: dict[str, float] | None = None
    contact_ratio_leaves: float | None = None
    phasing: dict[str, Any] | None = None
    sun_teeth_modulo: dict[str, Any] | None = None
    refuted: list[str] | None = None

    def plain(self) -> dict[str, Any]:
        """Return those there are."""
        return {name: value for name, value in asdict(self).items() if value is not None}


@dataclass(frozen=True)
class DangerousRegion:
    """A region of instability, named by its tongue: exact, or as first-order theory has it.

    boundary_frequency: edges in the mesh frequency, None of a closed region. endless: whether it has none.
    share_of_range: the part of the range that it takes. growth_rate: the largest in it. threshold: the factor on all
    stiffness variations from which on it is open, to first order.
    """

    label: str
    kind: str
    mesh: str
    harmonic: int
    mode_p: int
    mode_q: int
    frequency_ratio: float
    boundary_frequency: list[float] | None
    endless: bool
    share_of_range: float | None
    center_frequency: float
    growth_rate: float | None
    threshold: float | None
    closed_by: Remedies

    @classmethod
    def of(cls, tongue: Tongue, **found: Any) -> Self:
        """Return the region of a tongue with what was found of it."""
        names = ("label", "kind", "mesh", "harmonic", "mode_p", "mode_q", "frequency_ratio")
        return cls(**{name: getattr(tongue, name) for name in names}, **found)


@dataclass(frozen=True)
class JudgedRegions:
    """The regions between two mesh frequencies: candidates of first order, decided by exact search near them.

    verified: whether they were decided, which takes a common period that is not too long. scanned: at how many speeds
    of the range growth rates were looked at besides; unstable_share: the part of these at which they are positive.
    refuted: how many remedies of first order failed. not_judged: the modes of which first order knows nothing, as their
    mean stiffness is not positive. without_remedies: whether none are known: the rules for them go by real modes.
    """

    harmonics: int
    verified: bool
    scanned: int
    unstable_share: float | None
    not_judged: list[int]
    without_remedies: bool
    open: list[DangerousRegion]
    closest: list[DangerousRegion]
    number_open: int
    number_closed_by_damping: int
    number_not_excited: int
    refuted: int


@dataclass(frozen=True)
class DangerousSpeeds:
    """Dangers in the range of a sweep; without an axis of the mesh frequency all regions count.

    range: as shown. refused: why first-order theory, by which regions are looked for, does not apply; None where it
    does, and then regions are ``judged``.
    """

    shown: ShownSpeeds
    range: list[float] | None
    refused: str | None
    judged: JudgedRegions | None

    @property
    def unstable_share(self) -> float | None:
        """The part of the speeds looked at that is unstable, None where none were."""
        return None if self.judged is None else self.judged.unstable_share

    def within(self, unit: str, one: float) -> Self:
        """Return the same in another unit. one: its size in rad/s."""
        shown = replace(self.shown, unit=unit, scale=one * self.shown.teeth)
        ends = self.range and [end * self.shown.scale / shown.scale for end in self.range]
        return replace(self, shown=shown, range=ends)

    def plain(self) -> dict[str, Any]:
        """Return one mapping of all."""
        shown = {"axis": self.shown.name, **{k: getattr(self.shown, k) for k in ("unit", "scale", "teeth")}}
        judged = {"unstable_share": None} if self.judged is None else plain(self.judged)
        return shown | {"range": self.range, "refused": self.refused} | judged


OF_TONGUES = ("center_frequency", "half_width", "boundary_frequency", "boundary_error")
"""Keys of a tongue that are frequencies, or distances of them."""


def shown_in(facts: dict[str, Any], text: str) -> dict[str, Any]:
    """Return the facts with natural frequencies, tongues and the table of dangerous speeds in a unit.

    text: rpm, Hz, rad/s or another unit of a speed; SI. Raises ResultError for any other, and for orders.
    """
    if text == ORDER:
        where = (
            "the table of meshes shows theirs" if facts["meshes"][0]["order"] is not None else "and no teeth are given"
        )
        raise ResultError(f"--unit {text}: a natural frequency has an order at a single speed only; {where}")
    unit, one = unit_asked(text, not facts["unit"])
    return facts | {
        "unit": unit,
        "per_unit": one,
        "modes": [mode | {"natural_frequency": over(mode["natural_frequency"], one)} for mode in facts["modes"]],
        "tongues": [t | {key: over(t[key], one) for key in OF_TONGUES if key in t} for t in facts["tongues"]],
        "dangerous": facts["dangerous"].within(unit, one),
    }


def over(value: Any, one: float) -> Any:
    """Return a number or a list of them over a unit; texts and None as they are."""
    if isinstance(value, list):
        return [over(item, one) for item in value]
    return value / one if isinstance(value, float) else value


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns of text: the first to the left, numbers to the right, two spaces between."""
    numeric = [all(row[k] in {"", "-"} or row[k][0] in "+-.0123456789" for row in rows) for k in range(len(header))]
    widths = [max(len(line[k]) for line in [header, *rows]) for k in range(len(header))]
    lines = [header, ["-" * width for width in widths], *rows]
    pads = [str.rjust if right else str.ljust for right in numeric]
    padded = ([pad(cell, width) for pad, cell, width in zip(pads, line, widths, strict=True)] for line in lines)
    return "\n".join("  ".join(cells).rstrip() for cells in padded)


def columns(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns of text, all to the left, two spaces between, under a plain header."""
    widths = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in [header, *rows]
    ]


OF_SET = re.compile(r"(.+)\.(sun|ring)\.\d+")
"""The name of a mesh of a planetary set."""


def meshes_text(names: Iterable[str]) -> str:
    """Meshes in short: those of a planetary set, or of its sun or ring, by the name of the set."""
    kinds: dict[str, set[str]] = {}
    for name in names:
        found = OF_SET.fullmatch(name)
        kinds.setdefault(found[1] if found else name, set()).update({found[2]} if found else ())
    return ", ".join(f"{name}.{min(kind)}" if len(kind) == 1 else name for name, kind in kinds.items())


def label_text(label: str) -> str:
    """The label of a tongue, or several, with the meshes of sets in short: ``2w7/5 (stage 2)``."""

    def short(found: re.Match[str]) -> str:
        names = found[1].split("+")
        return f" ({meshes_text(names)})" if any(map(OF_SET.fullmatch, names)) else found[0]

    return re.sub(r" \(([^()]+)\)", short, label)
