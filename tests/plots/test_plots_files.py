"""Figure files: every kind in every format, the same bytes every time, and the command that writes them."""

from __future__ import annotations

import io
import os
import re
import warnings

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import plot_results as made
import pytest
import xarray as xr
from matplotlib.texmanager import TexManager
from matplotlib.textpath import TextToPath
from plot_results import planetary
from scenes import ran

import gearstab as gs
from gearstab.cli.plot import points
from gearstab.cli.terminal import selections
from gearstab.errors import PlotError, ResultError, UserError
from gearstab.info.result import describe, report
from gearstab.plots import KINDS, draw
from gearstab.plots.axes import LISTS
from gearstab.plots.drawing.style import save, style
from gearstab.plots.drawing.text import plain
from gearstab.results.export import export
from gearstab.results.write import result_tree, write_result

SIGNATURES = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}

OF_DESIGNS = ("contour", "tornado", "design", "pareto")
"""Drawn from the result of a design, see tests/design."""


def branches():
    """A short branch of motions with backlash, from the program: by hand it would be no motion."""
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5, "backlash": 2.0}
    pair = {"kind": "gear_pair", "units": "none", "equivalent_mass": 1.0, "damping_ratio": 0.05, "load": [0.5]}
    method = {"start": ["rest"], "at": [0.9], "points": 10, "cycles": 60}
    sweep = {"mesh_frequency": {"start": 0.8, "stop": 1.0, "num": 3}}
    return gs.sweep({"system": pair | {"meshes": [mesh]}, "sweep": sweep, "methods": {"branches": method}}, jobs=1)


def result_of(kind):
    """A small result that a kind of figure can be drawn from."""
    coords = made.axes(frequency=np.linspace(0.35, 7, 24), epsilon=np.linspace(0, 0.5, 13), phasing=[0.0, 0.5])
    groups = {
        "floquet": made.floquet_group(coords, damping=0.02),
        "perturbation": made.boundary_group(coords),
        "boundaries": made.boundary_group(coords),
        "uncoupled": made.boundary_group(coords, factor=1.2),
    }
    groups["floquet"]["growth_rate"].values[0, 3:5] = np.nan
    others = {
        "surface": made.two_amplitudes, "response": made.response, "work-precision": made.bench, "modes": planetary,
        "speeds": made.speeds, "spectrum": made.spectra, "pair": made.pair,
        "required-damping": made.required_damping, "phase-plane": made.backlash, "teeth": made.teeth,
        "probability": made.probability, "passage": made.passage, "waterfall": made.run_up, "orders": made.run_up,
        "campbell": made.crossing, "branches": branches,
    }  # fmt: skip
    return others.get(kind, lambda: made.tree(**groups))()


def options_of(kind):
    own = {"map": {"phasing": "0.5"}, "curve": {"epsilon": "0.3"}, "campbell": {"stiffness": "0.25"}}
    return {"select": own[kind]} if kind in own else {}


def written(tree, path):
    tree.to_netcdf(path, engine="h5netcdf")
    return path


@pytest.mark.parametrize(
    ("kind", "extension"),
    [
        # All kinds and all formats, and where time is short one format of each kind.
        pytest.param(kind, extension, marks=[pytest.mark.slow] * (k % len(SIGNATURES) != n))
        for k, kind in enumerate(kind for kind in KINDS if kind not in OF_DESIGNS)
        for n, extension in enumerate(SIGNATURES)
    ],
)
def test_every_kind_is_written_in_every_format(kind, extension, tmp_path):
    figure, _ = draw(result_of(kind), kind, dpi=80, **options_of(kind))
    path = tmp_path / f"figure{extension}"
    save(figure, path, "a title")
    assert path.read_bytes().startswith(SIGNATURES[extension])
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("extension", SIGNATURES)
def test_the_same_result_gives_the_same_bytes(extension, tmp_path):
    files = [tmp_path / f"{name}{extension}" for name in "ab"]
    for path in files:
        figure, _ = draw(result_of("map"), "map", dpi=80, **options_of("map"))
        save(figure, path, "a title")
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_large_map_stays_pixels_inside_a_vector_file(tmp_path):
    coords = made.axes(frequency=np.linspace(0.35, 7, 600), epsilon=np.linspace(0, 0.5, 300) ** 1.1)
    figure, _ = draw(made.tree(floquet=made.floquet_group(coords)), "map")
    for extension in (".pdf", ".svg"):
        path = tmp_path / f"map{extension}"
        save(figure, path)
        # 180,000 quadrilaterals would take more than 5 MB.
        assert path.stat().st_size < 500_000


