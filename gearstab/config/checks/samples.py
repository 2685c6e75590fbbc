"""Samples of a stiffness that cannot vary as much as the mesh says, or know nothing of its torque."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gearstab.config.document.problems import Path
from gearstab.config.document.tree import Document, entries, is_section, value_at
from gearstab.config.model.axes import Array, Axis
from gearstab.config.model.conflicts import plain_number
from gearstab.waveforms import Sampled, TorqueTable
from gearstab.waveforms.sampled import out_of_table
from gearstab.waveforms.section import wave_of

HINT = "leave it out, or check the samples"


def check_variation(document: Document, system: Any, samples: Mapping[Path, Array], axes: Sequence[Axis]) -> None:
    """Report variations of constant samples, which no factor makes vary, in the sections or along the axes.

    system: its section; samples: contents of files, (columns, N), by the place of the waveform below
    ``system``.
    """
    for path, waveform in waveforms(system, ()):
        values = samples[path][1] if path in samples else waveform.stiffness
        swept = [(axis, item) for axis in axes for item in axis.assignments if item.path[: len(path) - 1] == path[:-1]]
        if (
            wave_of(waveform) is not Sampled
            or not _constant(values)
            or any(i.path[: len(path)] == path for _, i in swept)
        ):
            continue
        for key in ("epsilon", "amplitude"):
            place: Path = (*path[:-1], key)
            axis = next(
                (axis for axis, item in swept if item.path == place and np.any(np.asarray(item.values) > 0)), None
            )
            value = value_at(system, place)
            message = f"the samples of the stiffness are constant, and no {key} makes them vary"
            if axis is not None:
                document.report(
                    ("sweep", axis.name),
                    "not_applicable",
                    message,
                    "remove the axis, or check the samples",
                    at_key=True,
                )
            elif value is not None and np.any(value > 0):
                given = document.get(("system", *place))
                document.report(("system", *place), "not_applicable", message, HINT, value=given)


def check_torques(document: Document, system: Any, axes: Sequence[Axis]) -> None:
    """Report torques, in the section or along the axes, that are beyond the table of a file.

    system: its section, with the contents of files.
    """
    for path, waveform in waveforms(system, ()):
        if wave_of(waveform) is not TorqueTable or getattr(waveform, "torques", None) is None:
            continue
        place: Path = (*path, "torque")
        given: list[tuple[Path, Any]] = [
            (("sweep", axis.name), item.values) for axis in axes for item in axis.assignments if item.path == place
        ]
        if not given and waveform.torque is not None:
            given = [(("system", *place), waveform.torque)]
        for where, values in given:
            if found := out_of_table(np.asarray(values, dtype=float), waveform.torques):
                message, hint = found
                document.report(where, "out_of_range", message, hint, at_key=where[0] == "sweep")


def _constant(values: Any) -> bool:
    known = values is not None and len(values) > 1 and all(plain_number(value) is not None for value in values)
    return known and bool(np.ptp(np.asarray(values, dtype=float)) == 0)


def waveforms(value: Any, path: Path) -> Iterator[tuple[Path, Any]]:
    """The sections ``waveform`` below a value, with their paths."""
    for key, inner in entries(value):
        if key == "waveform" and is_section(inner):
            yield (*path, key), inner
        else:
            yield from waveforms(inner, (*path, key))
