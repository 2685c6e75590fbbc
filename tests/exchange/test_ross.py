"""Geared rotors of ROSS: natural frequencies, forced responses and the mesh equal theirs."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import DOCS

import gearstab as gs
from gearstab.bench.costs import exponential_products
from gearstab.errors import NotPossible
from gearstab.floquet.general.mean import mean_motions

pytestmark = pytest.mark.slow
MESH = {"epsilon": 0.2, "contact_ratio": 1.6}


@pytest.fixture(scope="module")
def rotor() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("ross")
        from ross.multi_rotor import two_shaft_rotor_example

        return two_shaft_rotor_example()


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("speed", [0.0, 150.0])
def test_exponents_are_theirs(rotor: Any, speed: float) -> None:
    """Gyroscopic effects included, of the whole model at constant mesh stiffness."""
    model = gs.from_ross(rotor, meshes=[MESH], speed=speed)
    system = gs.build(model)
    np.testing.assert_allclose(system.mean_stiffness_matrix(), rotor.K(speed), rtol=1e-9, atol=1e-3)
    # One speed for each shaft, of which the second turns the other way.
    assert [np.sign(float(rotation.speed)) for rotation in system.rotations] == ([1, -1] if speed else [])
    damping = system.damping + sum(
        (rotation.speed * rotation.gyroscopic for rotation in system.rotations), np.zeros_like(system.damping)
    )
    inverse, size = np.linalg.inv(system.mass), system.size
    state = np.block(
        [[np.zeros((size, size)), np.eye(size)], [-inverse @ system.mean_stiffness_matrix(), -inverse @ damping]]
    )
    mine = np.sort(np.abs(np.linalg.eigvals(state).imag))
    theirs = np.sort(np.abs(rotor.run_modal(speed=speed, num_modes=24).wd))
    theirs = theirs[theirs > 1.0]
    for frequency in theirs:
        assert np.abs(mine - frequency).min() < 1e-6 * frequency


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("modes", [None, 40])
def test_gyroscopic_effects_follow_the_mesh_frequency(rotor: Any, modes: int | None) -> None:
    """Whirl frequencies at each speed are theirs; bearings there do not depend on it."""
    teeth = 37
    model = gs.from_ross(rotor, meshes=[MESH], modes=modes, speed_ratio=f"1/{teeth}")
    for speed in (50.0, 400.0):
        mine = mean_motions(gs.build(model), teeth * speed).frequency[0]
        theirs = np.abs(rotor.run_modal(speed=speed, num_modes=24).wd)
        for frequency in theirs[theirs > 1.0]:
            # Modes that are left out change the lowest ones by their part of the compliance.
            assert np.abs(mine - frequency).min() < (1e-6 if modes is None else 1e-3) * frequency


@pytest.mark.filterwarnings("default")
def test_forced_responses_are_theirs(rotor: Any) -> None:
    """With the gyroscopic effects of a turning rotor, at the speed that is given."""
    omega = 130.0
    model = gs.from_ross(rotor, meshes=[MESH | {"epsilon": 0.0}], speed=omega)
    assert len(model["rotation"]) == 2
    size = len(model["mass"])
    force = np.zeros(size)
    force[6] = 1000.0
    model["forces"] = [{"name": "push", "direction": force, "cos": [1.0]}]
    response = gs.respond({"system": model, "respond": {"mesh_frequency": omega, "steady_state": True}})["response"]
    phase = omega * response["time"].values
    waves = np.column_stack([np.cos(phase), -np.sin(phase), np.ones(len(phase))])
    fitted = np.linalg.lstsq(waves, response["displacement"].values, rcond=None)[0]
    forced = rotor.run_forced_response(force=force[:, None].astype(complex), speed_range=np.array([omega]))
    theirs = np.ravel(forced.forced_resp)
    lateral = np.abs(theirs) > 1e-6 * np.abs(theirs).max()
    np.testing.assert_allclose((fitted[0] + 1j * fitted[1])[lateral], theirs[lateral], rtol=1e-5)


@pytest.mark.filterwarnings("default")
def test_few_modes_of_a_varying_mesh(rotor: Any) -> None:
    model = gs.from_ross(rotor, meshes=[MESH | {"epsilon": 0.3}], modes=12)
    assert model.note.startswith("12 of 54 modes are kept")
    wn = rotor.run_modal(speed=0).wn
    mine = np.array([mode["natural_frequency"] for mode in gs.info(model)["modes"]])
    for frequency in wn[wn > 1.0]:
        # Theirs are moduli of damped eigenvalues; the damping ratios here are below 1 %.
        assert np.abs(mine - frequency).min() < 5e-4 * frequency
    assert len(gs.boundaries(model, 100.0, 600.0).label)


@pytest.mark.filterwarnings("default")
def test_bearings_with_coefficients_over_speed(rotor: Any) -> None:
    """Interpolated at the speed that is given, each at that of its shaft, or refused; whirl frequencies are theirs."""
    from ross.bearing_seal_element import BearingElement
    from ross.multi_rotor import MultiRotor
    from ross.rotor_assembly import Rotor

    own = rotor.rotors["driving"]
    table = np.linspace(100.0, 700.0, 7)
    bearings = [
        BearingElement(
            n=old.n, kxx=2e8 + 3e5 * table, kyy=1.5e8 + 2e5 * table, kxy=2e4 * table, kyx=-2e4 * table, cxx=3e3 + table,
            frequency=table, tag=f"brg{old.n}",
        )
        for old in own.bearing_elements
    ]  # fmt: skip
    geared = MultiRotor(
        Rotor(own.shaft_elements, own.disk_elements, bearings), rotor.rotors["driven"],
        coupled_nodes=(rotor.mesh.driving_gear.n, 0), gear_mesh_stiffness=1e8,
    )  # fmt: skip
    speed, teeth = 250.0, rotor.mesh.driving_gear.n_teeth
    model = gs.from_ross(geared, meshes=[MESH], speed=speed, speed_ratio=f"1/{teeth}")
    assert re.fullmatch(
        r"coefficients over speed are interpolated: brg0 at node 0 at 250 rad/s, brg3 at node 3 at 250 rad/s, "
        "and stay so at every mesh frequency",
        model.note,
    )
    mine = mean_motions(gs.build(model), teeth * speed).frequency[0]
    theirs = np.abs(geared.run_modal(speed=speed, num_modes=24).wd)
    for frequency in theirs[theirs > 1.0]:
        assert np.abs(mine - frequency).min() < 1e-6 * frequency
    with pytest.raises(NotPossible, match="has coefficients from 100 to 700 rad/s, and its shaft turns at 0 rad/s"):
        gs.from_ross(geared, meshes=[MESH], speed_ratio=f"1/{teeth}")


@pytest.mark.filterwarnings("default")
def test_mistakes(rotor: Any) -> None:
    with pytest.raises(NotPossible, match="nothing says how the stiffness of mesh 'mesh1' varies"):
        gs.from_ross(rotor)
    assert rotor.mesh.stiffness == 1e8


@pytest.mark.filterwarnings("default")
def test_the_session_of_the_documentation(
    rotor: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Load, sweep, plot and boundaries; Floquet's verdicts change at the edges that it prints, and the map has them."""
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"^```python\n([^`]*from ross[^`]*)^```$", (DOCS / "api.md").read_text(), re.M)
    names: dict[str, Any] = {}
    exec(compile(block, "docs/api.md", "exec"), names)
    assert len([line for line in block.splitlines() if line]) <= 20
    printed = re.findall(r"unstable from (\S+) to (\S+) rad/s", capsys.readouterr().out)
    assert len(printed) == 3
    found = np.array(printed, dtype=float)
    inside = np.stack([found[:, 0] + 0.2, found[:, 1] - 0.2], axis=1)
    assert np.all(gs.floquet(names["model"], inside).stable == 0)
    assert np.all(gs.floquet(names["model"], np.stack([found[:, 0] - 0.2, found[:, 1] + 0.2], axis=1)).stable == 1)
    stable = names["tree"]["floquet"]["stable"].sel(epsilon=0.2)
    omega = stable["mesh_frequency"].values
    expected = ~np.any((omega[:, None] > found[:, 0]) & (omega[:, None] < found[:, 1]), axis=1)
    np.testing.assert_array_equal(stable.values == 1, expected)
    assert (tmp_path / "rotor.png").stat().st_size > 10_000


@pytest.mark.filterwarnings("default")
def test_the_session_of_the_guide(rotor: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both pictures are drawn, and verdicts of the map are those of products of exponentials."""
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"^```python\n([^`]*from ross[^`]*)^```$", (DOCS / "guide" / "spinning.md").read_text(), re.M)
    names: dict[str, Any] = {}
    exec(compile(block, "docs/guide/spinning.md", "exec"), names)
    assert [part["speed_ratio"] for part in names["model"]["rotation"]] == ["1/328", "-1/23"]
    assert min((tmp_path / name).stat().st_size for name in ("campbell.png", "map.png")) > 10_000
    stable = names["tree"]["floquet"]["stable"].sel(epsilon=0.2)
    omega = stable["mesh_frequency"].values
    # Batched scipy.linalg.expm: a double multiplier on the unit circle is known to the root of rounding.
    growth = exponential_products(gs.build(names["model"]), omega)
    np.testing.assert_array_equal(stable.values == 0, growth > 1e-6)
    assert np.count_nonzero(growth > 1e-6) > 40
