"""``gearstab report``: one file, with what was found out."""

from __future__ import annotations

import base64
import os
import pty
import re
import subprocess
import sys
from contextlib import suppress
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from scenes import CONFIGS, TRAIN, ran, scene_text, succeeds, written

from gearstab.cli.report import BulletList, Heading, Page, Picture, Table, Text, facts, html
from gearstab.cli.report.content import page
from gearstab.cli.report.pdf import MARGIN, PAPER, pdf, sheets
from gearstab.config import load
from gearstab.floquet import frequencies, solve
from gearstab.perturbation import Tongue
from gearstab.plots.drawing.style import style
from gearstab.systems import build

SWEEP = scene_text("report_sweep")
DESIGN = scene_text("report_design")
PAIR = scene_text("report_pair")
LOAD = "  load: [1.0, 0.0, 0.5]\n"


def plain(data: str) -> str:
    """A page as text."""
    return unescape(re.sub(r"<[^>]+>", " ", re.sub(r"<style>.*?</style>", "", data, flags=re.S)))


@pytest.fixture(scope="module")
def proposed(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("report")
    succeeds("report", written(folder, TRAIN + DESIGN), "-o", folder / "page.html")
    return (folder / "page.html").read_text()


def test_one_file_with_its_pictures(proposed: str) -> None:
    sources = re.findall(r'(?:src|href)="([^"]*)"', proposed)
    assert sources
    for source in sources:
        kind, data = source.split(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data).startswith(b"\x89PNG")


def test_what_it_says(proposed: str) -> None:
    """2w3 in phase: 4.9001 to 5.9256, closed by a damping ratio of 0.0949; out of phase it is an eighth as wide."""
    text = plain(proposed)
    for words in ("Unstable: 1 region", "2w3", "4.9001 to 5.9256", "proposed", "c1 - c2 + 2h = 1",
                  "Assumptions and limits", "config digest", "gearstab version"):  # fmt: skip
        assert words in text, words
    (required,) = re.findall(r"a damping ratio of (\S+) of all modes", text)[:1]
    # The one that is printed was tried; the tries are some per cent apart.
    assert 0.0949 <= float(required) <= 1.1 * 0.0949
    # Both designs are judged.
    assert text.count("Regions in the operating range") == 2
    # The reasons stand once, in a list of their own.
    assert "Why, by first-order theory" in proposed
    assert "why: " not in proposed


def test_the_picture_names_its_axis(tmp_path: Path) -> None:
    figures = []
    for name, unit in (("mesh_frequency", "Hz"), ("input_speed", "rpm")):
        sweep = (
            f'sweep: {{{name}: {{start: "3000 {unit}", stop: "9000 {unit}", num: 3}}}}\nmethods: {{floquet: {{}}}}\n'
        )
        found = page(load(written(tmp_path, PAIR + sweep)), lambda text: None)
        figures += [block.figure for block in found.blocks if isinstance(block, Picture)]
    labels = [figure.axes[-1].get_xlabel() for figure in figures]
    assert labels == [r"mesh frequency $\Omega$ (Hz)", "input speed (rpm)"]


def test_too_much_work_is_not_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not the time that a machine takes decides, but the meetings of multipliers: that of fewer speeds is less work."""
    config = load(written(tmp_path, TRAIN + SWEEP))
    system = build(config.system)
    assert facts.search_work(system, 4.0, 7.0) == pytest.approx(2 * facts.search_work(system, 4.0, 112 / 22), rel=1e-9)
    monkeypatch.setattr(facts, "MOST_WORK", facts.search_work(system, 3.0, 7.0))
    monkeypatch.setattr(facts.regions, "reach", lambda low, high: (low, high))
    assert "would take too long" not in str(page(config, lambda text: None).blocks[0])
    monkeypatch.setattr(facts, "MOST_WORK", 0.0)
    assert "would take too long" in str(page(config, lambda text: None).blocks[0])


def test_a_region_of_many_tongues_names_the_leading_ones() -> None:
    members = [Tongue(1, 1, s, "first", "higher", f"2w1/{s}", float(s)) for s in range(2, 7)]
    assert facts._label(1.0, 2.0, members, ()) == "2w1/2 & 2w1/3 & 2w1/4 and 2 more"
    assert facts._label(1.0, 2.0, members[:3], ()) == "2w1/2 & 2w1/3 & 2w1/4"
    rows = [
        facts.Reach(f"2w1/{s}", "higher", (1, 1), low, 2.0, 0.1, 0.0, facts.OPEN, "-")
        for s, low in ((4, 1.1), (5, 1.8))
    ]
    assert facts._label(1.0, 2.0, members, rows) == "2w1/4 & 2w1/2 & 2w1/3 and 2 more"


def test_steps_show_on_a_terminal_and_nowhere_else(tmp_path: Path) -> None:
    """Standard error of a child on a pseudo-terminal, then what is none."""
    source = written(tmp_path, TRAIN + SWEEP)
    call = [sys.executable, "-m", "gearstab", "report", str(source), "-o", str(tmp_path / "page.html")]
    ours, theirs = pty.openpty()
    with subprocess.Popen(call, stderr=theirs) as process:
        os.close(theirs)
        shown = b""
        with suppress(OSError):  # the end of the child closes it
            while data := os.read(ours, 4096):
                shown += data
    os.close(ours)
    assert process.returncode == 0
    assert b"uncertainty" in shown
    assert b"75%" in shown
    assert ran("report", source, "-o", tmp_path / "page.html").stderr == f"report: {tmp_path / 'page.html'}\n"


def test_damping_that_suffices(tmp_path: Path) -> None:
    source = written(tmp_path, TRAIN.replace("tooth_ratio: 1", "tooth_ratio: 1\n  damping_ratio: 0.1") + SWEEP)
    succeeds("report", source, "-o", tmp_path / "page.pdf")
    assert (tmp_path / "page.pdf").read_bytes().startswith(b"%PDF-")
    found = page(load(source), lambda text: None)
    verdict = found.blocks[0]
    assert isinstance(verdict, Text)
    assert verdict.text.startswith("Stable in the whole operating range")
    table = next(b for b in found.blocks if isinstance(b, Table) and b.header[0] == "region")
    row = next(row for row in table.rows if row[0] == "2w3")
    assert row[3:7] == ["around 5.4234", "0.0949", "0.1", "closed by damping"]


def test_contact_and_uncertainty(tmp_path: Path) -> None:
    tolerance = "  tolerance: {samples: 64, parameters: {meshes.first.contact_ratio: {uniform: [1.4, 1.6]}}}\n"
    source = written(tmp_path, TRAIN.replace("  meshes:", LOAD + "  meshes:", 1) + SWEEP + tolerance)
    text = " ".join(b.text for b in page(load(source), lambda text: None).blocks if isinstance(b, Text))
    assert "Largest dynamic load factor" in text
    # In the middle of 2w3 every one of these trains is unstable.
    assert re.search(r"probability of instability of the given design is at most 1 ", text)


def test_a_train_whose_common_period_is_too_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(facts, "AFFORDABLE", 1)
    train = TRAIN.replace("tooth_ratio: 1", "tooth_ratio: 3/5\n  damping_ratio: 0.1\n" + LOAD.rstrip())
    found = page(load(written(tmp_path, train + SWEEP)), lambda text: None)
    text = " ".join(b.text for b in found.blocks if isinstance(b, Text))
    assert "one mesh frequency at a time" in text
    assert "Largest dynamic load factor" in text
    limits = next(b for b in found.blocks if isinstance(b, BulletList))
    assert "first-order theory" in limits.items[0]


def test_a_region_of_first_order_counts_as_open_where_vibration_grows(tmp_path: Path) -> None:
    damped = TRAIN.replace("tooth_ratio: 1", "tooth_ratio: 1\n  damping_ratio: 0.05")
    config = load(written(tmp_path, damped + SWEEP))
    system = build(config.system)
    for low, high, verdict in ((5.2, 5.6, facts.OPEN), (4.6, 4.8, facts.OPEN), (6.5, 6.6, facts.NOT_FOUND)):
        item = facts.Reach("2w3", "higher", (3, 3), low, high, np.nan, 0.05, facts.OPEN, "-")
        grows = solve(system, np.linspace(2 * low - high, 2 * high - low, 300)).growth_rate.max() > 0
        assert facts._looked_at(item, config, system).verdict == verdict
        assert grows == (verdict == facts.OPEN)


@pytest.fixture(scope="module")
def drivetrain() -> Page:
    """The common period is 2128 cycles of the first mesh: nothing is followed over it."""
    return page(load(CONFIGS / "drivetrains/nrel_5mw.yaml"), lambda text: None)


@pytest.mark.slow  # 45 s for its page; the train above goes the same way
def test_a_gearbox_of_a_long_common_period(drivetrain: Page) -> None:
    text = " ".join(b.text for b in drivetrain.blocks if isinstance(b, Text))
    assert "one mesh frequency at a time" in text
    assert "Largest dynamic load factor" in text
    limits = next(b for b in drivetrain.blocks if isinstance(b, BulletList))
    assert "first-order theory" in limits.items[0]


@pytest.mark.slow
def test_regions_of_first_order_in_which_nothing_grows_are_not_called_open(drivetrain: Page) -> None:
    """Growth rates decide, and the curve shows them: a region that is open has a rate above zero at its speeds."""
    table = next(b for b in drivetrain.blocks if isinstance(b, Table) and b.header[0] == "region")
    verdicts = [row[6] for row in table.rows]
    assert {"open", "no growth found"} <= set(verdicts)
    config = load(CONFIGS / "drivetrains/nrel_5mw.yaml")
    system = config.system.build()
    for row, verdict in zip(table.rows, verdicts, strict=True):
        if verdict != "open":
            continue
        low, high = (float(end) * 2 * np.pi / 60 * 56 for end in row[3].split(" to "))
        omega = np.linspace(2 * low - high, 2 * high - low, 80)
        assert frequencies.solve(system, omega, solve).growth_rate.max() > 0


def test_the_worst_speeds() -> None:
    """Local maxima, the ends included."""
    assert facts._peaks(np.array([3.0, 1.0, 2.0, 2.0, 0.0, 5.0])) == [0, 3, 5]
    assert facts._peaks(np.array([1.0])) == [0]


def test_a_rotor_that_whirls() -> None:
    """Its regions go with its speeds of rotation, and so do the numbers and damping ratios of motions."""
    blocks = page(load(CONFIGS / "spinning" / "rotor.yaml"), lambda text: None).blocks
    tables = {block.header[0]: block for block in blocks if isinstance(block, Table) and block.header[0]}
    rows = {row[0]: row for row in tables["region"].rows}
    assert rows["2w6"][6] == facts.OPEN
    assert rows["w2+w6"][6] == facts.CLOSED
    motions = tables["motion"].rows
    assert len(motions) == 6
    # That of wheel and pinion against each other hardly goes with the speed.
    assert float(rows["2w6"][5]) == pytest.approx(float(motions[5][2]), rel=1e-2)
    said = " ".join(block.text for block in blocks if isinstance(block, Text))
    assert "the widest mode 2 self-excited" in said


def test_mistakes(tmp_path: Path) -> None:
    source = written(tmp_path, TRAIN)
    assert ran("report", source, "-o", tmp_path / "page.html").exit_code == 2
    swept = written(tmp_path, TRAIN + SWEEP, "swept.yaml")
    assert ran("report", swept, "-o", tmp_path / "page.docx").exit_code == 2
    other = written(tmp_path, "<p>mine</p>", "mine.html")
    assert ran("report", swept, "-o", other).exit_code == 2
    assert other.read_text() == "<p>mine</p>"


def test_letters_that_mean_something_to_html_and_wide_tables() -> None:
    table = Table(["k" * 40] * 5, [["word " * 20] * 5])
    found = Page("a < b & c", [Heading("h"), Text("x > y"), BulletList(["<i>"]), table])
    data = html(found).decode()
    assert "<title>a &lt; b &amp; c</title>" in data
    assert "&lt;i&gt;" in data
    assert pdf(found).startswith(b"%PDF-")


def test_pages_hold_what_they_are_given() -> None:
    """Nothing leaves the page or lies over anything else, whatever its length; the header of a table comes again."""
    table = Table(["name", "k" * 40, "what closes it"], [[f"row{n}", "word " * 30, "x" * 90] for n in range(30)])
    items = BulletList([f"item{n} $ {'and so on ' * 20}" for n in range(12)])
    figure = Figure(figsize=(9.0, 4.0))
    figure.add_subplot().plot([0, 1])
    found = Page("A title " * 30, [Heading("h"), Text("text " * 900), items, table, Picture(figure, "A caption")])
    with style():
        pages = sheets(found)
        assert len(pages) > 3
        words = " ".join(text.get_text() for page in pages for text in page.texts)
        assert [n for n in range(30) if words.count(f"row{n} ") != 1] == []
        assert words.count("text") == 900
        headers = [sum(text.get_text() == "name" for text in page.texts) for page in pages]
        rows = [any(text.get_text().startswith("row") for text in page.texts) for page in pages]
        assert headers == list(map(int, rows))
        assert sum(headers) > 1
        for page in pages:
            boxes = [text.get_window_extent() for text in page.texts] + [ax.get_window_extent() for ax in page.axes]
            edges = np.array([(box.x0, box.y0, box.x1, box.y1) for box in boxes]) * 72 / page.dpi
            assert edges.min() > 15
            assert edges[:, 2].max() <= PAPER[0] - MARGIN + 5  # letters on whole pixels are a little wider
            lower, upper = edges[:, None, :2], edges[:, None, 2:]
            over = np.minimum(upper, edges[None, :, 2:]) - np.maximum(lower, edges[None, :, :2])
            assert ((over > 1.5).all(axis=-1).sum()) == len(edges)  # each one with itself alone
