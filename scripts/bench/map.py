"""Speed of the Floquet analysis against what one would write first, on the map of Lin & Parker (2002), Fig. 3.

All ways answer the same question for the same points, and the flags of stability that differ are counted.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bench.measuring import show, turns
from bench.others import expm_product, integrate, numpy_eigenvalues
from bench.scenes import train
from gearstab.floquet import solve
from gearstab.floquet.segments.pattern import prepare
from gearstab.system import Array

ON_CIRCLE, OF_INTEGRATION = 1e-8, 1e-6
"""Multipliers at this distance from the unit circle count as on it: of products, and of integrated equations."""


def main(rounds: int = 5) -> None:
    """Run all ways and print the table."""
    epsilon, omega = np.linspace(0.002, 0.4, 200), np.linspace(0.35, 7.0, 1000)
    system = train("1", epsilon)
    rows = [prepare(train("1", np.array([value])))[0] for value in epsilon]

    def loop(method: Callable[..., Array], step: int, every: int, circle: float) -> Callable[[], Array]:
        def run() -> Array:
            found = [np.abs(method(p, omega[::every] / p.elastic.rate[0])).max(axis=-1) for p in rows[::step]]
            return np.stack(found) <= 1 + circle

        return run

    ways: dict[str, tuple[Callable[[], Array], int, int]] = {
        "batched numpy.linalg.eigvals": (loop(numpy_eigenvalues, 1, 1, ON_CIRCLE), 1, 1),
        "gearstab": (lambda: solve(system, omega).stable == 1, 1, 1),
        "products of scipy.linalg.expm": (loop(expm_product, 40, 50, ON_CIRCLE), 40, 50),
        "DOP853, broken at the jumps": (loop(integrate, 100, 100, OF_INTEGRATION), 100, 100),
    }
    stable = ways["gearstab"][0]()
    seconds = np.median(turns([work for work, _, _ in ways.values()], rounds), axis=0)
    answers = [work() for work, _, _ in ways.values()]
    rates = [answer.size / t for answer, t in zip(answers, seconds, strict=True)]
    table = [
        (name, answer.size, rate, rate / rates[0], int(np.sum(answer != stable[::step, ::every])))
        for (name, (_, step, every)), answer, rate in zip(ways.items(), answers, rates, strict=True)
    ]
    show(
        f"Fig. 3, 1000 mesh frequencies x 200 amplitudes; medians of {rounds} runs",
        ("way", "points", "points/s", "x eigvals", "flags that differ"), table,
    )  # fmt: skip
