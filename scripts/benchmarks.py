"""The published benchmark set: numbers of papers and of independent programs against what comes out here.

python scripts/benchmarks.py [NAME...]     runs configs/benchmarks/NAME.yaml (all without names) and prints the table

A benchmark is a YAML file of its own kind:

    title, source, doi     what is compared, the whole reference, its DOI where it has one
    configuration          a configuration, by its path from this file, or the sections `system`, `sweep`, `methods`
    sweep, methods, respond  take the place of the configuration's own sections
    cases                  a list; each has `set` (paths and values, as `gearstab --set`) and `values`

and each of the values has

    name                   what the table calls it
    of                     a variable of the result, group/name
    at                     coordinates: numbers (the nearest is taken), texts, or lists of them
    factor, power          the number compared is factor * value ** power, for other units (default 1 and 1)
    nearest                true where `of` holds the edges of all tongues: each published one must be among them
    published, tolerance   a number or a list, and how far ours may be (absolute)
    relative               true where the tolerance is relative
    differs                why ours is another number; then the difference is expected, and its absence is an error
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr

from statements import CONFIGS, Runs

FOLDER = CONFIGS / "benchmarks"
SECTIONS = ("sweep", "methods", "respond")
KEYS = {"title", "source", "doi", "configuration", "cases", *SECTIONS}
VALUE_KEYS = {
    "name", "of", "at", "factor", "power", "nearest", "published", "tolerance", "relative", "differs",
}  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One published number: its name, ours, theirs, the difference allowed, and why they are expected to differ."""

    name: str
    ours: float
    theirs: float
    tolerance: float
    differs: str = ""

    @property
    def difference(self) -> float:
        """Ours less theirs."""
        return self.ours - self.theirs

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the tolerance; a number that is missing is not."""
        return bool(abs(self.difference) <= self.tolerance)

    @property
    def expected(self) -> bool:
        """Whether it agrees where it should, and differs where the file says why."""
        return self.agrees != bool(self.differs)

    @property
    def verdict(self) -> str:
        """Verdict in the words of the table."""
        if self.agrees:
            return "agrees" if self.expected else "agrees, though said to differ"
        return f"differs: {self.differs}" if self.differs else "DIFFERS"


def plain(path: Path) -> dict[str, Any]:
    """A YAML file as plain data."""
    from ruamel.yaml import YAML

    data = YAML(typ="safe").load(path.read_text())
    assert isinstance(data, dict), path
    return data


def configuration(path: Path, benchmark: Mapping[str, Any]) -> dict[str, Any]:
    """The configuration of a benchmark, with its own sections in their places."""
    base = benchmark["configuration"]
    found = plain((path.parent / base).resolve()) if isinstance(base, str) else dict(base)
    own = {section: benchmark[section] for section in SECTIONS if section in benchmark}
    if own:
        found = {key: value for key, value in found.items() if key not in SECTIONS} | own
    return {"title": benchmark["title"]} | found


def select(data: xr.Dataset, name: str, at: Mapping[str, Any]) -> np.ndarray:
    """The values of a variable at some coordinates, flat."""
    for key, wanted in at.items():
        coordinate = data[key]
        if coordinate.dtype.kind in "fiu":
            (dim,) = coordinate.dims
            places = np.abs(np.subtract.outer(np.atleast_1d(wanted), coordinate.values)).argmin(axis=1)
        else:
            (dim,) = coordinate.dims
            known = [str(text) for text in coordinate.values]
            places = np.array([known.index(text) for text in np.atleast_1d(wanted)])
        data = data.isel({dim: places})
    return np.asarray(data[name].values, dtype=float).ravel()


def rows(tree: xr.DataTree, value: Mapping[str, Any]) -> Iterator[Row]:
    """The rows of one entry of a file."""
    if unknown := value.keys() - VALUE_KEYS:
        raise ValueError(f"unknown keys: {', '.join(sorted(unknown))}")
    group, name = value["of"].split("/")
    found = select(tree[group].to_dataset(), name, value.get("at", {}))
    with np.errstate(divide="ignore"):
        found = value.get("factor", 1.0) * found ** value.get("power", 1)
    published = np.atleast_1d(np.asarray(value["published"], dtype=float))
    if value.get("nearest"):
        found = found[np.isfinite(found)]
        found = found[np.abs(np.subtract.outer(published, found)).argmin(axis=1)]
    if found.shape != published.shape:
        raise ValueError(f"{value['name']}: {found.size} values here, {published.size} published")
    allowed = value["tolerance"] * (np.abs(published) if value.get("relative") else np.ones(published.size))
    for k, (ours, theirs, most) in enumerate(zip(found, published, allowed, strict=True)):
        label = value["name"] if published.size == 1 else f"{value['name']} [{k + 1}]"
        yield Row(label, float(ours), float(theirs), float(most), value.get("differs", ""))


def compared(path: Path, runs: Runs) -> list[Row]:
    """All rows of a benchmark."""
    benchmark = plain(path)
    if unknown := benchmark.keys() - KEYS:
        raise ValueError(f"{path.name}: unknown keys: {', '.join(sorted(unknown))}")
    text = json.dumps(configuration(path, benchmark))
    found = []
    for case in benchmark["cases"]:
        settings = {name.replace(".", "__"): value for name, value in case.get("set", {}).items()}
        run = runs.respond if '"respond"' in text else runs.sweep
        tree = run(runs.config(text), **settings)
        for value in case["values"]:
            found += list(rows(tree, value))
    return found


def table(path: Path, found: Sequence[Row]) -> str:
    """The table of one benchmark, as text."""
    benchmark = plain(path)
    doi = f" doi:{benchmark['doi']}" if benchmark.get("doi") else ""
    lines = [f"{path.stem}: {benchmark['title']}", f"  {' '.join(benchmark['source'].split())}{doi}"]
    lines.append(f"  {'':34} {'ours':>16} {'theirs':>16} {'difference':>11} {'allowed':>8}  verdict")
    for row in found:
        lines.append(
            f"  {row.name:34} {row.ours:16.10g} {row.theirs:16.10g} {row.difference:11.1e} {row.tolerance:8.0e}"
            f"  {row.verdict}"
        )
    return "\n".join(lines) + "\n"


def main(names: Sequence[str]) -> int:
    """Print the tables; returns 1 where a number is not as expected."""
    paths = [FOLDER / f"{name}.yaml" for name in names] or sorted(FOLDER.glob("*.yaml"))
    total = unexpected = known = 0
    for path in paths:
        with TemporaryDirectory() as folder:
            found = compared(path, Runs(Path(folder)))
        print(table(path, found), flush=True)
        total += len(found)
        known += sum(bool(row.differs) for row in found)
        unexpected += sum(not row.expected for row in found)
    agree = total - known - unexpected
    print(f"{total} numbers: {agree} agree, {known} differ for a known reason, {unexpected} are not as expected")
    return 1 if unexpected else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
