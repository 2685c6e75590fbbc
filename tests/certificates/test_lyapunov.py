"""Decay by a form that is carried along the period: true claims are proved, false ones never are."""

from __future__ import annotations

from dataclasses import replace
from inspect import getsource
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("flint")

from test_verifier import SYSTEMS, at, edge, meissner, multipliers, turning

from gearstab.certificates import lyapunov
from gearstab.certificates.balls import definite
from gearstab.certificates.choices import Carried
from gearstab.certificates.equations import flow
from gearstab.certificates.lyapunov import decays
from gearstab.certificates.proof import Proof
from gearstab.certificates.segments import segments
from gearstab.certificates.verifier import CARRIED, Certificate
from gearstab.config import load
from gearstab.systems import build

DAMPED = [name for name, system in SYSTEMS.items() if flow(system).form is None]
GEARBOX = Path(__file__).parents[2] / "configs" / "kuria_kihiu_2008" / "gearbox.yaml"


@pytest.mark.parametrize("name", DAMPED)
def test_what_is_proved_decays_and_most_of_what_decays_is_proved(name: str) -> None:
    known, proved, calm = flow(SYSTEMS[name]), 0, 0
    for low in np.linspace(1.2, 2.55, 20).tolist():
        largest = max(multipliers(flow(at(SYSTEMS[name], omega)), omega)[0] for omega in (low, 1.002 * low))
        found = decays(known, low, 1.002 * low)
        assert not (found and largest >= 1)
        proved, calm = proved + found, calm + (largest < 0.99)
    # Multipliers of 0.99 are too near 1 for some pieces of this width only where they pass a tongue.
    assert proved >= calm - 1
    assert proved >= 10


@pytest.mark.parametrize("name", DAMPED)
def test_a_system_without_damping_does_not_decay(name: str) -> None:
    system = replace(SYSTEMS[name], damping=0 * SYSTEMS[name].damping)
    if system.following is not None:
        gyroscopic, circulatory, centripetal = system.following
        system = replace(system, following=(gyroscopic, 0 * circulatory, centripetal))
    assert not any(decays(flow(system), omega, omega) for omega in (1.3, 2.0, 2.5))


def test_a_piece_reaches_to_the_edge_but_not_over_it() -> None:
    """Against brute force: where the largest multiplier of Meissner's damped equation passes 1."""
    known, low, high = flow(meissner(damping=0.02)), 1.3, 1.9
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if multipliers(known, middle)[0] < 1 else (low, middle)
    # Damping narrows the region from 1.8058 on.
    assert edge(0.3, 1.6, 1.95) < low < 1.82
    assert decays(known, low * (1 - 2.4e-4), low * (1 - 2e-4))
    for ends in ((1 - 1e-4, 1 + 1e-6), (1 - 1e-4, 1 + 1e-3), (1 - 0.1, 1 + 1e-3), (1 + 1e-6, 1 + 1e-4)):
        assert not decays(known, low * ends[0], low * ends[1])


@pytest.mark.parametrize(
    ("low", "high"), [(np.nan, 2.0), (2.0, np.nan), (0.0, 2.0), (2.0, np.inf), (2.1, 2.0), (-2, 2)]
)
def test_what_is_no_interval_is_refused(low: float, high: float) -> None:
    assert not decays(flow(meissner(damping=0.02)), low, high)


def test_growth_is_not_claimed() -> None:
    proof = Proof(flow(meissner(damping=0.02)))
    piece = Certificate(2.6, 2.61, 0, CARRIED, np.zeros((0, 0)))
    assert proof(piece)
    assert not proof(replace(piece, outside=1))


FORGERIES = (
    "another speed",
    "not a number",
    "ends that do not meet",
    "a jump",
    "not symmetric",
    "too short",
    "too few",
)


@pytest.mark.parametrize("number", range(49))
def test_a_forged_form_proves_nothing(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """P is free to choose, but a wrong one must not prove anything."""
    random, kind = np.random.default_rng(number), FORGERIES[number % 7]
    known = flow(meissner(0.3, 0.02))
    low = float(random.choice([1.25, 2.3, 2.5, 2.6]))
    assert decays(known, low, 1.001 * low)

    class Forged(Carried):
        def __init__(self, generators: np.ndarray, states: list[int], fractions: list[float]) -> None:
            # Lengthens the period: the form of a lower speed, where the phase is another one.
            super().__init__(
                generators * (random.uniform(1.3, 2.0) if kind == "another speed" else 1), states, fractions
            )
            if kind == "not a number":
                self.ends[random.integers(2), 0, 0] = np.nan
            elif kind == "ends that do not meet":
                self.ends[-1] = self.ends[-1] * (1 + 1e-12)
            elif kind == "a jump":
                self.ends[1] = self.ends[1] * random.uniform(0.2, 0.7)
            elif kind == "too few":
                self.ends = self.ends[:-1]

        def inside(self, key, where):  # type: ignore[no-untyped-def]
            for some, lengths, forms in super().inside(key, where):
                if kind == "not symmetric":
                    forms[0, 1, 0, 0, 1] += 1e-9
                yield some, lengths * (0.5 if kind == "too short" else 1.0), forms

    monkeypatch.setattr(lyapunov, "Carried", Forged)
    assert not decays(known, low, 1.001 * low)


def test_what_grows_by_a_speed_that_follows_is_refused() -> None:
    """By what turns with it the shaft grows by itself at twice the speed."""
    slow, fast = flow(turning(0.01, 0.3)), flow(turning(0.01, 0.3, 1.0))
    assert decays(slow, 2.0, 2.002)
    assert not decays(fast, 2.0, 2.002)


def test_a_matrix_is_definite_only_if_it_is_by_more_than_its_error() -> None:
    random = np.random.default_rng(3)
    basis = np.linalg.qr(random.standard_normal((9, 9)))[0]
    for least, error, answer in ((1e-6, 1e-7, True), (1e-6, 1e-6, False), (-1e-14, 0.0, False), (1e-12, 0.0, True)):
        matrix = (basis * np.array([least, *np.linspace(1, 9, 8)])) @ basis.T
        assert definite(0.5 * (matrix + matrix.T)[None], np.array([error])) == answer


def test_a_referee_reads_two_hundred_lines() -> None:
    assert len(getsource(lyapunov).splitlines()) <= 200


@pytest.mark.parametrize(
    ("changes", "count_of_segments", "every"),
    [(["system.rotors.gear4.teeth=42"], 419, 4), pytest.param([], 8493, 40, marks=pytest.mark.slow)],
)
def test_a_part_of_a_gearbox_of_33_coordinates_is_proved(
    monkeypatch: pytest.MonkeyPatch, changes: list[str], count_of_segments: int, every: int
) -> None:
    """One sort in so many of the segments of its common period, over 5 % of the speed."""
    known = flow(segments(build(load(GEARBOX, changes).system))[0])
    assert len(known.states) == count_of_segments
    falls, count = lyapunov._falls_inside, [0, 0]

    def some(*given: np.ndarray) -> bool:
        count[0] += 1
        if count[0] % every:
            return True
        count[1] += 1
        return falls(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(lyapunov, "_falls_inside", some)
    assert decays(known, 4900.0, 5150.0)
    assert count[1] > 10


@pytest.mark.slow
def test_a_gearbox_of_33_coordinates_is_proved_over_a_tenth_of_its_range() -> None:
    """A tenth of 880 to 8796 rad/s, in one piece; two minutes of processor time."""
    assert decays(flow(segments(build(load(GEARBOX).system))[0]), 5000.0, 5792.0)
