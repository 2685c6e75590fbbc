"""Cases and ties that set the mesh frequency: points of operation instead of a grid."""

import numpy as np
from scenes import ran, scene_text

from gearstab.results import open_result

SYSTEM = scene_text("operating_points")
METHODS = "methods: {floquet: {}}\n"


def growth(folder, sweep, methods=METHODS):
    (folder / "points.yaml").write_text(SYSTEM + f"sweep:\n  {sweep}\n" + methods)
    target = folder / "points.h5"
    arguments = ["sweep", str(folder / "points.yaml"), "-o", str(target), "--overwrite", "-q"]
    result = ran(*arguments)
    assert result.exit_code == 0, result.output
    with open_result(target) as tree:
        return tree["floquet"].to_dataset().load()


def test_points_agree_with_the_grid(tmp_path):
    cases = "[{label: A, mesh_frequency: 4.2, phasing: 0}, {label: B, mesh_frequency: 4.2, phasing: 0.4}]"
    points = growth(tmp_path, f"case: {cases}\n  damping_ratio: [0, 0.01]")
    assert points["growth_rate"].dims == ("case", "damping_ratio")
    np.testing.assert_array_equal(points["mesh_frequency"], [4.2, 4.2])
    grid = growth(tmp_path, "phasing: [0, 0.4]\n  mesh_frequency: [2.0, 4.2]\n  damping_ratio: [0, 0.01]")
    # Stacks of another shape, whose products may be summed in another order.
    same = grid["growth_rate"].sel(mesh_frequency=4.2)
    np.testing.assert_allclose(points["growth_rate"], same, rtol=1e-12, atol=1e-13)


def test_tied_to_another_parameter(tmp_path):
    both = growth(tmp_path, "run: {targets: [mesh_frequency, phasing], values: [[2.0, 4.2, 5.0], [0.0, 0.0, 0.4]]}")
    grid = growth(tmp_path, "phasing: [0, 0.4]\n  mesh_frequency: [2.0, 4.2, 5.0]")["growth_rate"]
    np.testing.assert_allclose(both["growth_rate"], [grid[0, 0], grid[0, 1], grid[1, 2]], rtol=1e-12, atol=1e-13)
