"""The statements of Lin & Parker (1999) and of Cooley & Parker (2012) about natural frequencies over carrier speed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import scipy.linalg

from gearstab.config import load
from gearstab.floquet.general.mean import mean_motions
from gearstab.system import Array, GearSystem
from gearstab.systems import build
from statements import CONFIGS, Paper, Runs, Statement

PRINTED = "system.pin_preload=false"
"""The equations of both papers, without the tension of the pins."""
BELOW = (0.5, 0.9, 0.99, 0.9999)
"""Parts of a critical speed."""
EQUAL = 1e-6
"""Natural frequencies that differ by less than this part are one."""
TYPICAL = 1e-9
"""Part of the largest displacement that is none."""


def gear(config: str, speed: float, *changes: str) -> GearSystem:
    """A gear of a paper whose carrier turns at a speed, rad/s."""
    turning = f"system.carrier_speed={{speed: {float(speed)!r}}}"
    return build(load(CONFIGS / f"{config}.yaml", [turning, PRINTED, *changes]).system)


def groups(frequency: Array) -> list[Array]:
    """Positions of equal ones among ascending natural frequencies, zero left out."""
    cuts = np.flatnonzero(np.diff(frequency) > EQUAL * frequency[1:]) + 1
    return [own for own in np.split(np.arange(len(frequency)), cuts) if frequency[own[0]] > EQUAL * frequency[-1]]


def splits(speed: float) -> tuple[Array, Array, Array]:
    """(first-order split W |phi_1^T G phi_2|, split that comes out) of each pair, and shifts of single ones."""
    system = gear("lin_parker_1999/modes", speed)
    squared, shapes = scipy.linalg.eigh(system.mean_stiffness_matrix(), system.mass)
    rest = np.sqrt(np.maximum(squared, 0.0))
    moved = np.sort(mean_motions(system).frequency[0])
    (rotation,) = system.rotations
    assert rotation.gyroscopic is not None
    modal = shapes.T @ rotation.gyroscopic @ shapes
    pairs = [own for own in groups(rest) if len(own) == 2]
    single = [int(own[0]) for own in groups(rest) if len(own) == 1]
    predicted = np.array([speed * abs(modal[p, q]) for p, q in pairs])
    return predicted, np.array([np.ptp(moved[own]) for own in pairs]), np.abs(moved - rest)[single]


def frequencies_split(_: Runs) -> Iterator[Statement]:
    """Gyroscopic effects part the pairs of translational modes."""
    speeds = (25.0, 50.0)
    found = [splits(speed) for speed in speeds]
    errors = [np.abs(split / predicted - 1).max() for predicted, split, _ in found]
    largest = [predicted.max() / (2 * np.pi) for predicted, *_ in found]
    yield Statement(
        "gyroscopic effects",
        "The two equal natural frequencies of each pair of translational modes split with the carrier speed W, to "
        "first order w -+ (W/2) phi_1^T G phi_2",
        f"at W = {speeds[0]:g} and {speeds[1]:g} rad/s the pairs split by up to {largest[0]:.3g} and {largest[1]:.3g} "
        f"Hz, as first order says but for {errors[0]:.1e} and {errors[1]:.1e} of the split",
        bool(errors[0] < 1e-2 and errors[1] < 5 * errors[0]),
        "within 1 %, and the error of twice the speed at most five times as large",
        "the error of first order grows with the square of the speed",
    )
    shifts = [single.max() / split.max() for _, split, single in found]
    yield Statement(
        "gyroscopic effects",
        "Rotational and planet modes are not affected to first order",
        f"their frequencies move by at most {shifts[0]:.1e} and {shifts[1]:.1e} of the largest split",
        bool(shifts[0] < 0.05 and 1.8 < shifts[1] / shifts[0] < 2.2),
        "by less than 0.05 of the largest split, and that part doubles with the speed",
        "a shift in proportion to the square of the speed",
    )


def whirling_modes(system: GearSystem, speed: float) -> Array:
    """Motions ``(motions, bodies, 3)`` that oscillate, x, y or radial, tangential, and rotation of each body."""
    (rotation,), n = system.rotations, system.size
    assert rotation.gyroscopic is not None
    assert rotation.centripetal is not None
    stiffness = system.mean_stiffness_matrix() + speed**2 * rotation.centripetal
    bottom = -np.linalg.solve(system.mass, np.hstack([stiffness, speed * rotation.gyroscopic]))
    values, vectors = np.linalg.eig(np.vstack([np.eye(2 * n)[n:], bottom]))
    shapes = vectors[:n, values.imag > EQUAL * np.abs(values).max()].T
    return shapes.reshape(len(shapes), -1, 3) / np.abs(shapes).max(axis=1)[:, None, None]


def types(modes: Array) -> tuple[list[int], int]:
    """How many motions are of each type, and how many of none: the central bodies of a rotational mode only rotate and
    its planets move alike; in a translational one they do not rotate and orbit in circles; in a planet mode they rest.
    """
    central, planets = modes[:, :3], modes[:, 3:]
    orbits = np.abs(central[:, :, :1] + 1j * np.array([1.0, -1.0]) * central[:, :, 1:2]).max(axis=1).min(axis=1)
    moving, turning = np.abs(central[:, :, :2]).max(axis=(1, 2)), np.abs(central[:, :, 2]).max(axis=1)
    alike = np.abs(planets - planets[:, :1]).max(axis=(1, 2))
    # Central bodies at rest orbit in circles of no size.
    planet = np.maximum(moving, turning) < TYPICAL
    off = np.stack([np.maximum(moving, alike), np.maximum(turning, orbits)])
    rotational, translational = ~planet & (off < TYPICAL)
    counts = [int(kind.sum()) for kind in (rotational, translational, planet)]
    return counts, len(modes) - sum(counts)


def mode_types(_: Runs) -> Iterator[Statement]:
    """The structure of modes at speed."""
    cases = [("cooley_parker_2012/at_rest", 800.0, 3), *(("lin_parker_1999/modes", 300.0, n) for n in (4, 5))]
    found, real = {}, []
    for config, speed, planets in cases:
        modes = whirling_modes(gear(config, speed, f"system.planets={planets}"), speed)
        found[planets] = types(modes)
        flat = modes.reshape(len(modes), -1)
        largest = np.take_along_axis(flat, np.abs(flat).argmax(axis=1)[:, None], axis=1)
        real.append(int((np.abs((flat / largest).imag).max(axis=1) < EQUAL).sum()))
    listed = "; ".join(
        f"{n} planets: {', '.join(map(str, counts))} and {none} others" for n, (counts, none) in found.items()
    )
    yield Statement(
        "abstract",
        "Three types of modes exist, and only these: rotational, translational and planet modes",
        f"how many are of each type, the free rotation left out: {listed}",
        all(none == 0 and counts[1:] == [12, 3 * (n - 3)] for n, (counts, none) in found.items()),
        "no others to 1e-9, twelve translational and 3 (N - 3) planet modes",
        "Translational modes are no pairs of equal frequency now; central bodies orbit in circles.",
    )
    yield Statement(
        "abstract",
        "The modes are complex-valued",
        f"real ones among the modes of 3, 4 and 5 planets: {', '.join(map(str, real))}",
        not any(real),
        "none",
    )


def instabilities_at_high_speed(_: Runs) -> Iterator[Statement]:
    """Critical speeds, at which a natural frequency is zero, and what grows beyond."""
    config = "cooley_parker_2012/at_rest"
    system = gear(config, 1.0)
    (rotation,) = system.rotations
    assert rotation.centripetal is not None
    # K v = W^2 (-K_c) v
    inverse = scipy.linalg.eigh(-rotation.centripetal, system.mean_stiffness_matrix(), eigvals_only=True)
    critical = float(1 / np.sqrt(inverse.max()))
    below = [float(mean_motions(gear(config, part * critical)).frequency.min()) for part in BELOW]
    yield Statement(
        "critical speeds",
        "A natural frequency falls to zero with the carrier speed",
        f"det(K + W^2 K_c) = 0 at {critical:.6g} rad/s; at {', '.join(f'{part:g}' for part in BELOW)} of it the lowest "
        f"natural frequency is {', '.join(f'{w:.4g}' for w in below)} rad/s",
        all(first > second for first, second in pairwise(below)) and below[-1] < 1e-3 * below[0],
        "falls throughout, to less than 0.001 of the first number",
    )
    first: dict[str, float] = {}
    for part in np.linspace(0.1, 3.0, 59):
        found = mean_motions(gear(config, part * critical))
        for frequency in found.frequency[found.unstable]:
            first.setdefault("flutter" if frequency > 0 else "divergence", float(part))
    listed = ", ".join(f"{name} at {part:.3g}" for name, part in first.items())
    yield Statement(
        "abstract",
        "Divergence and flutter instabilities are observed at extremely high speeds",
        f"looked for in steps of 0.05 of the first critical speed, the first are {listed} times that speed, "
        f"{critical * 30 / np.pi:,.0f} rpm",
        len(first) == 2 and min(first.values()) > 1,
        "both are found, neither below the first critical speed",
    )


PAPER = Paper(
    name="Lin & Parker (1999), Cooley & Parker (2012)",
    reference="""\
J. Lin and R. G. Parker, "Analytical characterization of the unique properties of planetary gear free vibration",
*Journal of Vibration and Acoustics* 121 (1999), 316-321. C. G. Cooley and R. G. Parker, "Vibration properties of
high-speed planetary gears with gyroscopic effects", *Journal of Vibration and Acoustics* 134 (2012), 061014.""",
    remarks="""\
Statements in kind, about the mean system in coordinates that turn with the carrier, with the equations as printed
(`pin_preload: false`). The numbers printed of both gears at rest are checked by the tests.""",
    sections={
        "Natural frequencies over carrier speed": [frequencies_split, mode_types, instabilities_at_high_speed],
    },
)
