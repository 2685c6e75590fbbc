"""Sections ``sweep``, ``methods`` and ``design``, and here the parameters that they name.

From a name to what it stands for: ``epsilon``, ``meshes.second.contact_ratio``, ``mass.0.1``. Its unit depends on the
rest of the model: on which coordinates turn, and on whether it has units at all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, get_args

from pydantic import TypeAdapter
from pydantic.fields import FieldInfo

from gearstab.config.document import Code, Path, dotted, nearest, value_at
from gearstab.config.model import MESH_FREQUENCY
from gearstab.config.model.conflicts import items
from gearstab.config.model.fields import AngularFrequency, Quantity, Ratio, ShortName
from gearstab.config.model.reading import (
    WRONG,
    SkipRule,
    axis_choice,
    entry_type,
    field_types,
    is_model,
    known,
    number_kind,
    quantity,
    ratio,
    title_of,
    told,
    type_at,
)
from gearstab.systems import short_names, short_names_of
from gearstab.systems.base import System
from gearstab.systems.mesh import NamedToothMesh, ToothMesh, may_have
from gearstab.waveforms.section import WaveformSection, name_of, owners, wave_of

INPUT_SPEED = "input_speed"
"""Short name of the speed of a gearbox's input, which sets the mesh frequency."""

UNKNOWN_TEETH = "add teeth to system, or give mesh_frequency instead (matrices have no teeth)"
"""Remedy where an input speed is given for a system without teeth."""

NOT_GIVEN = {"damping_ratio": 0.0, "damping": 0.0}
"""Values of numbers that may be left out, where the model has None for that."""


class TargetError(ValueError):
    """A name stands for no number of the system; ``hint`` says what would."""

    def __init__(self, message: str, hint: str, code: Code = "unknown_target") -> None:
        super().__init__(message)
        self.hint, self.code = hint, code


@dataclass(frozen=True)
class Target:
    """A number of the system.

    paths: its places below ``system``; two places for an entry of a symmetric matrix, the named one first.
    annotation: its type with unit and range; title: what it is; default: its value when not given.
    factor: of the number there over the number that is given.
    """

    paths: tuple[Path, ...]
    annotation: Any
    title: str
    default: Any = None
    factor: float = 1.0

    @property
    def unit(self) -> str:
        """SI unit, "1" without one."""
        kind = number_kind(self.annotation)
        return kind.unit if kind else "1"

    @property
    def adapter(self) -> TypeAdapter[list[Any]]:
        """Return the pydantic adapter that checks and converts a list of values."""
        return TypeAdapter(list[self.annotation])  # type: ignore[name-defined]

    @property
    def exact(self) -> bool:
        """Whether it is an exact ratio or a word, which changes the structure of the problem."""
        return ratio(self.annotation) is not None or axis_choice(self.annotation) is not None

    @property
    def counted(self) -> bool:
        """Whether it is a number of teeth."""
        kind = ratio(self.annotation)
        return kind is not None and kind.counted

    @property
    def plain(self) -> Any:
        """The type of a number in its unit, wherever its own values must lie."""
        return Annotated[float, quantity(self.annotation) or Quantity()]

    @property
    def decimal(self) -> bool:
        """Whether it is a ratio that stands for an irrational number, which changes the structure as well."""
        kind = ratio(self.annotation)
        return kind is not None and not kind.exact


def resolve(name: str, system: System) -> list[Target]:
    """Return all numbers that a parameter name refers to, in a section ``system``.

    Raises TargetError for a name without a target.
    """
    return [_fitted(target, system) for target in _named(name, system)]


def described(path: Path, system: System) -> tuple[str, str, str]:
    """Return name, unit and title of the number at a path; a name unknown to the kind of system is its own title."""
    name = _written(path, system)
    try:
        (target,) = resolve(name, system)
    except (TargetError, SkipRule):
        return name, "1", name
    return name, target.unit, target.title


def _written(path: Path, raw: Any) -> str:
    """A path as one writes it: meshes and other entries by name."""
    words = []
    for k, part in enumerate(path, start=1):
        name = value_at(raw, (*path[:k], "name")) if isinstance(part, int) else None
        words.append(name if isinstance(name, str) else str(part))
    return ".".join(words)


def _fitted(target: Target, system: System) -> Target:
    """Return a target with the units that its number has in this system."""
    kind = quantity(target.annotation)
    if kind is None:
        return target
    wanted = quantity_at(system, target.paths[0], kind)
    parts = get_args(target.annotation)
    return replace(target, annotation=Annotated[tuple(wanted if part is kind else part for part in parts)])


