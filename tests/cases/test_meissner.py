"""Meissner's equation, x'' + sgn(cos) x = 0: half a period of growth and half a period of rotation, no mean stiffness.

The monodromy matrix has half the trace cosh(T/2) cos(T/2) in T = 2 pi/Omega.
"""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.optimize import brentq

import gearstab as gs

CASE = Path(__file__).with_name("b01_meissner_zero_mean.yaml")
COSINE = {"kind": "fourier", "cos": [0.5]}


def half_trace(omega):
    return np.cosh(np.pi / omega) * np.cos(np.pi / omega)


@pytest.fixture
def config():
    return gs.load(CASE)


def changed(tmp_path, **sections):
    """The case with other sections, as a configuration."""
    text = yaml.safe_load(CASE.read_text())
    wave = sections.pop("waveform", None)
    if wave is not None:
        mesh = text["system"]["meshes"][0]
        del mesh["contact_ratio"]
        mesh["waveform"] = wave
    path = tmp_path / "changed.yaml"
    path.write_text(yaml.safe_dump({**text, **sections}))
    return gs.load(path)


def test_growth_is_that_of_the_closed_form(config):
    found = gs.sweep(config)["floquet"]
    omega = np.asarray(found["mesh_frequency"])
    growth = np.arccosh(np.maximum(np.abs(half_trace(omega)), 1.0)) * omega / (2 * np.pi)
    np.testing.assert_allclose(found["growth_rate"], growth, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(found["stable"], growth == 0)


def test_edge_is_where_the_half_trace_is_minus_one(tmp_path):
    config = changed(
        tmp_path, methods={"boundaries": {}}, sweep={"mesh_frequency": {"start": 0.9, "stop": 7, "num": 3}}
    )
    edge = brentq(lambda omega: half_trace(omega) + 1, 1.5, 1.9, xtol=1e-14)
    found = np.asarray(gs.sweep(config)["boundaries"]["boundary_frequency"])
    assert edge == pytest.approx(1.6754230903822864, abs=1e-12)
    np.testing.assert_allclose(found, [[0.9, edge]], rtol=1e-9)


def test_mode_is_no_rigid_body(config):
    (mode,) = gs.sweep(config)["modes"]["mode_type"].values
    assert mode == "no mean stiffness"


def test_response_grows_or_not_as_stability_says(tmp_path):
    for omega, bounded in ((1.5, False), (1.7, True)):
        config = changed(tmp_path, respond={"mesh_frequency": omega, "cycles": 60, "initial": {"displacement": [1e-3]}})
        q = np.abs(np.asarray(gs.respond(config)["response"]["displacement"]))
        assert (q.max() < 1.0) == bounded


def test_smooth_wave_without_a_mean_is_mathieus_equation(tmp_path):
    # x'' + cos(Omega t) x = 0 is y'' + (a - 2 q cos 2 s) y = 0 with a = 0, q = 2/Omega^2 but for a phase: stable below
    # the q at which the characteristic value b_1(q), an eigenvalue of a tridiagonal matrix (DLMF 28.4.8), is 0.
    order = np.arange(20)

    def characteristic(q):
        side = q * np.eye(20, k=1)
        return np.linalg.eigvalsh(np.diag((2.0 * order + 1) ** 2 - q * (order == 0)) + side + side.T)[0]

    edge = np.sqrt(2 / brentq(characteristic, 0.5, 1.2, xtol=1e-14))
    config = changed(
        tmp_path, waveform=COSINE, sweep={"mesh_frequency": [float(edge * (1 + part)) for part in (-1e-7, 1e-7)]}
    )
    np.testing.assert_array_equal(gs.sweep(config)["floquet"]["stable"], [0, 1])
