"""``methods.perturbation: {order: 2}``: what a sweep stores, and that figures draw the curved boundaries."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot
from numpy.testing import assert_array_equal
from scenes import scene_text
from tongues import train

from gearstab.config import load
from gearstab.info.configuration import describe
from gearstab.info.text import report
from gearstab.mesh import PeriodicTerm
from gearstab.methods import OptionError
from gearstab.methods.perturbation import Perturbation, PerturbationOptions
from gearstab.perturbation import PERTURBATION_FLAGS, second_order
from gearstab.plots.maps import boundaries as boundary_figure
from gearstab.plots.view import Request
from gearstab.results import open_result
from gearstab.sweep import plan, run
from gearstab.waveforms import Rectangular

CONFIG = scene_text("perturbation_second_sweep")


def swept(folder: Path, text: str = CONFIG) -> Path:
    (folder / "train.yaml").write_text(text)
    run(plan(load(folder / "train.yaml", ())), folder / "r.h5", jobs=1)
    return folder / "r.h5"


def test_what_is_stored(tmp_path: Path) -> None:
    epsilon = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    expected = second_order(train(epsilon=(epsilon, epsilon)), 2)
    with open_result(swept(tmp_path)) as tree:
        group = tree["perturbation"].to_dataset().load()
    assert list(group["label"].values) == list(expected.label)
    for name, values in (
        ("boundary_frequency", expected.boundary_frequency), ("boundary_error", expected.boundary_error),
        ("first_order_boundary_frequency", expected.first_order_boundary), ("status", expected.status),
        ("half_width", expected.half_width), ("center_frequency", expected.center_frequency),
    ):  # fmt: skip
        assert_array_equal(group[name].values, values, err_msg=name)
        assert group[name].attrs["units"]
    assert group["boundary_error"].dims == ("tongue", "side", "epsilon")
    assert group["status"].attrs["flag_meanings"].split() == list(PERTURBATION_FLAGS)
    assert group.attrs["order"] == 2


def test_order_one_stores_what_it_did(tmp_path: Path) -> None:
    with open_result(swept(tmp_path, CONFIG.replace("order: 2", "order: 1"))) as tree:
        group = tree["perturbation"].to_dataset().load()
    assert {"boundary_error", "status"}.isdisjoint(group.data_vars)


def test_figures_draw_the_curved_boundaries(tmp_path: Path) -> None:
    with open_result(swept(tmp_path)) as tree:
        figure, drawn = boundary_figure.draw(tree, Request())
        frequency = tree["perturbation"]["boundary_frequency"].sel(side="lower").values
        label = list(tree["perturbation"]["label"].values)
    pyplot.close(figure)
    assert drawn["cases"][0]["perturbation"] is not None
    secondary = frequency[label.index("w3")]
    # 0.3 % below the root at epsilon = 0.1, sixteen times that at 0.4: no straight line.
    assert secondary[0] - secondary[-1] > 10 * (secondary[0] - secondary[1]) > 0


def test_other_periodic_terms_are_refused() -> None:
    term = PeriodicTerm("friction", np.ones(3), np.ones(3), Rectangular(1.5), None)
    options = PerturbationOptions(order=2, harmonics=1)
    Perturbation(options, train()).check()
    with pytest.raises(OptionError, match="friction"):
        Perturbation(options, replace(train(), terms=(term,))).check()


def test_info_lists_tongues_of_the_order_asked_for(tmp_path: Path) -> None:
    (tmp_path / "train.yaml").write_text(CONFIG)
    facts = describe(load(tmp_path / "train.yaml", ()), 3)
    assert facts["order"] == 2
    by_label = {tongue["label"]: tongue for tongue in facts["tongues"]}
    expected = second_order(train(epsilon=(0.3, 0.3)), 3)
    k = expected.label.index("2w3")
    assert by_label["2w3"]["boundary_frequency"] == list(expected.boundary_frequency[k])
    assert by_label["2w3"]["boundary_error"] == list(expected.boundary_error[k])
    assert "coincident_tongues" in by_label["(w2+w3)/3"]["status"]
    text = report(facts)
    assert "to second order" in text
    assert "another resonance too near" in text
    assert "error" in text