@pytest.mark.parametrize("extension", SIGNATURES)
def test_letters_that_the_font_lacks_are_drawn_without_a_warning(extension, tmp_path):
    tree = result_of("map")
    tree.attrs["title"] = "歯車 ⚙ Շ"
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        figure, _ = draw(tree, "map", dpi=80, **options_of("map"))
        save(figure, tmp_path / f"figure{extension}", tree.attrs["title"])
    assert [str(warning.message) for warning in said if "Glyph" in str(warning.message)] == []


def test_drawing_leaves_the_parameters_of_matplotlib_alone(tmp_path):
    before = dict(mpl.rcParams)
    figure, _ = draw(made.response(), dpi=80)
    save(figure, tmp_path / "figure.png")
    assert dict(mpl.rcParams) == before


def test_a_style_sheet_changes_the_figure_and_nothing_after_it(tmp_path):
    sheet = tmp_path / "mine.mplstyle"
    sheet.write_text("axes.labelsize: 14\n")
    before = dict(mpl.rcParams)
    figure, _ = draw(made.response(), dpi=80, style=str(sheet))
    assert figure.axes[-1].xaxis.label.get_size() == 14
    save(figure, tmp_path / "figure.png", sheet=str(sheet))
    assert dict(mpl.rcParams) == before


def test_every_mistake_of_a_style_sheet_is_a_line(tmp_path):
    sheet = tmp_path / "mine.mplstyle"
    sheet.write_text("lines.linewidth: wide\naxes.nothing: 3\nfont.size 8\nfont.size: 8\n")
    with pytest.raises(PlotError) as told:
        draw(made.response(), dpi=80, style=str(sheet))
    found = str(told.value).splitlines()
    assert all(line.startswith("--style: ") and str(sheet) in line for line in found)
    assert sorted(int(re.findall(r"line (\d+)", line)[0]) for line in found) == [1, 2, 3]
    assert any("Could not convert 'wide' to float" in line for line in found)
    sheet.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PlotError, match="is not a text file"):
        draw(made.response(), dpi=80, style=str(sheet))


def test_text_by_latex_escapes_names_and_needs_its_programs(tmp_path, monkeypatch):
    """Names of users are text: LaTeX would read an ampersand or an underscore as an instruction."""
    monkeypatch.setattr("gearstab.plots.drawing.style.which", lambda program: f"/programs/{program}")
    with style("latex"):
        assert plain("Lin & Parker: mesh_1, 50 % {a}") == r"Lin \& Parker: mesh\_1, 50 \% \{a\}"
    assert plain("a & b_c $5") == r"a & b_c \$5"
    monkeypatch.setattr("gearstab.plots.drawing.style.which", lambda program: None)
    with pytest.raises(PlotError, match="latex, dvipng"):
        draw(made.response(), style="latex")


@pytest.mark.parametrize("kind", ["probability", "campbell", "orders", "spectrum", "modes", "teeth"])
def test_latex_gets_no_sign_that_means_something_to_it(kind, monkeypatch):
    """Every text of a figure, as matplotlib would hand it to LaTeX: names of users, units, and words of ours."""
    told: list[str] = []

    def size(_manager, text, points, renderer=None):
        told.append(text)
        return 0.4 * points * len(text), points, 0.2 * points

    monkeypatch.setattr("gearstab.plots.drawing.style.which", lambda program: program)
    monkeypatch.setattr(TexManager, "get_text_width_height_descent", classmethod(size))
    monkeypatch.setattr(TextToPath, "get_text_path", lambda *_args, **_look: (np.zeros((0, 2)), np.zeros(0, int)))
    tree = result_of(kind)
    tree.attrs["title"] = "50 % of R&D, #1_a"
    for node in tree.subtree:
        names = {name: node.coords[name] for name in ("mesh", "dof") if name in node.coords and name in node.dims}
        odd = {name: [f"{value}_& 5 %" for value in values.values] for name, values in names.items()}
        node.dataset = node.to_dataset(inherit=False).assign_coords(odd)
    figure, _ = draw(tree, kind, dpi=100, size="double", style="latex", **options_of(kind))
    with style("latex"):
        figure.draw_without_rendering()
    assert r"50 \% of R\&D, \#1\_a" in told
    outside = [re.sub(r"(?<!\\)\$.*?(?<!\\)\$", "", text, flags=re.DOTALL) for text in told]
    assert [text for text in outside if re.search(r"(?<!\\)[%&#_^~$]", text)] == []
    assert [text for text in told if re.search(r"(?<!\\)[%&#]", text)] == []


