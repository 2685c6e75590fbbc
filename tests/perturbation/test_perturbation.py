"""First-order boundaries: published and recomputed numbers, closed forms, and what must not change them."""

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scenes import DATA
from systems import random_rotation, turned_star
from tongues import scaled, train

from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.perturbation import Tongues, first_order
from gearstab.perturbation.tongues import excitations, kind_of, label_of
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular

REFERENCE = json.loads((DATA / "lin_parker_2002.json").read_text())
# The reference numbers are doubles of another program: a few units in the last place of the largest of them.
LAST_DIGITS = 1e-14


def half_width(tongues: Tongues, label: str) -> np.ndarray:
    return tongues.half_width[tongues.label.index(label)]


# ---- numbers


@pytest.mark.parametrize("case", REFERENCE["first_order"], ids=lambda case: case["case"])
def test_recomputed_numbers(case: dict) -> None:
    ratio = Fraction(case["R"])
    harmonics = max(t.get("harmonic", 0) for t in case["tongues"]) or 3
    both = train(tuple(case["contact_ratio"]), case["phasing"], case["R"])
    # The reference's [2, 3] at R = 3/5 is the second mesh alone; that the first mesh's fifth harmonic has to be added
    # is shown against Floquet in test_perturbation_floquet.py.
    second = train(tuple(case["contact_ratio"]), case["phasing"], case["R"], epsilon=(0.0, 1.0))
    for t in case["tongues"]:
        parts = [tuple(part) for part in t.get("mesh_harmonics", [[1, t.get("harmonic")]])]
        mesh, s = parts[0]
        tongues = first_order(second if ratio == Fraction(3, 5) and parts == [(2, 3)] else both, harmonics)
        nu = s * (1 / ratio if mesh == 2 else 1)
        modes = [(t.mode_p, t.mode_q, t.frequency_ratio) for t in tongues.index]
        k = list(modes).index((t["p"], t["q"], float(nu)))
        assert tongues.center_frequency[k] == pytest.approx(t["center"], rel=LAST_DIGITS)
        assert tongues.half_width[k] == pytest.approx(t["half_width_per_eps"], abs=LAST_DIGITS)


def test_modes_of_table_1() -> None:
    modes = mean_modes(train())
    assert_allclose(modes.natural_frequency, REFERENCE["natural_frequencies"], rtol=LAST_DIGITS)
    assert_allclose(np.abs(modes.mesh_deflection.T), REFERENCE["mesh_deflection_abs"], rtol=LAST_DIGITS)


# ---- Lin & Parker's closed forms, for any train of their kind

positive = st.floats(0.1, 10)
contact = st.floats(1.0, 2.9)


@st.composite
def trains(draw: st.DrawFn, tooth_ratio: str | int) -> tuple[GearSystem, float, float, float]:
    """A system with epsilon = 1 (half-widths are then per epsilon), c1, c2 and h."""
    c1, c2, h = draw(contact), draw(contact), draw(st.floats(0, 1))
    stiffness = [draw(positive), draw(positive)]
    meshes = [
        {"name": "first", "mean_stiffness": stiffness[0], "epsilon": 1.0, "contact_ratio": c1},
        {"name": "second", "mean_stiffness": stiffness[1], "epsilon": 1.0, "contact_ratio": c2, "phasing": h},
    ]
    parameters = {"kind": "two_stage", "inertias": [draw(positive) for _ in range(3)], "meshes": meshes}
    parameters |= {"input_shaft_stiffness": draw(positive), "tooth_ratio": Fraction(tooth_ratio)}
    system = build(parameters)
    # The closed forms hold for distinct frequencies.
    assume(np.all(np.diff(mean_modes(system).natural_frequency) > 1e-6))
    return system, c1, c2, h


def strengths(system: GearSystem) -> tuple[np.ndarray, np.ndarray]:
    """w_p and x[i, p, q] = k_gi delta_ip delta_iq."""
    modes = mean_modes(system)
    x = [m.mean_stiffness * np.outer(d, d) for m, d in zip(system.meshes, modes.mesh_deflection.T, strict=True)]
    return modes.natural_frequency, np.array(x)


