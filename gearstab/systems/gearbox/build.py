"""From the parameters of a train to its GearSystem.

    M q'' + C q' + [K0 + sum_i k_i(t) g_i g_i^T] q = f,    one rigid-body mode for each train that is free to turn

Source: Kuria & Kihiu 2008, sections II and III, for any connected train of rotors, shafts and meshes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from gearstab.errors import NotPossible
from gearstab.gears.relief import ReliefForce
from gearstab.mesh import MachineElement, Mesh, PeriodicForce, PeriodicTerm, RevolutionError, Rotation
from gearstab.modal import static_mesh_force
from gearstab.system import Array, GearSystem
from gearstab.systems.assembly import Assembly, Element, MeshElement, Row, total
from gearstab.systems.gearbox import loads
from gearstab.systems.gearbox.bodies import Support, base_radius, number
from gearstab.systems.gearbox.faults import weak_tooth
from gearstab.systems.gearbox.loads import dampers, torques
from gearstab.systems.gearbox.meshes import from_teeth
from gearstab.systems.gearbox.planet_set import MEMBERS, TrainSet, TrainSetRows
from gearstab.systems.gearbox.teeth import MeshTeeth
from gearstab.systems.gearbox.train import Train
from gearstab.systems.kinematics import TrainError, Where
from gearstab.waveforms import Fourier, Rectangular, Tooth


def build(p: Any) -> GearSystem:
    """The gear system of a train; raises TrainError where its parts do not fit together.

    Source: Kuria & Kihiu 2008, section III (Lagrange's equations of 13 rotations and 20 displacements).
    """
    train = Train(p)
    rows = [_rows(train, item) for item in train.sets]
    pairs = [mesh_element(train, k) for k in range(len(train.pairs))]
    elements = [Element(train.rotation(k), mass=inertia) for k, inertia in enumerate(train.inertias)]
    elements += [*shaft_elements(train), *_supports(train), *dampers(train)]
    elements += [element for row in rows for element in row.planets_of(train.damping_factor)]
    symmetries = [row.cyclic() for row in rows if _cyclic(train, row)]
    meshes = [mesh for row in rows for mesh in _set_meshes(train, row)] + pairs
    assembly = Assembly(train.coordinates, elements, meshes)
    rotations = tuple(_turning(train, row) for row in rows if row.item.p.carrier_speed is not None)
    system = assembly.system(p, torques(train) or None, symmetries=tuple(symmetries), rotations=rotations)
    system = replace(system, forces=(*system.forces, *_reliefs(train, system)))
    system = replace(system, meshes=tuple(_with_errors(train, system)))
    whole = _rubbed(train, system, [number(item.p.damping) for item in pairs])
    return replace(whole, meshes=(*whole.meshes, *_weak_teeth(train, whole)))


def _with_errors(train: Train, system: GearSystem) -> Iterator[Mesh]:
    """Yield the meshes with what repeats with the revolutions of their gears; those of pairs come last."""
    first = len(system.meshes) - len(train.pairs)
    yield from system.meshes[:first]
    for mesh, gears, p in zip(system.meshes[first:], train.pairs, train.p.meshes, strict=True):
        counts = {train.name(gear): train.teeth(gear) for gear in gears}
        errors = []
        for item in p.revolution_errors:
            count = counts[item.gear]
            name, ratio = f"{mesh.name}.{item.gear}", Fraction(mesh.frequency_ratio) / count
            errors.append(RevolutionError(name, Fourier.build(item), ratio, np.asarray(mesh.lag) / count))
        yield replace(mesh, revolution_errors=tuple(errors))


def _reliefs(train: Train, system: GearSystem) -> Iterator[PeriodicForce]:
    """Yield what profile relief takes off the force of each mesh; its phase is that of the teeth."""
    for mesh, item in zip(train.meshes, system.meshes, strict=True):
        if not mesh.teeth.relieved:
            continue
        start = mesh.teeth.start
        profile = ReliefForce(loads.level(item), start, mesh.teeth.error, mesh.teeth.force)
        lag = np.asarray(item.lag) - start
        yield PeriodicForce(f"relief of {item.name}", item.direction, profile, item.frequency_ratio, lag, item.name)


def _rows(train: Train, item: TrainSet) -> TrainSetRows:
    """Return how the bodies of a set move. Raises TrainError for members that move in two frames."""
    if train.speeds[item.p.carrier] and (shared := train.shared(item)):
        place: Where = ("rotors", train.place[shared[0]], "support")
        message = f"moves in the plane of {item.name}, which turns with its carrier, and is in another mesh as well"
        raise TrainError(place, message, "give that mesh a rotor of its own and join both by a shaft")
    return item.rows(train.coordinates, train.signs)


def _cyclic(train: Train, row: TrainSetRows) -> bool:
    """Whether the mean system has the symmetry of a set: equal planets at equal angles, and no other mesh of a member.

    A weak tooth of sun or ring meets all planets, one of a planet its own meshes only.
    """
    spoilt = any(fault.gear == "planet" for fault in row.item.p.faults)
    return row.item.planets.angles is None and not train.shared(row.item) and not spoilt


def _weak_teeth(train: Train, system: GearSystem) -> Iterator[Mesh]:
    """Yield what the meshes lack while weak pairs of teeth carry."""
    known = {mesh.name: mesh for mesh in system.meshes}
    found: dict[str, int] = {}

    def part(name: str, teeth: MeshTeeth, p: Any, fault: Any, count: int, cycles: int) -> Mesh:
        whole, title = known[name], f"{name}.{fault.gear} tooth {fault.tooth}"
        found[title] = found.get(title, 0) + 1
        title += f" ({found[title]})" if found[title] > 1 else ""
        c, overlap = teeth.given_contact_ratio(p), teeth.each(lambda pair: pair.overlap_ratio)
        computed = isinstance(whole.waveform, Tooth)
        if teeth.helical and not computed:
            # The wave of helical teeth is that of the transverse section, averaged over the width.
            whole = replace(whole, waveform=Rectangular(c))
        one_pair = teeth.one_pair if computed else None
        return weak_tooth(whole, title, count, fault.factor, c, cycles, one_pair, overlap)

    for item in train.sets:
        planets_turn, sun_drives, _ = train.power(item)
        for name, n, fault, cycles in item.weak_pairs(planets_turn, sun_drives):
            teeth, count = item.teeth.pairs[name], item.counted(fault.gear)
            yield part(f"{item.name}.{name}.{n}", teeth, teeth.p, fault, count, cycles)
    for k, gears in enumerate(train.pairs):
        p, counts = train.p.meshes[k], {train.name(gear): train.teeth(gear) for gear in gears}
        for fault in p.faults:
            yield part(p.name, train.pair_teeth[k], p, fault, counts[fault.gear], fault.tooth - 1)


def _turning(train: Train, rows: TrainSetRows) -> Rotation:
    """Return the terms of the speed of a carrier in its frame."""
    members = {}
    for member in MEMBERS:
        rotor = train.place[rows.item.p[member]]
        if rotor in train.supported:
            members[member] = (train.masses[rotor], _drag(train, rotor))
    return rows.turning(members, train.driving * train.speeds[rows.item.p.carrier] / train.cycles)


def _drag(train: Train, rotor: int, key: str = "stiffness") -> Array:
    """The damping of a lateral or an axial support, 2 zeta sqrt(k m)."""
    support = train.rotors[rotor]["support"]
    k = number(support[key])
    return train.damping_factor * 2 * number(support.damping_ratio) * np.sqrt(k * train.masses[rotor])


def _set_meshes(train: Train, rows: TrainSetRows) -> Iterator[MeshElement]:
    """Yield the meshes of a set, compressed where they carry the load."""
    item, place = rows.item, f"{rows.item.name}."
    _, _, flank = train.power(item)
    known = [mesh for mesh in train.meshes if mesh.name.startswith(place) and mesh.motion.where == item.where]
    for k, name in enumerate(("sun", "ring")):
        with item.told():
            p, teeth = item.teeth.filled(name), item.teeth.pairs[name]
            angle = teeth.each(lambda pair: pair.pressure_angle)
            inertia = item.teeth.body("planet")[1]
        ends = [(base_radius(item.teeth.gears["planet"]), inertia)]
        if (row := rows.rotation(name)) and row.keys() <= train.place.keys():
            ends.append((base_radius(item.teeth.gears[name]), train.inertias[train.place[item.p[name]]]))
        mobility = sum((r**2 / j for r, j in ends), np.zeros(()))
        for n, mesh in zip(rows.numbers, known[k * item.count :], strict=False):
            along = {key: flank * value for key, value in rows.deflection(name, n, flank * angle).items()}
            lag = np.asarray(mesh.lag, dtype=float) + teeth.start
            found = MeshElement(
                p.model_copy(update={"name": mesh.name}), along, train.frequency_ratio(mesh.motion), lag
            )
            yield _damped(train, found, 1 / mobility)


def _damped(train: Train, found: MeshElement, mass: Array) -> MeshElement:
    """Return the mesh with its damping, c = 2 zeta sqrt(k m_e) (Kuria & Kihiu 2008). mass: m_e."""
    p = found.p
    drag = number(p.damping)
    if p.damping_ratio is not None:
        drag = 2 * number(p.damping_ratio) * np.sqrt(found.wave.mean_stiffness * mass)
    drag = train.damping_factor * drag
    return replace(found, p=p.model_copy(update={"damping": drag if np.any(drag) else None}))


def _filled(train: Train, k: int) -> Any:
    """The parameters of a mesh with what its teeth give."""
    p = train.p.meshes[k]
    if not from_teeth(p) and not train.pair_teeth[k].helical:
        return p
    try:
        return train.pair_teeth[k].filled()
    except TrainError:
        raise
    except NotPossible as error:
        remedy = f"{error.remedy or 'change the teeth'}, or give the stiffness of the mesh"
        raise TrainError(("meshes", k), error.message, remedy) from None


def mesh_element(train: Train, k: int) -> MeshElement:
    """Return the mesh of a pair; its lag is a fraction of its own period.

    Its deflection is R_b1 theta_1 - R_b2 theta_2 + n . (u_1 - u_2) - t (z_1 - z_2), with the force n of the driver on
    the driven gear and t = tan beta_b where a right-handed driver turns counter-clockwise or a left-handed one
    clockwise, else -tan beta_b; m_e = J_1 J_2/(R_b1^2 J_2 + R_b2^2 J_1).
    """
    gears, p, push = train.pairs[k], _filled(train, k), train.push(k)
    r1, r2 = (base_radius(train.rotors[gear]) for gear in gears)
    turned: Row = {train.name(gears[0]): r1, train.name(gears[1]): -r2}
    lead = train.sense(k) * train.pair_teeth[k].lead
    row = total(
        turned, train.shift(gears[0], push), train.shift(gears[1], (-push[0], -push[1])),
        train.slide(gears[0], -lead), train.slide(gears[1], lead),
    )  # fmt: skip
    lag = number(p.lag) + train.pair_teeth[k].start
    found = MeshElement(p, row, train.frequency_ratio(train.motions[k]), lag)
    j1, j2 = (train.inertias[gear] for gear in gears)
    return _damped(train, found, j1 * j2 / (r1**2 * j2 + r2**2 * j1))


def _rubbed(train: Train, system: GearSystem, drag: list[Array]) -> GearSystem:
    """The system with the friction of its meshes."""
    laws = [p.friction for p in train.p.meshes]
    if not any(laws):
        return system
    forces = np.abs(static_mesh_force(system))
    terms: list[PeriodicTerm] = []
    pushes: list[PeriodicForce] = []
    for k, law in enumerate(laws):
        if law is None:
            continue
        teeth, gears = train.pair_teeth[k], train.pairs[k]
        plain = law.kind == "constant"
        speed = 1.0 if plain else number(train.p.input.speed) * float(abs(train.speeds[train.name(gears[0])]))
        try:
            rubbing = teeth.friction(
                law, np.asarray(speed), np.ones(()) if plain else forces[..., k - len(train.pairs)]
            )
        except NotPossible as error:
            remedy = "change the teeth or the operating point"
            raise TrainError(("meshes", k, "friction"), error.message, remedy) from None
        arms = loads.arms(train, gears, rubbing, train.push(k), train.sense(k), teeth.pairs[0].wheel_drives)
        item, follows = system.meshes[k - len(train.pairs)], train.p.meshes[k].damping_follows_stiffness
        terms += loads.terms(item, rubbing, arms, drag[k], follows)
        pushes += loads.forces(item, rubbing, arms)
    return replace(system, terms=(*system.terms, *terms), forces=(*system.forces, *pushes))


def shaft_stiffness(train: Train, shaft: Any) -> Array:
    """k as given, or G pi (d^4 - d_i^4)/(32 l) of a round shaft, N m/rad."""
    if shaft.stiffness is not None:
        return number(shaft.stiffness)
    polar = np.pi / 32 * (number(shaft.diameter) ** 4 - number(shaft.bore) ** 4)
    if not np.all(polar > 0):
        raise TrainError(("shafts", train.p.shafts.index(shaft), "bore"), "leaves nothing of the shaft", "reduce it")
    return np.asarray(train.material["shear"]) * polar / number(shaft.length)


def shaft_elements(train: Train) -> Iterator[Element]:
    """Yield the twist of every shaft, whose ends turn the same way; c = 2 zeta sqrt(k J_1 J_2/(J_1 + J_2))."""
    for shaft in train.p.shafts:
        first, second = shaft.between
        j1, j2 = (train.inertias[train.place[end]] for end in (first, second))
        k = shaft_stiffness(train, shaft)
        c = 2 * number(shaft.damping_ratio) * np.sqrt(k * j1 * j2 / (j1 + j2))
        yield Element({first: 1.0, second: -1.0}, 0.0, k, train.damping_factor * c, shaft.name, MachineElement.SHAFT)


def _supports(train: Train) -> Iterator[Element]:
    """Yield mass and support of every rotor that moves in its plane or along its axis, and torsional supports."""
    for rotor, mass in train.masses.items():
        support, name = train.rotors[rotor]["support"], train.name(rotor)
        k, axial = number(support.stiffness), number(support.axial_stiffness)
        for way, along in (("x", (1.0, 0.0)), ("y", (0.0, 1.0))):
            yield Element(train.shift(rotor, along), mass, k, _drag(train, rotor), f"{name}.{way}")
        yield Element(train.slide(rotor, 1.0), mass, axial, _drag(train, rotor, "axial_stiffness"), f"{name}.z")
    for rotor, p in enumerate(train.rotors):
        support = p.get("support") or Support()
        k = number(support.torsional_stiffness)
        c = 2 * number(support.damping_ratio) * np.sqrt(k * train.inertias[rotor])
        yield Element(train.rotation(rotor), 0.0, k, train.damping_factor * c, train.name(rotor), MachineElement.SHAFT)
