"""Which kernel is in use: one notion for all rooms and threads, and what a result says of the one that ran."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from systems import system

from gearstab import ckernel
from gearstab.cli import main
from gearstab.config import load
from gearstab.errors import SettingError
from gearstab.floquet import solve
from gearstab.floquet.kernel import c_kernel, numpy_kernel
from gearstab.floquet.kernel import choice as kernel
from gearstab.methods import perturbation
from gearstab.methods.base import Method
from gearstab.results import open_result
from gearstab.sweep import plan, pool

built = pytest.mark.skipif(ckernel.library is None, reason="the compiled kernel was not built")
OMEGA = np.array([1.0, 2.0])


@pytest.fixture(autouse=True)
def nothing_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("GEARSTAB_KERNEL", "GEARSTAB_SIMD", "GEARSTAB_THREADS"):
        monkeypatch.delenv(name, raising=False)


def test_numpy_can_always_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSTAB_KERNEL", "numpy")
    assert kernel.current() is numpy_kernel
    assert solve(system(2, "generic", 0), OMEGA).kernel == "numpy"
    assert not ckernel.in_use()


@built
def test_the_compiled_kernel_is_the_default() -> None:
    assert kernel.available() == ("numpy", "c")
    assert kernel.current() is c_kernel
    assert ckernel.in_use()
    with kernel.using("numpy"):
        assert kernel.name() == "numpy"
        assert not ckernel.in_use()
    assert kernel.name() == "c"
    assert ckernel.in_use()


def test_one_line_says_that_the_compiled_kernel_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ckernel, "library", None)
    assert kernel.name() == "numpy"
    monkeypatch.setenv("GEARSTAB_KERNEL", "c")
    with pytest.raises(SettingError, match="was not built") as caught:
        kernel.current()
    assert "\n" not in str(caught.value)


@built
def test_one_line_says_that_an_update_left_the_compiled_kernel_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    ckernel.outdated.cache_clear()
    assert not ckernel.outdated()
    monkeypatch.setattr(ckernel.library, "sources", lambda: 1)
    ckernel.outdated.cache_clear()
    try:
        with pytest.raises(SettingError, match="make install") as caught:
            kernel.current()
        monkeypatch.setenv("GEARSTAB_KERNEL", "numpy")
        assert kernel.name() == "numpy"
    finally:
        ckernel.outdated.cache_clear()
    assert "\n" not in str(caught.value)


def test_unknown_kernels_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSTAB_KERNEL", "fortran")
    with pytest.raises(SettingError, match="numpy and c"):
        kernel.name()
    with pytest.raises(SettingError, match="numpy and c"):
        solve(system(2, "generic", 0), OMEGA)


@built
def test_unknown_instructions_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSTAB_SIMD", "mmx")
    with pytest.raises(SettingError, match="GEARSTAB_SIMD=mmx: this processor offers plain"):
        kernel.checked()
    # Nobody asks for instructions where NumPy serves.
    with kernel.using("numpy"):
        assert kernel.checked() == "numpy"


@pytest.mark.parametrize("text", ["0", "-1", "many", "1.5"])
def test_threads_must_be_a_positive_number(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("GEARSTAB_THREADS", text)
    with pytest.raises(SettingError, match="positive whole number"):
        ckernel.threads()


def test_threads_follow_the_environment_and_the_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    assert ckernel.threads() >= 1
    monkeypatch.setenv("GEARSTAB_THREADS", "3")
    assert ckernel.threads() == 3
    with kernel.using(threads=2):
        assert ckernel.threads() == 2
        with kernel.using("numpy"):
            assert (kernel.name(), ckernel.threads()) == ("numpy", 2)
    assert ckernel.threads() == 3


class TestInThreads:
    """A new thread has no context of its own; what it was started in holds for it."""

    def test_a_choice_holds_for_threads_started_inside(self) -> None:
        with kernel.using("numpy"), ThreadPoolExecutor(2) as threads:
            found = list(threads.map(lambda seed: solve(system(2, "generic", seed), OMEGA).kernel, range(4)))
        assert found == ["numpy"] * 4

    @built
    def test_choices_of_threads_do_not_meet(self) -> None:
        def chosen(name: str) -> set[str]:
            with kernel.using(name):
                return {solve(system(3, "generic", seed), OMEGA).kernel for seed in range(20)}

        with ThreadPoolExecutor(4) as threads:
            found = list(threads.map(chosen, ["c", "numpy"] * 4))
        assert found == [{"c"}, {"numpy"}] * 4
        assert kernel.name() == "c"

    @built
    def test_eigenproblems_and_propagation_go_the_same_way(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Nothing of the compiled kernel is called where NumPy was chosen."""

        class Forbidden:
            def __getattr__(self, name: str) -> object:
                raise AssertionError(name)

        monkeypatch.setattr(ckernel, "library", Forbidden())
        with kernel.using("numpy"):
            assert np.isfinite(solve(system(3, "generic", 1, damping=0.01), OMEGA).growth_rate).all()


