"""From teeth to mesh stiffness, stress and friction: pure functions and frozen dataclasses; SI units, radians.

- ``Gear``, ``Pair``, ``Notice`` (geometry, pair): involute geometry; ``pair.contact_ratio``, ``pair.notices``,
  ``pair.pressure_angle``, ``pair.pitch_phase`` and the like.
- ``tooth_profile`` (profile): flank and fillet as cut; ``gear_inertia``, ``disc_inertia`` (inertia).
- ``tooth_compliance``, ``pair_stiffness`` (compliance): of one tooth, of one pair along the path of contact s.
- ``StiffnessModel``, ``mesh_stiffness``, ``contact_stiffness`` (mesh_stiffness): over the mesh cycle; its ``waveform``
  and ``mean``, ``epsilon`` make a ``Mesh``; ``rectangular`` and ``series`` are its reductions.
- ``iso_stiffness`` (iso6336): the standard's estimate.
- ``load_shares``, ``mesh_root_stress``, ``root_stress``, ``critical_section``, ``contact_pressure`` (stress).
- ``ConstantFriction``, ``XuKahraman``, ``BenedictKelley``, ``mesh_friction`` (friction): periodic functions for
  non-symmetric terms and for forces.

Phase 0 of everything periodic is the entry of a pair of teeth.
"""

from gearstab.gears.compliance import ToothCompliance, contact_compliance, pair_stiffness, tooth_compliance
from gearstab.gears.friction import (
    BenedictKelley,
    ConstantFriction,
    Contact,
    Friction,
    MeshFriction,
    XuKahraman,
    contact_state,
    mesh_friction,
    sliding_sign,
)
from gearstab.gears.geometry import Gear
from gearstab.gears.inertia import Inertia, disc_inertia, gear_inertia
from gearstab.gears.iso6336 import IsoStiffness, iso_stiffness
from gearstab.gears.mesh_stiffness import (
    MeshStiffness,
    RectangularReduction,
    StiffnessModel,
    contact_stiffness,
    mesh_stiffness,
)
from gearstab.gears.pair import Notice, Pair
from gearstab.gears.profile import ToothProfile, tooth_profile
from gearstab.gears.stress import (
    CriticalSection,
    contact_pressure,
    critical_section,
    load_shares,
    mesh_root_stress,
    root_stress,
    root_stress_factors,
)

__all__ = [
    "BenedictKelley",
    "ConstantFriction",
    "Contact",
    "CriticalSection",
    "Friction",
    "Gear",
    "Inertia",
    "IsoStiffness",
    "MeshFriction",
    "MeshStiffness",
    "Notice",
    "Pair",
    "RectangularReduction",
    "StiffnessModel",
    "ToothCompliance",
    "ToothProfile",
    "XuKahraman",
    "contact_compliance",
    "contact_pressure",
    "contact_state",
    "contact_stiffness",
    "critical_section",
    "disc_inertia",
    "gear_inertia",
    "iso_stiffness",
    "load_shares",
    "mesh_friction",
    "mesh_root_stress",
    "mesh_stiffness",
    "pair_stiffness",
    "root_stress",
    "root_stress_factors",
    "sliding_sign",
    "tooth_compliance",
    "tooth_profile",
]
