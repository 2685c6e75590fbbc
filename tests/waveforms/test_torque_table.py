"""Mesh stiffness over phase and torque: between the torques of a table, from files, and what is wrong with tables."""

from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

import gearstab as gs
from gearstab.errors import DoubtWarning, NotPossible
from gearstab.waveforms import (
    Constant,
    Fourier,
    Product,
    Profile,
    Rectangular,
    Sampled,
    Scaled,
    TorqueTable,
    Trapezoidal,
)
from gearstab.waveforms.base import harmonic
from gearstab.waveforms.tooth import Piecewise

TORQUES, PHASES = np.array([50.0, 100.0, 250.0]), np.array([0.1, 0.3, 0.45, 0.9])
STIFFNESS = np.array([[2.0, 3.0, 2.5, 1.5], [2.2, 3.1, 2.9, 1.9], [2.4, 2.8, 2.6, 2.5]]) * 1e8


def columns() -> np.ndarray:
    torque, phase = np.meshgrid(TORQUES, PHASES, indexing="ij")
    return np.array([torque.ravel(), phase.ravel(), STIFFNESS.ravel()])


def table(torque: float | list[float]) -> TorqueTable:
    # The order of the lines of a file is of no account.
    shuffled = columns()[:, np.random.default_rng(3).permutation(12)]
    return TorqueTable.build(
        SimpleNamespace(torque=np.asarray(torque), interpolation=None, **TorqueTable.from_file(shuffled))
    )


def test_at_a_torque_of_the_table_it_is_the_wave_of_those_samples() -> None:
    x = np.linspace(0, 1, 101)
    for torque, stiffness in zip(TORQUES, STIFFNESS, strict=True):
        np.testing.assert_array_equal(table(torque).value(x), Sampled(PHASES, stiffness).value(x))


def test_between_two_torques_the_stiffness_is_linear_in_the_torque() -> None:
    wave, x = table([60.0, 200.0]), np.linspace(0, 0.99, 34)
    found = wave.mean_stiffness + 2 * wave.amplitude * wave.value(x[:, None])
    levels = np.array([np.interp(x, PHASES, row, period=1.0) for row in STIFFNESS])
    expected = [[np.interp(torque, TORQUES, column) for torque in (60.0, 200.0)] for column in levels.T]
    np.testing.assert_allclose(found, expected, rtol=1e-13)


def test_no_torque_beyond_the_table_is_guessed() -> None:
    with pytest.raises(NotPossible, match="torque 251 N m is beyond the table, from 50 to 250 N m"):
        table([100.0, 251.0])


def written(folder: Path, rows: np.ndarray, name: str = "k.csv") -> Path:
    path = folder / name
    if path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            for key, values in zip(TorqueTable.columns, rows, strict=True):
                file[key] = values
    else:
        lines = [",".join(f"{value:.17g}" for value in row) for row in rows.T]
        path.write_text("\n".join(["torque, phase, stiffness", *lines]))
    return path


def train(waveform: str, extra: str = "") -> str:
    return (
        f"system: {{kind: gear_pair, equivalent_mass: 0.6, meshes: [{{waveform: {waveform}}}]}}\n"
        f"sweep: {{mesh_frequency: {{start: 3.0e+4, stop: 6.0e+4, num: 31}}{extra}}}\nmethods: {{floquet: {{}}}}\n"
    )


@pytest.mark.parametrize("name", ["k.csv", "k.h5"])
def test_a_sweep_over_torques_is_that_of_their_samples(tmp_path: Path, name: str) -> None:
    written(tmp_path, columns(), name)
    source = tmp_path / "train.yaml"
    axis = ", meshes.0.waveform.torque: [50, 175 N m]"
    source.write_text(train(f"{{kind: table, file: {name}, torque: 80}}", axis))
    growth = gs.sweep(gs.load(source))["floquet"]["growth_rate"].values
    assert np.any(growth > 0)
    assert growth.shape == (31, 2)
    for k, stiffness in enumerate((STIFFNESS[0], 0.5 * (STIFFNESS[1] + STIFFNESS[2]))):
        source.write_text(train(f"{{kind: sampled, phase: {PHASES.tolist()}, stiffness: {stiffness.tolist()}}}"))
        known = gs.sweep(gs.load(source))["floquet"]["growth_rate"].values
        # Multipliers are right to 1e-9, with as many steps as the worst row needs.
        np.testing.assert_allclose(growth[:, k], known, rtol=1e-6)


