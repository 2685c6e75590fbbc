"""How far a system decouples does not hang on rounding: not on the basis of equal frequencies, not on last digits."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from planetary_gears import cyclic, parameters, planetary, with_epsilon
from systems import random_split, rotated, star

from gearstab.floquet.segments import blocks, reduction
from gearstab.floquet.segments.blocks import split
from gearstab.floquet.segments.decouple import DISCARDED, adapted, components, tolerance
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.system import GearSystem
from gearstab.systems import build

SEEDS = range(8)
EPS = np.finfo(float).eps


def parker(**changes: object) -> GearSystem:
    """Parker's gear, whose supports are 5000 times stiffer than its meshes."""
    return build(with_epsilon(parameters(**changes), 0.2))


SCENES = {
    "two clusters apart by little": (planetary(), [3, 6, 12]),
    "damped": (planetary(damping_ratio=0.005), [3, 6, 12]),
    "stiff supports": (parker(harmonics=8), [4, 5, 8, 18]),
    "copies": (cyclic(5), [3, 5, 5]),
    "soft and stiff waves of a ring": (cyclic(5, harmonics=12), [2, 7, 8, 9]),
    "copies of one mode": (star(), [1, 2]),
    "hidden": (random_split(np.random.default_rng(7), [3, 4, 2], 2), [2, 3, 4]),
}
"""Systems and the sizes of their blocks, the same for the symmetry that they declare and without it."""


def last_digits(system: GearSystem, rng: np.random.Generator) -> GearSystem:
    """The same system with entries and directions that are up to two units in the last place different."""

    def near(values: np.ndarray) -> np.ndarray:
        return np.asarray(values) * (1 + EPS * rng.integers(-2, 3, np.shape(values)))

    def symmetric(matrix: np.ndarray) -> np.ndarray:
        upper = np.triu(near(matrix))
        return upper + np.triu(upper, 1).T

    return replace(
        system,
        mass=symmetric(system.mass),
        stiffness=symmetric(system.stiffness),
        damping=None if system.damping is None else symmetric(system.damping),
        meshes=tuple(replace(mesh, direction=near(mesh.direction)) for mesh in system.meshes),
    )


def perturbed(monkeypatch: pytest.MonkeyPatch, system: GearSystem) -> Iterator[Pattern]:
    """The system as other processors might see it: other last digits, other bases of equal frequencies."""
    for seed in SEEDS:
        monkeypatch.setattr(reduction, "mean_modes", rotated(seed))
        yield from prepare(last_digits(system, np.random.default_rng(seed)))


def sizes(pattern: Pattern) -> list[int]:
    return sorted(block.pattern.size for block in split(pattern))


@pytest.mark.parametrize("declared", [True, False], ids=["declared", "found"])
@pytest.mark.parametrize("scene", SCENES)
def test_blocks_hang_on_no_rounding(monkeypatch: pytest.MonkeyPatch, scene: str, declared: bool) -> None:
    """And not nearly so: the same blocks for thresholds ten times smaller and ten times larger."""
    system, expected = SCENES[scene]
    for pattern in perturbed(monkeypatch, system if declared else replace(system, symmetries=())):
        assert sizes(pattern) == expected
        values, _, family, backward = blocks._family(pattern)
        none = tolerance(values, family, backward)
        assert DISCARDED <= none[0] <= 20 * DISCARDED
        _, coupling = adapted(values, family, none, pattern.elastic.turns)
        first, second = (components(coupling > factor * none) for factor in (0.1, 10.0))
        np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("break_", [1e-5, 1e-7, 1e-9])
def test_a_broken_symmetry_is_seen(monkeypatch: pytest.MonkeyPatch, break_: float) -> None:
    """One of four planets with a mesh that varies a little more, declared symmetric or not."""
    system = planetary()
    first, *others = system.meshes
    broken = replace(system, meshes=(replace(first, epsilon=first.epsilon * (1 + break_)), *others))
    for one in (broken, replace(broken, symmetries=())):
        for pattern in perturbed(monkeypatch, one):
            assert sizes(pattern) == [21]


@pytest.mark.parametrize("difference", [3e-14, 1e-13])
def test_differences_of_rounding_are_none(monkeypatch: pytest.MonkeyPatch, difference: float) -> None:
    hub = star()
    first, *others = hub.meshes
    off = replace(hub, meshes=(replace(first, epsilon=first.epsilon * (1 + difference)), *others))
    for pattern in perturbed(monkeypatch, off):
        assert sizes(pattern) == [1, 2]


def test_a_symmetry_that_is_none_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A turn of the wrong planets, declared: the blocks are those of the system without it."""
    system = planetary(damping_ratio=0.005)
    order = np.random.default_rng(3).permutation(system.size)
    (symmetry,) = system.symmetries
    wrong = replace(system, symmetries=(replace(symmetry, turn=symmetry.turn[order][:, order]),))
    for pattern in perturbed(monkeypatch, wrong):
        assert sizes(pattern) == [3, 6, 12]


def test_rows_of_one_batch_split_alike() -> None:
    """Two hundred amplitudes: whatever the last digits of each, the blocks are those of the symmetry."""
    system = replace(planetary(damping_ratio=0.005), symmetries=())
    amplitude = np.linspace(0.01, 0.4, 200)
    system = replace(system, meshes=tuple(replace(mesh, epsilon=amplitude) for mesh in system.meshes))
    for pattern in prepare(system):
        found = split(pattern)
        assert {block.pattern.size for block in found} == {3, 6, 12}
        assert sum(len(block.pattern.rows) for block in found) == 3 * len(pattern.rows)
