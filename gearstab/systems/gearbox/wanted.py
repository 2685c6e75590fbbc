"""What of a mesh stiffness follows from the teeth, because the configuration does not give it."""

from __future__ import annotations

from typing import Any

from gearstab.waveforms import WAVEFORMS
from gearstab.waveforms.section import has_own_mean

MEAN, VARIATION, CONTACT_RATIO, WAVE = "mean", "variation", "contact_ratio", "wave"


def from_teeth(p: dict[str, Any]) -> frozenset[str]:
    """Return which of MEAN, VARIATION, CONTACT_RATIO, WAVE the teeth of a mesh with these parameters give."""
    wave = WAVEFORMS[(p.get("waveform") or {}).get("kind", "rectangular")]
    if wave.of_teeth:
        return frozenset((MEAN, VARIATION, CONTACT_RATIO, WAVE))
    found = set()
    if not has_own_mean(p) and p.get("mean_stiffness") is None and p.get("max_stiffness") is None:
        found.add(MEAN)
    if not wave.own_variation and p.get("epsilon") is None and p.get("amplitude") is None:
        found.add(VARIATION)
    if wave.has_contact_ratio and p.get("contact_ratio") is None:
        found.add(CONTACT_RATIO)
    return frozenset(found)


def needs_width(p: dict[str, Any]) -> bool:
    """Whether the face widths of the gears of a mesh matter."""
    rubs = (p.get("friction") or {}).get("kind", "constant") != "constant"
    return rubs or (MEAN in from_teeth(p) and p.get("single_pair_stiffness") is None)
