"""Mistakes in a section: contradictions that rules find, and errors of pydantic, as problems with a remedy.

Rules look at typed sections; :mod:`gearstab.config.model.reading` says what they find of values that are wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any, TypeVar, cast, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import ErrorDetails, PydanticCustomError

from gearstab.config.document import Code, Document, Path, entries, is_number, nearest
from gearstab.config.model.fields import Section
from gearstab.config.model.reading import (
    WRONG,
    bare,
    descriptions,
    field_types,
    is_known,
    is_model,
    known,
    number_kind,
    read,
    right_name,
    type_at,
)
from gearstab.config.model.units import hint_of

Conflict = tuple[Path, Code, str, str]
"""Path below the section, code, message, remedy."""


def items(section: Any) -> list[tuple[Any, Any]]:
    """Return key and value of every known entry of a list, or of a section by name; none where it is not given."""
    return [(key, value) for key, value in entries(section) if value is not None and value is not WRONG]


def exactly_one(section: Any, names: tuple[str, ...]) -> Iterator[Conflict]:
    """Yield a conflict unless exactly one of the fields is given."""
    either = " or ".join(names)
    if all(getattr(section, name) is None for name in names):
        yield (), "missing", f"{either} is missing", f"add {either}"
    yield from at_most_one(section, names)


def at_most_one(section: Any, names: tuple[str, ...]) -> Iterator[Conflict]:
    """Yield a conflict for each field that is given in addition to another one."""
    given = [name for name in names if getattr(section, name) is not None]
    for extra in given[1:]:
        yield (extra,), "already_given", f"{given[0]} is given already", f"keep one of {', '.join(names)}"


def below(key: str | int, conflicts: Iterable[Conflict]) -> Iterator[Conflict]:
    """Yield the conflicts of the section at a key."""
    for path, code, message, hint in known(conflicts):
        yield (key, *path), code, message, hint


def plain_number(value: Any) -> float | None:
    """Return a number as written, or as a parameter; None for a text with a unit and what is no number."""
    return float(value) if is_number(value) else None


def within(section: Any, key: str, rule: Callable[[Any], Iterable[Conflict]]) -> Iterator[Conflict]:
    """Yield the conflicts that a rule finds in the section at a key, where it is given."""
    inner = getattr(section, key)
    if inner is not None and inner is not WRONG:
        yield from below(key, rule(inner))


def within_each(section: Any, key: str, rule: Callable[[Any], Iterable[Conflict]]) -> Iterator[Conflict]:
    """Yield the conflicts that a rule finds in each entry of the list or section at a key."""
    for place, item in items(getattr(section, key)):
        yield from below(key, below(place, rule(item)))


def wrong_length(section: Any, key: str, size: int | None, what: str = "coordinate") -> Iterator[Conflict]:
    """Yield a conflict where the list at a key has another number of entries than ``size``; None: it is unknown."""
    inner = getattr(section, key)
    if inner is not None and inner is not WRONG and size is not None and len(inner) != size:
        yield (key,), "wrong_count", f"has {len(inner)} entries", f"give {size}, one per {what}"


def no_direction(section: Any, key: str, size: int | None, hint: str) -> Iterator[Conflict]:
    """Yield a conflict where the list at a key is no vector of the size of the system, or has only zeros."""
    wrong, vector = list(wrong_length(section, key, size)), getattr(section, key)
    yield from wrong
    if vector and not wrong and all(entry == 0 for entry in vector):
        yield (key,), "only_zeros", "has only zeros", hint


def repeated_names(section: Any, key: str, one: str) -> Iterator[Conflict]:
    """Yield a conflict for each name of an entry of the list at a key that one before it has. one: what an entry is."""
    seen: set[str] = set()
    for place, item in items(getattr(section, key)):
        name = getattr(item, "name", None)
        if not isinstance(name, str):
            continue
        if name in seen:
            message, hint = f"two {key.replace('_', ' ')} are called '{name}'", f"give each {one} a name of its own"
            yield (key, place, "name"), "repeated_name", message, hint
        seen.add(name)


def report(document: Document, path: Path, conflicts: Iterable[Conflict], section: Any) -> None:
    """Report what contradicts itself in a section, but for what is said of wrong values."""
    for inner, code, message, hint in known(conflicts):
        if is_known(section, inner):
            document.report((*path, *inner), code, message, hint)


CARRIER = "planets on a turning carrier belong to planetary_sets of kind: gearbox, or to kind: planetary"
INSTEAD_OF_CARRIER = "give planetary_sets: [{name, sun, ring, carrier, held, planets: {count, teeth}}] in a gearbox"

HELICAL = (
    "helical teeth belong to gears, whose numbers of teeth and modules are known",
    "give helix_angle, and hand: right or left, to gears or rotors of kind: gearbox, or to gears of kind: planetary",
)
BEVEL = ("bevel, hypoid and worm gears are not modelled: axes are parallel", "take kind: matrices")
MODIFIED = (
    "profile relief is that of a mesh of kind: gearbox; other modifications of the flanks are not modelled",
    "give the mesh relief: {tip: {amount: 20 um, length: 2 mm}}, or the stiffness that they leave as waveform: "
    "{kind: sampled, ..}",
)
MISALIGNED = (
    "misalignment of gears and a load that varies along the face are not modelled",
    "give the stiffness that they leave as waveform: {kind: sampled, ..} and mean_stiffness",
)
TILTING = (
    "tilting rotors and bending shafts are not modelled: gears move in their plane, and along the axis in gearboxes",
    "take kind: matrices with the matrices of a finite element program",
)
FRICTION = (
    "dry friction of bearings and seals is not modelled: all damping is viscous",
    "give damping_ratio, or friction: {coefficient: ..} to a mesh of kind: gearbox for that between teeth",
)
STRUCTURAL = (
    "structural (hysteretic) damping, which depends on no frequency, is not modelled: all damping is viscous",
    "give damping_ratio: a loss factor of 0.02 is one of 0.01 at resonance",
)
HEAT = (
    "temperatures and lubricant films are not modelled",
    "change what they change: stiffness, centre distance, damping",
)
REVOLVING = (
    "errors that repeat with a revolution are those of a mesh of two gears of kind: gearbox, and not of planetary sets",
    "give that mesh revolution_errors: [{gear: NAME, cos: [10 um]}], or remove it",
)
NOT_MODELLED = {
    **dict.fromkeys(("helix_angle", "helix", "hand", "overlap_ratio"), HELICAL),
    **dict.fromkeys(("cone_angle", "pitch_cone_angle", "shaft_angle", "spiral_angle", "lead_angle"), BEVEL),
    **dict.fromkeys(("misalignment", "misaligned", "lead_crowning", "face_load_factor"), MISALIGNED),
    **dict.fromkeys(("tilting_stiffness", "tilt", "diametral_inertia", "bending_stiffness"), TILTING),
    **dict.fromkeys(("dry_friction", "coulomb_friction", "friction_torque"), FRICTION),
    **dict.fromkeys(("structural_damping", "hysteretic_damping", "loss_factor"), STRUCTURAL),
    **dict.fromkeys(("temperature", "lubricant", "film_thickness", "oil_film"), HEAT),
    **dict.fromkeys(("revolution_errors", "eccentricity", "run_out", "runout", "pitch_error"), REVOLVING),
    **dict.fromkeys(("relief", "tip_relief", "root_relief", "crowning", "profile_modification"), MODIFIED),
}
"""Key -> message and remedy, in every section of a system."""
PLANETARY = ("planets", "planet", "carrier", "planetary", "stages")
"""Keys of stages with a carrier, in kinds that have none."""


def not_modelled(key: str, kind: object) -> tuple[str, str] | None:
    """Return message and remedy of an unknown key in a system of a kind; None where it means nothing in particular."""
    if key in PLANETARY and kind != "planetary":
        return CARRIER, INSTEAD_OF_CARRIER
    return NOT_MODELLED.get(key)


Model = TypeVar("Model", bound=BaseModel)

SIGNS = {"greater_than": ">", "greater_than_equal": ">=", "less_than": "<", "less_than_equal": "<="}
SHAPES = {
    "list_type": ("must be a list", "write [ ... ]"),
    "tuple_type": ("must be a list", "write [ ... ]"),
    "model_type": ("must be a mapping", "write keys and values below it, or { ... }"),
    "dict_type": ("must be a mapping", "write keys and values below it, or { ... }"),
    "bool_type": ("must be true or false", "write true or false, without quotes"),
    "string_type": ("must be a text", "put it in quotes"),
}


def validate(document: Document, model: type[Model], path: Path) -> Model | None:
    """The section at ``path`` as its model, or None after reporting what is wrong with it."""
    section, errors = read(model, document.get(path))
    report_errors(document, errors, model, path)
    return None if errors else section


def report_errors(
    document: Document, details: Sequence[ErrorDetails], model: Any, path: Path, ignore: Collection[Path] = ()
) -> None:
    """Report every error but those that follow from another one.

    These concern neighbours of an option that does not exist yet, or a key that is given but misspelt. ignore: paths in
    the document whose problems are known already.
    """
    extra = [d["loc"] for d in details if d["type"] == "extra_forbidden"]
    misspelt = [(*loc[:-1], right_name(str(loc[-1]), type_at(model, loc[:-1]))) for loc in extra]
    unavailable = [d["loc"] for d in details if d["type"] == "unavailable"]
    for detail in details:
        loc = detail["loc"]
        follows = (_lacks(detail) and loc in misspelt) or any(
            loc != other and loc[: len(other) - 1] == other[:-1] for other in unavailable
        )
        if (*path, *loc) not in ignore and not follows:
            _report_one(document, detail, model, path)


def explain(detail: Any) -> tuple[Code, str, str]:
    """Return code, message and remedy of an error that concerns a value alone."""
    kind, context = detail["type"], detail.get("ctx", {})
    if kind in SIGNS:
        bound = f"{SIGNS[kind]} {next(iter(context.values())):g}"
        return "out_of_range", f"must be {bound}", f"choose a value {bound}"
    if kind in SHAPES:
        return "wrong_type", *SHAPES[kind]
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        hint = f"give {'at least' if kind == 'too_short' else 'at most'} {wanted}"
        return "wrong_count", f"has {context['actual_length']} entries", hint
    return kind, detail["msg"], context.get("hint", "")


def report_detail(document: Document, path: Path, detail: Any, value: Any) -> None:
    """Report an error that concerns a value alone."""
    document.report(path, *explain(detail), value=value)


def report_wrong(document: Document, path: Path, error: PydanticCustomError, value: Any) -> None:
    """Report an error that a conversion raised."""
    document.report(path, cast(Code, error.type), error.message(), hint_of(error), value=value)


def _report_one(document: Document, detail: Any, model: Any, path: Path) -> None:
    loc: Path = detail["loc"]
    here = (*path, *loc)
    parent = type_at(model, loc[:-1])
    if _lacks(detail) and isinstance(loc[-1], int):
        _wrong_count(document, here[:-1], parent)
    elif _lacks(detail):
        description = descriptions(parent).get(str(loc[-1]), "")
        document.report(here, "missing", "is missing", f"add {loc[-1]}: {description.rstrip('.')}")
    elif detail["type"] == "extra_forbidden":
        key = str(loc[-1])
        if here[0] == "system" and (absent := not_modelled(key, document.get(("system", "kind")))):
            if absent[0] not in [problem.message for problem in document.problems]:
                document.report(here, "unavailable", *absent, at_key=True)
            return
        # In braces a comma begins the next entry: {start: 0,35} has the keys start and 35.
        comma = key.isdecimal() and detail["input"] is None
        hint = "write a decimal point if this follows a decimal comma" if comma else _right_key(key, parent)
        document.report(here, "unknown_key", "unknown key", hint, at_key=True)
    elif detail["type"] == "too_long" and get_origin(bare(type_at(model, loc))) is tuple:
        _wrong_count(document, here, type_at(model, loc))
    else:
        code, message, hint = explain(detail)
        value = detail["input"]
        kind = number_kind(type_at(model, loc))
        if detail["type"] in SIGNS and kind is not None and kind.unit == "rad" and isinstance(value, int | float):
            hint = f'write "{value:g} deg" if degrees are meant, or {hint} rad'
        document.report(here, code, message, hint, value=None if value in ([], {}) else value)


def _lacks(detail: Any) -> bool:
    """Whether a field is missing, and not what a validator says to be so, which travels in a context."""
    return detail["type"] == "missing" and not detail.get("ctx")


def _wrong_count(document: Document, path: Path, annotation: Any) -> None:
    count = len(get_args(bare(annotation)))
    given = len(document.get(path))
    if not any(p.path == ".".join(map(str, path)) and p.code == "wrong_count" for p in document.problems):
        document.report(path, "wrong_count", f"has {given} entr{'y' if given == 1 else 'ies'}", f"give exactly {count}")


def _right_key(key: str, model: type[BaseModel]) -> str:
    if issubclass(model, Section) and key in model.misplaced:
        return model.misplaced[key]
    sections = [name for name, kind in field_types(model).items() if is_model(kind) and key in kind.model_fields]
    if len(sections) == 1:
        return f"it belongs in {sections[0]}: {{{key}: ..}}"
    return nearest(key, model.model_fields)
