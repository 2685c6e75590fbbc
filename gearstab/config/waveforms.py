"""The section ``waveform``: the shape of a mesh stiffness over its period."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, StrictStr
from pydantic_core import PydanticCustomError, core_schema

from gearstab.config.model.conflicts import Conflict, at_most_one, exactly_one
from gearstab.config.model.fields import (
    Choice,
    NonNegative,
    Number,
    Quantity,
    Section,
    Whole,
)
from gearstab.waveforms.splines import FEWEST

MOST_HARMONICS = 200
MOST_SAMPLES = 10_000
"""Far more than a cycle of a mesh needs, and each is a kink that the integration must stop at."""
NARROWEST = 1e-9
"""Distance of two samples; closer ones make slopes that double precision cannot hold."""


POSITION = Quantity(turns=True)


class Position:
    """A fraction of a turn that no axis sets."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(POSITION.number, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return handler(schema)


@dataclass(frozen=True)
class Form:
    """What a kind of waveform takes.

    required, optional: keys beside ``kind``. contact_ratio: whether the mesh gives one. own_variation: whether the wave
    has an epsilon of its own, when the mesh gives none. shapes: keys of which exactly one says where it comes from.
    """

    required: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    contact_ratio: bool = True
    own_variation: bool = False
    shapes: tuple[str, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """All of them."""
        return self.required + self.optional


SAMPLES = ("file", "phase", "stiffness", "interpolation")

FORMS: dict[str, Form] = {
    "rectangular": Form(),
    "trapezoidal": Form(required=("ramp",)),
    "fourier": Form(optional=("sin", "cos"), contact_ratio=False),
    "sampled": Form(optional=SAMPLES, contact_ratio=False, own_variation=True, shapes=("file", "stiffness")),
    "pair": Form(
        optional=("shape", "ends", "pair_stiffness", *SAMPLES),
        own_variation=True,
        shapes=("shape", "file", "stiffness"),
    ),
    "tooth": Form(optional=("harmonics",), contact_ratio=False, own_variation=True),
}
"""The kinds of waveforms and their keys, one line each."""


class Waveform(Section):
    """The shape of the mesh stiffness over its period; which keys it has depends on its kind."""

    kind: Annotated[str, Choice("waveform", tuple(FORMS))] = Field(
        default="rectangular",
        title="kind of waveform",
        description="rectangular: stiff for the fraction c - floor(c) of the period; trapezoidal: with ramps; "
        "fourier: a series; sampled: stiffness over a period; pair: the sum over the pairs of teeth in contact; "
        "tooth: computed from the teeth of a gearbox.",
    )
    ramp: Annotated[float, Field(ge=0, le=1), Quantity()] | None = Field(
        default=None,
        title="ramp",
        description="trapezoidal: each jump is a linear ramp of this fraction of the period, centred on the jump (1).",
    )
    sin: Annotated[list[Number], Field(max_length=MOST_HARMONICS)] | None = Field(
        default=None,
        title="sine coefficients",
        description="fourier: a_s of sin s x, s = 1, 2, ..., x = Omega_i t - 2 pi lag (1).",
    )
    cos: Annotated[list[Number], Field(max_length=MOST_HARMONICS)] | None = Field(
        default=None, title="cosine coefficients", description="fourier: b_s of cos s x, s = 1, 2, ... (1)."
    )
    shape: Annotated[str, Choice("shape", ("constant", "parabolic"))] | None = Field(
        default=None,
        title="shape of a pair's stiffness",
        description="pair: along the contact of one pair, constant or parabolic; or give file, or stiffness.",
    )
    ends: NonNegative | None = Field(
        default=None,
        title="stiffness at the ends of contact",
        description="pair: of a parabolic shape, over that in the middle (1); 0.55 without (Cai & Hayashi 1994).",
    )
    pair_stiffness: Annotated[float, Field(gt=0), Quantity("N/m", ("N m",))] | None = Field(
        default=None,
        title="stiffness of one pair",
        description="pair: in the middle of its contact (N/m); the mesh then needs no mean_stiffness.",
    )
    file: StrictStr | None = Field(
        default=None,
        title="file of samples",
        description="sampled, pair: a .csv or .h5 file of phase and stiffness, relative to the configuration.",
    )
    phase: list[Annotated[float, Position()]] | None = Field(
        default=None,
        title="phases of the samples",
        description="sampled: in [0, 1), ascending; pair: from 0 to 1 along the contact of one pair (1).",
    )
    stiffness: list[Annotated[float, Quantity("N/m", ("N m",))]] | None = Field(
        default=None, title="sampled stiffness", description="sampled, pair: one value a phase (N/m)."
    )
    interpolation: Annotated[str, Choice("interpolation", ("linear", "cubic"))] | None = Field(
        default=None,
        title="interpolation",
        description="sampled, pair: linear (order 2, the default) or cubic, a spline (order 4, overshoots at jumps).",
    )
    harmonics: Annotated[int, Field(ge=1, le=MOST_HARMONICS), Whole()] | None = Field(
        default=None, title="harmonics", description="tooth: keep the wave's first harmonics only; all without."
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """Keys of other kinds, keys that are missing, and samples that make no function."""
        kind = kind_of(raw)
        form = FORMS.get(kind)
        if form is None:
            return
        for key in raw:
            if key in cls.model_fields and key != "kind" and key not in form.keys and raw[key] is not None:
                owners = ", ".join(name for name, other in FORMS.items() if key in other.keys)
                yield (key,), f"a {kind} wave takes no {key}", f"remove it, or choose kind: {owners}"
        for key in form.required:
            if raw.get(key) is None:
                description = (cls.model_fields[key].description or "").partition(": ")[2]
                yield (key,), "is missing", f"add {key}: {description.rstrip('.')}"
        known = set(raw) <= set(cls.model_fields)
        if kind == "fourier" and known and not raw.get("sin") and not raw.get("cos"):
            yield (), "has no harmonics", "add sin: [..] or cos: [..], the coefficients of the harmonics"
        if form.shapes:
            yield from _samples(raw, kind, form)


def _samples(raw: dict[str, Any], kind: str, form: Form) -> Iterator[Conflict]:
    phase, stiffness = raw.get("phase"), raw.get("stiffness")
    if phase is not None and all(raw.get(key) is None for key in form.shapes):
        yield ("stiffness",), "is missing", "add stiffness: one number for each phase"
        return
    given = [key for key in form.shapes if raw.get(key) is not None]
    yield from exactly_one(raw, form.shapes)
    if len(given) > 1:
        return
    if raw.get("ends") is not None and raw.get("shape") != "parabolic":
        yield ("ends",), "belongs to a parabolic shape", "remove it, or choose shape: parabolic"
    if raw.get("shape") is not None:
        for key in ("phase", "interpolation"):
            if raw.get(key) is not None:
                yield (key,), "belongs to sampled stiffness", "remove it, or give stiffness instead of shape"
    elif "pair_stiffness" in form.keys:
        yield from at_most_one(raw, ("pair_stiffness", "file", "stiffness"))
    if raw.get("file") is not None and phase is not None:
        yield ("phase",), "file is given already", "keep one of file, phase"
    elif stiffness is not None and phase is None:
        yield ("phase",), "is missing", "add phase: one number for each stiffness"
    positions = _positions(phase)
    if positions is not None and isinstance(stiffness, list):
        if len(positions) != len(stiffness):
            yield ("stiffness",), f"has {len(stiffness)} entries", f"give {len(positions)}, one a phase"
        elif found := wrong_phase(positions, kind, str(raw.get("interpolation") or "linear")):
            index, message, hint = found
            yield ("phase",) if index is None else ("phase", index), message, hint


def wrong_phase(phase: Sequence[float], kind: str, interpolation: str) -> tuple[int | None, str, str] | None:
    """What is wrong with the phases of samples: index of the first wrong one, message, remedy.

    kind: ``sampled``, phases in [0, 1), or ``pair``, from 0 to 1.
    """
    fewest = FEWEST.get(interpolation, 2) if kind == "sampled" else 2
    if len(phase) < fewest:
        return (
            None,
            f"has {len(phase)} sample{'s' * (len(phase) != 1)}",
            f"give at least {fewest} for {interpolation} interpolation",
        )
    if len(phase) > MOST_SAMPLES:
        return None, f"has {len(phase)} samples", f"give at most {MOST_SAMPLES}"
    for i, value in enumerate(phase):
        if kind == "sampled" and not 0 <= value < 1:
            again = "; leave it out, phase 1 is phase 0 again" if value == 1 else ""
            return i, f"phase {value:g} is outside [0, 1)", f"a phase is a fraction of the mesh period{again}"
        if kind == "pair" and not 0 <= value <= 1:
            return i, f"phase {value:g} is outside [0, 1]", "0 is the first point of a pair's contact, 1 the last one"
        if i and value == phase[i - 1]:
            return i, f"phase {value:g} is given twice", "give each phase once; a jump is a steep slope"
        if i and value - phase[i - 1] < NARROWEST:
            apart = "is not above the one before" if value < phase[i - 1] else "is too close to the one before"
            return i, f"phase {value:g} {apart}", "sort the samples by phase"
    if kind == "pair" and (phase[0] != 0 or phase[-1] != 1):
        return None, f"runs from {phase[0]:g} to {phase[-1]:g}", "give a pair's whole contact, from phase 0 to 1"
    return None


def _positions(phase: Any) -> list[float] | None:
    """The phases of samples; None where there is no list, or something in it that is reported value by value."""
    if not isinstance(phase, list):
        return None
    try:
        return [POSITION.number(value) for value in phase]
    except PydanticCustomError:
        return None


def kind_of(waveform: Any) -> str:
    """The kind of a section ``waveform`` as written, "" for none that exists."""
    kind = waveform.get("kind", "rectangular") if isinstance(waveform, dict) else "rectangular" if not waveform else ""
    return kind if isinstance(kind, str) and kind in FORMS else ""


def form_of(mesh: Any) -> Form | None:
    """That of a mesh as written; None where its kind does not exist."""
    return FORMS.get(kind_of(mesh.get("waveform") if isinstance(mesh, dict) else None))


def shape_conflicts(raw: dict[str, Any], contact_ratio: str) -> Iterator[Conflict]:
    """What contradicts itself in ``waveform`` and ``contact_ratio`` of a section as written.

    contact_ratio: what to give where it is missing.
    """
    waveform, ratio, form = raw.get("waveform"), raw.get("contact_ratio"), form_of(raw)
    if isinstance(waveform, dict):
        for path, message, hint in Waveform.conflicts(waveform):
            yield ("waveform", *path), message, hint
    if form is None:
        return
    if ratio is None and form.contact_ratio:
        yield ("contact_ratio",), "is missing", f"add contact_ratio: {contact_ratio}"
    elif ratio is not None and not form.contact_ratio:
        yield ("contact_ratio",), "the waveform has no contact ratio", "remove it, or choose another waveform"


def has_no_ratio(mesh: Any) -> bool:
    """Whether the waveform of a mesh as written takes no contact ratio."""
    form = form_of(mesh)
    return form is not None and not form.contact_ratio


def has_own_mean(mesh: dict[str, Any]) -> bool:
    """Whether the wave of a mesh as written says how stiff it is."""
    waveform = mesh.get("waveform")
    keys = ("file", "stiffness", "pair_stiffness")
    given = isinstance(waveform, dict) and any(waveform.get(k) is not None for k in keys)
    return given or kind_of(waveform) == "sampled"
