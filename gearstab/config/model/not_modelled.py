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
