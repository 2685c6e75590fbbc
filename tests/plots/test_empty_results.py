"""Every figure, ``info`` and ``export`` of results in which something is empty, single or missing.

No region, no event and runs that end at once are ordinary results; others come about by a cut with xarray. A figure is
drawn, or one line says why not; nothing else may be raised.
"""

from __future__ import annotations

import io

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from test_plots_files import OF_DESIGNS, options_of, result_of

from gearstab.errors import UserError
from gearstab.info.result import describe, report
from gearstab.plots import KINDS, draw
from gearstab.plots.axes import LISTS
from gearstab.results.export import export
from gearstab.results.write import result_tree, write_result

MADE = [kind for kind in KINDS if kind not in OF_DESIGNS]
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

    return tree.map_over_datasets(emptied)


def variants(tree: xr.DataTree, sizes: tuple[int, ...]) -> dict[str, xr.DataTree]:
    """Results by what is done to them: each list emptied, each dimension cut to a size, no numbers."""
    dims = list(dict.fromkeys(str(dim) for node in tree.subtree for dim in node.sizes))
    found = {f"{dim}=0": cut(tree, dim, 0) for dim in dims if dim in LISTS}
    return found | {f"{dim}={n}": cut(tree, dim, n) for dim in dims for n in sizes} | {"no numbers": blank(tree)}


@pytest.mark.parametrize("sizes", [(), pytest.param((0, 1), marks=pytest.mark.slow)], ids=["lists", "all"])
@pytest.mark.parametrize("kind", MADE)
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
