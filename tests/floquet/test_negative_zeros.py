"""Results hold no negative zeros, which read as if something decayed."""

import h5py
import numpy as np
import pytest
from scenes import ran, scene_text

SWEEP = scene_text("negative_zeros_sweep")
APART = scene_text("negative_zeros_apart")


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
