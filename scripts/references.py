"""Stored values of figures, and when a result still agrees with them.

Of every variable of a result: its shape, how many values are finite, their mean, and a sample of its cells; of flags
how often each value occurs; of texts a sample. The mean sees a change anywhere, the cells say where. Of every picture:
the mean lightness of 32 x 24 blocks, two hexadecimal digits each. All of it is text, a few kilobytes per figure, so
that a change is visible in a commit.

``TOLERANCES`` says how far results may differ on other processors, with other kernels and linear algebra, and why.
Pictures are compared in the locked environment only: other versions of Matplotlib place text differently.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from importlib.metadata import version
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import xarray as xr

ROOT = Path(__file__).parent.parent
STORED = ROOT / "tests" / "data" / "figures"
LOCK = ROOT / "scripts" / "requirements.lock"

CELLS = 40
MOST_CELLS = 160
MAIN = ("floquet/growth_rate", "boundaries/boundary_frequency")
"""Variables of which more cells are stored: those that maps show."""
DIGITS = 9
BLOCKS = (24, 32)
BLOCK_DIFFERENCE, MEAN_DIFFERENCE = 16, 1.0
"""Largest differences, of 255, in one block and on average: a missing line of text or another region is more."""

Reference = dict[str, Any]


@dataclass(frozen=True)
class Tolerance:
    """How far the values of a variable may differ.

    relative: to the value. absolute: to the largest value. squares: values agree also where their squares do.
    odd: the part of the values that may be finite on one side only, or differ by more; at least ``few`` may be.
    mean: by how much more the mean may differ then, relative to it.
    reason: why.
    """

    relative: float = 1e-6
    absolute: float = 1e-7
    squares: bool = False
    odd: float = 0.0
    few: int = 0
    mean: float = 0.0
    reason: str = ""

    def agree(self, now: np.ndarray, then: np.ndarray, scale: float) -> np.ndarray:
        """Whether values agree, one by one; two that are not finite do."""
        close = np.abs(now - then) <= self.relative * np.abs(then) + self.absolute * scale
        if self.squares:
            close |= np.abs(now**2 - then**2) <= (self.relative + self.absolute) * scale**2
        return close | (~np.isfinite(now) & ~np.isfinite(then))

    def allowed(self, count: int) -> int:
        """How many of so many values may be odd."""
        return max(self.few, int(self.odd * count))


LEFT_OUT = (
    "modes/mode_shape", "modes/mesh_deflection", "natural_frequencies/mode_shape",
    "boundaries/tolerance", "boundaries/evaluations", "boundaries/contacts", "response/mean_velocity",
)  # fmt: skip
"""The basis of modes of equal frequency is free, and the sign of all; how a search went is its own, and differs between
kernels; the mean velocity of what stays where it is is rounding."""

TOLERANCES: tuple[tuple[str, Tolerance], ...] = (
    ("modes/natural_frequency", Tolerance(
        1e-8, 1e-8, reason="rounding of an eigenvalue problem, relative to its largest eigenvalue")),
    ("floquet/growth_rate*", Tolerance(
        1e-6, 1e-6, squares=True, odd=0.01, few=2, reason="beside a boundary growth is the square root of a distance")),
    ("floquet/exponent_*", Tolerance(
        1e-6, 1e-6, squares=True, odd=0.05, few=4, reason="as growth; the order of equal ones is free")),
    ("floquet/error_estimate", Tolerance(
        0.1, 0.01, odd=0.1, few=4, reason="a difference of nearly equal numbers")),
    ("floquet/stable", Tolerance(odd=1e-4, few=2, reason="points on a boundary fall to either side")),
    ("floquet/status", Tolerance(odd=0.02, few=4, reason="flags depend on error estimates, which are mostly rounding")),
    ("boundaries/holder", Tolerance(odd=0.02, few=2, mean=1e-2, reason="narrow regions may be closed, see below")),
    ("boundaries/*", Tolerance(
        1e-7, 1e-7, odd=0.01, few=2, mean=1e-4,
        reason="found to 1e-10; regions about as wide as the width floor may be closed")),
    ("perturbation/*", Tolerance(1e-7, 1e-7, odd=0.005, few=1, reason="closed forms; tongues on top of each other")),
    ("required_damping/*", Tolerance(1e-5, 1e-6, odd=0.01, few=2, reason="root finding on growth rates")),
    ("passage/growth*", Tolerance(
        1e-4, reason="what decays by 30 e-folds on the way is right to exp(30) eps")),
    ("*/multiplier_error", Tolerance(1.0, 1.0, odd=1.0, mean=1e3, reason="rounding errors themselves")),
    ("branches/residual", Tolerance(1.0, 1.0, odd=1.0, mean=1e3, reason="rounding errors themselves")),
    ("branches/*", Tolerance(
        1e-6, 1e-7, odd=0.1, few=4, mean=0.05,
        reason="rounding may decide that a step is halved, which moves motions")),
    ("*", Tolerance(reason="rounding, amplified by a long history or by resonance")),
)  # fmt: skip
"""By group and variable; the first pattern that fits holds."""


def tolerance(name: str) -> Tolerance:
    """Tolerance of a variable, ``group/name``."""
    return next(found for pattern, found in TOLERANCES if fnmatch(name, pattern))


def positions(size: int, cells: int) -> np.ndarray:
    """Which cells of an array are stored: all of a small one, else spread by the golden ratio, on no row of a grid."""
    if size <= cells:
        return np.arange(size)
    return np.unique((np.arange(cells) * 0.6180339887498949 % 1.0 * size).astype(int))


def rounded(value: float) -> float | None:
    """A number as it is stored; null where it is not finite."""
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None


def entry(values: np.ndarray, cells: int = CELLS) -> Reference:
    """Return the entry that is stored of a variable."""
    flat = values.ravel()
    kept = positions(flat.size, cells)
    if flat.dtype.kind in "iub":
        counts = sorted(Counter(flat.tolist()).items())
        if len(counts) <= 20:
            return {"shape": list(values.shape), "counts": {str(value): count for value, count in counts}}
        flat = flat.astype(float)
    if flat.dtype.kind != "f":
        return {"shape": list(values.shape), "texts": [str(flat[i]) for i in kept]}
    finite = flat[np.isfinite(flat)]
    return {
        "shape": list(values.shape), "finite": int(finite.size),
        "mean": rounded(float(finite.mean())) if finite.size else None,
        "cells": [rounded(float(flat[i])) for i in kept],
    }  # fmt: skip


def of_result(path: Path) -> dict[str, Reference]:
    """Entries that are stored of a result, by group and variable."""
    found = {}
    with xr.open_datatree(path, engine="h5netcdf") as tree:
        for group in tree.groups:
            node = tree[group]
            assert isinstance(node, xr.DataTree)
            data = node.to_dataset(inherit=False)
            names = [*data.data_vars, *(name for name in data.coords if name == "label")]
            for name in map(str, names):
                key = f"{group.strip('/')}/{name}"
                if data[name].size and key not in LEFT_OUT:
                    found[key] = entry(data[name].values, MOST_CELLS if key in MAIN else CELLS)
    return found


def of_picture(path: Path) -> list[str]:
    """The mean lightness of the blocks of a picture, a text for each row of blocks."""
    pixels = matplotlib.image.imread(path)[..., :3].mean(axis=-1)
    rows, columns = BLOCKS
    edges = [np.linspace(0, size, parts + 1).astype(int) for size, parts in zip(pixels.shape, BLOCKS, strict=True)]
    sums = np.add.reduceat(np.add.reduceat(pixels, edges[0][:-1], axis=0), edges[1][:-1], axis=1)
    means = sums / np.outer(np.diff(edges[0]), np.diff(edges[1]))
    levels = np.rint(255 * means).astype(int)
    return ["".join(f"{level:02x}" for level in levels[row, :columns]) for row in range(rows)]


def stored(name: str) -> Reference | None:
    """The reference of a figure; None where there is none."""
    path = STORED / f"{name}.json"
    return json.loads(path.read_text()) if path.exists() else None


def seconds(name: str) -> float:
    """How long a figure takes, by its reference; for ever without."""
    reference = stored(name)
    return float("inf") if reference is None else float(reference["seconds"])


def write(name: str, result: Path, pictures: Sequence[Path], times: Sequence[float]) -> None:
    """Write the reference of a figure. Variables that agree stay as they are, and a time that is about the same."""
    before = stored(name)
    known = 0.0 if before is None else float(before["seconds"])
    spent = float(f"{sum(times):.1g}")
    if before is not None and (times[0] == 0 or known / 2 <= spent <= 2 * known):
        spent = known
    variables = of_result(result)
    for key, then in (before["variables"] if before else {}).items():
        if key in variables and not of_entry(variables[key], then, tolerance(key)):
            variables[key] = then
    made = {"seconds": spent, "variables": variables}
    images = {path.stem: of_picture(path) for path in pictures}
    path = STORED / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(as_text(made, images))


def as_text(made: Mapping[str, Any], images: Mapping[str, list[str]]) -> str:
    """JSON with a line for each variable and each row of a picture, so that a difference shows what changed."""
    lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in made["variables"].items()]
    drawn = [f"  {json.dumps(key)}: {json.dumps(rows, indent=1)}" for key, rows in images.items()]
    return (
        f'{{\n "seconds": {json.dumps(made["seconds"])},\n "variables": {{\n' + ",\n".join(lines)
        + '\n },\n "pictures": {\n' + ",\n".join(drawn) + "\n }\n}\n"
    )  # fmt: skip


def pictures_left_out() -> str:
    """Why pictures are not compared here; empty where they are."""
    found = re.search(r"^matplotlib==(\S+)", LOCK.read_text(), re.M)
    assert found, "matplotlib is in the lock"
    here = version("matplotlib")
    if here == found[1]:
        return ""
    return f"pictures are not compared: Matplotlib is {here} here and {found[1]} in scripts/requirements.lock"


def differences(name: str, result: Path, pictures: Sequence[Path]) -> list[str]:
    """In what a figure differs from its reference, a line each."""
    reference = stored(name)
    if reference is None:
        return [f"no reference yet: python scripts/figures.py --update {name}"]
    wrong = of_variables(of_result(result), reference["variables"])
    if not wrong and not pictures_left_out():
        for path in pictures:
            wrong += of_images(path.stem, of_picture(path), reference["pictures"].get(path.stem))
    return wrong


def of_variables(now: Mapping[str, Reference], then: Mapping[str, Reference]) -> list[str]:
    """In what variables differ."""
    wrong = [f"{name} is gone" for name in then if name not in now]
    wrong += [f"{name} is new" for name in now if name not in then]
    for name in then:
        if name in now:
            wrong += [f"{name}: {line}" for line in of_entry(now[name], then[name], tolerance(name))]
    return wrong


def of_entry(now: Reference, then: Reference, tolerance: Tolerance) -> list[str]:
    """In what one variable differs."""
    if now.keys() != then.keys() or now["shape"] != then["shape"]:
        return [f"shape {now['shape']} instead of {then['shape']}"]
    size = int(np.prod(then["shape"], dtype=int))
    if "texts" in then:
        odd = [f"{a!r} instead of {b!r}" for a, b in zip(now["texts"], then["texts"], strict=True) if a != b]
        return odd[:1] if len(odd) > tolerance.allowed(len(then["texts"])) else []
    if "counts" in then:
        moved = sum((Counter(then["counts"]) - Counter(now["counts"])).values())
        return [f"counts {now['counts']} instead of {then['counts']}"] if moved > tolerance.allowed(size) else []
    return of_numbers(now, then, tolerance, size)


def of_numbers(now: Reference, then: Reference, tolerance: Tolerance, size: int) -> list[str]:
    """In what the numbers of one variable differ: how many are finite, their mean, single cells."""
    a, b = (np.array(cells["cells"], dtype=float) for cells in (now, then))
    scale = float(np.max(np.abs(b), initial=0.0, where=np.isfinite(b)))
    odd = ~tolerance.agree(a, b, scale)
    wrong = []
    if abs(now["finite"] - then["finite"]) > tolerance.allowed(size):
        wrong.append(f"{now['finite']} finite values instead of {then['finite']}")
    if np.count_nonzero(odd) > tolerance.allowed(b.size):
        worst = int(np.argmax(np.nan_to_num(np.where(odd, np.abs(a - b), 0.0), nan=np.inf)))
        wrong.append(f"{np.count_nonzero(odd)} of {b.size} cells, the worst {now['cells'][worst]} instead of "
                     f"{then['cells'][worst]}")  # fmt: skip
    # Where one more or less is finite, the means are of different values.
    comparable = now["finite"] == then["finite"] and then["mean"] is not None
    slack = (tolerance.relative + tolerance.mean) * abs(then["mean"] or 0.0) + tolerance.absolute * scale
    if comparable and abs(now["mean"] - then["mean"]) > slack:
        wrong.append(f"mean {now['mean']} instead of {then['mean']}")
    return wrong


def of_images(name: str, now: Sequence[str], then: Sequence[str] | None) -> list[str]:
    """In what a picture differs."""
    if then is None:
        return [f"picture {name} is new"]
    a, b = (np.array([list(bytes.fromhex(row)) for row in rows], dtype=float) for rows in (now, then))
    apart = np.abs(a - b)
    if apart.max() <= BLOCK_DIFFERENCE and apart.mean() <= MEAN_DIFFERENCE:
        return []
    row, column = np.unravel_index(np.argmax(apart), apart.shape)
    return [f"picture {name}: lightness differs by {apart.mean():.1f} of 255 on average, by {apart.max():.0f} in block "
            f"row {row + 1}, column {column + 1} of {BLOCKS[0]} x {BLOCKS[1]}"]  # fmt: skip
