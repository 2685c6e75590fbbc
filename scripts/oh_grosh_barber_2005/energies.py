"""Oh, Grosh & Barber (2005), section 2 (the equations and their jumps) and 3.1 (energy, Fig. 3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import pi, tau

import numpy as np
import xarray as xr

from gearstab.gears.geometry import Gear
from gearstab.gears.pair import Pair
from statements import SAME_TO_ROUNDING, Runs, Statement, at_most, number, numbers, sort_of

FIG3 = "oh_grosh_barber_2005/fig3"
OTHERS = {name: f"{FIG3}_{name}" for name in ("rigid_kinematic", "classical")}
K1, K2, SINGLE = 1430.0, 2780.0, 1.73
INERTIAS = (2.89e-3, 0.7402)
TEETH = (24, 96)
ANGLE = 20.0


def constants(unit: float = 1.0) -> tuple[float, float, float]:
    """M1, M2 and w0 with the inertias times a factor."""
    first, second = (n**2 / (unit * inertia) for n, inertia in zip(TEETH, INERTIAS, strict=True))
    m2 = 0.5 * (first + second)
    return 0.5 * (first - second), m2, float(np.sqrt(m2 * 0.5 * (K1 + K2)))


def of_teeth() -> float:
    """The contact ratio of standard teeth with the numbers of Table 1."""
    pinion, wheel = (Gear(teeth, 6.35e-3, np.deg2rad(ANGLE), face_width=0.1) for teeth in TEETH)
    return Pair(pinion, wheel).contact_ratio


def response(runs: Runs, config: str = FIG3, **changes: object) -> xr.Dataset:
    return runs.respond(config, **changes)["response"].to_dataset()


def stiffness_steps(found: xr.Dataset) -> np.ndarray:
    """dk of every event."""
    return (found["event_pairs_after"].values - found["event_pairs_before"].values) * (K2 - K1)


def jumps(runs: Runs) -> Iterator[Statement]:
    found = response(runs)
    m1, m2, _ = constants()
    before, after = (found[f"event_theta_dot_{side}"].values for side in ("before", "after"))
    rates = [found[f"event_phi_dot_{side}"].values for side in ("before", "after")]
    step = stiffness_steps(found)
    squares = after**2 - before**2 + m2 * step * found["event_phi"].values ** 2
    ratio = (rates[1] - rates[0]) - m1 / m2 * (after - before)
    yield Statement(
        "(9), (11)", "theta'^2 falls by M2 dk phi^2, phi' changes by M1/M2 times as much as theta'",
        f"{len(step)} changes of stiffness in Fig. 3: {at_most(np.abs(squares / before**2).max())}; "
        f"{at_most(np.abs(ratio / before).max())}",
        bool(max(np.abs(squares / before**2).max(), np.abs(ratio / before).max()) < 1e-9), SAME_TO_ROUNDING,
    )  # fmt: skip
    slower = bool(np.all((after - before) * step < 0))
    yield Statement(
        "2.2", "the gear set slows down where the number of teeth in contact increases, speeds up where it decreases",
        f"at {'all' if slower else 'some'} of them", slower, "at all of them",
    )  # fmt: skip


def stuck(runs: Runs) -> Iterator[Statement]:
    found = response(
        runs, system__damping_ratio=0.1, system__torque=42.1, respond__speed=30.0, respond__cycles=100
    )  # fmt: skip
    words = found.attrs["status"]
    reached = int(found["cycle"].values.max(initial=0))
    cycles = 100
    yield Statement(
        "2.3", "steps 1 to 6 are repeated",
        f"with zeta = 0.1, T0 = 42.1 N m and 286 rpm they end after {reached} mesh cycles of {cycles}: {words}",
        sort_of(reached == cycles, reached > 1), "all cycles are reached; in part: some are",
        "(9) has no solution where theta'^2 < M2 dk phi^2: the gear is then reflected, theta' -> -theta', and damping "
        "traps it with one pair in contact. Balanced torques with damping have no steady rotation.",
    )  # fmt: skip


def units(runs: Runs) -> Iterator[Statement]:
    speeds = np.array([600, 4500]) * 24 * pi / 30
    mine, printed = [speeds / (constants(unit)[2] * np.sqrt(1 - 0.05**2)) for unit in (1.0, 1e-3)]
    fine = [bool(np.all(np.abs(values - [0.1, 0.75]) < [0.005, 0.01])) for values in (printed, mine)]
    yield Statement(
        "Fig. 4", "N1 Omega1/w_d = 0.1 and 0.75 at 600 and 4500 rpm; I1 = 2.89 and I2 = 740.2 kg mm^2",
        f"{numbers(mine)} with inertias of 2.89e-3 and 0.7402 kg m^2, {numbers(printed)} with the printed unit",
        sort_of(fine[0], fine[1]), "0.1 and 0.75 to 0.005 and 0.01; in part: with another unit",
        "The unit must be 1e-3 kg m^2 where k is in N m.",
    )  # fmt: skip
    module = [2 * radius / teeth for radius, teeth in zip((76.2, 304.8), TEETH, strict=True)]
    yield Statement(
        "3, Table 1", "module 6.25 mm; radii of the pitch circles 76.2 and 304.8 mm",
        f"2 r/N = {numbers(module)} mm for both gears",
        all(abs(m - 6.25) < 0.005 for m in module), "rounds to 6.25 mm",
        "Four teeth per inch of diameter are a module of 6.35 mm; the equations use neither.",
    )  # fmt: skip
    ratio = 2 - SINGLE / tau
    yield Statement(
        "3, Table 1", "theta12 = 1.73 and theta21 = 4.56 rad; contact ratio 1.75",
        f"they add up to {number(1.73 + 4.56, 4)} = 2 pi + {number(1.73 + 4.56 - tau, 2)}; contact ratio "
        f"{number(ratio, 4)}; of its {TEETH[0]} and {TEETH[1]} teeth with {number(ANGLE, 2)} degrees "
        f"{number(of_teeth(), 4)}",
        sort_of(abs(ratio - 1.75) < 0.005, abs(1.73 + 4.56 - tau) < 0.01),
        "rounds to 1.75; in part: the angles add up to 2 pi within their rounding",
        "Both are durations within 2 pi of theta, for a contact ratio of 1.725: neither these nor the teeth give 1.75.",
    )  # fmt: skip


def conserved(runs: Runs) -> Iterator[Statement]:
    found = response(runs, system__damping_ratio=0.0)["energy"].values
    spread = np.ptp(found) / found[0]
    yield Statement(
        "3.1", "without damping U remains constant",
        f"energy-conserving formulation, Fig. 3 without damping, {at_most(spread)}", bool(spread < 1e-9),
        SAME_TO_ROUNDING,
    )  # fmt: skip


def fig3(runs: Runs) -> Iterator[Statement]:
    found = response(runs)["energy"].values
    falls = bool(np.diff(found).max() <= 1e-12 * found[0])
    yield Statement(
        "Fig. 3", "energy-conserving: a monotonically decreasing total energy",
        f"U falls from {number(found[0], 4)} to {number(found[-1], 4)} J in 20 cycles, "
        f"{'without' if falls else 'with'} a rise", falls, "without a rise",
    )  # fmt: skip
    other = response(runs, OTHERS["rigid_kinematic"])
    change, phi, step = (other["event_energy_change"].values, other["event_phi"].values, stiffness_steps(other))
    defect = np.abs(change - step * phi**2).max() / np.abs(change).max()
    cycles = other["section_energy"].values
    yield Statement(
        "Fig. 3", "rigid kinematic: upward jumps where the number of teeth in contact increases",
        f"jumps of dk phi^2 ({at_most(defect)}), in the last cycle of {numbers(change[-2:])} J",
        bool(defect < 1e-9 and np.all((change > 0) == (step > 0))), "upward where dk > 0, at every jump",
    )  # fmt: skip
    drift = abs(cycles[-1] - cycles[2]) / cycles[2]
    yield Statement(
        "Fig. 3", "rigid kinematic: no overall reduction in total energy from cycle to cycle",
        f"U after cycles 3 and 20, {at_most(drift)}", bool(drift < 1e-9), SAME_TO_ROUNDING,
        "After the first cycles the jumps give back exactly what the damping takes.",
    )  # fmt: skip


def artificial(runs: Runs) -> Iterator[Statement]:
    found = response(runs, OTHERS["classical"])
    gained = found["event_energy_change"].values[-2:].sum()
    yield Statement(
        "4", "the classical equations predict an artificial net increase in energy during one cycle of rotation",
        f"Fig. 3, classical: the two jumps of a cycle add up to {number(gained)} J, and damping takes as much",
        bool(gained > 0), "more than 0",
    )  # fmt: skip


def damping(runs: Runs) -> Iterator[Statement]:
    found = response(runs)
    m1, m2, w0 = constants()
    m = m1 / m2
    rate, speed = found["phi_dot"].values, found["theta_dot"].values
    # Work of a force in (2) alone, from the kinetic energy (phi' - m theta')^2/(1 - m^2) + theta'^2.
    alone = -4 * 0.1 * w0 / m2 * rate * (rate - m * speed) / (1 - m**2)
    yield Statement(
        "3", "the damping term is included on the left-hand side of (2)",
        f"there alone it gives energy {number(100 * np.mean(alone > 0), 2)} % of the time of Fig. 3, at up to "
        f"{number(alone.max(), 2)} W; with its part M1/M2 in (3) it takes at most "
        f"{number((4 * 0.1 * w0 / m2 * rate**2).max(), 2)} W and never gives any",
        not np.any(alone > 0), "it never gives energy",
        "A force between the gears acts on both coordinates: dU/dt = -4 zeta w0 phi'^2/M2. Also c in (14) is not that "
        "of the text; zeta is used.",
    )  # fmt: skip


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [jumps, stuck, units, damping, conserved, fig3, artificial]
