"""Results in memory hold every variable, and those saved are as good as the files of the commands."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scenes import CONFIGS, TRAIN, ran, scene_text, succeeds, written
from test_runs import same

import gearstab as gs
from gearstab.errors import OutputError, ResultError
from gearstab.methods import METHODS
from gearstab.results import open_result
from gearstab.results.read import is_sealed

UNCERTAIN = "{parameters: {meshes.first.contact_ratio: {normal: [1.5, 0.03]}}, samples: 16}"
EVERY = f"""\
{TRAIN}
  damping_ratio: 0.02
  load: [0, 0, 1]
sweep: {{mesh_frequency: [5.0, 5.6], epsilon: [0.2, 0.3]}}
methods:
  boundaries: {{tolerance: 1.0e-9}}
  passage: {{rate: [3]}}
  tolerance: {UNCERTAIN}
  tongue_probability: {{samples: 16}}
"""
"""A sweep of every method; those without options are added."""
PAIR = scene_text("saved_results")


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The configuration of a pair."""
    return written(tmp_path_factory.mktemp("pair"), PAIR)


@pytest.fixture(scope="module")
def tree(pair: Path) -> xr.DataTree:
    return gs.sweep(pair, jobs=1)


def test_every_variable_of_every_method_is_in_memory_and_saved(tmp_path: Path) -> None:
    named = {line.strip().partition(":")[0] for line in EVERY.splitlines()}
    others = [name for name in METHODS if name not in named and name != "branches"]
    config = written(tmp_path, EVERY + "".join(f"  {name}: {{}}\n" for name in others))
    every = gs.sweep(config, jobs=1)
    assert {*METHODS} - {"branches"} <= set(every.children)  # branches are of systems with backlash
    for node in every.subtree:
        for name, item in node.to_dataset(inherit=False).variables.items():
            assert item.values.shape == item.shape, f"{node.path} {name}"
    # A variable with the name of a group was the one that stayed in the closed file.
    assert {"required_damping", "tolerance", "tongue_probability"} <= {
        str(name) for node in every.subtree for name in node.data_vars
    }
    assert np.isfinite(every["required_damping"]["required_damping"]).all()
    gs.save(every, tmp_path / "saved.h5")
    with open_result(tmp_path / "saved.h5") as saved:
        same(every, saved)


def test_a_saved_result_is_the_file_of_the_command(pair: Path, tree: xr.DataTree) -> None:
    out, saved = pair.with_name("out.h5"), pair.with_name("saved.h5")
    succeeds("sweep", pair, "-o", out, "-q")
    gs.save(tree, saved)
    with open_result(out) as one, open_result(saved) as other:
        same(one, other)
        assert other.attrs["config_file"] == one.attrs["config_file"] == "case.yaml"
    assert is_sealed(saved)
    # The command takes it for its own: nothing is computed again, and it can be extended.
    assert "already complete" in ran("sweep", pair, "-o", saved).output
    finer = ("--set", "sweep.epsilon=[0.2, 0.25, 0.3]", "-o", pair.with_name("finer.h5"))
    extended = ran("sweep", pair, *finer, "--extend", saved)
    assert f"floquet: 10 of 15 points are taken over from {saved}" in extended.output
    for words in (("info", saved), ("plot", saved, "-o", pair.with_name("saved.png")), ("export", saved, "-o", "-")):
        succeeds(*words)


def test_responses_and_designs_are_saved(tmp_path: Path) -> None:
    respond = gs.load(CONFIGS / "oh_grosh_barber_2005" / "fig4a.yaml", {"respond.cycles": 3})
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}
    design = {"range": {"mesh_frequency": [1.5, 2.5]}, "variables": {"contact_ratio": {"values": [1.5, 1.8]}}}
    pair = {"kind": "gear_pair", "units": "none", "equivalent_mass": 1.0, "meshes": [mesh]}
    results = {
        "respond": gs.respond(respond),
        "design": gs.design({"system": pair, "design": design | {"minimise": "instability_width"}}),
    }
    for command, result in results.items():
        gs.save(result, tmp_path / f"{command}.h5")
        with open_result(tmp_path / f"{command}.h5") as read:
            same(result, read)
        assert json.loads(ran("info", tmp_path / f"{command}.h5", "--json").output)["provenance"]["command"] == command
    with pytest.raises(OutputError, match="is a result of gearstab design"):
        gs.save(results["respond"], tmp_path / "design.h5")


def test_a_result_that_xarray_wrote_is_read(tree: xr.DataTree, tmp_path: Path) -> None:
    path = tmp_path / "result.nc"
    tree.to_netcdf(path)
    with open_result(path) as read:
        same(tree, read)
    facts = json.loads(ran("info", path, "--json").output)
    assert facts["provenance"]["format_version"] == "1"
    assert not facts["unchanged"]
    for words in (("plot", path, "-o", tmp_path / "map.png"), ("export", path, "-o", "-")):
        succeeds(*words)
    # Read lazily and saved again, also in the place of the file itself, it has everything.
    with open_result(path) as read:
        gs.save(read, tmp_path / "again.h5")
    with open_result(tmp_path / "again.h5") as again:
        same(tree, again)
        gs.save(again, tmp_path / "again.h5")
    assert is_sealed(tmp_path / "again.h5")


def test_a_part_of_a_result_is_saved(tree: xr.DataTree, tmp_path: Path) -> None:
    part = tree.isel(epsilon=[1])
    gs.save(part, tmp_path / "part.h5")
    with open_result(tmp_path / "part.h5") as read:
        xr.testing.assert_equal(part.to_dataset(), read.to_dataset())
        xr.testing.assert_equal(part["floquet"].to_dataset(), read["floquet"].to_dataset())


def test_what_no_result_can_hold_is_one_line(tree: xr.DataTree, tmp_path: Path) -> None:
    odd = tree.copy()
    odd.attrs["note"] = {"a": 1}
    times = tree.copy()
    times["floquet/z"] = times["floquet/growth_rate"].astype("timedelta64[ns]")
    for wrong, message in (
        (xr.DataTree(), "this tree is no result of gearstab: its attribute gearstab_version is missing"),
        (odd, "the attribute note is of the type dict; a result holds numbers and texts"),
        (times, "/floquet: z has the type timedelta64[ns]; a result holds numbers and texts"),
    ):
        with pytest.raises(ResultError) as caught:
            gs.save(wrong, tmp_path / "out.h5")
        assert message in str(caught.value)
    with pytest.raises(OutputError, match=r"a result has a name that ends in \.h5, not in \.csv"):
        gs.save(tree, tmp_path / "out.csv")
    assert list(tmp_path.iterdir()) == []
