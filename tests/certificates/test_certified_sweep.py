"""Certificates of a sweep: stored, proved again by ``gearstab verify``, refused where they were changed."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from scenes import opened, ran, refused, result_of, scene_text, succeeds, written

pytest.importorskip("flint")

from gearstab.certificates.segments import segments
from gearstab.certificates.verifier import CARRIED, COUNTED
from gearstab.cli.report.facts import curve_speeds, state_of
from gearstab.config import load
from gearstab.config.document.yaml import parse
from gearstab.design.problem import Span
from gearstab.plots import draw
from gearstab.results import open_result
from gearstab.sweep import Reporter
from gearstab.sweep.certificates import verify
from gearstab.systems import build

PLANETARY = Path(__file__).parents[2] / "configs" / "spinning" / "planetary.yaml"

CASE = scene_text("certified_sweep_case")
"""At epsilon 0.3 a region from 2.63 to 2.73."""


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("certificates")
    result_of(folder, CASE, "boundaries")
    return folder / "case.h5"


@pytest.fixture
def copied(stored: Path, tmp_path: Path) -> Path:
    for name in ("case.h5", "case.yaml"):
        shutil.copy(stored.parent / name, tmp_path / name)
    return tmp_path / "case.h5"


def test_all_pieces_are_proved_again(stored: Path) -> None:
    found = opened(stored)["boundaries"].to_dataset()
    assert (found["certified_share"] > 0.999).all()
    # The widest part left is next to an edge: the part of the range that is given up there.
    assert (found["uncertified_width"] < 4e-4).all()
    done = succeeds("verify", stored)
    count = int(np.isfinite(found["certificate_frequency"].values[:, 0]).sum())
    assert f"{count} of {count} certificates proved" in done.stdout
    assert "theorem" in done.stdout


def test_pieces_agree_with_the_regions(stored: Path) -> None:
    found = opened(stored)["boundaries"].to_dataset()
    for row in range(2):
        ends = found["certificate_frequency"].values[:, :, row]
        outside = found["certificate"].values[:, row, 0]
        edges = found["boundary_frequency"].values[:, :, row]
        middle = ends.mean(axis=1)
        inside = ((edges[:, :1] < middle) & (middle < edges[:, 1:])).any(axis=0)
        there = np.isfinite(middle)
        assert np.array_equal(outside[there] > 0, inside[there])
    assert (found["certificate"].values[:, 1, 0] > 0).any()


def test_few_coordinates_need_no_numbers_but_the_ends(stored: Path) -> None:
    """A piece from edge to edge: one at epsilon 0.1, one before, in and after the region at 0.3; no coordinates."""
    found = opened(stored)["boundaries"].to_dataset()
    there = np.isfinite(found["certificate_frequency"].values[:, 0])
    assert there.sum(axis=0).tolist() == [1, 3]
    numbers = found["certificate"].sel(entry=["outside", "rate"]).values[there]
    assert set(numbers[:, 0].tolist()) == {0, 1}
    assert (numbers[:, 1] == COUNTED).all()
    assert np.isnan(found["certificate"].sel(entry="X[1,1]").values).all()


def test_info_says_how_much_has_certificates(stored: Path) -> None:
    line = next(line for line in ran("info", stored).stdout.splitlines() if line.startswith("certificates"))
    share = float(line.split()[1])
    assert 99.9 < share < 100
    assert "no part without is wider than" in line
    assert re.search(r"around 2 edges \S+ to \S+, half of them", line)


def test_the_gap_around_every_edge_is_stored(stored: Path) -> None:
    """At epsilon 0.3 a piece ends on each side of both edges, so far apart; at 0.1 there are none."""
    found = opened(stored)["boundaries"].to_dataset()
    gap, edges = found["uncertified_at_boundary"].values[..., 1], found["boundary_frequency"].values[..., 1]
    ends = found["certificate_frequency"].values[:, :, 1]
    assert np.isnan(found["uncertified_at_boundary"].values[..., 0]).all()
    assert np.isfinite(gap).sum() == 2
    for width, edge in zip(gap[np.isfinite(gap)], edges[np.isfinite(gap)], strict=True):
        below, above = np.nanmax(ends[ends <= edge]), np.nanmin(ends[ends >= edge])
        assert width == pytest.approx((above - below) / edge, rel=1e-12)
        assert 0 < width < 4e-4


def test_a_map_hatches_what_has_certificates(stored: Path) -> None:
    with open_result(stored) as tree:
        figure, _ = draw(tree, "boundaries")
        share = float(tree["boundaries"]["certified_share"].mean())
    (legend,) = figure.legends
    (label,) = [text.get_text() for text in legend.get_texts() if "certified" in text.get_text()]
    assert label == f"certified, {100 * share:.2f} % of the range"
    hatched = [item for item in figure.axes[0].collections if item.get_hatch()]
    # Pieces that follow one another are one patch: at epsilon 0.3 one before, in and after the region, at 0.1 one.
    assert [len(item.get_paths()) for item in hatched] == [4]


def test_a_report_says_how_much_has_certificates(stored: Path) -> None:
    config = load(stored.with_name("case.yaml"))
    system = build(config.system)
    spans = (Span(2.3, 2.5, 1.0, 1.0),)
    state = state_of("present", system, spans, config, curve_speeds(spans))
    assert "of the mesh frequencies have certificates" in state.uncovered


def row_and_piece(file: h5py.File) -> tuple[int, int]:
    """The first unstable piece at epsilon 0.3."""
    return 1, int(np.flatnonzero(file["boundaries/certificate"][:, 1, 0] > 0)[0])


def moved(file: h5py.File) -> None:
    row, piece = row_and_piece(file)
    file["boundaries/certificate_frequency"][piece, :, row] *= 1 - 1e-3


def said_stable(file: h5py.File) -> None:
    row, piece = row_and_piece(file)
    file["boundaries/certificate"][piece, row, :2] = 0, 1


def spoiled(file: h5py.File) -> None:
    row, piece = row_and_piece(file)
    file["boundaries/certificate"][piece, row, 1] = np.nan


def exchanged(file: h5py.File) -> None:
    row, piece = row_and_piece(file)
    file["boundaries/certificate"][piece, row] = file["boundaries/certificate"][0, row]


@pytest.mark.parametrize("forge", [moved, said_stable, spoiled, exchanged])
def test_a_changed_certificate_is_named_and_the_rest_kept(copied: Path, forge: Callable[[h5py.File], None]) -> None:
    with h5py.File(copied, "r+") as file:
        forge(file)
    done = ran("verify", copied)
    assert done.exit_code == 1
    named = [line for line in done.stderr.splitlines() if "not proved" in line]
    assert len(named) == 1
    assert "epsilon 0.3: not proved" in named[0]
    total = int(done.stdout.split(" of ")[1].split()[0])
    assert f"{total - 1} of {total} certificates proved" in done.stdout


def test_a_share_or_an_edge_that_the_pieces_do_not_make_up_is_told(copied: Path) -> None:
    """A share that is too large, a piece that is taken out, an edge that is moved: all pieces left are proved."""
    kept = copied.read_bytes()

    def larger_share(file: h5py.File) -> None:
        file["boundaries/certified_share"][1] = 1.0

    def fewer_pieces(file: h5py.File) -> None:
        file["boundaries/certificate"][0, 1, 0] = np.nan

    def moved_edge(file: h5py.File) -> None:
        file["boundaries/boundary_frequency"][...] *= 1.01

    for forge in (larger_share, fewer_pieces, moved_edge):
        copied.write_bytes(kept)
        with h5py.File(copied, "r+") as file:
            forge(file)
        done = ran("verify", copied)
        assert done.exit_code == 1
        assert "epsilon 0.3: not proved: what is stored about the certified share" in done.stderr
        assert "epsilon 0.1" not in done.stderr


def test_a_row_under_another_name_is_refused(copied: Path) -> None:
    with h5py.File(copied, "r+") as file:
        file["epsilon"][...] = file["epsilon"][...][::-1]
    assert "its values of epsilon are not those of its configuration" in refused("verify", copied)


def test_another_configuration_proves_nothing_of_this_one(copied: Path) -> None:
    """With the digest that fits it: contact ratios that move both edges."""
    with h5py.File(copied, "r+") as file:
        given = str(file.attrs["config"]).replace("contact_ratio: 1.5", "contact_ratio: 1.7")
        file.attrs["config"] = given
        file.attrs["config_digest"] = load(parse(given, "case").data, source=copied.with_name("case.yaml")).digest
    done = ran("verify", copied)
    assert done.exit_code == 1
    assert "epsilon 0.3: not proved" in done.stderr


POINTS = CASE.replace("[2.2, 2.9]", "[2.0, 2.2, 2.7, 2.9]").replace("boundaries", "floquet")


def test_points_of_a_grid_are_marked_and_proved_again(tmp_path: Path) -> None:
    found = result_of(tmp_path, POINTS, "floquet")
    assert (found["certified"] == 1).all()
    assert set(found["stable"].values.ravel().tolist()) == {0, 1}
    done = succeeds("verify", tmp_path / "case.h5")
    assert "the verdict at 100 % of the points" in done.stdout
    with h5py.File(tmp_path / "case.h5", "r+") as file:
        stable = file["floquet/stable"]
        stable[2, 1] = 1 - stable[2, 1]
    done = ran("verify", tmp_path / "case.h5")
    assert done.exit_code == 1
    assert "epsilon 0.3: not proved stable from 2.7 to 2.7" in done.stderr


LONG = CASE.replace("0.01\n", "0.02\n").replace("tooth_ratio: 1\n", 'tooth_ratio: "97/101"\n')
LONG = LONG.replace("[2.2, 2.9]", "[2.735, 2.741]").replace("[0.1, 0.3]", "[0.3]")
"""Some 400 segments; an edge at 2.7425."""


def test_a_long_period_is_proved_by_a_form_that_is_carried_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As is done with matrices of a million numbers, which take minutes."""
    monkeypatch.setattr("gearstab.certificates.covering.NUMBERS", 1000)
    found = result_of(tmp_path, LONG, "boundaries")
    numbers = found["certificate"].values[:, 0]
    assert (numbers[:, 0] == 0).all()
    assert (numbers[:, 1] == CARRIED).all()
    assert found["certified_share"] > 0.999
    succeeds("verify", tmp_path / "case.h5")
    # What reaches over the edge by a thousandth is refused, and what ends nowhere.
    with h5py.File(tmp_path / "case.h5", "r+") as file:
        file["boundaries/certificate_frequency"][-1, 1, 0] *= 1 + 1e-3
    done = ran("verify", tmp_path / "case.h5")
    assert done.exit_code == 1
    assert f"{len(numbers) - 1} of {len(numbers)} certificates proved" in done.stdout
    with h5py.File(tmp_path / "case.h5", "r+") as file:
        file["boundaries/certificate_frequency"][-1, 1, 0] = np.nan
    assert ran("verify", tmp_path / "case.h5").exit_code == 1