def test_an_installation_of_latex_that_lacks_a_package_is_told_in_one_line(tmp_path, monkeypatch):
    """As most installations do at first: matplotlib then raises an error of many lines."""
    for name in ("latex", "dvipng"):
        program = tmp_path / name
        program.write_text("#!/bin/sh\necho \"! LaTeX Error: File 'type1ec.sty' not found.\"\nexit 1\n")
        program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path))
    with pytest.raises(PlotError) as told, style("latex"):
        draw(made.response(), style="latex")[0].draw_without_rendering()
    assert str(told.value).endswith("LaTeX Error: File 'type1ec.sty' not found.")
    assert "\n" not in str(told.value)


def test_a_figure_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "figure.png"
    path.write_bytes(b"old")
    figure, _ = draw(made.response(), dpi=80)

    def full_disk(*_args, **_kwargs):
        raise OSError("no space left")

    monkeypatch.setattr(figure, "savefig", full_disk)
    with pytest.raises(OSError, match="no space"):
        save(figure, path)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["figure.png"]


# --- the command


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    coords = made.axes(frequency=np.linspace(0.35, 7, 24), epsilon=np.linspace(0, 0.5, 13), phasing=[0.0, 0.5])
    tree = made.tree(floquet=made.floquet_group(coords), perturbation=made.boundary_group(coords))
    return written(tree, tmp_path_factory.mktemp("results") / "train.h5")


def run(*arguments):
    return ran("plot", *arguments)


