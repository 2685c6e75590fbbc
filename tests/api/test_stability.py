"""Systems from Python: arrays for any parameter are as many systems, and each theory gives what a sweep gives."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scenes import CONFIGS, scene_text, written

import gearstab as gs
from gearstab.config import ConfigError
from gearstab.errors import DoubtWarning, NotPossible

EPSILON = np.array([0.0, 0.1, 0.3])
CONTACT_RATIO = np.array([[1.5], [1.2]])
FREQUENCY = np.linspace(1.0, 6.0, 11)
NAMES = {"epsilon": EPSILON, "meshes.second.contact_ratio": CONTACT_RATIO}

SWEPT = scene_text("stability_swept")


@pytest.fixture(scope="module")
def train(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("train"), SWEPT)


@pytest.fixture(scope="module")
def tree(train: Path) -> xr.DataTree:
    return gs.sweep(train)


def test_growth_rates_are_those_of_a_sweep(train: Path, tree: xr.DataTree) -> None:
    found = gs.floquet(gs.build(train, NAMES), FREQUENCY, exponents=True)
    group = tree["floquet"]
    for name in ("growth_rate", "stable", "status", "exponent_real", "exponent_imag"):
        assert found[name].shape == group[name].shape
        np.testing.assert_array_equal(found[name], group[name].values)
    assert found.growth_rate is found["growth_rate"]


def test_mesh_frequencies_keep_their_shape(train: Path) -> None:
    system = gs.build(train)
    flat = gs.floquet(system, FREQUENCY[:6]).growth_rate
    assert gs.floquet(system, 5.4).growth_rate.shape == ()
    np.testing.assert_array_equal(gs.floquet(system, FREQUENCY[:6].reshape(2, 3)).growth_rate, flat.reshape(2, 3))


def test_edges_are_those_of_a_sweep(train: Path, tree: xr.DataTree) -> None:
    found = gs.boundaries(gs.build(train, NAMES), FREQUENCY[0], FREQUENCY[-1])
    group = tree["boundaries"]
    assert list(found.label) == list(group["label"].values)
    np.testing.assert_array_equal(found.boundary_frequency, group["boundary_frequency"].values)
    np.testing.assert_array_equal(found.contacts, group["contacts"].values)


def test_predicted_regions_are_those_of_a_sweep(train: Path, tree: xr.DataTree) -> None:
    found = gs.perturbation(gs.build(train, NAMES), harmonics=2)
    group = tree["perturbation"]
    assert list(found.label) == list(group["label"].values)
    for name in ("boundary_frequency", "half_width", "center_frequency"):
        np.testing.assert_allclose(found[name], group[name].values, rtol=1e-14)


def test_one_system_has_no_batch(train: Path) -> None:
    system = gs.build(train)
    assert system.batch == ()
    assert gs.boundaries(system, 1.0, 6.0).boundary_frequency.shape[1:] == (2,)
    assert gs.perturbation(system).half_width.ndim == 1


ARRAYS = {
    "gear_pair.yaml": ("damping_ratio", [0.01, 0.02]),
    "drive_train.yaml": ("meshes.0.mean_stiffness", [1e8, 2e8]),
    "parker_2009/fig3.yaml": ("masses.sun", [0.4, 0.5]),
    "reducer.yaml": ("rotors.0.inertia", [0.01, 0.02]),
    "lin_parker_2002/fig3.yaml": ("inertias.1", [0.3, 0.4]),
    "waveforms/harmonics.yaml": ("epsilon", [0.1, 0.2]),
}
"""A number of every kind of system."""


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_are_as_many_systems(name: str) -> None:
    path, values = ARRAYS[name]
    square = np.array([values, values[::-1]])
    batch = gs.build(CONFIGS / name, {path: square})
    assert batch.batch == (2, 2)
    single = [gs.build(CONFIGS / name, {path: value}) for value in values]
    for one, row in ((single[0], (0, 0)), (single[1], (0, 1)), (single[1], (1, 0))):
        for matrix in ("mass", "damping"):
            theirs = getattr(batch, matrix)
            if theirs is not None:
                full = np.broadcast_to(theirs, (2, 2, *theirs.shape[-2:]))
                same(full[row], getattr(one, matrix))
        full = np.broadcast_to(batch.mean_stiffness_matrix(), (2, 2, one.size, one.size))
        same(full[row], one.mean_stiffness_matrix())


def same(batched: np.ndarray, alone: np.ndarray) -> None:
    """Products of matrices are summed in another order in a batch."""
    np.testing.assert_allclose(batched, alone, rtol=0, atol=1e-14 * np.abs(alone).max())


def test_exact_ratios_are_given_one_at_a_time(train: Path) -> None:
    system = gs.build(train, tooth_ratio=Fraction(3, 5))
    assert system.meshes[1].frequency_ratio == Fraction(5, 3)
    with pytest.raises(ValueError, match="must be constant over the rows that are built together"):
        gs.build(train, tooth_ratio=["3/5", "2/3"])


def test_a_section_by_itself_is_enough() -> None:
    section = gs.load(CONFIGS / "gear_pair.yaml").document.data["system"]
    growth = gs.floquet(section, 2.0).growth_rate
    assert growth == gs.floquet(CONFIGS / "gear_pair.yaml", 2.0).growth_rate > 0
    assert gs.info(section)["modes"][0]["natural_frequency"] == pytest.approx(1.0)


def test_pairs_of_gears_are_as_many_systems_too() -> None:
    config = gs.load(CONFIGS / "oh_grosh_barber_2005" / "fig4a.yaml")
    batch = gs.floquet(gs.build(config, torque=[20.0, 21.0]), [3000.0, 3100.0])
    single = gs.floquet(gs.build(config, torque=21.0), [3000.0, 3100.0])
    assert batch.growth_rate.shape == (2, 2)
    np.testing.assert_allclose(batch.growth_rate[1], single.growth_rate, rtol=1e-9)


MISTAKES = {
    "frequency": (lambda s: gs.floquet(s, [1.0, -1.0]), "mesh frequencies must be positive numbers"),
    "nan": (lambda s: gs.floquet(s, np.nan), "mesh frequencies must be positive numbers"),
    "range": (lambda s: gs.boundaries(s, 3.0, 2.0), "must satisfy 0 < lower < upper, not 3, 2"),
    "unknown": (lambda s: gs.floquet(s, 1.0, tolerence=1e-8), "options: floquet.tolerence: unknown key; did you mean"),
    "option": (lambda s: gs.boundaries(s, 1.0, 2.0, tolerance=-1), "options: boundaries.tolerance: must be > 0"),
    "mode": (lambda s: gs.floquet(s, 1.0, modes=[7]), "floquet.modes there is no mode 7"),
    "speed": (lambda s: gs.build(TRAIN_DATA, mesh_frequency=[1.0]), "mesh_frequency is no number of a system"),
    "value": (lambda s: gs.build(TRAIN_DATA, epsilon=[0.1, np.inf]), "values: sweep.epsilon.1: "),
    "name": (lambda s: gs.build(TRAIN_DATA, epsilom=[0.1]), "did you mean 'epsilon'"),
    "section": (lambda s: gs.sweep(TRAIN_DATA), "configuration: methods: is missing; add the section methods"),
    "override": (lambda s: gs.load(TRAIN_DATA, epsilon="soft"), "override epsilon: system.meshes.0.epsilon: must be a"),
    "type": (lambda s: gs.load({"system": object()}), "configuration: system: is of the type object"),
}
TRAIN_DATA = {
    "kind": "two_stage", "inertias": (1.0, 0.3, 4.0), "input_shaft_stiffness": 0.5, "tooth_ratio": 1,
    "meshes": [{"mean_stiffness": np.float64(1.0), "epsilon": 0.3, "contact_ratio": 1.5}] * 2,
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line(train: Path, name: str) -> None:
    call, message = MISTAKES[name]
    with pytest.raises((ConfigError, NotPossible)) as caught:
        call(gs.build(train))
    first = str(caught.value).splitlines()[0]
    assert message in first
    assert len(str(caught.value).splitlines()) <= 2  # one mistake of each mesh


def test_shapes_that_do_not_go_together(train: Path) -> None:
    with pytest.raises(ValueError, match="shape mismatch"):
        gs.build(train, {"epsilon": np.zeros(3), "damping_ratio": np.zeros(2)})


def test_overrides_of_a_loaded_configuration_add_up(train: Path) -> None:
    with pytest.warns(DoubtWarning, match="no effect on the sweep"):
        once = gs.load(train, epsilon=0.2)
    twice = gs.load(once, {"meshes.first.contact_ratio": 1.25})
    assert [mesh.epsilon for mesh in gs.build(twice).meshes] == [0.2, 0.2]
    assert gs.build(twice).meshes[0].waveform.contact_ratio == 1.25
    assert twice.overrides == ("epsilon=0.2", "meshes.first.contact_ratio=1.25")
    assert gs.build(once).meshes[0].waveform.contact_ratio == 1.5
    assert twice.source == train