def test_a_file_that_is_cut_short_is_refused(copied: Path) -> None:
    copied.write_bytes(copied.read_bytes()[:-4000])
    assert "damaged" in refused("verify", copied)


def test_a_result_without_certificates_is_refused(tmp_path: Path) -> None:
    result_of(tmp_path, CASE.replace("{certificate: true}", "{}"), "boundaries")
    assert "holds no certificates" in refused("verify", tmp_path / "case.h5")


class Interrupting(Reporter):
    """Stops after the first part, or counts what there is to do."""

    def __init__(self, stops: bool) -> None:
        self.stops, self.done = stops, -1

    def begin(self, method: str, points: int, done: int, seconds: float | None, together: int) -> None:
        self.done = done

    def advance(self, points: int, unstable: int, failed: int) -> None:
        if self.stops:
            raise KeyboardInterrupt


def test_an_interrupted_run_goes_on_where_it_was(copied: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        verify(copied, 1, Interrupting(True))
    again = Interrupting(False)
    rows = verify(copied, 1, again)
    assert again.done == min(16, rows[0].pieces) == rows[0].earlier
    assert not any(row.refused for row in rows)
    assert not copied.with_name("case.h5.verified").exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("{certificate: true}", "{certificate: true, modes: [1, 2]}", "whole system"),
        ("contact_ratio: 1.5}", "waveform: {kind: fourier, sin: [1.0]}}", "constant between jumps"),
    ],
)
def test_what_has_no_certificates_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert said in refused("check", written(tmp_path, CASE.replace(old, new)))


