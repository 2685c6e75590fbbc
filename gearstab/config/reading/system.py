"""The sections ``system``, ``sweep`` and ``design``, which depend on each other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from gearstab.config.document.problems import Path, Problem, dotted, nearest
from gearstab.config.document.tree import sequence
from gearstab.config.document.yaml import Document, value_at
from gearstab.config.model.axes import Array, Axis, replaced

if TYPE_CHECKING:
    from gearstab.config.sections.design import Design
    from gearstab.config.sections.sweep import Context
    from gearstab.config.sections.targets import Target
    from gearstab.systems.base import System


@dataclass
class SystemSections:
    """``system``, ``sweep`` and ``design``. plain: ``system`` as plain data; specs: ``sweep``, resolved.

    context, uncertain: what the names of uncertain parameters refer to, and stand for.
    doubts: overrides without effect.
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


def read_system(document: Document, model: type[System], source: FilePath) -> SystemSections | None:
    """The sections ``system`` and ``sweep``; None after reporting problems."""
    from gearstab.config.checks.samples import check_torques, check_variation
    from gearstab.config.model.conflicts import as_meant, report
    from gearstab.config.model.validation import validate
    from gearstab.config.sections import sweep
    from gearstab.config.sections.dimensions import check_units
    from gearstab.waveforms import WAVEFORMS

    raw = document.data["system"]
    _name_meshes(document, model)
    contents = model.read_files(document, source)
    model.complete(document, raw, model.size(as_meant(raw | contents, model)))
    from_file: dict[str, Any] = {k: v for k, v in contents.items() if k != "damping"}
    if "damping" in contents:
        from_file["damping"] = {"matrix": contents["damping"]}
    meant = as_meant(raw | from_file, model)
    samples, doubts = _read_samples(document, model, meant, source)
    context = sweep.Context(document, model, meant)
    layouts = sweep.layouts(context) if "sweep" in document.data else []
    doubts += sweep.without_effect(document, layouts)
    variables: list[sweep.UnresolvedAxis] = []
    if "design" in document.data:
        from gearstab.config.sections import design

        variables = design.layouts(context)
    known = set(sweep.base_values(document, [*layouts, *variables]))
    targets: dict[str, list[Target]] = {}
    if value_at(document.data, ("methods", "tolerance")) is not None:
        from gearstab.config.sections import uncertain

        targets = uncertain.resolve(context, value_at(document.data, uncertain.SECTION))
        known |= set(uncertain.base_values(context, targets))
    section = as_meant(raw | from_file, model)
    report(document, ("system",), model.conflicts(section), section)
    known |= check_units(document, model, meant, "system", model, known)
    system = validate(document, model, ("system",), known)
    built = [(layout.name, sweep.build(context, layout)) for layout in layouts]
    wanted = design.read(context, variables) if "design" in document.data else None
    if system is None:
        return None
    axes = tuple(item[0] for _, item in built if item)
    if system.damping is None and system.damping_ratio is None and "damping" not in contents:
        system = system.model_copy(update={"damping_ratio": 0.0})
    plain = {"kind": raw["kind"]} | system.model_dump(mode="json", exclude_none=True)
    system = system.with_files(contents)
    for where, columns in samples.items():
        wave = WAVEFORMS[value_at(system, (*where, "kind"))]
        system = replaced(system, where, value_at(system, where).model_copy(update=wave.from_file(columns)))
    check_variation(document, section, samples, axes)
    check_torques(document, system, axes)
    contents |= {dotted(where): values for where, values in samples.items()}
    specs = {name: item[1] for name, item in built if item}
    return SystemSections(plain, system, contents, axes, specs, context, targets, wanted, doubts)


def _name_meshes(document: Document, model: type[System]) -> None:
    meshes = document.data["system"].get("meshes")
    for i in range(len(sequence(meshes))):
        name = model.mesh_names[i] if i < len(model.mesh_names) else f"mesh{i + 1}"
        document.fill(("system", "meshes", i, "name"), name, document.where(("system", "meshes", i)))


def _read_samples(
    document: Document, model: type[System], section: dict[str, Any], source: FilePath
) -> tuple[dict[Path, Array], list[Problem]]:
    """Return the contents of the files of waveforms, by the place of the waveform below ``system``, and what is
    doubtful about them; problems are reported.
    """
    from gearstab.config.checks.samples import waveforms
    from gearstab.waveforms.section import wave_of

    found: dict[Path, Array] = {}
    doubts: list[Problem] = []
    for path, waveform in waveforms(section, ()):
        name, wave = waveform.get("file"), wave_of(waveform)
        if not isinstance(name, str) or wave is None:
            continue
        from gearstab.config.checks.sample_file import read_samples
        from gearstab.config.document.files import DataFileError
        from gearstab.config.sections.dimensions import quantity_at

        interpolation = waveform.get("interpolation") or "linear"
        try:
            columns = {key: quantity_at(model, section, (*path, key), kind) for key, kind in wave.columns.items()}
            found[path], doubt = read_samples(source.parent / name, wave, str(interpolation), columns)
        except DataFileError as error:
            document.report(("system", *path, "file"), "file", str(error), error.hint, value=name)
            continue
        if doubt:
            place = ("system", *path, "file")
            doubts.append(document.problem(place, "unusual", doubt, "check the measurement", value=name))
    return found, doubts
