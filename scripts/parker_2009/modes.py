"""Parker (2009), Table 1 and the modal properties."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from parker_2009.common import DIGITS, PRINTED, TYPES, WORDS, gear, table_1
from statements import AS_PRINTED, Runs, Statement, at_most, number, numbers, tongue

INFERRED, OTHER = 0, 1
EQUAL = 1e-10
"""Equal frequencies come out equal to this; those of stiff modes of different types are as near as 1e-8."""


def frequencies(tree: xr.DataTree, case: int) -> list[float]:
    """w_1 to w_9 of a case of table1.yaml, from the roots of the tongues at 2 w_p."""
    roots = [tongue(tree, "perturbation", "center_frequency", f"2w{p}") for p in (1, 3, 4, 5, 7, 8, 9)]
    values = [float(root.isel(case=case)) / 2 for root in roots]
    return [values[k] for k in (0, 0, 1, 2, 3, 3, 4, 5, 6)]


def rounds(values: list[float]) -> list[bool]:
    """Which of the nine frequencies round to the printed ones."""
    return [round(v, d) == p for v, d, p in zip(values, DIGITS, PRINTED, strict=True)]


def natural_frequencies(runs: Runs) -> Iterator[Statement]:
    tree = table_1(runs)
    inferred, printed = frequencies(tree, INFERRED), frequencies(tree, OTHER)
    yield Statement(
        "Table 1",
        f"omega_1 to omega_9 = {', '.join(map(str, PRINTED))}",
        f"with k_cu = 1e11 N/m: {numbers(inferred, 7)}",
        all(rounds(inferred)),
        "all round to the printed ones",
        "All as printed except k_cu, printed as 5e11: 1e11 is inferred from these frequencies.",
    )
    wrong = [p for p, right in enumerate(rounds(printed), start=1) if not right]
    yield Statement(
        "Table 1",
        "k_cu = 5e11 N/m, with omega_3 = 1.113",
        f"omega_3 = {number(printed[2], 7)}; of the nine frequencies, those that do not round to the printed ones: "
        f"{', '.join(f'omega_{p}' for p in wrong)}",
        not wrong,
        "all round to the printed ones",
        "Nothing but k_cu was changed to get the value above.",
    )
    yield Statement(
        "Numerical Verification",
        "the first 11 natural frequencies are given in Table 1",
        f"it has {len(PRINTED)}; omega_10 and omega_11 are {numbers(gear(tree).frequency[9:11], 6)}",
        len(PRINTED) == 11,
        "it has eleven",
        "A pair of translational modes in which the ring bends with three nodal diameters.",
    )


def types(runs: Runs) -> Iterator[Statement]:
    found = gear(table_1(runs))
    kinds = [WORDS.get(kind.split(",")[0].split(" (")[0], kind) for kind in found.kinds[:9]]
    yield Statement(
        "Table 1",
        f"types of the nine modes: {', '.join(TYPES)}",
        ", ".join(kinds),
        kinds == TYPES,
        AS_PRINTED,
    )
    nature = found.nature[:9]
    expected = [{"T": 1, "R": 0, "P": 2, "PR": None}[kind] for kind in TYPES]
    worst = max(found.impurity(p) for p, kind in enumerate(nature, start=1) if kind is not None)
    yield Statement(
        "(29)",
        "mesh deflections of a mode are c1 cos T psi_n + c2 sin T psi_n; T = 0 for rotational, 1 for translational, "
        "d for planet modes (2 for N = 4)",
        f"T of the nine modes: {', '.join('-' if kind is None else str(kind) for kind in nature)}; {at_most(worst)}",
        nature == expected and worst < 1e-8,
        "T as printed, equal to 1e-8",
    )
    ratio = float(np.abs([found.sun[7], found.ring[7]]).max() / np.abs(found.sun[:9]).max())
    yield Statement(
        "Modal properties",
        "mesh deflections of purely ring modes are zero",
        f"omega_8: beside the largest one of the nine modes, {at_most(ratio)}",
        ratio < 1e-8,
        "equal to 1e-8",
    )
    equal = [p for p in range(1, 9) if abs(found.frequency[p] / found.frequency[p - 1] - 1) < EQUAL]
    yield Statement(
        "Mathematical formulation",
        "translational modes come in pairs of one natural frequency; rotational and purely ring modes are distinct, "
        "planet modes of N = 4 too",
        "pairs: " + ", ".join(f"omega_{p} = omega_{p + 1}" for p in equal),
        equal == [1, 5],
        "the translational ones are the only pairs",
    )


def number_of_planets(runs: Runs) -> Iterator[Statement]:
    sorts = {}
    for planets in (3, 4, 5, 6):
        tree = runs.sweep(
            "parker_2009/table1",
            planets=planets,
            phases={"sun": [0.0] * planets, "sun_ring": 0.5},
            ring={"kind": "elastic", "harmonics": 8, "bending_stiffness": 5.0e7},
            **NOTHING,
        )
        found = gear(tree)
        pairs = [abs(a / b - 1) < EQUAL for a, b in zip(found.frequency, found.frequency[1:], strict=False)]
        double = {p for p, equal in enumerate(pairs) if equal} | {p + 1 for p, equal in enumerate(pairs) if equal}
        planet = [p for p, kind in enumerate(found.kinds) if kind.startswith("planet")]
        sorts[planets] = (len([p for p in planet if p not in double]), len([p for p in planet if p in double]))
    yield Statement(
        "Mathematical formulation",
        "planet modes exist for N >= 4 only; all are degenerate for odd N, some are distinct for even N",
        "distinct and degenerate planet modes (8 harmonics of the ring): "
        + "; ".join(f"N = {planets}: {a}, {b}" for planets, (a, b) in sorts.items()),
        sorts[3] == (0, 0) and sorts[5][0] == 0 < sorts[5][1] and sorts[4][0] > 0 and sorts[6][0] > 0,
        "none for N = 3, no distinct ones for N = 5, some for N = 4, 6",
    )


NOTHING = {"sweep": {"mesh_frequency": [1.0, 2.0]}, "methods": {"perturbation": {"order": 1, "harmonics": 1}}}
"""For the modes alone."""


def convergence(runs: Runs) -> Iterator[Statement]:
    steps = [4, 8, 16, 24]
    found = [gear(runs.sweep("parker_2009/ring_harmonics", ring__harmonics=j, **NOTHING)).frequency[:9] for j in steps]
    change = np.abs(np.array(found[:-1]) / found[-1] - 1).max(axis=1)
    yield Statement(
        "(28)",
        "the harmonics of the ring go up to an arbitrarily large number",
        f"largest relative change of omega_1 to omega_9 from {steps[-1]} harmonics with "
        f"{', '.join(map(str, steps[:-1]))}: {numbers(change, 2)}",
        bool(np.all(np.diff(change) < 0) and change[-1] < 1e-4),
        "the change falls, below 1e-4",
        "Eight give the four digits of Table 1.",
    )


def rigid_ring(runs: Runs) -> Iterator[Statement]:
    elastic = gear(table_1(runs))
    rigid = gear(runs.sweep("parker_2009/rigid_ring", **NOTHING))
    yield Statement(
        "Introduction",
        "the ring's deformation matters: earlier models have a rigid one",
        f"with a rigid ring omega_1 to omega_7 are {numbers(rigid.frequency[:7], 4)}, instead of "
        f"{numbers(elastic.frequency[:7], 4)}; omega_8 and omega_9 do not exist, the next one is "
        f"{number(rigid.frequency[7], 4)}",
        bool(rigid.frequency[7] > elastic.frequency[8] > elastic.frequency[7] > rigid.frequency[6]),
        "a rigid ring lacks modes among the nine",
        "It moves the planet mode by "
        f"{number(100 * (rigid.frequency[3] / elastic.frequency[3] - 1), 2)} %, the others below it by less than "
        f"{number(100 * np.abs(rigid.frequency[[0, 2]] / elastic.frequency[[0, 2]] - 1).max(), 1)} %.",
    )


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [
    natural_frequencies, types, number_of_planets, convergence, rigid_ring,
]  # fmt: skip
