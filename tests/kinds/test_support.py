"""Comparison of a system's features with those that a method supports."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearstab.design.quantities import EXACT, SUPPORTS
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.methods import METHODS, Method, OptionError, Outcome
from gearstab.support import ANY_LINEAR, unsupported
from gearstab.system import Feature, GearSystem
from gearstab.waveforms import Rectangular


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
