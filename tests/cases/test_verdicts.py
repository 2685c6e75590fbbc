"""``gearstab info`` and ``report``: verdicts on configurations that first order, or the symmetric mean, gets wrong."""

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from scenes import ran, succeeds

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.plots import draw
from gearstab.results import open_result
from gearstab.systems import build

HERE = Path(__file__).parent


def facts(name: str, *options: str) -> dict:
    done = succeeds("info", HERE / f"{name}.yaml", "--json", *options)
    return json.loads(done.stdout)


def test_a_region_that_is_not_open_and_a_remedy_that_opens_it() -> None:
    """First order has 2w1/3 open and closed by a contact ratio of 5/3; it is stable, and 5/3 opens it."""
    name = "b14_remedy_false"
    system = build(load(HERE / f"{name}.yaml").system)
    w1 = 24494.897427831780
    growth = solve(system, w1 * np.linspace(0.6448, 0.6718, 50)).growth_rate
    assert growth.max() == pytest.approx(-0.006882 * w1, rel=0.01)
    found = facts(name)["dangerous"]
    assert found["verified"]
    labels = [region["label"] for region in found["open"]]
    assert "2w1/3" not in labels
    assert "2w1/7" in labels  # which first order has closed by damping
    assert "1.667" not in ran("info", HERE / f"{name}.yaml").stdout
    changed = facts(name, "--set", "meshes.0.contact_ratio=1.6666666666666667")["dangerous"]
    (opened,) = (region for region in changed["open"] if region["label"] == "2w1/3")  # quiet to first order
    assert opened["growth_rate"] == pytest.approx(0.012942 * w1, rel=0.01)
    assert np.array(opened["boundary_frequency"]) / w1 == pytest.approx([0.6448, 0.6718], abs=3e-4)  # of a raster


@pytest.mark.parametrize(("name", "growth"), [("d1_mean_system_unstable", 0.2265), ("d1b_negative_damping", 0.0145)])
def test_a_mean_system_that_grows_by_itself_comes_first(name: str, growth: float) -> None:
    """The verdict follows the title; growth against the eigenvalues of the matrices of the file."""
    matrices = {
        "d1_mean_system_unstable": ([[1.1, 0.5], [-0.5, 1.0]], [[0.02, 0.0], [0.0, 0.02]]),
        "d1b_negative_damping": ([[1.1, 0.0], [0.0, 4.0]], [[-0.029, 0.0], [0.0, 0.001]]),
    }
    stiffness, damping = matrices[name]
    whole = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.array(stiffness), -np.array(damping)]])
    largest = np.linalg.eigvals(whole).real.max()
    assert largest == pytest.approx(growth, abs=1e-4)
    done = ran("info", HERE / f"{name}.yaml")
    assert done.stdout.splitlines()[1].startswith(f"UNSTABLE: the mean system grows by itself, by up to {largest:.4g}")
    assert "No region of instability is open" not in done.stdout
    found = facts(name)
    assert max(found["mean_system"]["growth_rate"]) == pytest.approx(largest, rel=1e-9)
    (region,) = found["dangerous"]["open"]
    assert region["kind"] == "self-excited"
    assert region["share_of_range"] == pytest.approx(1.0)


def _half_trace(omega: np.ndarray, mean: float) -> np.ndarray:
    """Half the trace over a period of x'' + (mean + sgn cos) x = 0, |mean| < 1: half of it grows, half turns."""
    a, b, half = np.sqrt(1 - mean), np.sqrt(1 + mean), np.pi / omega
    return np.cosh(a * half) * np.cos(b * half) + (a * a - b * b) / (2 * a * b) * np.sinh(a * half) * np.sin(b * half)


@pytest.mark.parametrize("mean", [0.0, -0.05])
def test_ranges_without_a_positive_mean_stiffness_are_those_of_the_closed_form(mean: float) -> None:
    """First order knows nothing of such a mode; the verdict is that of exact Floquet analysis."""
    stiffness = f"system.stiffness=[[{mean - 1}]]"
    sweep = "sweep={mesh_frequency: {start: 0.9, stop: 6, num: 4}}"
    found = facts("b01_meissner_zero_mean", "--set", stiffness, "--set", sweep)["dangerous"]
    omega = np.linspace(0.9, 6, 5101)
    unstable = np.abs(_half_trace(omega, mean)) > 1
    inside = np.zeros(len(omega), dtype=bool)
    for low, high in (region["boundary_frequency"] for region in found["open"]):
        inside |= (omega >= low) & (omega <= high)
    far = np.abs(np.abs(_half_trace(omega, mean)) - 1) > 1e-6
    assert (inside == unstable)[far].all()
    assert found["unstable_share"] == pytest.approx(unstable.mean(), abs=0.002)  # two steps of the coarser grid
    assert found["refuted"] == 0
    text = ran("info", HERE / "b01_meissner_zero_mean.yaml", "--set", stiffness, "--set", sweep).stdout
    assert "No region of instability is open" not in text
    assert text.splitlines()[1].startswith("UNSTABLE at ") == (mean < 0)


