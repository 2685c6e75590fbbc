"""The page of a map: self-contained, a picture without scripts, no unstable point lost."""

import re
from pathlib import Path

import numpy as np
import pytest
from scenes import TRAIN, succeeds

from gearstab.plots.interactive import MOST_CELLS, reduced, unformatted

SWEEP = "sweep:\n  mesh_frequency: {start: 4.0, stop: 7.0, num: 31}\n  epsilon: [0.1, 0.2, 0.3]\n"
pytest.importorskip("bokeh")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    axis = "  meshes.first.contact_ratio: [1.3, 1.5]\n"
    (folder / "train.yaml").write_text(TRAIN + SWEEP + axis + "methods: {floquet: {}, boundaries: {}}\n")
    succeeds("sweep", folder / "train.yaml", "-o", folder / "train.h5")
    succeeds("plot", folder / "train.h5", "-o", folder / "map.html")
    return folder / "map.html"


def test_it_needs_nothing_from_elsewhere(page: Path) -> None:
    text = page.read_text()
    assert not re.search(r'<(script|link|img)[^>]*(src|href)="(https?:)?//', text)
    # In the body of the page, not in the program of Bokeh, which names this tag as well.
    assert re.search(r'</head>\s*<body>\s*<noscript><img alt="Stability map" src="data:image/png;base64,', text)
    words = ('"Slider"', '"HoverTool"', '"MultiLine"', "2w3", "relative mesh stiffness variation")
    assert [word for word in words if word not in text] == []


def test_labels_are_those_of_figures_without_mathematics() -> None:
    assert unformatted(r"mesh frequency $\Omega$ (rad/s)") == "mesh frequency \N{GREEK CAPITAL LETTER OMEGA} (rad/s)"
    assert unformatted(r"shaft $k_{\mathrm{b}}$ ($\mathrm{s}^{-1}$)") == "shaft k_b (s^-1)"


def test_no_unstable_point_is_lost() -> None:
    values = np.ma.masked_all((3, 7 * MOST_CELLS // 2))
    values.data[:] = -0.125  # stable, and decaying
    values[1, 1234], values[2, -1] = 0.5, 0.25
    failed = np.zeros(values.shape, bool)
    failed[0, 7], failed[1, 1233] = True, True
    found = reduced(values, failed)
    assert found.shape == (3, MOST_CELLS)
    assert found.dtype == np.float32
    assert sorted(found[found > 0]) == [0.25, 0.5]
    assert np.isnan(found).sum() == 1  # the other failure is beside an unstable point
    assert set(found[found <= 0]) == {np.float32(-0.125)}
