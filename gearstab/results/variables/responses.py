"""Variables of motions: over time and at speeds, with backlash, and of pairs given by their gears."""

from __future__ import annotations

from dataclasses import replace

from gearstab.results import variables
from gearstab.results.variables import DOF, GRID, ROWS, SPEED, TEXT, Variable, coordinate, design

RESPONSE = (
    coordinate("time", "time", "f8", "s", "time"),
    *DOF,
    coordinate("mesh", "mesh", TEXT, "1", "tooth mesh"),
    Variable("displacement", ("time", "dof"), "f8", "m", "displacement"),
    Variable("velocity", ("time", "dof"), "f8", "m/s", "velocity"),
    Variable("mesh_deflection", ("time", "mesh"), "f8", "m", "mesh deflection along the line of action"),
    Variable("mesh_force", ("time", "mesh"), "f8", "N", "elastic mesh force"),
    Variable("energy", ("time",), "f8", "J", "kinetic energy and potential energy at the stiffness of the moment"),
    Variable("static_mesh_force", ("mesh",), "f8", "N", "mesh force under the constant load, at the mean stiffness"),
    Variable("mean_velocity", ("dof",), "f8", "m/s", "uniform motion that displacements are relative to"),
    coordinate("frequency", "frequency", "f8", "rad/s", "frequency"),
    Variable("mesh_force_amplitude", ("frequency", "mesh"), "f8", "N", "amplitude of the mesh force"),
    Variable("mesh_deflection_amplitude", ("frequency", "mesh"), "f8", "m", "amplitude of the mesh deflection"),
    Variable("mesh_force_density", ("frequency", "mesh"), "f8", "N^2 s", "spectral density of the mesh force"),
    Variable(
        "mesh_deflection_density", ("frequency", "mesh"), "f8", "m^2 s",
        "spectral density of the mesh deflection",
    ),
    coordinate("peak", "peak", "i4", "1", "number of the peak of the mesh forces' spectra, the largest first"),
    Variable("peak_mesh", ("peak",), TEXT, "1", "tooth mesh of the peak"),
    Variable("peak_frequency", ("peak",), "f8", "rad/s", "frequency of the peak"),
    Variable("peak_amplitude", ("peak",), "f8", "N", "amplitude of the harmonic"),
    Variable("peak_density", ("peak",), "f8", "N^2 s", "height of the peak"),
    Variable("status", (), "i2", "1", "what is to be said of the response; 0: nothing"),
)  # fmt: skip

RAMP_RESPONSE = (
    coordinate("time", "time", "f8", "s", "time"),
    coordinate("momentary_mesh_frequency", "time", "f8", "rad/s", "mesh frequency at the time"),
    *DOF,
    coordinate("mesh", "mesh", TEXT, "1", "tooth mesh"),
    Variable("displacement", ("time", "dof"), "f8", "m", "displacement without rigid-body motion"),
    Variable("velocity", ("time", "dof"), "f8", "m/s", "velocity without rigid-body motion"),
    Variable("mesh_deflection", ("time", "mesh"), "f8", "m", "mesh deflection along the line of action"),
    Variable("mesh_force", ("time", "mesh"), "f8", "N", "elastic mesh force"),
    Variable("static_mesh_force", ("mesh",), "f8", "N", "mesh force under the constant load, at the mean stiffness"),
    coordinate("moment", SPEED, "f8", "s", "time in the middle of a window"),
    coordinate("frequency", "frequency", "f8", "rad/s", "frequency"),
    coordinate("harmonic", "harmonic", "i4", "1", "multiple of the frequency of the mesh itself"),
    Variable("mesh_force_spectrogram", (SPEED, "frequency", "mesh"), "f4", "N", "amplitude of the mesh force"),
    Variable(
        "mesh_force_harmonic", (SPEED, "harmonic", "mesh"), "f8", "N",
        "amplitude of a harmonic of the mesh force",
    ),
    Variable("status", (), "i2", "1", "what is to be said of the response; 0: nothing"),
)  # fmt: skip

