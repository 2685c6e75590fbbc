"""A kind of system is one class and one line in a table: a toy one is added, configured, built and described.

Its mesh has a number of its own, whose field alone makes it an axis and gives it a short name.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pytest
from pydantic import Field

from gearstab.config import ConfigError, load
from gearstab.config.model.fields import Mass, Quantity, ShortName
from gearstab.config.schema import commented, schema
from gearstab.design.quantities import EXACT, SUPPORTS
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.methods import METHODS, Method, OptionError, Outcome
from gearstab.system import ANY_LINEAR, Feature, GearSystem, unsupported
from gearstab.systems import KINDS, build
from gearstab.systems.base import Start, System
from gearstab.systems.forcing import with_damping
from gearstab.systems.mesh import NamedToothMesh, build_mesh
from gearstab.waveforms import Rectangular


class Preloaded(NamedToothMesh):
    """A mesh with a number that other meshes have not."""

    preload: Annotated[float, Quantity("N"), ShortName()] = Field(default=0.0, title="preload", description="F (N).")


class Anchored(System):
    """One mass on a spring and a mesh."""

    mesh_names: ClassVar[tuple[str, ...]] = ("only",)
    start: ClassVar[Start | None] = Start(
        "A mass on a spring", {"kind": "anchored", "mass": 0.25}, {"spring": ([3, 8], "of the anchor")}
    )

    kind: Literal["anchored"] = Field(title="kind of system", description="A mass that a spring holds.")
    mass: Mass = Field(title="held mass", description="m (kg).")
    spring: Annotated[float, Field(ge=0), Quantity("N/m")] = Field(title="spring", description="k0 (N/m).")
    meshes: tuple[Preloaded] = Field(title="meshes", description="One tooth mesh.")

    def size(self) -> int:
        return 1

    def equations(self) -> GearSystem:
        mass, spring = (np.asarray(value, dtype=float)[..., None, None] for value in (self.mass, self.spring))
        mesh = build_mesh(self.meshes[0], np.ones(1))
        return with_damping(GearSystem(mass, spring, (mesh,), coordinates=("x",)), self)


TEXT = """\
system:
  kind: anchored
  mass: {mass}
  spring: 3 N/m
  damping_ratio: 0.1
  meshes: [{{mean_stiffness: 1, epsilon: 0.2, contact_ratio: 1.5}}]
sweep: {{mesh_frequency: {{start: 1, stop: 2, num: 3}}, spring: [3, 8], preload: [1 kN, 2 kN]}}
methods: {{floquet: {{}}}}
"""


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setitem(KINDS, "anchored", Anchored)

    def write(mass: str) -> Path:
        path = tmp_path / "anchored.yaml"
        path.write_text(TEXT.format(mass=mass))
        return path

    return write


def test_a_new_kind_is_configured_built_and_swept(written: Any) -> None:
    config = load(written("250 g"))
    system = build(config.at({"spring": np.array([0, 1])}))
    np.testing.assert_array_equal(system.mass[..., 0, 0], 0.25)
    np.testing.assert_array_equal(system.mean_stiffness_matrix()[:, 0, 0], [4.0, 9.0])
    assert system.meshes[0].name == "only"
    assert (config.axes[1].units, config.axes[1].long_name) == ("N/m", "spring")
    assert "Anchored" in schema()["$defs"]


def test_a_number_with_a_short_name_is_an_axis(written: Any) -> None:
    config = load(written("250 g"), ("preload=3",))
    assert (config.axes[2].name, config.axes[2].units, config.axes[2].long_name) == ("preload", "N", "preload")
    system: Any = config.at({"preload": np.array([0, 1])})
    np.testing.assert_array_equal(system.meshes[0].preload, [1000.0, 2000.0])


def test_it_is_offered_to_start_from(written: Any) -> None:
    text = commented("anchored")
    assert re.search(r"(?m)^  mass: 0.25 +# m \(kg\)$", text)
    assert re.search(r"(?m)^  spring: \[3, 8\] +# of the anchor$", text)


def test_its_mistakes_are_told_like_those_of_others(written: Any) -> None:
    with pytest.raises(ConfigError) as caught:
        load(written("25 mm"))
    (problem,) = caught.value.problems
    assert (problem.path, problem.line) == ("system.mass", 3)


# --- comparison of a system's features with those that a method supports


def pair(**changes: object) -> GearSystem:
    mesh = Mesh("mesh", np.ones(1), np.asarray(1.0), np.asarray(0.3), Rectangular(np.asarray(1.5)))
    return replace(GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,)), **changes)


RUBBING = pair(terms=(PeriodicTerm("rubbing", np.ones(1), np.ones(1)),))
IRRATIONAL = pair(meshes=(replace(pair().meshes[0], frequency_ratio=2**0.5),))


class Toy(Method):
    """A method that declares nothing."""

    name = "toy"

    def variables(self) -> tuple:
        return ()

    def run(self, mesh_frequency: np.ndarray) -> Outcome:
        return Outcome({})

    def cost(self) -> float:
        return 1.0


@pytest.mark.parametrize(("system", "words"), [(RUBBING, "also has rubbing"), (IRRATIONAL, "irrational ratio")])
def test_a_method_that_declares_nothing_refuses_every_feature(system: GearSystem, words: str) -> None:
    Toy(None, pair()).check()
    with pytest.raises(OptionError, match=words):
        Toy(None, system).check()


class Declared(Toy):
    supports = frozenset({Feature.PERIODIC_TERMS})


def test_a_method_takes_the_features_that_it_declares_and_no_others() -> None:
    Declared(None, RUBBING).check()
    with pytest.raises(OptionError, match="irrational ratio"):
        Declared(None, replace(RUBBING, meshes=IRRATIONAL.meshes)).check()


def test_every_method_and_design_quantity_declares_features_that_exist() -> None:
    assert SUPPORTS.keys() == EXACT.keys()
    for supports in (*(method.supports for method in METHODS.values()), *SUPPORTS.values()):
        assert supports <= frozenset(Feature)


def test_a_system_without_features_is_supported_by_all() -> None:
    assert unsupported(pair(), ()) is None
    assert unsupported(replace(RUBBING, meshes=IRRATIONAL.meshes), ANY_LINEAR) is None
