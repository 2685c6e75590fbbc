"""Results hold no negative zeros, which read as if something decayed."""

import h5py
import numpy as np
import pytest
from scenes import TRAIN, ran

SWEEP = (
    TRAIN
    + """\
sweep:
  epsilon: [0.0, 0.3]
  mesh_frequency: {start: 0.35, stop: 7.0, num: 40}
methods:
  floquet: {exponents: true}
  perturbation: {order: 2}
  boundaries: {}
  uncoupled: {}
"""
)
APART = """\
system:
  kind: gear_pair
  equivalent_mass: 1.0
  damping_ratio: 0.05
  load: 0.5
  meshes: [{mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5, backlash: 2.0}]
respond: {mesh_frequency: 2.0, cycles: 20, initial: {displacement: [1.6]}}
"""


@pytest.mark.parametrize(
    ("command", "text", "changes"),
    [("sweep", SWEEP, []), ("sweep", SWEEP, ["--set", "damping_ratio=0.02"]), ("respond", APART, [])],
    ids=["sweep", "damped", "backlash"],
)
def test_zeros_have_no_sign(tmp_path, command, text, changes):
    path, out = tmp_path / "scene.yaml", tmp_path / "out.h5"
    path.write_text(text)
    done = ran(command, path, "-o", out, *changes)
    assert done.exit_code == 0, done.output
    negative = []

    def look(name, item):
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "f":
            values = item[()]
            if np.any((values == 0) & np.signbit(values)):
                negative.append(name)

    with h5py.File(out) as file:
        file.visititems(look)
    assert not negative