def _named(name: str, system: System) -> list[Target]:
    if name == "mesh_frequency":
        return [Target((MESH_FREQUENCY,), AngularFrequency, "mesh frequency")]
    if name == INPUT_SPEED:
        cycles = told(system.cycles_of_input, 1.0)
        if cycles is None:
            raise TargetError("the numbers of teeth are not known", UNKNOWN_TEETH, "needs_other")
        own = [Target((path,), AngularFrequency, "input speed") for path in system.follow_speed()]
        return [Target((MESH_FREQUENCY,), AngularFrequency, "input speed", None, cycles), *own]
    if name.isidentifier() and name not in type(system).model_fields:
        # One that only other kinds of systems have is known too, for the message.
        short = short_names_of(type(system)).get(name) or short_names().get(name)
        if short is not None:
            return _of_meshes(name, short, system)
    return [_walk(name, system.expand_path(name.split(".")), system)]


def _of_meshes(name: str, short: ShortName, system: System) -> list[Target]:
    found = []
    for place, mesh in system.mesh_places():
        kind = type_at(type(system), place)
        if not is_model(kind) or name not in field_types(kind) or not may_have(name, short, place[-1], mesh):
            continue
        field = kind.model_fields[name]
        found.append(Target(((*place, name),), field_types(kind)[name], title_of(kind, name), _default(field, name)))
    if found:
        return found
    if "meshes" in type(system).model_fields and not any(True for _ in system.mesh_places()):
        raise TargetError("the system has no meshes", "add system.meshes")
    remedy = f"the meshes give {short.rival}: use that, or give them {name}" if short.rival else short.hint
    raise TargetError(f"no mesh{' but the first' if short.but_first else ''} has {name}", remedy)


def _walk(name: str, parts: list[str], system: System) -> Target:
    annotation: Any = type(system)
    value: Any = system
    path: Path = ()
    title, owner, default = "", "", None
    step: str | int
    for part in parts:
        if annotation is WaveformSection and part in field_types(annotation):
            _check_waveform(part, value, dotted(("system", *path, part)))
        if is_model(annotation) and part in field_types(annotation):
            field = annotation.model_fields[part]
            title, default = title_of(annotation, part), _default(field, part)
            annotation, step = _of_its_kind(field_types(annotation)[part], value), part
            if is_model(annotation) and issubclass(annotation, ToothMesh):
                owner = f" of {part}"
        elif entry_type(annotation, 0) is not None:
            step = index = _index(name, part, path, value, entry_type(annotation, 0))
            annotation, default = entry_type(annotation, index), None
            title = f"{title}[{index}]"
            if is_model(annotation):
                owner = f" of {value_at(value, (index, 'name'))}"
        else:
            raise TargetError("unknown parameter", nearest(name, candidates(system)))
        value, path = value if value is WRONG else value_at(value, (step,)), (*path, step)
        if value is None and default is None and is_model(annotation) and part != parts[-1]:
            where = dotted(("system", *path))
            raise TargetError(f"there is no {part} here", f"add {where}, of which the axis sets a number")
    if number_kind(entry_type(annotation, 0)) is not None:
        raise TargetError("is a list, and an axis sets a number", f"name an entry, such as {name}.0", "not_an_axis")
    if number_kind(annotation) is None and axis_choice(annotation) is None:
        remedy = f"run a sweep for each, with --set {dotted(('system', *path))}=.."
        raise TargetError("is not a number that an axis can set", remedy, "not_an_axis")
    return Target(_mirrored(path), annotation, title + owner, default)


def _check_waveform(key: str, waveform: Any, where: str) -> None:
    """A wave varies with the keys of its own kind only. where: path of the key in the document."""
    if key == "kind":
        hint = f"run a sweep for each, with --set {where}=.."
        raise TargetError("is a word, and an axis sets a number", hint, "not_an_axis")
    wave = wave_of(waveform)
    if wave is not None and key in wave.keys.model_fields:
        return
    message = "unknown waveform" if wave is None else f"a {name_of(wave)} wave takes no {key}"
    raise TargetError(message, f"choose waveform kind: {owners(key)}", "not_applicable")


def _of_its_kind(annotation: Any, section: Any) -> Any:
    """The annotation of a ratio that its section declares not to be exact; others as they are."""
    kind = ratio(annotation)
    if kind is not None and kind.sibling and value_at(section, (kind.sibling,)) is False:
        return Annotated[float, Ratio(exact=False)]
    return annotation


def _default(field: FieldInfo, name: str) -> Any:
    """The value of a field that is not given; None where it must be."""
    default = None if field.is_required() else field.get_default()
    return NOT_GIVEN.get(name) if default is None else default


def _index(name: str, part: str, path: Path, value: Any, entry: Any) -> int:
    if not part.isdecimal() and is_model(entry) and "name" in entry.model_fields:
        names = [(i, item.name) for i, item in items(value)]
        found = [i for i, known in names if isinstance(known, str) and known == part]
        if not found:
            choices = [name.replace(part, known) for _, known in names if isinstance(known, str)]
            what = "mesh" if issubclass(entry, NamedToothMesh) else "entry"
            raise TargetError(f"there is no {what} '{part}'", nearest(name, choices))
        return int(found[0])
    if not part.isdecimal():
        raise TargetError("unknown parameter", f"{dotted(path)} is a list: use an index from 0 on")
    count = 0 if value is None else len(value)
    if int(part) >= count:
        if not count:
            raise TargetError("there is no such entry", f"give {dotted(path)} a base value under system")
        raise TargetError(f"there is no entry {part}", f"{dotted(path)} has entries 0 to {count - 1}")
    return int(part)