def test_springs_that_give_way_while_the_speed_follows_are_refused(tmp_path: Path) -> None:
    """Their stiffness is no polynomial of the speed; with the carrier's speed held it is a number, and accepted."""
    given = PLANETARY.read_text().replace("boundaries: {}", "boundaries: {certificate: true}")
    said = refused("check", written(tmp_path, given))
    assert "methods.boundaries.certificate: needs springs that do not give way" in said
    assert "hold the speed, or remove it" in said
    with pytest.raises(ValueError, match="go with the speed or its square"):
        segments(build(load(PLANETARY).system))
    held = given.replace("carrier_speed: from_teeth", 'carrier_speed: {speed: "100 rpm"}')
    range_of_input = 'input_speed: {start: "500 rpm", stop: "30000 rpm"'
    held = held.replace(range_of_input, "mesh_frequency: {start: 1.0e+3, stop: 2.0e+3")
    succeeds("check", written(tmp_path, held))


def test_python_flint_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearstab.methods.base.find_spec", lambda name: None)
    assert "gearstab[verify]" in refused("sweep", written(tmp_path, CASE))


SHAFT = scene_text("certified_shaft")
"""At low speeds unstable in tongues only, at high ones by itself."""


@pytest.mark.parametrize("speed", ["speed: 0.05", "speed: 4.0", 'speed_ratio: "1/15"'])
def test_systems_with_speeds_of_rotation_are_proved_as_they_turn(tmp_path: Path, speed: str) -> None:
    found = result_of(tmp_path, SHAFT.replace("speed: 0.05", speed), "boundaries")
    assert found["certified_share"] > 0.999
    points = opened(tmp_path / "case.h5")["floquet"].to_dataset()
    stable, ends = points["stable"].values, found["certificate_frequency"].values
    assert (points["certified"] == 1).all()
    assert set(stable.tolist()) == {"speed: 4.0": {0}}.get(speed, {0, 1})
    for at, own in zip(points["mesh_frequency"].values, stable.tolist(), strict=True):
        (inside,) = np.nonzero((ends[:, 0] <= at) & (at <= ends[:, 1]))
        assert all((found["certificate"].values[inside, 0] == 0) == own)
    succeeds("verify", tmp_path / "case.h5")
