"""From parameters to periodic terms of the stiffness and damping matrix."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.system import PeriodicTerm
from gearstab.systems.arrays import vector
from gearstab.systems.waveforms import own_variation, waveform
from gearstab.waveforms import Constant, Profile, Scaled


def periodic_terms(p: dict[str, Any]) -> tuple[PeriodicTerm, ...]:
    """The terms of ``p["terms"]``.

    Each has ``left`` u, ``right`` v, ``stiffness`` a(x) and ``damping`` c(x) (``mean``, ``amplitude``, ``waveform``,
    ``contact_ratio``: mean + 2 amplitude w(x)), ``frequency_ratio`` and ``lag``, in periods of its own.
    """
    return tuple(
        PeriodicTerm(
            part.get("name") or f"term{i + 1}", vector(part["left"]), vector(part["right"]),
            _profile(part.get("stiffness")), _profile(part.get("damping")), part["frequency_ratio"],
            np.asarray(part.get("lag", 0.0), dtype=float),
        )
        for i, part in enumerate(p.get("terms") or [])
    )  # fmt: skip


def _profile(p: dict[str, Any] | None) -> Profile | None:
    if p is None:
        return None
    mean, amplitude = p.get("mean"), p.get("amplitude")
    if all(p.get(key) is None for key in ("amplitude", "contact_ratio", "waveform")):
        return Constant(np.asarray(mean, dtype=float))
    wave = waveform(p)
    if mean is None or amplitude is None:
        found = own_variation(wave)
        mean = found[0] if mean is None else mean
        amplitude = found[1] if amplitude is None else amplitude
    return Scaled(wave, np.asarray(mean, dtype=float), 2 * np.asarray(amplitude, dtype=float))