TOOTH_LOADS = (
    coordinate("contact", "contact", "f8", "1", "contact of a pair of teeth, from its first point to its last one"),
    Variable("tooth_load", ("contact", "mesh"), "f8", "N", "largest load of a pair of teeth"),
    Variable(
        "static_tooth_load", ("contact", "mesh"), "f8", "N", "load of a pair of teeth under the static mesh force"
    ),
    coordinate("flank", "flank", TEXT, "1", "gear and mesh"),
    Variable("root_stress", ("contact", "flank"), "f8", "Pa", "largest stress at the root of a tooth (ISO 6336-3)"),
    Variable(
        "static_root_stress", ("contact", "flank"), "f8", "Pa",
        "stress at the root of a tooth under the static mesh force",
    ),
    Variable("peak_root_stress", ("flank",), "f8", "Pa", "largest stress at the root of a tooth along its contact"),
)  # fmt: skip
"""Variables of responses of systems whose teeth are known."""

BACKLASH_RESPONSE = (
    *RESPONSE,
    Variable("mesh_velocity", ("time", "mesh"), "f8", "m/s", "rate of the mesh deflection"),
    Variable(
        "contact", ("time", "mesh"), "i1", "1", "flank in contact",
        {"flag_values": [-1, 0, 1], "flag_meanings": "below_the_play none above_the_play"},
    ),
    Variable("play", ("mesh", "bound"), "f8", "m", "deflection less transmission error, between which a mesh is apart"),
    coordinate("bound", "bound", TEXT, "1", "end of the play"),
    coordinate("event", "event", "i8", "1", "number of the change of contact, from 1"),
    Variable("event_time", ("event",), "f8", "s", "time of the event"),
    Variable("event_mesh", ("event",), TEXT, "1", "tooth mesh of the event"),
    Variable("event_kind", ("event",), TEXT, "1", "separation, drive_side_contact or coast_side_contact"),
    Variable("event_velocity", ("event",), "f8", "m/s", "rate of the mesh deflection, less the transmission error's"),
    Variable("peak_to_peak", ("mesh",), "f8", "m", "peak-to-peak mesh deflection of the settled motion"),
    Variable("rms", ("mesh",), "f8", "m", "root mean square of the mesh deflection about its mean, settled"),
    Variable("mesh_force_peak", ("mesh",), "f8", "N", "largest magnitude of the elastic mesh force, settled"),
    Variable("contact_loss_ratio", ("mesh",), "f8", "1", "part of the time without contact, settled"),
)  # fmt: skip
"""Variables of a system whose teeth may part."""

SPEED_RESPONSE = (
    coordinate("mesh", "mesh", TEXT, "1", "tooth mesh"),
    Variable("mesh_force_peak", (GRID, "mesh"), "f8", "N", "largest elastic mesh force"),
    Variable("mesh_force_mean", (GRID, "mesh"), "f8", "N", "mean elastic mesh force"),
    Variable("mesh_force_rms", (GRID, "mesh"), "f8", "N", "root mean square of the mesh force about its mean"),
    Variable("transmission_error_peak_to_peak", (GRID, "mesh"), "f8", "m", "peak-to-peak dynamic transmission error"),
    Variable(
        "transmission_error_rms", (GRID, "mesh"), "f8", "m",
        "root mean square of the dynamic transmission error about its mean",
    ),
    Variable("mesh_force_min", (GRID, "mesh"), "f8", "N", "least elastic mesh force"),
    Variable(
        "transmission_error_first_harmonic", (GRID, "mesh"), "f8", "m",
        "amplitude of the dynamic transmission error at the frequency of the mesh",
    ),
    Variable("dynamic_load_factor", (GRID, "mesh"), "f8", "1", "dynamic load factor"),
    Variable(
        "load_factor_fewest_pairs", (GRID, "mesh"), "f8", "1",
        "dynamic load factor while the fewest pairs of teeth carry",
    ),
    Variable(
        "tooth_load_factor", (GRID, "mesh"), "f8", "1",
        "largest load of a pair of teeth over the static mesh force",
    ),
    Variable("status", (GRID,), "i2", "1", "what is to be said of the steady state; 0: nothing"),
)  # fmt: skip
"""Variables of the steady state at every point."""

