"""How likely regions reach into a range of speeds."""

from importlib import import_module

import numpy as np
import pytest
from scenes import TRAIN, problems, read, result_of, scene_text
from systems import pair

from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.sweep import plan
from gearstab.systems import build

PAIR = scene_text("tongue_probability_pair")


def test_a_known_probability(tmp_path):
    """The primary region widens with epsilon: it reaches down to 1.9 from the epsilon on at which 1.9 is unstable."""
    low, high = 0.05, 0.45
    for _ in range(50):
        middle = 0.5 * (low + high)
        stable = solve(build(pair({"epsilon": middle})), np.array([1.9])).stable[0, 0]
        low, high = (middle, high) if stable else (low, middle)
    found = result_of(tmp_path, PAIR, "tongue_probability")
    assert list(found["label"].values) == ["2w1"]
    lower, middle, upper = (float(found[f"tongue_probability{end}"][0]) for end in ("_lower", "", "_upper"))
    truth = (0.45 - low) / 0.4
    assert 0.1 < truth < 0.9
    assert lower <= truth <= upper
    # Eight scrambles of 64 points each tell an edge apart to a 64th.
    assert abs(middle - truth) < 1 / 64


SEVERAL = scene_text("tongue_probability_several")


def test_samples_are_searched_one_by_one(tmp_path, monkeypatch):
    planned = plan(read(tmp_path, SEVERAL))
    uncertain, design = planned.config.uncertainties, planned.layouts[-1].method.design
    whole = result_of(tmp_path, SEVERAL, "tongue_probability")
    count = dict.fromkeys(whole["label"].values, 0)
    parameters = planned.config.system
    for numbers in design.points:
        system = build(uncertain.sampled(parameters, numbers[None]))
        found = boundaries(system, 2.0, 6.0, 1e-6, 1e-6).arranged()
        touching = np.isfinite(found.boundary_frequency).any(axis=1)[:, 0]
        for (tongue, occurrence), inside in zip(found.index, touching, strict=True):
            assert occurrence == 0
            count[tongue.label] += bool(inside)
    # The phasing of the system itself is 0.
    at = whole["tongue_probability"].sel({"meshes.second.phasing": 0.0})
    assert dict(zip(whole["label"].values, at.values * design.size, strict=True)) == pytest.approx(count)
    # Blocks change nothing, also where no sample of a block has a region that others have.
    monkeypatch.setattr(import_module("gearstab.sweep.plan"), "MOST", 1)
    monkeypatch.setattr(import_module("gearstab.methods.base").Method, "fewest", 1)
    parts = result_of(tmp_path, SEVERAL, "tongue_probability").sortby("label")
    whole = whole.sortby("label")
    assert plan(read(tmp_path, SEVERAL)).layouts[-1].count == 3
    for name in ("tongue_probability", "tongue_probability_lower", "tongue_probability_upper"):
        np.testing.assert_array_equal(parts[name], whole[name])


def test_without_distributions_there_is_nothing_to_draw(tmp_path):
    text = TRAIN + "sweep: {mesh_frequency: [2.0, 6.0]}\nmethods: {tongue_probability: {}}\n"
    (problem,) = problems(tmp_path, text)
    assert (problem.path, problem.code) == ("methods.tongue_probability", "needs_other")