def test_the_figure_lies_beside_the_result(result):
    done = run(result, "--select", "phasing=0", "--dpi", "60")
    assert done.exit_code == 0, done.output
    assert done.stdout == ""
    assert str(result.with_suffix(".png")) in done.stderr
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_the_command_takes_a_kind_and_a_file(result, tmp_path):
    target = tmp_path / "new" / "figure.svg"
    done = run(result, "-o", target, "--kind", "slices", "--no-title", "--size", "double", "--x", "epsilon")
    assert done.exit_code == 0, done.output
    assert target.read_bytes().startswith(b"<?xml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--x", "speed"], ["speed", "mesh_frequency, epsilon, phasing"]),
        (["--select", "epsilon"], ["AXIS=VALUE"]),
        (["--select", "phasing=9"], ["phasing = 9", "0, 0.5"]),
        (["--select", "phasing=0", "--select", "phasing=0.5"], ["phasing twice"]),
        (["--kind", "response"], ["no time response"]),
        (["--kind", "map"], ["left over: phasing"]),
        (["--variable", "noise", "--kind", "slices"], ["noise", "growth_rate"]),
        (["--kind", "slices", "--style", "nowhere"], ["nowhere", "latex", "ggplot"]),
        (["-o", "figure.gif"], [".gif", ".png, .pdf, .svg"]),
        (["-o", "figure"], [".png, .pdf, .svg"]),
    ],
)
def test_mistakes_are_one_line_and_exit_2(result, arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(result, *arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    for word in words:
        assert word in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", ["missing", "text", "empty", "foreign", "folder"])
def test_a_file_that_is_no_result_is_one_line_and_exit_2(content, tmp_path):
    path = tmp_path / "other.h5"
    if content == "text":
        path.write_text("omega growth\n1 2\n")
    elif content == "empty":
        path.write_bytes(b"")
    elif content == "foreign":
        xr.Dataset({"temperature": ("time", np.zeros(3))}).to_netcdf(path, engine="h5netcdf")
    elif content == "folder":
        path.mkdir()
    done = run(path)
    assert done.exit_code == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "other.h5" in done.stderr


def test_selections_keep_what_follows_the_first_equals_sign():
    assert selections(("case=c1 = c2 = 1.5", "epsilon= 0.3")) == {"case": "c1 = c2 = 1.5", "epsilon": "0.3"}
    with pytest.raises(ResultError, match="AXIS=VALUE"):
        selections(("=3",))


@pytest.mark.parametrize("kind", ["map", "boundaries"])
def test_points_are_marked_where_they_lie(kind):
    _, artists = draw(result_of("map"), kind, marks={"A": (4.2, 0.3)}, **options_of("map"))
    cross, name = artists["marks"]
    assert (cross.get_xdata()[0], cross.get_ydata()[0]) == (4.2, 0.3)
    assert name.get_text() == "A"


def test_points_are_refused_where_there_is_no_map():
    with pytest.raises(PlotError, match="marks no points"):
        draw(result_of("modes"), "modes", marks={"A": (4.2, 0.3)})


def test_points_are_written_as_name_and_place():
    assert points(("A=4.2,0.3", "x=y = 1, 2")) == {"A": (4.2, 0.3), "x=y": (1.0, 2.0)}
    for text in ("A", "A=1", "A=1,2,3", "A=one,2"):
        with pytest.raises(PlotError, match="NAME=X,Y"):
            points((text,))


def test_exact_and_approximate_boundaries_are_told_apart():
    """A legend says which is which only where both are drawn."""
    tree = result_of("map")
    figure, _ = draw(tree, "map", **options_of("map"))
    (legend,) = figure.legends
    assert [t.get_text() for t in legend.get_texts()][:2] == ["exact boundaries", "first order"]
    del tree["perturbation"]
    figure, _ = draw(tree, "map", **options_of("map"))
    assert not any("first order" in t.get_text() for legend in figure.legends for t in legend.get_texts())


def test_a_title_may_be_given():
    tree = result_of("map")
    figure, _ = draw(tree, "map", title="Stability of a train", **options_of("map"))
    assert figure.get_suptitle().startswith("Stability of a train")


# Results in which something is empty, single or missing: no region, no event, runs that end at once, parts cut out.

DRAWN_WITHOUT_REGIONS = ("map", "slices", "curve", "boundaries", "campbell", "speeds", "required-damping", "modes")
"""Kinds that show regions, or go on without them."""


def cut(tree: xr.DataTree, dim: str, size: int) -> xr.DataTree:
    """The result with no more than ``size`` values along a dimension."""
    groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
    return xr.DataTree.from_dict({p: g.isel({dim: slice(size)}) if dim in g.sizes else g for p, g in groups.items()})


def blank(tree: xr.DataTree) -> xr.DataTree:
    """The result with NaN in the place of every number but those of coordinates."""

    def emptied(group: xr.Dataset) -> xr.Dataset:
        return group.map(lambda a: xr.full_like(a, np.nan) if a.dtype.kind == "f" else a).assign_attrs(group.attrs)

    # Not by map_over_datasets: to it, the mesh frequencies of branches are the axis of this name, which they inherit.
    return xr.DataTree.from_dict({node.path: emptied(node.to_dataset(inherit=False)) for node in tree.subtree})


def variants(tree: xr.DataTree, sizes: tuple[int, ...]) -> dict[str, xr.DataTree]:
    """Results by what is done to them: each list emptied, each dimension cut to a size, no numbers."""
    dims = list(dict.fromkeys(str(dim) for node in tree.subtree for dim in node.sizes))
    found = {f"{dim}=0": cut(tree, dim, 0) for dim in dims if dim in LISTS}
    return found | {f"{dim}={n}": cut(tree, dim, n) for dim in dims for n in sizes} | {"no numbers": blank(tree)}


@pytest.mark.parametrize("sizes", [(), pytest.param((0, 1), marks=pytest.mark.slow)], ids=["lists", "all"])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in OF_DESIGNS])
def test_a_figure_or_one_line(kind: str, sizes: tuple[int, ...]) -> None:
    for name, tree in variants(result_of(kind), sizes).items():
        try:
            # Layout and text are those of the other tests; limits, scales and ticks are asked for here.
            figure, _ = draw(tree, kind, dpi=50, **options_of(kind))
            for ax in figure.axes:
                _ = ax.get_xticks(), ax.get_yticks()
        except UserError as error:
            message = str(error)
            assert message, name
            assert "\n" not in message, name
            cut_off = name in ("side=1", "bound=1") or (name.endswith("=0") and name[:-2] not in LISTS)
            assert ("lacks values along" in message) == cut_off, name
            assert kind not in DRAWN_WITHOUT_REGIONS or name != "tongue=0", message
        plt.close("all")


@pytest.mark.parametrize("kind", ["surface", "pair", "teeth"])
def test_facts_and_tables(kind: str, tmp_path) -> None:
    tree = result_of(kind)
    tree.attrs["gearstab_version"] = "0"
    for number, part in enumerate(variants(tree, (0,)).values()):
        path = tmp_path / f"{number}.h5"
        write_result(path, result_tree(part))
        assert report(describe(path))
        group = next(iter(part.children))
        stream = io.BytesIO()
        rows, _ = export(path, None, stream, group)
        assert len(stream.getvalue().decode().splitlines()) == rows + 1


def test_the_deflection_of_a_pair_that_turns_back_is_drawn_whole() -> None:
    tree = result_of("pair")
    response = tree["response"]
    response["section_time"][:] = float(response["time"][-1]) + np.arange(response.sizes["cycle"])
    figure, artists = draw(tree, "pair", dpi=50)
    assert artists["deflection"] is not None
    plt.close(figure)
