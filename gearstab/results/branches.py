"""The group ``branches`` of a result, as a dataset that can be cut.

Its ``mesh_frequency`` of every motion has the name of an axis of the sweep, which the group would inherit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gearstab.errors import ResultError

if TYPE_CHECKING:
    import xarray as xr


def branches_of(tree: xr.DataTree) -> xr.Dataset:
    """Return the group with the axes over which it stands. Raises ResultError for one of an older layout."""
    own = tree.children["branches"].to_dataset(inherit=False)
    if "branch_frequency" in own or "kind" in own:
        raise ResultError("its branches were written by an older gearstab, in another layout: run the sweep again")
    own = own.reset_coords([name for name, item in own.coords.items() if item.ndim > 1])
    return own.assign_coords({name: tree.coords[name] for name in own.dims if name in tree.coords})
