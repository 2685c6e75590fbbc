"""A result that xarray writes itself, as ``docs/api.md`` shows it."""

import numpy as np

import gearstab as gs

pair = {
    "system": {
        "kind": "gear_pair",
        "equivalent_mass": 1.0,
        "damping_ratio": 0.02,
        "meshes": [{"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}],
    },
    "sweep": {"mesh_frequency": np.linspace(0.5, 2.5, 21), "epsilon": [0.1, 0.2, 0.3]},
    "methods": {"floquet": {}},
}
tree = gs.sweep(pair)
tree.to_netcdf("pair.nc", engine="h5netcdf")
gs.plot("pair.nc")