# The squares of half-widths are compared: sums that may cancel down to rounding of their largest possible term.
CANCELLED = 1e-13


@given(trains(1))
def test_closed_forms_21_22_23(drawn: tuple) -> None:
    """Lambda_pp^(1), Lambda_pp^(2) and Lambda_pq^(1) of one mesh frequency."""
    system, c1, c2, h = drawn
    w, x = strengths(system)
    tongues = first_order(system, 2)
    for p in range(3):
        for q in range(p, 3):
            for s in (1, 2):
                first, second = (x[i, p, q] * np.sin(s * np.pi * c) for i, c in ((0, c1), (1, c2)))
                mixed = 2 * first * second * np.cos(s * np.pi * (c1 - c2 + 2 * h))
                weight = (2 / (s * np.pi)) ** 2 / (w[p] * w[q])
                expected = weight * (first**2 + second**2 + mixed) / s**2
                ours = half_width(tongues, label_of(p + 1, q + 1, s))
                bound = CANCELLED * weight * np.sum(x[:, p, q] ** 2)
                assert ours**2 == pytest.approx(expected, rel=1e-10, abs=bound)


@given(trains("5/7"))
def test_closed_form_28(drawn: tuple) -> None:
    """Frequencies that nothing shares: each mesh alone, whatever the phasing."""
    system, c1, c2, _ = drawn
    w, x = strengths(system)
    tongues = first_order(system, 3)
    for p in range(3):
        for q in range(p, 3):
            for s in (1, 2, 3):
                label, scale = label_of(p + 1, q + 1, s), 2 / (s**2 * np.pi * np.sqrt(w[p] * w[q]))
                first = abs(scale * x[0, p, q] * np.sin(s * np.pi * c1))
                second = abs(scale * x[1, p, q] * np.sin(s * np.pi * c2)) * 5 / 7
                # An argument of sin near s pi c carries a rounding error of 1e-15.
                bound = 1e-13 * scale * np.abs(x).max()
                assert half_width(tongues, label) == pytest.approx(first, rel=1e-10, abs=bound)
                assert half_width(tongues, f"{label} (second)") == pytest.approx(second, rel=1e-10, abs=bound)


@given(trains("1/2"))
def test_corrected_closed_form_32(drawn: tuple) -> None:
    """(32) with the weights 1, 4, 4 and 1/(2 pi w_p); printed are 1, 1, 2 and 2/(pi w_p)."""
    system, c1, c2, h = drawn
    w, x = strengths(system)
    tongues = first_order(system, 2)
    for p in range(3):
        first, second = x[0, p, p] * np.sin(2 * np.pi * c1), 2 * x[1, p, p] * np.sin(np.pi * c2)
        total = first**2 + second**2 + 2 * first * second * np.cos(np.pi * (2 * c1 - c2 + 2 * h))
        ours = half_width(tongues, label_of(p + 1, p + 1, 2))
        bound = CANCELLED * np.sum(x[:, p, p] ** 2) / w[p] ** 2
        assert ours**2 == pytest.approx(total / (2 * np.pi * w[p]) ** 2, rel=1e-10, abs=bound)


def test_printed_form_32_is_about_twice_too_large() -> None:
    """The correction matters: at c1 = c2 = 1.5 the print gives exactly twice, elsewhere no constant factor."""
    w, x = strengths(train())
    print_of = 2 / (np.pi * w[2]) * x[1, 2, 2]
    assert print_of / half_width(first_order(train(tooth_ratio="1/2"), 2), "w3") == pytest.approx(2, rel=1e-12)


# ---- what the paper concludes from them


@pytest.mark.parametrize("c", [(1.0, 2.0), (2.0, 2.0), (1.0, 1.0)])
def test_integer_contact_ratios_leave_no_instability(c: tuple[float, float]) -> None:
    assert_array_equal(first_order(train(c, 0.3), 3).half_width, 0.0)


