"""Every command on random configurations: no warning of NumPy (they are errors here), no traceback, an answer."""

import json
import os
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from random_documents import Document, documents
from scenes import examples, scene_data, written

from gearstab.cli import group
from gearstab.results import open_result


def called(*words: object) -> str:
    """The output of a command, which must end well."""
    done = CliRunner().invoke(group, list(map(str, words)))
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.output


def answered(document: Document, folder: Path) -> None:
    """Run all commands on a configuration and look at what the sweep left."""
    path, out = written(folder, json.dumps(document), "random.yaml"), folder / "random.h5"
    called("check", path)
    called("sweep", path, "-o", out, "--overwrite", "-j", 1)
    with open_result(out) as tree:
        found = tree["floquet"].load()
    assert set(found["stable"].values.ravel().tolist()) <= {0, 1}
    assert found["growth_rate"].notnull().all()
    called("info", path)
    if "respond" in document:
        called("respond", path, "-o", folder / "response.h5")


@examples(4, 300)
@given(document=documents())
def test_ordinary_and_odd_systems(document: Document, tmp_path_factory: pytest.TempPathFactory) -> None:
    if "GEARSTAB_THOROUGH" not in os.environ and any("waveform" in mesh for mesh in document["system"]["meshes"]):
        # Edges of smooth waves take seconds.
        document["methods"].pop("boundaries", None)
    answered(document, tmp_path_factory.mktemp("random"))


TWO_MESHES = scene_data("random_two_meshes")
IRRATIONAL = scene_data("random_irrational")
BARELY: Document = {
    "kind": "gear_pair", "equivalent_mass": 0.05, "damping_ratio": 0.1,
    "meshes": [{"name": "mesh", "mean_stiffness": 0.05, "epsilon": 5e-324, "contact_ratio": 2.5,
                "waveform": {"kind": "trapezoidal", "ramp": 5e-324}}],
}  # fmt: skip

UNDAMPED: Document = {
    "kind": "matrices", "mass": [[1, 0], [0, 1]], "stiffness": [[0, 0], [0, 0]], "damping_ratio": 2.3e-308,
    "meshes": [{"name": "mesh", "direction": [0, 1], "mean_stiffness": 1, "epsilon": 0.3, "contact_ratio": 1.5}],
}  # fmt: skip


@pytest.mark.parametrize(
    ("system", "methods"),
    [
        (TWO_MESHES, {"floquet": {"exponents": True}, "required_damping": {}}),
        (IRRATIONAL, {"floquet": {"lyapunov": {"cycles": 20}}}),
        (BARELY, {"floquet": {}, "perturbation": {"order": 2}, "boundaries": {}}),
        (UNDAMPED, {"floquet": {}, "boundaries": {}}),
    ],
    ids=["a constant mesh beside a smooth one", "irrational and smooth", "all but zero", "damped by next to nothing"],
)
def test_what_has_failed(system: Document, methods: Document, tmp_path: Path) -> None:
    sweep = {"mesh_frequency": {"start": 0.5, "stop": 4.0, "num": 6}}
    answered({"system": system, "sweep": sweep, "methods": methods}, tmp_path)