def _mirrored(path: Path) -> tuple[Path, ...]:
    """An entry of a symmetric matrix together with its counterpart."""
    row, column = path[-2:] if len(path) > 2 else (0, 0)
    counterpart = (*path[:-2], column, row)
    if path[0] not in ("mass", "stiffness", "damping") or row == column or not isinstance(row, int):
        return (path,)  # a number of another form of damping is below a name
    return (path, counterpart)


def candidates(system: System) -> list[str]:
    """Names that an axis may have in this system, without the entries of matrices."""
    names = ["mesh_frequency", *([INPUT_SPEED] if told(system.cycles_of_input) is not None else [])]
    for name, short in short_names().items():
        try:
            _of_meshes(name, short, system)
        except TargetError:
            continue
        names.append(name)
    return names + list(_numbers(type(system), system, ()))


def _numbers(annotation: Any, raw: Any, path: Path) -> Iterator[str]:
    if number_kind(annotation):
        if raw is not None or not isinstance(path[-1], int):
            yield dotted(path)
    elif is_model(annotation) and raw is not None and raw is not WRONG:
        for key, inner in field_types(annotation).items():
            yield from _numbers(inner, raw[key], (*path, key))
    elif isinstance(raw, list | tuple):
        for i, item in enumerate(raw):
            if not isinstance(item, list | tuple):
                name = value_at(item, ("name",))
                name = name if isinstance(name, str) else i
                yield from _numbers(entry_type(annotation, i), item, (*path, name))


TURNED = {
    "m": ("m", "rad"),
    "m/s": ("m/s", "rad/s"),
    "N": ("N", "N m"),
    "kg": ("kg", "kg m", "kg m^2"),
    "N/m": ("N/m", "N", "N m"),
    "N s/m": ("N s/m", "N s", "N m s"),
}
"""Unit of displacements -> units where none, one or both of the coordinates that it belongs to are rotations in rad."""

NO_UNITS = "the model has none (system.units: none)"
SCALED = "times are in sqrt(m_r/k_rp) with scaling: dimensionless"
OF_A_TORQUE = "of a torque, give the force that it is over the base radius"


def quantity_at(system: System, path: Path, declared: Quantity) -> Quantity:
    """Return the limits of the number at a path, which its field declares, in a section whose values may be wrong.

    path: below ``system``, or beginning with ``mesh_frequency`` or ``respond``.
    """
    if declared.unit in ("1", "rad"):
        return declared
    if told(lambda: system.units == "none") and not system.needs_units:
        return Quantity(advice=NO_UNITS)
    scaled = told(lambda: getattr(system, "scaling", "SI") == "dimensionless")
    if path[0] in ("mesh_frequency", "respond") and scaled and declared.unit != "m":
        return Quantity(advice=SCALED)
    turning, angle = told(system.turning), bool(told(system.turning_meshes))
    if path[0] == "meshes" and path[2:3] == ("direction",):
        given = turning is not None and path[-1] in range(len(turning))
        lever = not given or (turning[path[-1]] and not angle)  # type: ignore[index]
        return declared if lever else Quantity(advice="the mesh deflection is this times the coordinate")
    units = TURNED.get(declared.unit)
    found = set(known(_rotations(system, path, turning, angle))) if declared.others and units else set()
    if not units or len(found) != 1:
        return declared
    unit = units[found.pop()]
    return replace(declared, unit=unit, others=(), advice=OF_A_TORQUE if unit == "N" and path[0] == "load" else "")


def _rotations(system: Any, path: Path, turning: Sequence[bool] | None, angle: bool) -> Iterator[int]:
    """How many of the coordinates that a number belongs to are rotations; several answers where it belongs to many."""
    if path[0] == "meshes":
        stiffness = path[2] not in ("backlash", "transmission_error")
        yield (2 if stiffness else 1) * angle
        return
    groups: list[Sequence[Any]] = []
    if path[0] in ("forces", "terms"):
        item = system[path[0]][path[1]]
        vectors = [item[key] for key in (("direction",) if path[0] == "forces" else ("left", "right"))]
        groups = [[k for k, value in enumerate(vector) if value is WRONG or value != 0] for vector in vectors]
    elif path[0] in ("mass", "stiffness", "damping"):
        groups = [[path[-2]], [path[-1]]]
    elif path[0] in ("load", "respond"):
        groups = [[path[-1]]]
    if (
        turning is None
        or not groups
        or any(not isinstance(k, int) or k >= len(turning) for group in groups for k in group)
    ):
        return
    first, second = groups if len(groups) == 2 else (groups[0], None)
    for i in first:
        for also in [0] if second is None else [int(turning[j]) for j in second]:
            yield int(turning[i]) + also
