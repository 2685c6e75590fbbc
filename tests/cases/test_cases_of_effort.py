"""Sweeps that take long: what is foretold, and the cheaper way for two measured meshes."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

import gearstab as gs
from gearstab import ckernel
from gearstab.config import load
from gearstab.floquet.frequencies.choice import chosen
from gearstab.sweep import forecast, plan
from gearstab.sweep.compute import compute

CASES = Path(__file__).parent


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """The configuration of two measured meshes with its files, noisy samples of a smooth stiffness."""

    def rise(z: np.ndarray) -> np.ndarray:
        return 1 / (1 + np.exp(-z / 0.015))

    generator, phase = np.random.default_rng(5), np.arange(720) / 720
    level = rise(phase) * (1 - rise(phase - 0.6)) + rise(phase - 1.0)
    values = (1.5e8 + 0.9e8 * level + 0.1e8 * np.sin(2 * np.pi * phase)) * (1 + 0.01 * generator.standard_normal(720))
    generator.permutation(720)
    few = np.unique(np.r_[0, np.sort(generator.choice(720, 200, replace=False))])
    (tmp_path / "k").mkdir()
    for name, kept in (("frac", np.arange(720)), ("nonuni", few)):
        table = np.c_[phase[kept], values[kept]]
        np.savetxt(tmp_path / "k" / f"{name}.csv", table, "%.10g", ",", header="phase,stiffness", comments="")
    (tmp_path / "b22.yaml").write_text((CASES / "b22_long_sampled.yaml").read_text())
    return tmp_path / "b22.yaml"


def test_auto_takes_the_cheaper_way(measured: Path) -> None:
    # A common period of 37 cycles has 26,397 exponentials; the window of a Lyapunov exponent as many for each of the
    # 500/0.62 = 804 cycles of its own.
    strategy = chosen(plan(load(measured)).base, "auto")
    assert strategy.name == "common_period"
    assert strategy.period is not None
    assert strategy.period.segments > strategy.affordable


@pytest.mark.slow
def test_two_measured_meshes(measured: Path) -> None:
    found = gs.sweep(gs.load(measured, {"sweep.mesh_frequency": ["2500 Hz", "7600 Hz"]}), jobs=1)
    # An independent Magnus integration of fourth order on 47,961 pieces.
    np.testing.assert_allclose(found["floquet"]["growth_rate"], [-45.58037156, -41.4684575], rtol=0, atol=1e-6)


LONG = [
    "a4_steady_state_never_ends", "a7_dry_run_too_low", "dry_run_estimate", "slow_gearbox", "slow_terms_8dof",
    "singular_R999_plain",
]  # fmt: skip


@pytest.mark.parametrize("name", LONG)
def test_no_time_is_told_that_no_sample_bears_out(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing ends in time, and a kernel that looks stops it."""
    planned = plan(load(CASES / f"{name}.yaml", (), needs=("sweep", "methods")))
    start = time.thread_time()
    found = forecast.estimate(planned, 1, budget=0.05)
    # Samples look at the clock every 0.05 s of a call; what is built before is no part of them.
    assert time.thread_time() - start < 5
    for method in found.methods:
        assert (method.seconds is None) == method.time.startswith("not known (a sample took more than ")
        assert method.seconds is None or method.seconds > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dry_run_estimate", "slow_gearbox", "slow_terms_8dof", "a7_dry_run_too_low"])
def test_a_time_that_is_told_is_right_within_a_factor_of_three(name: str) -> None:
    planned = plan(load(CASES / f"{name}.yaml", (), needs=("sweep", "methods")))
    told = {method.name: method.seconds for method in forecast.estimate(planned, 1).methods}
    with ckernel.using(threads=1):
        for layout in planned.layouts:
            seconds = told[layout.method.name]
            if seconds is None or seconds < 0.1:
                continue
            start = time.thread_time()
            for block in layout.blocks():
                compute(planned, block)
            assert 1 / 3 < (time.thread_time() - start) / seconds < 3, layout.method.name
