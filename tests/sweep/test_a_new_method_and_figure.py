"""A method, an output variable and a figure are one class or object and one line in a table each: toys of them."""

import json
import subprocess
import sys
from pathlib import Path

TOYS = """
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from gearstab.config.model.fields import Section
from gearstab.methods import METHODS, POINTS, Outcome
from gearstab.methods.base import Method
from gearstab.methods.floquet import Floquet
from gearstab.results.variables import GRID, Variable


class PowerOptions(Section):
    '''The mesh frequency to a power.'''

    power: float = 2.0


class Power(Method):
    name = "power"
    Options = PowerOptions
    frequency = POINTS

    def variables(self):
        return (Variable("power_of_frequency", (GRID,), "f8", "1", "mesh frequency to a power"),)

    def run(self, mesh_frequency):
        value = np.broadcast_to(mesh_frequency**self.options.power, (self.system.rows, mesh_frequency.size))
        return Outcome({"power_of_frequency": value})

    def cost(self):
        return 1.0


class WithDecrement(Floquet):
    def variables(self):
        return (*super().variables(), Variable("decrement", (GRID,), "f8", "1", "growth within a mesh cycle"))

    def run(self, mesh_frequency):
        found = super().run(mesh_frequency)
        decrement = found.values["growth_rate"] * 2 * np.pi / mesh_frequency
        return replace(found, values=found.values | {"decrement": decrement})


METHODS["power"] = Power
METHODS["floquet"] = WithDecrement
"""

USE = """
import json
import sys
from pathlib import Path

from gearstab import plots
from gearstab.config import ConfigError, load
from gearstab.results import open_result
from gearstab.sweep import plan, run

CONFIG = '''
system:
  kind: gear_pair
  equivalent_mass: 1
  meshes: [{mean_stiffness: 1, epsilon: 0.3, contact_ratio: 1.5}]
sweep: {epsilon: [0.1, 0.2], mesh_frequency: [1.0, 2.0, 3.0]}
methods: {floquet: {}, power: {power: POWER}}
'''


def configured(power):
    path = Path(sys.argv[1]) / "toy.yaml"
    path.write_text(CONFIG.replace("POWER", power))
    return load(path)


try:
    configured("much")
except ConfigError as error:
    refused = [problem.path for problem in error.problems]
out = Path(sys.argv[1]) / "toy.h5"
run(plan(configured("3")), out, jobs=1)
with open_result(out) as tree:
    tree = tree.load()
before = plots.default_kind(tree, plots.Request())
toy = plots.Kind("toy", "an empty sheet", lambda tree, request: (Figure(), {"drawn": True}), lambda c: c.holds("power"))
plots.KINDS["toy"] = toy
floquet = tree["floquet"]
print(json.dumps({
    "refused": refused,
    "dims": tree["power"]["power_of_frequency"].dims,
    "values": tree["power"]["power_of_frequency"].values.tolist(),
    "power": float(tree["power"].attrs["power"]),
    "off": float(abs(floquet["decrement"] - floquet["growth_rate"] * 2 * np.pi / floquet["mesh_frequency"]).max()),
    "name": floquet["decrement"].attrs["long_name"],
    "kinds": [before, plots.default_kind(tree, plots.Request())],
    "drawn": plots.draw(tree)[1]["drawn"],
    "map": list(plots.draw(tree, "map", variable="power_of_frequency")[1]),
}))
"""


def test_new_ones_are_one_class_and_one_line(tmp_path: Path) -> None:
    """In a process of its own: the section ``methods`` is put together from the table when it is first imported."""
    done = subprocess.run([sys.executable, "-c", TOYS + USE, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["refused"] == ["methods.power.power"]
    assert found["dims"] == ["epsilon", "mesh_frequency"]
    assert found["values"] == [[1.0, 8.0, 27.0]] * 2
    assert found["power"] == 3.0
    assert found["off"] == 0.0
    assert found["name"] == "growth within a mesh cycle"
    assert found["kinds"] == ["map", "toy"]
    assert found["drawn"]
    assert "cells" in found["map"]