# sin(2 pi 1.5) is rounding: such a tongue is exactly closed all the same.
def test_half_integer_contact_ratios_leave_no_secondary_instability() -> None:
    tongues = first_order(train((1.5, 1.5), 0.3), 2)
    assert_array_equal([half_width(tongues, f"w{p}") for p in (1, 2, 3)], 0.0)


@pytest.mark.parametrize(("c1", "c2"), [(1.5, 1.5), (1.1, 1.9), (1.3, 1.6), (1.75, 1.25)])
def test_phasing_that_minimises_primary_instabilities(c1: float, c2: float) -> None:
    """(21): least for c1 - c2 + 2h = +-1 or 3, greatest for 0 or 2; the paper's example c1 = 1.1, c2 = 1.9, h = 0.9."""
    h = np.linspace(0, 1, 2001)
    tongues = first_order(train((c1, c2), h), 1)
    for p in (1, 2, 3):
        width = half_width(tongues, f"2w{p}")
        turn = c1 - c2 + 2 * h
        low, high = turn[np.argmin(width)], turn[np.argmax(width)]
        # The grid of h has a step of 5e-4.
        assert min(abs(low - k) for k in (-1, 1, 3)) <= 1e-3
        assert min(abs(high - k) for k in (-2, 0, 2)) <= 1e-3


def test_combination_instabilities_go_the_other_way() -> None:
    """(23), Fig. 5: what reduces the primary regions enlarges w1+w3 and w2+w3, whose delta products differ in sign."""
    worst, better = (first_order(train(phasing=h), 1) for h in (0.0, 0.5))
    for label in ("2w1", "2w2", "2w3", "w1+w2"):
        assert half_width(better, label) < 0.5 * half_width(worst, label)
    for label in ("w1+w3", "w2+w3"):
        assert half_width(better, label) > 10 * half_width(worst, label)


def test_greatest_secondary_instability() -> None:
    """(22): c1, c2 = 1.25 or 1.75, h = 0 give Lambda = (k1 d1^2 + k2 d2^2)^2/(pi w_p)^2 (printed without divisor)."""
    w, x = strengths(train())
    c = np.linspace(1, 2, 41)
    c1, c2, h = np.meshgrid(c, c, np.linspace(0, 1, 41)[:-1], indexing="ij")
    tongues = first_order(train((c1, c2), h), 2)
    for p in range(3):
        width = 2 * half_width(tongues, f"w{p + 1}")
        expected = (x[0, p, p] + x[1, p, p]) / (np.pi * w[p])
        assert width.max() == pytest.approx(expected, rel=1e-12)
        for c_1, c_2 in ((1.25, 1.25), (1.75, 1.75)):
            at = np.argmin(abs(c - c_1)), np.argmin(abs(c - c_2)), 0
            assert width[at] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("c1", "c2", "turns"), [(1.2, 1.3, (0.5, 1.5)), (1.7, 1.8, (0.5, 1.5)), (1.2, 1.7, (0, 1, 2))])
def test_phasing_that_minimises_secondary_instabilities(c1: float, c2: float, turns: tuple[float, ...]) -> None:
    """Below (22): |c1 - c2 + 2h| = 0.5, 1.5 with both below or above 1.5, else 0, 1, 2."""
    h = np.linspace(0, 1, 2001)
    width = half_width(first_order(train((c1, c2), h), 2), "w2")
    least = abs(c1 - c2 + 2 * h[np.argmin(width)])
    assert min(abs(least - t) for t in turns) <= 1e-3


def test_figure_7_combination_instability_vanishes_at_0_343() -> None:
    """eps2 = 0.3: the text says "near 0.23"; from B_23 = 0 follows eps1 = 0.3 d22 d23/(d12 d13) = 0.3432."""
    d = np.array(REFERENCE["mesh_deflection_abs"])
    vanishing = 0.3 * d[1, 1] * d[1, 2] / (d[0, 1] * d[0, 2])
    assert vanishing == pytest.approx(0.343, abs=5e-4)
    at = first_order(train(epsilon=(np.array([0.23, vanishing]), 0.3)), 1)
    near, zero = half_width(at, "w2+w3")
    assert near > 0.04
    assert zero == pytest.approx(0, abs=1e-15)


