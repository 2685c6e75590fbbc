"""Cost of samples of uncertain parameters: a probability map against a plain sweep of as many points."""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import process_time

from bench.measuring import show
from gearstab import ckernel
from gearstab.config import load
from gearstab.methods import SampledMethod
from gearstab.sweep import plan
from gearstab.sweep.compute import compute

SYSTEM = """
system:
  kind: two_stage
  inertias: [1.0, 0.3, 4.0]
  input_shaft_stiffness: 0.5
  tooth_ratio: 1
  damping_ratio: DAMPING
  meshes:
    - {name: first, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}
    - {name: second, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}
"""
PLAIN = """
sweep: {mesh_frequency: {start: 0.35, stop: 7.0, num: 8000}, epsilon: {start: 0.0, stop: 0.5, num: WIDE}}
methods: {floquet: {}}
"""
TOLERANCE = """
sweep: {mesh_frequency: {start: 0.35, stop: 7.0, num: 400}, epsilon: {start: 0.0, stop: 0.5, num: ROWS}}
methods:
  tolerance:
    samples: 1000
    sobol: SOBOL
    parameters:
      meshes.first.contact_ratio: {normal: [1.5, 0.03]}
      meshes.second.contact_ratio: {normal: [1.5, 0.03]}
      input_shaft_stiffness: {triangular: [0.4, 0.5, 0.6]}
"""


def seconds(text: str) -> tuple[int, float]:
    """Points, or samples of points, of a configuration, and the processor time that its blocks take."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.yaml"
        path.write_text(text)
        planned = plan(load(path))
    layout = planned.layouts[0]
    method = layout.method
    samples = method.design.size if isinstance(method, SampledMethod) else 1
    start = process_time()
    for block in layout.blocks():
        compute(planned, block)
    return layout.points * samples, process_time() - start


def main(rows: int = 200) -> None:
    """Run both, with and without damping and Sobol indices, and print the ratios of processor time per point."""
    title = f"Two-stage train, map of 400 x {rows} cells with 1,000 samples each, one processor"
    table = list[tuple[object, ...]]()
    with ckernel.using(threads=1):
        for damping in ("0", "0.01"):
            system = SYSTEM.replace("DAMPING", damping)
            plain = None
            for name, text in (
                ("plain sweep", PLAIN), ("probability", TOLERANCE.replace("SOBOL", "false")),
                ("probability and Sobol indices", TOLERANCE.replace("SOBOL", "true")),
            ):  # fmt: skip
                points, taken = seconds(system + text.replace("ROWS", str(rows)).replace("WIDE", str(50 * rows)))
                each = taken / points * 1e9
                plain = plain or each
                what = f"{name}{', damping ratio 1 %' if damping != '0' else ''}"
                table.append((what, f"{points:,}", each, each / plain))
    show(title, ("", "points", "ns per point", "x plain"), table)