def test_units_of_a_header_are_read(tmp_path: Path) -> None:
    rows = columns() / np.array([[1e3], [1 / 360], [1e6]])
    lines = ["torque [kN m]; phase (deg); stiffness [N/um]", *("; ".join(map(repr, row.tolist())) for row in rows.T)]
    (tmp_path / "k.csv").write_text("\n".join(lines))
    source = tmp_path / "train.yaml"
    source.write_text(train("{kind: table, file: k.csv, torque: 175}"))
    mesh = gs.build(gs.load(source)).meshes[0]
    known = table(175.0)
    np.testing.assert_allclose(mesh.waveform.phase, known.phase, rtol=1e-14)
    np.testing.assert_allclose(mesh.waveform.stiffness, known.stiffness, rtol=1e-14)


def test_measured_rows_close_the_period_at_every_torque(tmp_path: Path) -> None:
    rows = columns()
    closing = rows[:, rows[1] == rows[1].min()] + np.array([[0], [1], [0]])
    assert closing.shape[1] == len(np.unique(rows[0]))
    closing[2, -1] *= 1.1
    mixed = np.concatenate([rows, closing], axis=1)[:, ::-1]
    (tmp_path / "k.csv").write_text("\n".join(",".join(map(repr, row.tolist())) for row in mixed.T))
    source = tmp_path / "train.yaml"
    source.write_text(train("{kind: table, file: k.csv, torque: 175}"))
    # 1.1 times the first one: 1 - 1/1.1 of the larger one.
    with pytest.warns(DoubtWarning, match=r"drifts .* \(9\.1 %\)"):
        config = gs.load(source)
    wave = gs.build(config).meshes[0].waveform
    np.testing.assert_allclose(wave.phase, table(175.0).phase, rtol=0, atol=1e-15)
    np.testing.assert_allclose(wave.stiffness, table(175.0).stiffness, rtol=1e-15)


# --- Fourier coefficients of profiles against the discrete Fourier transform and series known in closed form


RATIOS = np.array([1.3, 1.5, 1.62])
PROFILES: dict[str, Profile] = {
    "constant": Constant(0.7),
    "scaled": Scaled(Rectangular(RATIOS), 0.2, np.array([0.5, -1.0, 2.0])),
    "a wave as it is": Trapezoidal(1.4, 0.1),
    "product": Product(Scaled(Rectangular(RATIOS), 1.0, 0.6), Scaled(Trapezoidal(1.7, 0.2), -0.4, 1.0)),
    "product of series": Product(
        Scaled(Fourier((0.3, 0.1), (0.2, -0.4)), 1.0, 0.5), Fourier((0.1, 0.0, 0.2), (0.6, 0.2, 0.3))
    ),
    "pieces": Piecewise(np.array([0.0, 0.3, 0.3, 0.8]), np.arange(12.0).reshape(4, 3) - 4),
}


@pytest.mark.parametrize("name", PROFILES)
def test_coefficients_against_sums_over_samples(name: str) -> None:
    """Midpoints of 20,000 intervals: wrong by 1/20,000 of a jump at most, and not where jumps fall between them."""
    profile = PROFILES[name]
    count = 20_000
    x = (np.arange(count) + 0.5) / count
    values = np.broadcast_to(profile.value(x.reshape(-1, *[1] * len(profile.batch))), (count, *profile.batch))
    for s in (0, 1, 2, 3, 7):
        expected = np.tensordot(np.exp(-2j * np.pi * s * x) / count, values, axes=1)
        found = harmonic(profile, s)
        assert found.shape == profile.batch
        np.testing.assert_allclose(found, expected, atol=2e-7 * np.abs(values).max())


def test_products_of_series_are_convolutions() -> None:
    """To rounding: of 1 + (sin x + cos 2x)/2 and cos x, x = 2 pi phase."""
    profile = Product(Scaled(Fourier((1.0, 0.0), (0.0, 1.0)), 1.0, 0.5), Fourier((0.0,), (1.0,)))
    # cos x + sin(2x)/4 + (cos x + cos 3x)/4
    expected = [0, 0.625, -0.125j, 0.125, 0, 0]
    np.testing.assert_allclose([harmonic(profile, s) for s in range(6)], expected, atol=1e-15)


def test_harmonics_that_are_missing_are_exactly_zero() -> None:
    wave = Rectangular(1.5)
    for profile in (wave, Scaled(wave, 0.1, 3.0), Product(Scaled(wave, 1.0, 1.0), Constant(2.0))):
        assert [harmonic(profile, s) != 0 for s in range(1, 7)] == [True, False] * 3