MESH_ORDER = "mesh_order"
"""Dimension: multiples of the mesh frequency."""


def connections(part: str, unit: str) -> tuple[Variable, ...]:
    """Variables of the steady state of all connections of a part, ``bearing`` or ``shaft``; unit: of their forces."""
    name, words = load_of(part)
    return (
        coordinate(part, part, TEXT, "1", part),
        Variable(f"{name}_peak", (GRID, part), "f8", unit, f"largest {words}"),
        Variable(f"{name}_mean", (GRID, part), "f8", unit, f"mean {words}"),
        Variable(f"{name}_rms", (GRID, part), "f8", unit, f"root mean square of the {words} about its mean"),
        Variable(f"{name}_harmonic", (GRID, MESH_ORDER, part), "f8", unit, f"amplitude of the {words} at an order"),
    )


def history_of_connections(part: str, unit: str) -> tuple[Variable, ...]:
    """Variable over time of all connections of a part."""
    name, words = load_of(part)
    return coordinate(part, part, TEXT, "1", part), Variable(name, ("time", part), "f8", unit, words)


def run_up_of_connections(part: str, unit: str) -> tuple[Variable, ...]:
    """Variables of a run-up, over time and over the speed, of all connections of a part."""
    name, words = load_of(part)
    dims = (SPEED, MESH_ORDER, part)
    own = Variable(f"{name}_harmonic", dims, "f8", unit, f"amplitude of the {words} at an order")
    return *history_of_connections(part, unit), own


def load_of(part: str) -> tuple[str, str]:
    """Return the name of what a part carries, ``bearing_force`` or ``shaft_torque``, and its words."""
    name = f"{part}_{'torque' if part == 'shaft' else 'force'}"
    return name, name.replace("_", " ")


ORDERS = coordinate(MESH_ORDER, MESH_ORDER, "f8", "1", "multiple of the mesh frequency")

ALL_MOTIONS = (
    "mesh_force_peak", "transmission_error_peak_to_peak", "transmission_error_rms", "dynamic_load_factor",
)  # fmt: skip
"""Variables that motions with backlash have, too."""

MULTIPLIERS = (
    coordinate("multiplier", "multiplier", "i4", "1", "number of the Floquet multiplier, by descending magnitude"),
    Variable("multiplier_real", (GRID, "multiplier"), "f8", "1", "real part of the motion's Floquet multiplier"),
    Variable("multiplier_imag", (GRID, "multiplier"), "f8", "1", "imaginary part of the motion's Floquet multiplier"),
    Variable("multiplier_error", (GRID,), "f8", "1", "estimated error of the multipliers"),
    Variable(
        "motion_stable", (GRID,), "i1", "1", "stability of the periodic motion",
        {"flag_values": [-1, 0, 1], "flag_meanings": "not_periodic unstable stable"}, missing=-1,
    ),
    Variable(
        "loss", (GRID,), "i1", "1", "how stability is lost, or would be first, by the largest multiplier",
        {"flag_values": [0, 1, 2, 3], "flag_meanings": "none fold period_doubling neimark_sacker"},
    ),
)  # fmt: skip
"""Variables of periodic motions with backlash."""

BACKLASH_SPEED_RESPONSE = (
    *(v for v in SPEED_RESPONSE if v.name == "mesh" or v.name in ALL_MOTIONS),
    Variable("contact_loss_ratio", (GRID, "mesh"), "f8", "1", "part of the time without contact"),
    Variable("period", (GRID,), "i2", "1", "common periods after which the motion repeats itself; 0: it does not"),
    *MULTIPLIERS,
    Variable("status", (GRID,), "i2", "1", "what is to be said of the motion; 0: nothing"),
)
"""Limit cycles of motions with backlash."""

POINT = ("branch", ROWS, "point")


