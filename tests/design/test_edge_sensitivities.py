"""d(edge)/d(parameter) of every region that a design reports, exact and by first-order theory."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scenes import TRAIN, read, scene_text
from scipy.linalg import expm

from gearstab.design.problem import DesignProblem
from gearstab.design.regions import DesignTongues, tongues

VARIABLES = scene_text("edge_sensitivities_variables")
DAMPING = "    damping_ratio: [0.0, 0.01]\n"
AT = np.array([1.4, 1.55, 0.3, 0.3, 0.5, 0.3, 4.0])
"""c1, c2, h, epsilon, k_s, J_2, J_3; J_1 = 1 and both meshes of stiffness 1."""
EPSILON = 3


def regions(folder: Path, low: float, high: float, at: np.ndarray, *sets: str) -> DesignTongues:
    """The regions of a design of Lin & Parker's train, as ``gearstab design`` reports them."""
    variables = VARIABLES.replace("  minimise", f"{DAMPING}  minimise") if len(at) > len(AT) else VARIABLES
    config = read(folder, f"{TRAIN}design:\n  range: {{mesh_frequency: [{low}, {high}]}}\n{variables}", *sets)
    assert config.design is not None
    return tongues(DesignProblem(config, config.design), [at])


def monodromy(at: np.ndarray, omega: complex, second: int) -> np.ndarray:
    """exp(A_n t_n) ... exp(A_1 t_1) over a cycle of the slower mesh, analytic in all arguments.

    second: cycles of the second mesh in one of the first. A rectangular wave is k_g (1 + 2 eps (1 - d)) for the part
    d = c - 1 of its period, from its lag on, and k_g (1 - 2 eps d) for the rest.
    """
    c1, c2, h, eps, spring, j2, j3 = at
    jumps = [0.0, c1 - 1]
    jumps += [((lag + k) / second) for lag in (-h, c2 - 1 - h) for k in range(-2, second + 2)]
    times = sorted((t for t in [*jumps, 1.0] if 0 <= np.real(t) <= 1), key=np.real)
    a = np.zeros((6, 6), dtype=complex)
    a[:3, 3:] = np.eye(3)
    product = np.eye(6, dtype=complex)
    for begin, end in pairwise(times):
        middle = np.real(begin + end) / 2
        if np.real(end - begin) <= 0:
            continue
        first = 1 + 2 * eps * ((middle < np.real(c1 - 1)) - (c1 - 1))
        other = 1 + 2 * eps * (((second * middle + np.real(h)) % 1 < np.real(c2 - 1)) - (c2 - 1))
        stiffness = np.array([[spring + first, first, 0], [first, first + other, other], [0, other, other]])
        a[3:, :3] = -stiffness / np.array([1.0, j2, j3])[:, None]
        product = expm(a * (end - begin) * 2 * np.pi / omega) @ product
    return product


def slopes(at: np.ndarray, omega: float, second: int = 1) -> np.ndarray:
    """d(edge)/d(parameter): where two multipliers have met, rho, they stay together if w^H dM v = 0.

    v and w are the right and the left eigenvector of rho, one each (a Jordan block); dM in the edge and a parameter are
    complex steps.
    """
    m = monodromy(at, omega, second).real
    values = np.linalg.eigvals(m)
    apart = np.abs(values[:, None] - values) + 9 * np.eye(6)
    i, j = np.unravel_index(np.argmin(apart), apart.shape)
    assert apart[i, j] < 1e-3
    rho = values[i] + values[j]
    left, singular, right = np.linalg.svd(m - rho / abs(rho) * np.eye(6))
    assert singular[-1] < 1e-8 * singular[-2]
    w, v = left[:, -1].conj(), right[-1].conj()

    def moved(step: np.ndarray, faster: complex = 0) -> complex:
        return complex(w @ (monodromy(at + step, omega + faster, second).imag / 1e-30) @ v)

    by_omega = moved(np.zeros(7), 1e-30j)
    ratios = -np.array([moved(1e-30j * unit) for unit in np.eye(7)]) / by_omega
    assert np.abs(ratios.imag).max() < 1e-5 * np.abs(ratios).max()
    return ratios.real


@pytest.mark.parametrize(("sets", "second"), [([], 1), (["tooth_ratio=1/2"], 2)], ids=["R = 1", "R = 1/2"])
def test_every_edge_moves_as_meeting_multipliers_do(tmp_path: Path, sets: list[str], second: int) -> None:
    """Primary, secondary and combination regions, of wide variations of stiffness and up to high harmonics."""
    found = regions(tmp_path, 1.5, 6.0, AT, *sets)
    kinds = {tongue.kind for tongue, _ in found.index}
    assert {"primary", "combination"} <= kinds
    assert len(found.index) >= 8
    for k in range(len(found.index)):
        for side in range(2):
            expected = slopes(AT, float(found.edges[k, side, 0]), second)
            assert found.sensitivity[k, side, 0] == pytest.approx(expected, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize(
    ("sets", "low"),
    [([], 1.5), (["tooth_ratio=1/2"], 1.5), (["damping_ratio=0"], 3.0)],
    ids=["R = 1", "R = 1/2", "damped"],
)
def test_first_order_sensitivities_are_limits_for_every_tongue(tmp_path: Path, sets: list[str], low: float) -> None:
    """Differences of exact and first-order ones are a series in eps without a constant, damping going as eps."""
    left: list[dict[object, np.ndarray]] = []
    for eps in (0.002, 0.001, 0.0005, 0.00025):
        at = np.append(AT, 0.02 * eps) if "damping_ratio=0" in sets else AT.copy()
        at[EPSILON] = eps
        found = regions(tmp_path, low, 6.0, at, *sets)
        left.append({key: found.sensitivity[k, :, 0] - found.first_order[k, :, 0] for k, key in enumerate(found.index)})
    keys = [key for key in left[-1] if all(key in one for one in left)]
    assert {"2w2", "2w3", "w1+w3", "w2+w3"} <= {tongue.label for tongue, _ in keys}
    for key in keys:
        limits = [one[key] for one in left]
        for power in (1, 2, 3):
            limits = [(2**power * fine - coarse) / (2**power - 1) for coarse, fine in pairwise(limits)]
        assert np.abs(limits[0]).max() < 1e-5, key[0].label
