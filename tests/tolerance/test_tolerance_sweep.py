"""Sweeps of systems whose parameters are uncertain."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scenes import TRAIN, plain, problems, read, result_of, scene_text
from systems import pair

from gearstab.floquet import solve
from gearstab.sweep import plan
from gearstab.sweep.compute import compute
from gearstab.systems import build
from gearstab.tolerance import SamplingDesign, correlated

PAIR = """
system: {kind: gear_pair, equivalent_mass: 1.0, meshes: [{mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}]}
"""


def shares(found, **where):
    return [float(found[name].sel(**where)) for name in ("probability_lower", "probability", "probability_upper")]


def edge(low: float, high: float, unstable) -> float:
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return 0.5 * (low + high)


def stable(epsilon: float, frequency: float) -> bool:
    """Whether the system of PAIR is."""
    return bool(solve(build(pair({"epsilon": epsilon})), np.array([frequency])).stable[0, 0])


def test_a_known_probability(tmp_path):
    # A primary tongue is entered as epsilon grows: the probability is the part of the range beyond the edge.
    text = (
        PAIR
        + """
sweep: {mesh_frequency: [1.9, 2.1]}
methods: {tolerance: {samples: 1024, seed: 3, parameters: {epsilon: {uniform: [0.05, 0.45]}}}}
"""
    )
    found = result_of(tmp_path, text, "tolerance")
    for frequency in (1.9, 2.1):
        begins = edge(0.05, 0.45, lambda e, f=frequency: not stable(e, f))
        lower, middle, upper = shares(found, mesh_frequency=frequency)
        truth = (0.45 - begins) / 0.4
        assert 0.1 < truth < 0.9
        assert lower <= truth <= upper
        assert abs(middle - truth) < 1 / 128


def test_samples_are_systems_built_one_by_one(tmp_path):
    text = (
        TRAIN
        + """
sweep: {mesh_frequency: [1.4, 2.3, 3.1], meshes.second.phasing: [0.0, 0.3]}
methods:
  tolerance:
    samples: 64
    seed: 5
    sobol: false
    parameters:
      meshes.first.contact_ratio: {normal: [1.5, 0.1]}
      epsilon: {triangular: [0.2, 0.3, 0.5]}
      inertias.1: {uniform: [-0.1, 0.1], deviation: true}
    correlation: [{between: [meshes.first.contact_ratio, epsilon], value: 0.7}]
"""
    )
    found = result_of(tmp_path, text, "tolerance")
    from scipy import stats

    matrix = np.array([[1.0, 0.7, 0.0], [0.7, 1.0, 0.0], [0.0, 0.0, 1.0]])
    points = correlated(SamplingDesign.of((0, 0, 1), 64, False, 5).points, matrix)
    ratio, epsilon, inertia = (stats.norm(1.5, 0.1).ppf(points[:, 0]),
                               stats.triang(1 / 3, 0.2, 0.3).ppf(points[:, 1]),
                               0.3 + stats.uniform(-0.1, 0.2).ppf(points[:, 2]))  # fmt: skip
    base = plain(read(tmp_path, text).system)
    for phasing in (0.0, 0.3):
        unstable = []
        for c, e, m in zip(ratio, epsilon, inertia, strict=True):
            one, other = base["meshes"]
            meshes = [one | {"contact_ratio": c, "epsilon": e}, other | {"epsilon": e, "phasing": phasing}]
            system = build(base | {"inertias": [1.0, m, 4.0], "meshes": meshes})
            unstable.append(solve(system, np.array([1.4, 2.3, 3.1])).stable[0] == 0)
        wanted = np.mean(unstable, axis=0)
        assert found["probability"].sel({"meshes.second.phasing": phasing}).values == pytest.approx(wanted, abs=1e-12)
        assert 0 < wanted.min() < wanted.max() < 1


MAP = scene_text("tolerance_sweep_map")


def test_blocks_and_processes_change_nothing(tmp_path, monkeypatch):
    planning, tolerance = (import_module(f"gearstab.{name}") for name in ("sweep.plan", "methods.tolerance"))
    whole = result_of(tmp_path, MAP, "tolerance")
    assert set(whole["probability"].dims) == {"epsilon", "mesh_frequency", "case"}
    monkeypatch.setattr(planning, "MOST", 500)
    monkeypatch.setattr(planning, "LONGEST", 500)
    monkeypatch.setattr(tolerance, "ROW", 7)
    planned = plan(read(tmp_path, MAP))
    assert planned.layouts[0].count > 20
    parts = result_of(tmp_path, MAP, "tolerance")
    assert whole.identical(parts)
    assert float(whole["sobol_total"].max()) > 0.5


def test_the_speed_may_be_uncertain_without_an_axis(tmp_path):
    # The probability of a speed in a tongue, against its edges.
    text = (
        PAIR
        + """
sweep: {epsilon: [0.2, 0.3]}
methods: {tolerance: {samples: 1024, parameters: {mesh_frequency: {uniform: [1.8, 2.6]}}}}
"""
    )
    found = result_of(tmp_path, text, "tolerance")
    assert found["probability"].dims == ("epsilon",)
    for epsilon in (0.2, 0.3):
        low, high = (edge(end, 2.0, lambda f, e=epsilon: not stable(e, f))
                     for end in (1.6, 2.4))  # fmt: skip
        lower, middle, upper = shares(found, epsilon=epsilon)
        truth = (high - max(low, 1.8)) / 0.8
        assert lower <= truth <= upper
        assert abs(middle - truth) < 1 / 64


SPEED = """
methods:
  tolerance: {samples: 512, seed: 4, integrate_speed: true, parameters: {mesh_frequency: DISTRIBUTION, OTHERS}}