def along_branches(variables: tuple[Variable, ...]) -> tuple[Variable, ...]:
    """Return variables of every speed as those of every motion of a branch."""
    dims = [tuple(name for dim in v.dims for name in (POINT if dim == GRID else (dim,))) for v in variables]
    return tuple(replace(v, dims=own) for v, own in zip(variables, dims, strict=True))


BRANCHES = (
    coordinate("point", "point", "i4", "1", "number of the motion along its branch, from 1"),
    coordinate("multiplier", "multiplier", "i4", "1", "number of the Floquet multiplier, by descending magnitude"),
    Variable("mesh_frequency", POINT, "f8", "rad/s", "mesh frequency of the motion"),
    Variable(
        "amplitude_rms", POINT, "f8", "m",
        "root mean square of the dynamic transmission error about its mean, of the mesh where it is largest",
    ),
    Variable(
        "amplitude_peak", POINT, "f8", "m",
        "largest deviation of the dynamic transmission error from its mean, of the mesh where it is largest",
    ),
    Variable(
        "stable", POINT, "i1", "1", "stability of the motion",
        {"flag_values": [-1, 0, 1], "flag_meanings": "no_motion unstable stable"}, missing=-1,
    ),
    Variable("multipliers", (*POINT, "multiplier"), "c16", "1", "Floquet multipliers of the motion"),
    *along_branches(tuple(v for v in MULTIPLIERS if v.name in ("multiplier_error", "loss"))),
    Variable(
        "event", POINT, "i1", "1", "what multipliers do there that cross the unit circle, or that a flank is grazed",
        {"flag_values": [0, 1, 2, 3, 4, 5],
         "flag_meanings": "none fold period_doubling neimark_sacker grazing branch_point"},
    ),
    Variable("multiplicity", POINT, "i1", "1", "how many multipliers, or pairs of them, cross at once"),
    Variable("period", ("branch", ROWS), "i4", "1", "cycles of the first mesh after which motions repeat themselves"),
    Variable("parent", ("branch", ROWS), "i4", "1", "branch that this one leaves, from 0", missing=-1),
    Variable("residual", POINT, "f8", "1", "difference of the motion's end and start, over its extent"),
    *along_branches(tuple(
        v for v in BACKLASH_SPEED_RESPONSE
        if v.name in ("mesh", "mesh_force_peak", "transmission_error_peak_to_peak", "transmission_error_rms",
                      "contact_loss_ratio")
    )),
    Variable(
        "jump", POINT, "i1", "1", "whether stable motions end there, so that the motion jumps",
        {"flag_values": [-1, 0, 1], "flag_meanings": "in_falling_speed no in_rising_speed"},
    ),
    Variable("landing_branch", POINT, "i4", "1", "branch that it jumps to, from 0", missing=-1),
    Variable(
        "landing_point", POINT, "i4", "1", "motion next to the one that it jumps to",
        {"comment": "position along the dimension point, from 0, or -1"}, missing=-1,
    ),
    Variable("status", POINT, "i2", "1", "why a branch ends there, and what is to be said of the motion"),
)  # fmt: skip
"""Periodic motions with backlash, followed through folds."""

