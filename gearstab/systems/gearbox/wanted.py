"""What of a mesh stiffness follows from the teeth, because the configuration does not give it."""

from __future__ import annotations

from typing import Any

MEAN, VARIATION, CONTACT_RATIO, WAVE = "mean", "variation", "contact_ratio", "wave"
NO_RATIO = ("fourier", "sampled")
"""Kinds of waves without a contact ratio."""


def from_teeth(p: dict[str, Any]) -> frozenset[str]:
    """Which of MEAN, VARIATION, CONTACT_RATIO, WAVE the teeth of a mesh with these parameters give."""
    wave = p.get("waveform") or {}
    kind = wave.get("kind", "rectangular")
    if kind == "tooth":
        return frozenset((MEAN, VARIATION, CONTACT_RATIO, WAVE))
    own_mean = kind == "sampled" or any(wave.get(key) is not None for key in ("file", "stiffness", "pair_stiffness"))
    found = set()
    if not own_mean and p.get("mean_stiffness") is None and p.get("max_stiffness") is None:
        found.add(MEAN)
    if kind not in ("sampled", "pair") and p.get("epsilon") is None and p.get("amplitude") is None:
        found.add(VARIATION)
    if kind not in NO_RATIO and p.get("contact_ratio") is None:
        found.add(CONTACT_RATIO)
    return frozenset(found)


def needs_width(p: dict[str, Any]) -> bool:
    """Whether the face widths of the gears of a mesh matter."""
    rubs = (p.get("friction") or {}).get("kind", "constant") != "constant"
    return rubs or (MEAN in from_teeth(p) and p.get("single_pair_stiffness") is None)
