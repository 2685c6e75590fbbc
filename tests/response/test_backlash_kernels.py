"""The compiled kernel follows motions with backlash as DOP853 does, and refuses what it cannot."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import systems
from driven import SMOOTH, integrated_with_backlash, train, with_waves

from gearstab import ckernel
from gearstab.errors import NotPossible
from gearstab.response import driven_response
from gearstab.response.backlash import BACKLASH_FLAGS, LimitCycle, backlash_response, follow
from gearstab.response.backlash.dynamics import Dynamics, dynamics, extremes_of, play, product, resting, sampled
from gearstab.response.steady import driven
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Fourier

LIBRARY: Any = ckernel.library

Array = np.ndarray


def loose(system: GearSystem, width: float) -> GearSystem:
    return replace(system, meshes=tuple(replace(mesh, backlash=width) for mesh in system.meshes))


def planetary(motion: str) -> GearSystem:
    """Three planets, all six meshes with backlash and damping."""
    mesh = {"mean_stiffness": 1.0, "epsilon": 0.2, "contact_ratio": 1.5, "backlash": 0.2, "damping": 0.05}
    supports = {"carrier": 0.0, "sun": 0.0, "ring_tangential": 10.0, "ring_radial": 10.0, "carrier_rotation": 0.0,
                "sun_rotation": 0.0}  # fmt: skip
    if motion == "planar":
        supports |= {"carrier": 0.3, "sun": 0.2, "planet": 0.7}
    return build({
        "kind": "planetary", "planets": 3, "ring": {"kind": "rigid"}, "motion": motion,
        "masses": {"ring": 1.0, "planet": 0.7, "sun": 0.5, "carrier": 1.2}
        if motion == "planar" else {"ring": 1.0, "planet": 0.7},
        "inertias": {"ring": 2.0, "carrier": 3.0, "sun": 1.0, "planet": 0.6}, "supports": supports,
        "pressure_angles": {"sun": 0.4, "ring": 0.4}, "meshes": {"sun": mesh, "ring": mesh},
        "phases": {"sun": [0, 0.3, 0.6], "sun_ring": 0.2}, "scaling": "SI", "load": {"sun": 0.3, "carrier": -0.55},
    })  # fmt: skip


CASES: dict[str, tuple[GearSystem, float]] = {
    "a long common period": (loose(train(Fraction(16, 17)), 0.3), 1.3),
    "planets": (planetary("rotational"), 1.3),
    "planar planets": (planetary("planar"), 1.1),
    "rattle without load": (build(systems.pair({"backlash": 0.5, "transmission_error": {"sin": [0.2]}})), 0.7),
    "many harmonics": (loose(with_waves(train(), SMOOTH[0], Fourier(np.zeros(12), 0.5 ** np.arange(12))), 0.3), 0.9),
}


def pushed(system: GearSystem) -> tuple[Array, Array]:
    return resting(system, play(system)), 2.0 * np.cos(np.arange(system.size))


def ends(system: GearSystem) -> Array:
    teeth = play(system)
    return np.stack([teeth.low, teeth.high], axis=1)


@pytest.mark.parametrize("name", CASES)
def test_motions_are_those_of_an_integrator(name: str) -> None:
    """Over a number of impacts, each of which makes the errors of DOP853 larger; planets have many more."""
    system, omega = CASES[name]
    start = pushed(system)
    found = backlash_response(system, omega, 40.0 if len(system.meshes) < 6 else 4.0, start, 30)
    reference, changes = integrated_with_backlash(system, ends(system), omega, np.concatenate(start), found.time)
    assert len(changes) == len(found.events) >= 8
    np.testing.assert_allclose([e.time for e in found.events], [time for time, *_ in changes], rtol=0, atol=1e-7)
    assert [e.mesh for e in found.events] == [mesh for _, mesh, _ in changes]
    np.testing.assert_allclose(found.displacement, reference[:, : system.size], rtol=0, atol=1e-7)
    assert isinstance(found.cycle, LimitCycle)


@pytest.mark.parametrize("width", [1e-3, 0.05])
def test_narrow_play_is_met_on_both_sides(width: float) -> None:
    """Teeth that bounce between their flanks: the shorter the flight, the closer the events."""
    system = build(systems.pair({"backlash": width, "epsilon": 0.0}))
    start = np.array([0.3]), np.array([0.2])
    found = backlash_response(system, 1.0, 30.0, start, 10)
    assert {event.kind for event in found.events} == {0, 1, 2}
    _, changes = integrated_with_backlash(system, ends(system), 1.0, np.concatenate(start), found.time)
    np.testing.assert_allclose([e.time for e in found.events], [time for time, *_ in changes], atol=1e-8)


def test_hardly_any_play_hardly_matters() -> None:
    item = systems.pair({"backlash": 1e-9, "epsilon": 0.0})
    start = np.array([0.3]), np.array([0.2])
    found = backlash_response(build(item), 1.0, 30.0, start, 10)
    assert {event.kind for event in found.events} == {0, 1, 2}
    expected = driven_response(build(systems.pair({"epsilon": 0.0})), 1.0, *start, 30.0, 10)
    # Ten flights of 1e-9 at a speed of about 0.3.
    np.testing.assert_allclose(found.displacement, expected.displacement, atol=1e-7)


@pytest.mark.parametrize(
    ("above", "parts", "grazes"),
    [(0.9, 0, False), (1.0 - 1e-13, 0, True), (1.0, 0, True), (1.0 + 1e-13, 0, True), (1.0 + 1e-9, 1, True),
     (1.0 + 1e-5, 1, True)],
)  # fmt: skip
def test_how_touches_are_judged(above: float, parts: bool, grazes: bool) -> None:
    """An undamped pair that swings down to its flank, or hardly beyond, with 2 of load on a stiffness of 4."""
    system = build(systems.pair({"backlash": 0.4, "epsilon": 0.0, "mean_stiffness": 4.0}, load=[2.0]))
    start = np.array([0.2 + 0.5 + 0.5 * above]), np.zeros(1)
    found = backlash_response(system, 3.0, 20.0, start, 20)
    # What is passed by 1e-12 of the play is no contact; what is missed by 1e-6 of it is a graze.
    assert (len(found.events) > 0) == parts
    assert bool(found.flags & BACKLASH_FLAGS["grazing"]) == grazes


def test_the_largest_system_of_the_tests() -> None:
    """A planar planetary gear: eighteen coordinates."""
    system = planetary("planar")
    start = pushed(system)
    found = backlash_response(system, 1.1, 6.0, start, 20)
    reference, changes = integrated_with_backlash(system, ends(system), 1.1, np.concatenate(start), found.time)
    assert len(changes) == len(found.events) >= 6
    np.testing.assert_allclose(found.displacement, reference[:, : system.size], atol=1e-8)


@pytest.mark.parametrize("stiffer", [1.0, 2.0**26, 2.0**40])
def test_units_do_not_matter(stiffer: float) -> None:
    """Stiffnesses as in SI units, under a load that keeps the teeth in contact: the motion of the linear system."""
    system, faster = train(), np.sqrt(stiffer)
    meshes = tuple(
        replace(m, mean_stiffness=m.mean_stiffness * stiffer, damping=m.damping * faster, backlash=0.3,
                backlash_zero="drive_side") for m in system.meshes
    )  # fmt: skip
    assert system.damping is not None
    system = replace(
        system, meshes=meshes, stiffness=system.stiffness * stiffer, damping=system.damping * faster,
        load=np.array([3.0, 0.0, 8.0]) * stiffer,
    )  # fmt: skip
    q, v, end = resting(system, play(system)), np.array([0.05, -0.03, 0.1]) * faster, 20.0 / faster
    found = backlash_response(system, 1.9 * faster, end, (q, v), 30)
    assert not found.events
    expected = driven_response(system, 1.9 * faster, q, v, end, 30)
    np.testing.assert_allclose(found.displacement, expected.displacement, rtol=1e-12)
    np.testing.assert_allclose(found.mesh_force, expected.mesh_force, rtol=1e-12)


def model(system: GearSystem, omega: float) -> Dynamics:
    return dynamics(system, driven(system, omega), play(system))


def test_contacts_are_forgotten_when_they_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    system = planetary("rotational")
    expected = backlash_response(system, 1.3, 30.0, pushed(system), 20)
    monkeypatch.setattr(follow, "MOST_KEPT", 0)
    found = backlash_response(system, 1.3, 30.0, pushed(system), 20)
    np.testing.assert_array_equal(found.displacement, expected.displacement)


def test_functions_too_rough_for_series_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    system, omega = CASES["many harmonics"]
    monkeypatch.setattr(follow, "MOST_CELLS", 4)
    with pytest.raises(NotPossible, match="too rough"):
        backlash_response(system, omega, 20.0, pushed(system), 10)


def test_cells_hold_the_functions() -> None:
    """At places of their own, to rounding."""
    prepared = model(*CASES["many harmonics"])
    table = follow.timetable(prepared)
    u = np.linspace(0.01, 0.99, 7)
    tau = table.span[:, :1] + u * np.diff(table.span)
    values = np.einsum("xk,ckj->cxj", np.vander(u, table.order, increasing=True), table.shapes)
    np.testing.assert_allclose(values.reshape(-1, 2), prepared.values(tau.ravel()), atol=1e-13)
    np.testing.assert_allclose(table.span[1:, 0], table.span[:-1, 1], rtol=1e-15)


def test_values_and_extremes_of_polynomials() -> None:
    random = np.random.default_rng(0)
    powers = random.normal(size=(9, 25, 3)) / (1 + np.arange(25.0)[:, None]) ** 2
    counts = np.array([0, 3, 1, 0, 70, 8, 16, 0, 33])
    first, u = np.concatenate([[0], np.cumsum(counts)]), random.random(counts.sum())
    of = np.repeat(np.arange(len(counts)), counts)
    expected = np.einsum("xk,xki->xi", np.vander(u, 25, increasing=True), powers[of, :, :2])
    np.testing.assert_allclose(sampled(powers, first, u, 2), expected, atol=1e-14)
    dense = np.einsum("xk,skc->xsc", np.vander(np.linspace(0, 1, 20001), 25, increasing=True), powers)
    # The height of an extreme between points 1/128 apart, by parabolas.
    np.testing.assert_allclose(extremes_of(powers), [dense.min(axis=0), dense.max(axis=0)], atol=1e-5)


def test_products_of_polynomials() -> None:
    one, other = np.array([[[1.0], [2.0]]]), np.array([[[3.0], [0.0], [-1.0]]])
    np.testing.assert_array_equal(product(one, other)[0, :, 0], [3.0, 6.0, -1.0, -2.0])


class TestArguments:
    """Arrays of wrong sizes are refused, never read or written beyond their ends."""

    @pytest.fixture
    def given(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """Arguments of a first call."""
        calls: list[list[Any]] = []

        class Library:
            def __getattr__(self, name: str) -> Any:
                return getattr(LIBRARY, name)

            def follow(self, *given: Any) -> tuple[int, int]:
                calls.append(list(given))
                return follow.CHATTERS, 0

        system, omega = CASES["planets"]
        prepared = model(system, omega)
        course = follow.ContactCourse.of(prepared)
        motion = follow.follow(course, prepared.motion.state(*pushed(system)))
        monkeypatch.setattr(ckernel, "library", Library())
        with pytest.raises(follow.Chatter):
            next(motion)
        return calls[0]

    def test_right_sizes_are_accepted(self, given: list[Any]) -> None:
        # The first contact is not known yet.
        assert LIBRARY.follow(*given) == (follow.UNKNOWN, 0)

    @pytest.mark.parametrize("position", [2, 3, 4, 5, 6, 10, 11, 12, 13, 14, 15, 16])
    def test_short_arrays(self, position: int, given: list[Any]) -> None:
        given[position] = given[position].ravel()[:-1].copy()
        with pytest.raises(ValueError, match="shapes"):
            LIBRARY.follow(*given)

    @pytest.mark.parametrize(("position", "value"), [(0, 10**6), (0, 1), (1, 0), (2, -1), (3, 2**62), (4, 0), (5, 0),
                                                     (6, 40), (6, 1), (7, 1), (10, 0)])  # fmt: skip
    def test_wrong_numbers(self, position: int, value: int, given: list[Any]) -> None:
        numbers = list(given[0])
        numbers[position] = value
        given[0] = tuple(numbers)
        with pytest.raises(ValueError, match="shapes"):
            LIBRARY.follow(*given)

    def test_a_cell_that_does_not_exist(self, given: list[Any]) -> None:
        given[10][1] = 10**9
        with pytest.raises(ValueError, match="shapes"):
            LIBRARY.follow(*given)

    def test_places_beyond_the_samples(self) -> None:
        powers, u, out = np.zeros((2, 3, 1)), np.zeros(4), np.zeros((4, 1))
        for first in ([0, 2, 5], [-1, 2, 4]):
            with pytest.raises(ValueError, match="shapes"):
                LIBRARY.sampled(2, 2, 1, 1, powers, np.array(first), 4, u, out)
        with pytest.raises(ValueError, match="shapes"):
            LIBRARY.extremes(2, 2, 1, powers, 513, np.zeros((2, 1)), np.zeros((2, 1)))
