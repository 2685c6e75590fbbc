"""From teeth to mesh stiffness, stress and friction: pure functions and frozen dataclasses; SI units, radians.

- ``Gear``, ``Pair``, ``Notice`` (geometry, pair): involute geometry; ``pair.contact_ratio``, ``pair.notices``,
  ``pair.pressure_angle``, ``pair.pitch_phase`` and the like.
- ``PlanetSet``, ``closing_shifts`` (pair): a planet between sun and ring, its profile shifts and the lag of its
  meshes.
- ``tooth_profile`` (geometry): flank and fillet as cut.
- ``tooth_compliance``, ``pair_stiffness`` (compliance): of one tooth, of one pair along the path of contact s.
- ``StiffnessModel``, ``mesh_stiffness``, ``contact_stiffness`` (mesh_stiffness): over the mesh cycle; its ``waveform``
  and ``mean``, ``epsilon`` make a ``Mesh``; ``rectangular`` and ``series`` are its reductions.
- ``Relief``, ``FlankRelief`` (relief), ``loaded_mesh`` (loaded): tangent stiffness and static
  transmission error under load.
- ``load_shares``, ``mesh_root_stress``, ``root_stress``, ``critical_section``, ``contact_pressure`` (stress).
- ``ConstantFriction``, ``XuKahraman``, ``BenedictKelley``, ``mesh_friction`` (friction): periodic functions for
  non-symmetric terms and for forces.

Phase 0 of everything periodic is the entry of a pair of teeth.
"""