# ---- names


def test_labels_and_kinds() -> None:
    assert [label_of(3, 3, s) for s in (1, 2, 3, 4, 5, 6)] == ["2w3", "w3", "2w3/3", "w3/2", "2w3/5", "w3/3"]
    assert [label_of(2, 3, s) for s in (1, 2, 3)] == ["w2+w3", "(w2+w3)/2", "(w2+w3)/3"]
    assert [kind_of(2, 2, s) for s in (1, 2, 3)] == ["primary", "secondary", "higher"]
    assert [kind_of(1, 2, s) for s in (1, 2, 3)] == ["combination", "higher combination", "higher combination"]


def test_one_frequency_has_no_mesh_in_its_labels() -> None:
    tongues = first_order(train(), 3)
    assert {t.mesh for t in tongues.index} == {"first+second"}
    assert tongues.label[:7] == ("2w1", "w1+w2", "w1+w3", "2w2", "w2+w3", "2w3", "w1")
    assert len(set(tongues.label)) == len(tongues.label) == 18


def test_labels_say_which_mesh_runs_at_another_frequency() -> None:
    tongues = first_order(train(tooth_ratio="3/5"), 3)
    found = dict(zip(tongues.label, tongues.index, strict=True))
    assert len(found) == len(tongues.index)
    assert (found["2w3"].mesh, found["2w3"].frequency_ratio) == ("first", 1.0)
    own = found["2w3 (second)"]
    assert (own.mesh, own.harmonic, own.kind, own.frequency_ratio) == ("second", 1, "primary", 5 / 3)
    # The second mesh's third harmonic is the first mesh's fifth: both count, and the label is the first mesh's.
    shared = found["2w3/5"]
    assert (shared.mesh, shared.harmonic, shared.frequency_ratio) == ("first+second", 5, 5.0)


def test_harmonics_beyond_the_limit_count_where_another_mesh_brings_the_frequency_in() -> None:
    system = train(tooth_ratio="1/2")
    parts = {float(e.ratio): e.parts for e in excitations(system, 2)}
    assert parts == {1.0: ((0, 1),), 2.0: ((0, 2), (1, 1)), 4.0: ((0, 4), (1, 2))}


# ---- invariance


@given(st.floats(-3, 3), st.sampled_from([1, "3/5", "1/2"]))
def test_time_origin_does_not_matter(shift: float, tooth_ratio: str | int) -> None:
    """Delaying all meshes by the same time (r_i shift of their own periods) changes no width."""
    system = train((1.3, 1.6), 0.2, tooth_ratio)
    moved = [replace(m, lag=m.lag + shift * float(m.frequency_ratio)) for m in system.meshes]
    later = first_order(replace(system, meshes=tuple(moved)), 3)
    assert_allclose(later.half_width, first_order(system, 3).half_width, rtol=1e-10, atol=1e-13)


def test_batches_are_rows_put_together() -> None:
    """Rows of different structure: with and without a rigid-body mode, in two batch dimensions, damped."""
    k0, epsilon = np.array([0.0, 0.5, 2.0])[:, None], np.array([0.0, 0.1])
    every = {"epsilon": (epsilon, epsilon), "input_shaft_stiffness": k0}
    batch = first_order(train((1.4, 1.5), 0.2, damping_ratio=0.01, **every), 2)
    assert batch.half_width.shape == (12, 3, 2)
    assert batch.boundary_frequency.shape == (12, 2, 3, 2)
    for i in range(3):
        for j in range(2):
            values = {"epsilon": (epsilon[j], epsilon[j]), "input_shaft_stiffness": k0[i, 0]}
            single = first_order(train((1.4, 1.5), 0.2, damping_ratio=0.01, **values), 2, modes=[1, 2, 3])
            assert single.index == batch.index
            for name in ("center_frequency", "half_width", "boundary_frequency", "threshold"):
                expected = getattr(single, name)
                assert_allclose(getattr(batch, name)[..., i, j], expected, rtol=1e-12, atol=1e-15)