"""


def test_a_speed_alone_is_integrated_over_its_regions(tmp_path):
    """P = Phi((b - w)/s) - Phi((a - w)/s) of the region a to b, whose ends are found by bisection here."""
    from scipy.special import ndtr

    low, high = (edge(end, 2.0, lambda f: not stable(0.3, f)) for end in (1.6, 2.4))
    method = SPEED.replace("DISTRIBUTION", "{normal: [0, 0.05], deviation: true}").replace(", OTHERS", "")
    found = result_of(tmp_path, PAIR + "sweep: {mesh_frequency: [1.7, 1.8, 2.0, 2.25]}" + method, "tolerance")
    for frequency in found["mesh_frequency"].values:
        lower, middle, upper = shares(found, mesh_frequency=frequency)
        truth = ndtr((high - frequency) / 0.05) - ndtr((low - frequency) / 0.05)
        assert lower <= truth <= upper
        assert upper - lower < 1e-6
        assert middle == pytest.approx(truth, abs=1e-7)
    assert "sobol_first" not in found


def test_a_speed_beside_other_parameters_is_integrated(tmp_path):
    """Uniform speeds and epsilon: the area between the edges, which Gauss-Legendre takes of those of 32 systems."""
    from gearstab.floquet.boundaries import boundaries

    method = SPEED.replace("DISTRIBUTION", "{uniform: [1.7, 2.6]}").replace("OTHERS", "epsilon: {uniform: [0.2, 0.4]}")
    found = result_of(tmp_path, PAIR + "sweep: {equivalent_mass: [1.0]}" + method, "tolerance")
    nodes, weights = np.polynomial.legendre.leggauss(32)
    regions = boundaries(build(pair({"epsilon": 0.3 + 0.1 * nodes})), 1.7, 2.6, 1e-10, 1e-10)
    truth = np.sum(0.5 * weights[regions.row] * (regions.upper - regions.lower) / 0.9)
    lower, middle, upper = shares(found, equivalent_mass=1.0)
    assert lower <= truth <= upper
    # 512 drawn speeds know it to 0.01 or so.
    assert middle == pytest.approx(truth, abs=1e-4)
    assert upper - lower < 0.01


def test_deviations_follow_the_axis(tmp_path):
    text = (
        PAIR
        + """
sweep: {epsilon: [0.1, 0.3], mesh_frequency: [1.9]}
methods: {tolerance: {samples: 512, parameters: {epsilon: {uniform: [-0.05, 0.05], deviation: true}}}}
"""
    )
    found = result_of(tmp_path, text, "tolerance")
    begins = edge(0.05, 0.45, lambda e: not stable(e, 1.9))
    for epsilon in (0.1, 0.3):
        truth = np.clip((epsilon + 0.05 - begins) / 0.1, 0.0, 1.0)
        assert float(found["probability"].sel(epsilon=epsilon)[0]) == pytest.approx(truth, abs=1 / 64)


def test_what_failed_and_negative_levels_are_flagged(tmp_path):
    text = (
        PAIR
        + """
sweep: {mesh_frequency: [1.9]}
methods: {tolerance: {samples: 64, parameters: {epsilon: {uniform: [0.5, 1.5]}}}}
"""
    )
    found = result_of(tmp_path, text, "tolerance")
    flags = dict(zip(found["status"].flag_meanings.split(), found["status"].flag_masks, strict=True))
    assert int(found["status"][0]) & flags["negative_stiffness"]


def mistakes(folder: Path, method: str, sweep: str = "mesh_frequency: [1.0, 2.0]") -> list[str]:
    text = f"{TRAIN}sweep: {{{sweep}}}\nmethods: {{tolerance: {method}}}\n"
    return [str(problem) for problem in problems(folder, text)]


def test_correlations_that_contradict_each_other(tmp_path):
    method = """{parameters: {epsilon: {normal: [0.3, 0.1]}, contact_ratio: {normal: [1.5, 0.1]}, inertias.0: {normal:
      [1, 0.1]}}, correlation: [{between: [epsilon, contact_ratio], value: 0.9}, {between: [epsilon, inertias.0],
      value: 0.9}, {between: [inertias.0, contact_ratio], value: -0.9}]}"""
    assert "not positive definite" in mistakes(tmp_path, method)[0]


def test_what_reaches_beyond_the_possible_is_cut_off_and_said(tmp_path):
    text = (
        TRAIN
        + """
sweep: {mesh_frequency: [1.0]}
methods: {tolerance: {samples: 16, parameters: {meshes.first.contact_ratio: {normal: [1.02, 0.02]}}}}
"""
    )
    config = read(tmp_path, text)
    # Below 1, one standard deviation off.
    assert "15.9 % of the distribution lies outside of 1 to 1000" in str(config.doubts[0])
    compute(planned := plan(config), next(planned.layouts[0].blocks()))


def test_units_and_values_that_the_system_leaves_out(tmp_path):
    text = """
system: {kind: gear_pair, equivalent_mass: 1.0, meshes: [{mean_stiffness: 1.0, contact_ratio: 1.5}]}
sweep: {mesh_frequency: [1.9]}
methods: {tolerance: {parameters: {epsilon: {triangular: [0.1, 0.2, 0.3]}, equivalent_mass: {normal: [1000 g, 10 g]}}}}
"""
    config = read(tmp_path, text)
    assert config.system["meshes"][0]["epsilon"] == 0.2
    assert config.tree["methods"]["tolerance"]["parameters"]["equivalent_mass"]["normal"] == [1.0, 0.01]
    again = read(tmp_path, config.resolved)
    assert again.digest == config.digest