def test_a_mean_system_that_grows_may_be_held_by_the_varying_stiffness() -> None:
    sweep = "sweep={mesh_frequency: {start: 1.7, stop: 2.2, num: 4}}"
    options = ["--set", "system.stiffness=[[-1.05]]", "--set", sweep]
    assert np.abs(_half_trace(np.linspace(1.7, 2.2, 501), -0.05)).max() < 1
    text = ran("info", HERE / "b01_meissner_zero_mean.yaml", *options).stdout
    assert text.splitlines()[1].startswith("STABLE by the varying mesh stiffness: the mean system grows by itself")
    assert "No region of instability is open there." in text


def test_natural_frequencies_of_a_system_with_terms_are_those_of_the_whole_mean_system(tmp_path: Path) -> None:
    """Cross-coupling s against the eigenvalues of the matrices of the file; shapes and roots keep their own."""
    coupling = [0.0, 0.02, 0.5]
    entry = "{{label: '{0}', terms.cross_a.stiffness.mean: {0}, terms.cross_b.stiffness.mean: -{0}}}"
    sweep = f"sweep={{mesh_frequency: [0.5, 5], s: [{', '.join(entry.format(s) for s in coupling)}]}}"
    out = tmp_path / "result.h5"
    options = ["--set", sweep, "--set", "methods={natural_frequencies: {}, perturbation: {}}"]
    succeeds("sweep", HERE / "d1_mean_system_unstable.yaml", "-o", out, *options)
    with open_result(out) as tree:
        for group in ("modes", "natural_frequencies"):
            assert "damped" in tree[group]["natural_frequency"].attrs["long_name"]
            symmetric = tree[group]["symmetric_frequency"].values.reshape(-1, 2)
            np.testing.assert_allclose(symmetric, np.broadcast_to([1, 1.1**0.5], symmetric.shape), rtol=1e-14)
        found = tree["natural_frequencies"]["natural_frequency"].values
        _, artists = draw(tree, "campbell", select={"s": "0.5"})
        drawn = [line.get_ydata()[0] for line in artists["panels"][0]["modes"]]
    for s, own in zip(coupling, found, strict=True):
        stiffness = [[1.1, s], [-s, 1.0]]
        whole = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.array(stiffness), -0.02 * np.eye(2)]])
        expected = sorted(w for w in np.linalg.eigvals(whole).imag if w > 0)
        assert sorted(own) == pytest.approx(expected, rel=1e-12)  # rounding of a matrix of four rows
    assert drawn == pytest.approx(list(found[-1]))
    assert "damped natural frequencies" in [text.get_text() for text in artists["legend"].get_texts()]


def test_nothing_is_said_of_stable_speeds_where_there_are_none(tmp_path: Path) -> None:
    text = report(tmp_path, "d1b_negative_damping")
    assert "The mean system is unstable by itself" in text
    assert "neither proved nor counted" not in text


def test_a_motion_belongs_to_the_mode_it_resembles() -> None:
    """A constant term that stiffens the slower coordinate beyond the faster one: w^2 of 1.1 and 4 become 9.1 and 4."""
    term = "{name: stiff, left: [1, 0], right: [1, 0], stiffness: {mean: 8.0}}"
    found = facts("d1b_negative_damping", "--set", f"terms=[{term}]")["mean_system"]
    assert found["frequency"] == pytest.approx([2.0, 9.1**0.5], rel=1e-6)  # damping takes (c/2)^2 = 2.5e-7 of w^2
    assert found["mode"] == [2, 1]


def test_a_report_is_cheap_and_in_the_unit_typed(tmp_path: Path) -> None:
    """A reducer of 59 and 21 mesh cycles: the damped search alone, where the undamped one would take an hour."""
    text = report(tmp_path, "a3_report_never_ends")
    assert "Stable in the whole operating range" in text
    assert "input speed (rpm)" in text
    assert len(re.search(r"the worst are ([^.]*?) rpm", text).group(1).split(", ")) == 3  # type: ignore[union-attr]


def test_a_report_in_rpm_or_in_the_unit_asked_for(tmp_path: Path) -> None:
    """2w6/9 of the two-stage gearbox, which first order leaves out, is the widest: 6840.4 to 6945.6 rpm."""
    text = report(tmp_path, "a5_report_in_rad_per_s")
    assert "5 regions of instability" in text
    assert "the widest 2w6/9 from 6840.4 to 6945.6 rpm" in text
    assert text.count(" 0.005 open ") == 5
    system = build(load(HERE / "a5_report_in_rad_per_s.yaml").system)
    per_rpm = 20 * np.pi / 30  # 20 teeth
    inside = solve(system, per_rpm * np.array([6830.0, 6841.0, 6900.0, 6945.0, 6956.0])).stable[0]
    assert inside.tolist() == [1, 0, 0, 0, 1]
    asked = report(tmp_path, "a5_report_in_rad_per_s", "--unit", "Hz")
    assert "the widest 2w6/9 from 114.01 to 115.76 Hz" in asked


def report(folder: Path, name: str, *options: str) -> str:
    """A report as text."""
    out = folder / "page.html"
    out.unlink(missing_ok=True)
    succeeds("report", HERE / f"{name}.yaml", "-o", out, *options)
    text = re.sub(r"<style>.*?</style>|<[^>]+>", " ", out.read_text(), flags=re.S)
    return re.sub(r"\s+", " ", unescape(text))