def test_rigid_modes_take_no_part() -> None:
    free = first_order(train(input_shaft_stiffness=0.0), 1)
    assert free.label == ("2w2", "w2+w3", "2w3")
    assert np.isfinite(free.half_width).all()
    kept = first_order(train(input_shaft_stiffness=0.0), 1, modes=[1, 2, 3])
    assert_array_equal(np.isnan(kept.half_width), [True, True, True, False, False, False])


def test_modes_of_negative_mean_stiffness_have_no_tongue() -> None:
    mesh = Mesh("mesh", np.array([1.0, -1.0]), np.asarray(1.0), np.asarray(0.1), Rectangular(1.5))
    tongues = first_order(GearSystem(np.eye(2), np.diag([-0.8, 1.0]), (mesh,)), 1)
    assert tongues.label == ("2w1", "w1+w2", "2w2")
    assert_array_equal(np.isnan(tongues.center_frequency), [True, True, False])
    assert_array_equal(np.isnan(tongues.half_width), [True, True, False])


def test_without_variation_an_undamped_tongue_is_its_root() -> None:
    tongues = first_order(train(epsilon=(0.0, 0.0)), 1)
    assert_array_equal(tongues.half_width, 0.0)
    assert_array_equal(tongues.boundary_frequency, np.stack([tongues.center_frequency] * 2, axis=1))


def test_widths_are_proportional_to_epsilon() -> None:
    system = train((1.3, 1.8), 0.3, "1/2")
    per_epsilon = first_order(system, 3).half_width
    assert_allclose(first_order(scaled(system, 0.3), 3).half_width, 0.3 * per_epsilon, rtol=1e-13)


# ---- repeated frequencies


@pytest.mark.parametrize("damping", [None, np.diag([0.01, 0.03, 0.02, 0.05])], ids=["undamped", "damped"])
def test_basis_of_a_degenerate_pair_does_not_matter(damping: np.ndarray | None) -> None:
    assert mean_modes(turned_star(np.eye(4))).natural_frequency[1:3] == pytest.approx(np.sqrt([1.7, 1.7]), rel=1e-14)
    plain = first_order(turned_star(np.eye(4), damping), 3)
    carried = dict(zip(plain.label, ~np.isnan(plain.half_width), strict=True))
    first_harmonic = {label: there for label, there in carried.items() if "/" not in label and "w" in label[1:]}
    present = {label for label, there in first_harmonic.items() if there}
    assert present == {"2w1", "w1+w2", "w1+w4", "2w2", "w2+w4", "2w4"}
    assert plain.half_width[plain.label.index("2w2")] > 0.01
    for seed in range(5):
        turned = first_order(turned_star(random_rotation(seed), damping), 3)
        # A rotation of the coordinates perturbs the modes by rounding, some 1e-15, and the widths by little more.
        assert_allclose(turned.half_width, plain.half_width, rtol=1e-12, atol=1e-12)
        assert_allclose(turned.boundary_frequency, plain.boundary_frequency, rtol=1e-12)
        assert_allclose(turned.threshold, plain.threshold, rtol=1e-11)


def test_groups_may_differ_from_row_to_row() -> None:
    """A batch in which one row is symmetric and the others are not equals its rows."""

    def detuned(extra: np.ndarray) -> GearSystem:
        system = turned_star(np.eye(4), np.diag([0.01, 0.03, 0.02, 0.05]))
        added = np.zeros((4, 4))
        added[1, 1] = 1.0
        return GearSystem(system.mass, system.stiffness + extra[..., None, None] * added, system.meshes, system.damping)

    extra = np.array([0.2, 0.0, 0.1, 0.0])
    batch = first_order(detuned(extra), 2)
    for k, value in enumerate(extra):
        single = first_order(detuned(np.asarray(value)), 2)
        assert_allclose(batch.half_width[:, k], single.half_width, rtol=1e-12, atol=1e-15)
    assert np.isnan(batch.half_width[batch.label.index("w2+w3"), [1, 3]]).all()
    assert np.isfinite(batch.half_width[batch.label.index("w2+w3"), [0, 2]]).all()
