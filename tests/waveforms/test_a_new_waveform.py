"""A waveform is one class in one file and one line in a table: a toy one is added, configured, swept and refused."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

TOY = """
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from gearstab.config.model.fields import Quantity
from gearstab.waveforms import WAVEFORMS, Waveform
from gearstab.waveforms.base import Keys, as_array


class SawtoothKeys(Keys):
    tilt: Annotated[float, Field(gt=0, le=1), Quantity()] | None = Field(
        default=None, title="tilt", description="sawtooth: the height of the rise (1)."
    )


@dataclass(frozen=True)
class Sawtooth(Waveform):
    said: ClassVar[str] = "rises all the time"
    keys: ClassVar[type[Keys]] = SawtoothKeys
    required: ClassVar[tuple[str, ...]] = ("tilt",)
    has_contact_ratio: ClassVar[bool] = False

    tilt: Any

    @classmethod
    def build(cls, spec, contact_ratio=None):
        return cls(as_array(spec["tilt"]))

    @property
    def batch(self):
        return np.shape(self.tilt)

    def value(self, x):
        return self.tilt * (np.asarray(x) - np.floor(x) - 0.5)

    def breakpoints(self):
        return np.zeros((*self.batch, 1))

    def extremes(self):
        return -0.5 * self.tilt, 0.5 * self.tilt


WAVEFORMS["sawtooth"] = Sawtooth
"""

USE = """
import json
import sys
from pathlib import Path

from gearstab.config import ConfigError, load
from gearstab.config.schema import schema
from gearstab.systems import build

folder = Path(sys.argv[1])


def system(wave, tilt):
    text = f'''
system:
  kind: gear_pair
  equivalent_mass: 1
  meshes: [{{mean_stiffness: 2, epsilon: 0.1, waveform: {wave}}}]
sweep: {{mesh_frequency: {{start: 1, stop: 2, num: 3}}, meshes.mesh.waveform.tilt: {tilt}}}
methods: {{floquet: {{}}}}
'''
    path = folder / "toy.yaml"
    path.write_text(text)
    return load(path)


def problems(*args):
    try:
        system(*args)
    except ConfigError as error:
        return [[p.path, p.message, p.hint] for p in error.problems]
    return []


config = system("{kind: sawtooth, tilt: 0.5}", "[0.25, 1]")
mesh = build(config.at({"meshes.mesh.waveform.tilt": np.array([0, 1])})).meshes[0]
print(json.dumps({
    "values": mesh.waveform.value(np.array([0.75])).tolist(),
    "long_name": config.axes[1].long_name,
    "range": problems("{kind: sawtooth, tilt: 2}", "[0.5]"),
    "other": problems("{kind: fourier, sin: [1], tilt: 0.5}", "[0.5]"),
    "schema": "sawtooth" in schema()["$defs"]["WaveformSection"]["properties"]["kind"]["enum"],
}))
"""


def test_a_new_waveform_is_one_class_and_one_line(tmp_path: Path) -> None:
    """In a process of its own: the section is put together from the table when it is first imported."""
    done = subprocess.run([sys.executable, "-c", TOY + USE, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["values"] == [0.0625, 0.25]
    assert found["long_name"].startswith("tilt")
    assert found["schema"]
    assert [path for path, _, _ in found["range"]] == ["system.meshes.0.waveform.tilt"]
    assert any(hint == "remove it, or choose kind: sawtooth" for _, _, hint in found["other"])