PAIR_RESPONSE = (
    coordinate("time", "time", "f8", "s", "time"),
    coordinate("mesh", "mesh", TEXT, "1", "tooth mesh"),
    Variable("phi", ("time",), "f8", "rad", "deflection of the teeth, (N1 theta1 - N2 theta2)/2"),
    Variable("phi_dot", ("time",), "f8", "rad/s", "rate of the deflection"),
    Variable("theta", ("time",), "f8", "rad", "rotation, (N1 theta1 + N2 theta2)/2"),
    Variable("theta_dot", ("time",), "f8", "rad/s", "rotational speed"),
    Variable("energy", ("time",), "f8", "J", "total energy: kinetic and strain energy less the work of the torques"),
    Variable("mesh_stiffness", ("time", "mesh"), "f8", "N m", "torsional mesh stiffness"),
    Variable("mesh_force", ("time", "mesh"), "f8", "N", "elastic mesh force"),
    coordinate("cycle", "cycle", "i8", "1", "number c of the crossing of theta = 2 pi c"),
    Variable("section_time", ("cycle",), "f8", "s", "time of the crossing"),
    Variable("section_phi", ("cycle",), "f8", "rad", "deflection at the crossing"),
    Variable("section_phi_dot", ("cycle",), "f8", "rad/s", "rate of the deflection just after the crossing"),
    Variable("section_theta", ("cycle",), "f8", "rad", "rotation at the crossing"),
    Variable("section_theta_dot", ("cycle",), "f8", "rad/s", "rotational speed just after the crossing"),
    Variable("section_energy", ("cycle",), "f8", "J", "total energy just after the crossing"),
    Variable("section_direction", ("cycle",), "i1", "1", "1 forwards, -1 backwards"),
    coordinate("event", "event", "i8", "1", "number of the change of mesh stiffness that was met, from 1"),
    Variable("event_time", ("event",), "f8", "s", "time of the event"),
    Variable("event_direction", ("event",), "i1", "1", "1 forwards, -1 backwards"),
    Variable(
        "event_passed", ("event",), "i1", "1", "whether the gears passed",
        {"flag_values": [0, 1], "flag_meanings": "reflected passed"},
    ),
    Variable("event_pairs_before", ("event",), "i1", "1", "pairs of teeth in contact before the event"),
    Variable("event_pairs_after", ("event",), "i1", "1", "pairs of teeth in contact after the event"),
    Variable("event_theta", ("event",), "f8", "rad", "rotation at the event"),
    Variable("event_phi", ("event",), "f8", "rad", "deflection at the event"),
    Variable("event_phi_dot_before", ("event",), "f8", "rad/s", "rate of the deflection just before the event"),
    Variable("event_phi_dot_after", ("event",), "f8", "rad/s", "rate of the deflection just after the event"),
    Variable("event_theta_dot_before", ("event",), "f8", "rad/s", "rotational speed just before the event"),
    Variable("event_theta_dot_after", ("event",), "f8", "rad/s", "rotational speed just after the event"),
    Variable("event_energy_change", ("event",), "f8", "J", "change of the total energy at the event"),
    Variable("event_error_amplification", ("event",), "f8", "1", "growth of a small error of the initial state"),
    Variable("event_rounding_error", ("event",), "f8", "1", "error of phi by rounding, over its largest magnitude"),
    coordinate("frequency", "frequency", "f8", "rad/s", "frequency"),
    coordinate("normalised_frequency", "frequency", "f8", "1", "frequency over the damped natural frequency w_d"),
    Variable(
        "power_spectral_density", ("frequency",), "f8", "rad2 s", "one-sided power spectral density of the deflection"
    ),
    coordinate("peak", "peak", "i4", "1", "number of the peak, the largest first"),
    Variable("peak_frequency", ("peak",), "f8", "rad/s", "frequency of the peak"),
    Variable("peak_normalised_frequency", ("peak",), "f8", "1", "frequency of the peak over w_d"),
    Variable("peak_power_spectral_density", ("peak",), "f8", "rad2 s", "height of the peak"),
    Variable("status", (), "i2", "1", "how the run went; 0: complete"),
)  # fmt: skip
"""Variables of a gear pair whose mesh stiffness depends on its rotation."""

TEETH = (
    coordinate("mesh", "mesh", TEXT, "1", "tooth mesh"),
    Variable("notices", (ROWS, "mesh"), "i2", "1", "what is wrong with the teeth; 0: nothing"),
)
"""Variables of a gearbox, over the axes on which its teeth depend."""


def every_variable() -> tuple[Variable, ...]:
    """Return all variables of a result, those of the sections of a table once for each table."""
    found: list[Variable] = []
    for table in (*vars(variables).values(), *vars(design).values(), *globals().values()):
        found += [item for item in (table if isinstance(table, tuple) else (table,)) if isinstance(item, Variable)]
    return tuple(found)


def taken_names() -> frozenset[str]:
    """Return the names of all variables and dimensions: an axis of one of them could not stand beside it."""
    return frozenset(name for variable in every_variable() for name in (variable.name, *variable.dims))
