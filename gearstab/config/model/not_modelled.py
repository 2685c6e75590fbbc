"""Keys of what other programs model and this one does not, and what to give instead."""

from __future__ import annotations

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
REVOLVING = (
    "errors that repeat with a revolution are those of a mesh of two gears of kind: gearbox, and not of planetary sets",
    "give that mesh revolution_errors: [{gear: NAME, cos: [10 um]}], or remove it",
)
NOT_MODELLED = {
    **dict.fromkeys(("helix_angle", "helix", "hand", "overlap_ratio"), HELICAL),
    **dict.fromkeys(("cone_angle", "pitch_cone_angle", "shaft_angle", "spiral_angle", "lead_angle"), BEVEL),
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
