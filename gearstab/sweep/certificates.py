"""The certificates of a result, proved again: of boundaries piece by piece, of a grid point by point.

Nothing is taken from the result but its configuration, from which the systems are built anew, and the certificates.
What has been looked at is noted in a file beside the result, so that an interrupted run goes on where it was.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.certificates.covering import claimed
from gearstab.certificates.equations import Flow, Segments, flow
from gearstab.certificates.proof import Proof, unpacked
from gearstab.certificates.segments import segments
from gearstab.certificates.shares import around_edges, union_length
from gearstab.certificates.verifier import Certificate
from gearstab.config import Config, ConfigError, load
from gearstab.config.document.yaml import parse
from gearstab.errors import ResultError
from gearstab.results.output import write_bytes
from gearstab.results.read import attributes, reading
from gearstab.sweep.plan import Plan, plan
from gearstab.sweep.progress import Reporter
from gearstab.system import Array

if TYPE_CHECKING:
    import xarray as xr

SAID = "certified_share", "uncertified_width", "uncertified_at_boundary"
"""Variables that say how much of a range its pieces cover."""
AGREES = 1e-9
"""Error of what they say."""
AT_ONCE = 16
"""Pieces between two notes of what was looked at."""

Part = tuple[int, int]
"""A row, and the first of AT_ONCE of its pieces."""


@dataclass(frozen=True)
class CertifiedRow:
    """A row of a result: its values on the axes, its system, its pieces, or points where both ends are one.

    points: of a grid, how many there are; 0 where the pieces are those of a range. edges: as stored, of any shape.
    said: what the variables SAID hold.
    """

    place: Mapping[str, Any]
    system: Segments
    pieces: Sequence[Certificate]
    points: int = 0
    edges: Array = field(default_factory=lambda: np.empty(0))
    said: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class ProvedRow:
    """Proved part of a row: share of the mesh frequencies, widest rest relative to them; pieces that are not.

    points: of a grid, how many; share and widest are then those of points, and 0. earlier: how many pieces an
    interrupted run has looked at. agrees: whether what is stored about shares and edges is what is proved.
    """

    place: Mapping[str, Any]
    pieces: int
    share: float
    widest: float
    refused: Sequence[Certificate]
    points: int
    earlier: int
    agrees: bool


def verify(path: Path, jobs: int, reporter: Reporter) -> list[ProvedRow]:
    """Prove all certificates of a result with ``jobs`` processes. Raises ResultError."""
    rows, (start, stop) = certified(path)
    notes = _Notes(path)
    earlier = set(notes.proved)
    parts = [(k, at) for k, row in enumerate(rows) for at in range(0, len(row.pieces), AT_ONCE)]
    count = {part: len(rows[part[0]].pieces[part[1] : part[1] + AT_ONCE]) for part in parts}
    done = sum(count[part] for part in parts if part in earlier)
    reporter.begin("certificates", sum(count.values()), done, None, AT_ONCE * jobs)
    try:
        for part, found in _proved(rows, [part for part in parts if part not in earlier], jobs):
            notes.add(part, found)
            reporter.advance(len(found), 0, found.count(False))
    finally:
        reporter.end()
    notes.remove()
    answers = []
    for k, row in enumerate(rows):
        own = [part for part in parts if part[0] == k]
        fine = [answer for part in own for answer in notes.proved[part]]
        answers.append(_of_row(row, fine, sum(count[part] for part in own if part in earlier), start, stop))
    return answers


def certified(path: Path) -> tuple[list[CertifiedRow], tuple[float, float]]:
    """Return all rows of a result with their certificates, and the range of mesh frequencies. Raises ResultError."""
    planned = _plan(path)
    with reading(path) as tree:
        groups = {str(name): node.to_dataset() for name, node in tree.children.items()}
        _refuse_other_labels(path, planned, groups)
        boundaries, grid = groups.get("boundaries"), groups.get("floquet")
        rows = _pieces(planned, boundaries) if boundaries is not None and "certificate" in boundaries else []
        rows += _points(planned, grid) if grid is not None and "certified" in grid else []
    if not rows:
        raise ResultError(f"{path}: holds no certificates; methods.boundaries: {{certificate: true}} stores them")
    return rows, planned.mesh_frequency_range if planned.fast is not None else (0.0, 0.0)


def _refuse_other_labels(path: Path, planned: Plan, groups: Mapping[str, xr.Dataset]) -> None:
    """Raise ResultError where values on axes, which say what a row is about, are not those of the configuration."""
    for axis in (*planned.row_axes, *([planned.fast] if planned.fast else [])):
        for found in groups.values():
            if axis.name in found and list(found[axis.name].values) != list(axis.values):
                raise ResultError(f"{path}: its values of {axis.name} are not those of its configuration")


def _pieces(planned: Plan, found: xr.Dataset) -> list[CertifiedRow]:
    """Return the certified rows of ``methods.boundaries``."""
    ends = found["certificate_frequency"].transpose(*planned.rows, "piece", "side").values
    numbers = found["certificate"].transpose(*planned.rows, "piece", "entry").values
    edges = found["boundary_frequency"].transpose(*planned.rows, ...).values
    said = {name: found[name].transpose(*planned.rows, ...).values for name in SAID if name in found}
    rows = []
    for place, named, system in _systems(planned, found):
        there = ~np.isnan(numbers[place][:, 0])
        pieces = unpacked(ends[place][there], numbers[place][there])
        own = {name: values[place] for name, values in said.items()}
        rows.append(CertifiedRow(named, system, pieces, 0, edges[place], own))
    return rows


def _points(planned: Plan, found: xr.Dataset) -> list[CertifiedRow]:
    """Return the certified rows of ``methods.floquet``, whose coordinates are found anew."""
    order = (*planned.rows, *([planned.fast.name] if planned.fast else []))
    marks, stable = (found[name].transpose(*order).values for name in ("certified", "stable"))
    rows = []
    for place, named, system in _systems(planned, found):
        index = {name: np.array([k]) for name, k in zip(planned.rows, place, strict=True)}
        omega = np.ravel(planned.mesh_frequency(index, np.arange(planned.fast.size if planned.fast else 1)))
        there, known = np.atleast_1d(marks[place]) != 0, flow(system)
        claims = zip(omega[there].tolist(), np.atleast_1d(stable[place])[there].tolist(), strict=True)
        rows.append(CertifiedRow(named, system, [_point(known, *claim) for claim in claims], len(omega)))
    return rows


def _point(known: Flow, omega: float, stable: int) -> Certificate:
    """A certificate of what is said of a point; one that nobody can prove where its multipliers say otherwise."""
    piece = claimed(known, omega, omega)
    if piece is not None and stable == int(piece.outside == 0):
        return piece
    return Certificate(omega, omega, 0 if stable else 1, 1.0, np.zeros((1, 1)))


def _systems(planned: Plan, found: xr.Dataset) -> Iterator[tuple[tuple[int, ...], dict[str, Any], Segments]]:
    """Yield the place, the values on the axes and the system of each row."""
    for place in np.ndindex(*(axis.size for axis in planned.row_axes)):
        index = dict(zip(planned.rows, place, strict=True))
        system = planned.config.at({name: np.array([k]) for name, k in index.items()}).build()
        yield place, {name: found[name].values[k] for name, k in index.items()}, segments(system)[0]


def _plan(path: Path) -> Plan:
    """Return the plan that the result was computed from."""
    found = attributes(path)
    source = path.parent / found.get("config_file", path.name)
    try:
        config: Config = load(parse(found["config"], str(path)).data, source=source)
    except (ConfigError, KeyError) as error:
        raise ResultError(f"{path}: its configuration cannot be read: {str(error).splitlines()[0]}") from None
    if config.digest != found.get("config_digest"):
        raise ResultError(f"{path}: files that its configuration refers to have changed")
    return plan(config)


def _proved(rows: Sequence[CertifiedRow], parts: Sequence[Part], jobs: int) -> Iterator[tuple[Part, list[bool]]]:
    """Which pieces of each part are proved, as soon as it is known."""
    if jobs == 1:
        prover = _Prover(rows)
        for part in parts:
            yield part, prover(part)
        return
    with ProcessPoolExecutor(jobs, initializer=_begin, initargs=(rows,)) as pool:
        try:
            futures = {pool.submit(_prove, part): part for part in parts}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


_prover: _Prover


class _Prover:
    """Proves parts of rows; what is known of a row serves all its parts."""

    def __init__(self, rows: Sequence[CertifiedRow]) -> None:
        self.rows, self.row = rows, -1

    def __call__(self, part: Part) -> list[bool]:
        """Which pieces are proved."""
        row, at = part
        if row != self.row:
            self.row, self.proof = row, Proof(flow(self.rows[row].system))
        return [self.proof(piece) for piece in self.rows[row].pieces[at : at + AT_ONCE]]


def _begin(rows: Sequence[CertifiedRow]) -> None:
    """The prover of a process that works for another."""
    global _prover
    _prover = _Prover(rows)


def _prove(part: Part) -> list[bool]:
    return _prover(part)


def _of_row(row: CertifiedRow, fine: Sequence[bool], earlier: int, start: float, stop: float) -> ProvedRow:
    ends = np.array([(piece.low, piece.high) for piece, good in zip(row.pieces, fine, strict=True) if good])
    refused = [piece for piece, good in zip(row.pieces, fine, strict=True) if not good]
    if row.points:
        return ProvedRow(row.place, len(fine), len(ends) / row.points, 0.0, refused, row.points, earlier, True)
    ends = ends.reshape(-1, 2)
    covered, widest = union_length(ends, start, stop)
    share = covered / (stop - start)
    proved = np.array(share), np.array(widest), around_edges(row.edges, ends, start, stop)
    said = [(row.said.get(name, value), value) for name, value in zip(SAID, proved, strict=True)]
    agrees = all(np.allclose(a, b, AGREES, AGREES, equal_nan=True) for a, b in said)
    return ProvedRow(row.place, len(fine), share, widest, refused, 0, earlier, agrees)


class _Notes:
    """Progress of a verification, in a file beside it that counts while the result stays as it is."""

    def __init__(self, result: Path) -> None:
        self.path = result.with_name(result.name + ".verified")
        found = result.stat()
        self.of = [found.st_size, found.st_mtime_ns]
        self.proved: dict[Part, list[bool]] = {}
        if self.path.exists():
            with suppress(ValueError, KeyError, TypeError):  # cut short: begin anew
                kept = json.loads(self.path.read_text())
                if kept["of"] == self.of:
                    self.proved = {(row, at): answers for row, at, answers in kept["proved"]}

    def add(self, part: Part, answers: list[bool]) -> None:
        """Keep an answer."""
        self.proved[part] = answers
        kept = {"of": self.of, "proved": [[*part, answers] for part, answers in self.proved.items()]}
        write_bytes(self.path, json.dumps(kept).encode())

    def remove(self) -> None:
        """Nothing is left to go on with."""
        self.path.unlink(missing_ok=True)
