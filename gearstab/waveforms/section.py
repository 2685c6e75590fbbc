"""The section ``waveform`` of a configuration: the keys of all waves, of which each takes its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, create_model

from gearstab.config.document import Path, entries, is_section
from gearstab.config.model.conflicts import Conflict, within
from gearstab.config.model.fields import Choice
from gearstab.config.model.reading import WRONG, descriptions
from gearstab.waveforms import WAVEFORMS, Waveform
from gearstab.waveforms.base import Keys

KIND = "; ".join(f"{name}: {wave.said}" for name, wave in WAVEFORMS.items())

if TYPE_CHECKING:

    class WaveformSection(Keys):
        """See below."""

else:
    WaveformSection = create_model(
        "WaveformSection",
        __module__=__name__,
        __base__=tuple(dict.fromkeys(wave.keys for wave in reversed(WAVEFORMS.values()) if wave.keys is not Keys)),
        __doc__="The shape of the mesh stiffness over its period; which keys it has depends on its kind.",
        kind=(
            Annotated[str, Choice("waveform", tuple(WAVEFORMS))],
            Field(default="rectangular", title="kind of waveform", description=f"{KIND}."),
        ),
    )


def wave_of(section: WaveformSection | None) -> type[Waveform] | None:
    """Return the wave of a section, rectangular without one; None for a kind that does not exist."""
    if section is WRONG:
        return None
    kind = "rectangular" if section is None else section.kind
    return WAVEFORMS.get(kind) if isinstance(kind, str) else None


def waveforms(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any, type[Waveform] | None]]:
    """Yield path, section and wave of every section ``waveform`` below a value."""
    for key, inner in entries(value):
        if key == "waveform" and is_section(inner):
            yield (*path, key), inner, wave_of(inner)
        else:
            yield from waveforms(inner, (*path, key))


def build_waveform(section: WaveformSection | None, contact_ratio: Any) -> Waveform:
    """Build the wave of a section, with the contact ratio of its mesh where its kind has one."""
    section = WaveformSection() if section is None else section
    return WAVEFORMS[section.kind].build(section, contact_ratio)


def name_of(wave: type[Waveform]) -> str:
    """Return its kind."""
    return next(name for name, other in WAVEFORMS.items() if other is wave)


def owners(key: str) -> str:
    """Return the kinds of waves that take a key, for messages."""
    return ", ".join(name for name, wave in WAVEFORMS.items() if key in wave.keys.model_fields)


def shape_conflicts(mesh: Any, complete: bool = True) -> Iterator[Conflict]:
    """Yield what contradicts itself in ``waveform`` and ``contact_ratio`` of a mesh or term.

    complete: whether a contact ratio that the waveform needs must be there, as nothing else gives it.
    """
    ratio, wave = mesh.contact_ratio, wave_of(mesh.waveform)
    if wave is None:
        return
    yield from within(mesh, "waveform", lambda section: _conflicts(wave, section))
    if ratio is None and wave.has_contact_ratio and complete:
        description = descriptions(mesh.__class__)["contact_ratio"].rstrip(".")
        yield ("contact_ratio",), "missing", "is missing", f"add contact_ratio: {description}"
    elif ratio is not None and not wave.has_contact_ratio and not wave.of_teeth:
        hint = "remove it, or choose another waveform"
        yield ("contact_ratio",), "not_applicable", "the waveform has no contact ratio", hint


def _conflicts(wave: type[Waveform], section: Any) -> Iterator[Conflict]:
    """Yield keys of other waves, keys that are missing, and what the wave itself finds."""
    fields, name = WaveformSection.model_fields, name_of(wave)
    for key in fields:
        if key not in wave.keys.model_fields and section[key] is not None:
            yield (key,), "not_applicable", f"a {name} wave takes no {key}", f"remove it, or choose kind: {owners(key)}"
    for key in wave.required:
        if section[key] is None:
            description = descriptions(wave.keys)[key].partition(": ")[2]
            yield (key,), "missing", "is missing", f"add {key}: {description.rstrip('.')}"
    if section.model_fields_set <= fields.keys() or wave.sources:
        yield from wave.conflicts(section)


def has_no_ratio(mesh: Any) -> bool:
    """Return whether the waveform of a mesh takes no contact ratio."""
    wave = wave_of(mesh.waveform)
    return wave is not None and not wave.has_contact_ratio


def has_own_mean(mesh: Any) -> bool:
    """Return whether the wave of a mesh says how stiff it is."""
    wave = wave_of(mesh.waveform)
    return wave is not None and wave.has_own_mean(mesh.waveform)