TRAIN = """\
system:
  kind: two_stage
  inertias: [1.0, 0.3, 4.0]
  input_shaft_stiffness: 0.5
  damping_ratio: 0.01
  meshes:
    - {name: first, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}
    - {name: second, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}
sweep:
  mesh_frequency: {start: 2.0, stop: 6.0, num: 7}
  epsilon: [0.1, 0.2, 0.3]
"""
PAIR = """\
system:
  kind: gear_pair
  formulation: energy_conserving
  teeth: [24, 96]
  inertias: [2.89e-3, 0.7402]
  torsional_stiffness: [1430, 2780]
  single_contact_angle: 1.73
  torque: 21.05
  damping_ratio: 0.1
sweep: {mesh_frequency: [12000.0, 20000.0]}
"""
# A friction of its own, as everything that is not symmetric.
TERMS = """\
system:
  kind: matrices
  mass: [[1.0, 0.0], [0.0, 2.0]]
  stiffness: [[0.5, 0.0], [0.0, 0.2]]
  damping: {matrix: [[0.02, 0.0], [0.0, 0.02]]}
  meshes: [{name: a, direction: [1, -1], mean_stiffness: 1.0, epsilon: 0.2, contact_ratio: 1.5}]
  terms:
    - {name: drag, left: [1.0, 0.0], right: [1.0, -1.0], stiffness: {amplitude: 0.01, mean: 0.02, contact_ratio: 1.5}}
sweep: {mesh_frequency: [1.0, 2.0, 3.0]}
"""


@pytest.fixture(params=[1, 2], ids=["alone", "side by side"])
def jobs(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(pool, "WORTH_THREADS", 0.0)
    # Several blocks, so that there is something to be side by side.
    monkeypatch.setattr(sys.modules["gearstab.sweep.plan"], "MOST", 3)
    monkeypatch.setattr(Method, "fewest", 1)
    monkeypatch.setattr(perturbation, "ROWS", 1)
    return int(request.param)


@pytest.mark.parametrize("chosen", ["numpy", pytest.param("c", marks=built)])
@pytest.mark.parametrize(
    ("text", "methods", "ran"),
    [
        (TRAIN, "{floquet: {}}", None),
        (TRAIN, "{required_damping: {}}", None),
        (TRAIN, "{boundaries: {tolerance: 1.0e-6, width_floor: 1.0e-2}}", None),
        (TRAIN, "{floquet: {}, perturbation: {}, boundaries: {tolerance: 1.0e-6, width_floor: 1.0e-2}}", None),
        (TRAIN, "{perturbation: {}}", "none"),
        (TRAIN, "{floquet: {frequencies: lyapunov}}", "numpy"),
        (TERMS, "{floquet: {}}", None),
        (PAIR, "{floquet: {}}", "numpy"),
    ],
    ids=["floquet", "required damping", "boundaries", "all of them", "perturbation", "lyapunov", "terms", "orbits"],
)
def test_a_result_names_the_kernel_that_ran(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jobs: int, text: str, methods: str, ran: str | None, chosen: str
) -> None:
    monkeypatch.setenv("GEARSTAB_KERNEL", chosen)
    config, out = tmp_path / "scene.yaml", tmp_path / "out.h5"
    config.write_text(text + f"methods: {methods}\n")
    assert all(layout.count > 1 for layout in plan(load(config)).layouts)
    with pytest.raises(SystemExit) as ended:
        main(["sweep", str(config), "-o", str(out), "-j", str(jobs), "-q"])
    assert not ended.value.code
    with open_result(out) as tree:
        assert tree.attrs["kernel"] == (ran or chosen)


@pytest.mark.parametrize(
    ("methods", "said"), [("{required_damping: {}}", 1), ("{floquet: {}}", 1), ("{perturbation: {}}", 0)]
)
def test_the_slow_kernel_is_said_where_it_ran(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], methods: str, said: int
) -> None:
    monkeypatch.setattr(ckernel, "library", None)
    config = tmp_path / "scene.yaml"
    config.write_text(TRAIN + f"methods: {methods}\n")
    with pytest.raises(SystemExit):
        main(["sweep", str(config), "-o", str(tmp_path / "out.h5")])
    assert capsys.readouterr().err.count("the compiled kernel was not built") == said


@pytest.mark.parametrize("command", ["sweep", "sweep --dry-run", "info", "bench --no-plot", "respond"])
@pytest.mark.parametrize("setting", ["GEARSTAB_KERNEL=fortran", pytest.param("GEARSTAB_SIMD=mmx", marks=built)])
def test_a_wrong_setting_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str, setting: str
) -> None:
    name, _, value = setting.partition("=")
    monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    Path("scene.yaml").write_text(
        TRAIN + "methods: {floquet: {}}\nrespond: {mesh_frequency: 2.0, cycles: 3, initial: "
        "{displacement: [0.1, 0, 0], velocity: [0, 0, 0]}}\n"
    )
    with pytest.raises(SystemExit) as ended:
        main([*command.split(), "scene.yaml"])
    assert ended.value.code == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.splitlines()[-1].startswith(setting)
    assert not list(tmp_path.rglob("*.h5"))
