"""The sections ``system``, ``sweep`` and ``design``, which depend on each other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from gearstab.config.checks.samples import check_torques, check_variation, waveforms
from gearstab.config.document.problems import Path, Problem, dotted, nearest
from gearstab.config.document.tree import Document, sequence, value_at
from gearstab.config.model import conflicts
from gearstab.config.model.axes import Array, Axis, replaced
from gearstab.config.model.conflicts import report_errors
from gearstab.config.model.reading import WRONG, read
from gearstab.config.sections import sweep
from gearstab.config.sections.dimensions import check_units, quantity_at
from gearstab.waveforms import WAVEFORMS
from gearstab.waveforms.section import wave_of

if TYPE_CHECKING:
    from gearstab.config.sections.design import Design
    from gearstab.config.sections.sweep import Context
    from gearstab.config.sections.targets import Target
    from gearstab.systems.base import System


@dataclass
class SystemSections:
    """``system``, ``sweep`` and ``design``. plain: ``system`` as plain data; specs: ``sweep``, resolved.

    context, uncertain: what the names of uncertain parameters refer to, and stand for.
    doubts: overrides without effect. sound: whether the section has no mistake.
    """

    plain: dict[str, Any]
    section: System
    contents: dict[str, Array]
    axes: tuple[Axis, ...]
    specs: dict[str, Any]
    context: Context
    uncertain: dict[str, list[Target]]
    design: Design | None
    doubts: list[Problem]
    sound: bool


def find_model(document: Document) -> type[System] | None:
    """The model of ``system.kind``; None after reporting that there is none."""
    from gearstab.systems import KINDS

    if "system" not in document.data:
        return None
    system = document.data["system"]
    available = f"available: {', '.join(KINDS)}"
    if not isinstance(system, dict):
        document.report(("system",), "wrong_type", "must be a mapping", f"add kind; {available}", value=system)
        return None
    kind, path = system.get("kind"), ("system", "kind")
    if isinstance(kind, str) and kind in KINDS:
        return KINDS[kind].variant(system)
    if kind is None:
        document.report(path, "missing", "is missing", f"add kind; {available}")
    else:
        document.report(
            path, "unknown_choice", "is no kind of system", f"{nearest(str(kind), KINDS)} ({available})", value=kind
        )
    return None


def read_system(document: Document, model: type[System], source: FilePath) -> SystemSections:
    """Read ``system``, ``sweep`` and ``design``; report problems. document: with short forms written out."""
    raw = document.data["system"]
    for i in range(len(sequence(raw.get("meshes")))):
        name = model.mesh_names[i] if i < len(model.mesh_names) else f"mesh{i + 1}"
        document.fill(("system", "meshes", i, "name"), name, document.where(("system", "meshes", i)))
    contents = model.read_files(document, source)
    model.complete(document, raw, contents)
    bare, errors = read(model, document.data["system"])
    section = bare.with_files(contents)
    samples, doubts = _read_samples(document, section, source)
    context = sweep.Context(document, section)
    layouts = sweep.layouts(context) if "sweep" in document.data else []
    doubts += sweep.without_effect(document, layouts)
    variables: list[sweep.UnresolvedAxis] = []
    if "design" in document.data:
        from gearstab.config.sections import design

        variables = design.layouts(context)
    base = list(sweep.base_values(context, [*layouts, *variables]))
    targets: dict[str, list[Target]] = {}
    if value_at(document.data, ("methods", "tolerance")) is not None:
        from gearstab.config.sections import uncertain

        targets = uncertain.resolve(context, value_at(document.data, uncertain.SECTION))
        base += uncertain.base_values(context, targets)
    for path, value, place in reversed(base):  # the first one counts
        bare, document.values["system", *path] = replaced(bare, path, value), place
    section = bare.with_files(contents)
    conflicts.report(document, ("system",), section.conflicts(), section)
    given = {("system", *path) for path, _, _ in base}
    report_errors(document, errors, model, ("system",), given | check_units(document, section, "system", model, given))
    context = replace(context, system=section)
    built = [(layout.name, sweep.build(context, layout)) for layout in layouts]
    axes = tuple(item[0] for _, item in built if item)
    wanted = design.read(context, variables) if "design" in document.data else None
    sound = all(("system", *error["loc"]) in given for error in errors) and all(
        value is not WRONG for _, value, _ in base
    )
    plain: dict[str, Any] = {}
    if sound:
        if section.damping is None and section.damping_ratio is None:
            bare, section = (each.model_copy(update={"damping_ratio": 0.0}) for each in (bare, section))
        plain = {"kind": section["kind"]} | bare.model_dump(mode="json", exclude_none=True)
        for where, columns in samples.items():
            wave = WAVEFORMS[value_at(section, (*where, "kind"))]
            held = value_at(section, where).model_copy(update=wave.from_file(columns))
            section = replaced(section, where, held)
        check_variation(document, section, samples, axes)
        check_torques(document, section, axes)
    contents |= {dotted(where): values for where, values in samples.items()}
    specs = {name: item[1] for name, item in built if item}
    return SystemSections(plain, section, contents, axes, specs, context, targets, wanted, doubts, sound)


def _read_samples(document: Document, section: System, source: FilePath) -> tuple[dict[Path, Array], list[Problem]]:
    """Return the contents of the files of waveforms, by the place of the waveform below ``system``, and what is
    doubtful about them; problems are reported.
    """
    found: dict[Path, Array] = {}
    doubts: list[Problem] = []
    for path, waveform in waveforms(section, ()):
        name, wave = getattr(waveform, "file", None), wave_of(waveform)
        if not isinstance(name, str) or wave is None:
            continue
        from gearstab.config.checks.sample_file import read_samples
        from gearstab.config.document.files import DataFileError

        try:
            columns = {key: quantity_at(section, (*path, key), kind) for key, kind in wave.columns.items()}
            interpolation = waveform.interpolation if isinstance(waveform.interpolation, str) else "linear"
            found[path], doubt = read_samples(source.parent / name, wave, interpolation, columns)
        except DataFileError as error:
            document.report(("system", *path, "file"), "file", str(error), error.hint, value=name)
            continue
        if doubt:
            place = ("system", *path, "file")
            doubts.append(document.problem(place, "unusual", doubt, "check the measurement", value=name))
    return found, doubts
