"""The benchmarks of scripts/bench: all can be started, ways take turns, a name that is none is one line."""

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(autouse=True)
def scripts(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Put the folder of the scripts on the path, and leave no variable that it sets."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "GEARSTAB_THREADS"):
        monkeypatch.setenv(name, "1")
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "scripts")
    yield
    for name in [name for name in sys.modules if name.split(".")[0] == "bench"]:
        del sys.modules[name]


def test_every_benchmark_can_be_started() -> None:
    runner = import_module("bench.__main__")
    for name in (*runner.NAMES, *runner.ON_REQUEST):
        assert callable(import_module(f"bench.{name}").main)


def test_an_unknown_name_is_one_line() -> None:
    with pytest.raises(SystemExit, match="no benchmark speed; there is kernel, blocks"):
        import_module("bench.__main__").main(["speed"])


def test_ways_take_turns_and_are_told_per_point(capsys: pytest.CaptureFixture[str]) -> None:
    """A clock that counts calls: the second way has a hundred points for the same time."""
    measuring = import_module("bench.measuring")
    order: list[str] = []
    ways = [
        measuring.Way(name, points, lambda name=name: order.append(name)) for name, points in (("a", 1), ("b", 100))
    ]
    ticks = iter(range(1000))
    measuring.compare("turns", ways, 3, lambda: float(next(ticks)))
    assert "".join(order) == "ab" + "ab" * 3
    assert "0.01" in capsys.readouterr().out
    assert measuring.turns([lambda: None], 2, lambda: float(next(ticks))).tolist() == [[1.0], [1.0]]


def test_other_ways_agree_with_each_other() -> None:
    """Three independent ways to the multipliers of a train, from which benchmarks take their ratios."""
    others, scenes = import_module("bench.others"), import_module("bench.scenes")
    from gearstab.floquet.segments.pattern import prepare

    (pattern,) = prepare(scenes.train("1", np.array([0.3]), damping_ratio=0.01))
    omega = np.array([0.9, 2.1]) / pattern.elastic.rate[0]
    found = [np.sort(np.abs(way(pattern, omega)), axis=-1) for way in (others.expm_product, others.integrate)]
    # The integrator's tolerance is 1e-10 per step.
    np.testing.assert_allclose(found[0], found[1], rtol=1e-7)
