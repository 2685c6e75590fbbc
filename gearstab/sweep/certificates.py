"""The certificates of a result, proved again: of boundaries piece by piece, of a grid point by point.

Nothing is taken from the result but its configuration, from which the systems are built anew, and the certificates.
What has been looked at is noted in a file beside the result, so that an interrupted run goes on where it was.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.certificates.equations import Flow, Segments, flow
from gearstab.certificates.making import claimed
from gearstab.certificates.proof import Proof, unpacked
from gearstab.certificates.segments import segments
from gearstab.certificates.shares import union_length
from gearstab.certificates.verifier import Certificate
from gearstab.config import Config, ConfigError, load
from gearstab.config.document.yaml import parse
from gearstab.errors import ResultError
from gearstab.results.output import write_bytes
from gearstab.results.read import attributes, reading
from gearstab.sweep.plan import Plan, plan
from gearstab.sweep.progress import Reporter

if TYPE_CHECKING:
    import xarray as xr

AT_ONCE = 16
"""Pieces between two notes of what was looked at."""

Part = tuple[int, int]
"""A row, and the first of AT_ONCE of its pieces."""


@dataclass(frozen=True)
class CertifiedRow:
    """A row of a result: its values on the axes, its system, its pieces, or points where both ends are one.

    points: of a grid, how many there are; 0 where the pieces are those of a range.
    """

    place: Mapping[str, Any]
    system: Segments
    pieces: Sequence[Certificate]
    points: int = 0


@dataclass(frozen=True)
class ProvedRow:
    """Proved part of a row: share of the mesh frequencies, widest rest relative to them; pieces that are not.

    points: of a grid, how many; share and widest are then those of points, and 0.
    """

    place: Mapping[str, Any]
    pieces: int
    share: float
    widest: float
    refused: Sequence[Certificate]
    points: int


def verify(path: Path, jobs: int, reporter: Reporter) -> list[ProvedRow]:
    """Prove all certificates of a result with ``jobs`` processes. Raises ResultError."""
    rows, (start, stop) = certified(path)
    notes = _Notes(path)
    parts = [(k, at) for k, row in enumerate(rows) for at in range(0, len(row.pieces), AT_ONCE)]
    count = {part: len(rows[part[0]].pieces[part[1] : part[1] + AT_ONCE]) for part in parts}
    done = sum(count[part] for part in parts if part in notes.proved)
    reporter.begin("certificates", sum(count.values()), done, None, AT_ONCE * jobs)
    try:
        for part, found in _proved(rows, [part for part in parts if part not in notes.proved], jobs):
            notes.add(part, found)
            reporter.advance(len(found), 0, found.count(False))
    finally:
        reporter.end()
    notes.remove()
    return [_of_row(row, [notes.proved[part] for part in parts if part[0] == k], start, stop)
            for k, row in enumerate(rows)]  # fmt: skip


def certified(path: Path) -> tuple[list[CertifiedRow], tuple[float, float]]:
    """Return all rows of a result with their certificates, and the range of mesh frequencies. Raises ResultError."""
    planned = _plan(path)
    with reading(path) as tree:
        groups = {str(name): node.to_dataset() for name, node in tree.children.items()}
        boundaries, grid = groups.get("boundaries"), groups.get("floquet")
        rows = _pieces(planned, boundaries) if boundaries is not None and "certificate" in boundaries else []
        rows += _points(planned, grid) if grid is not None and "certified" in grid else []
    if not rows:
        raise ResultError(f"{path}: holds no certificates; methods.boundaries: {{certificate: true}} stores them")
    return rows, planned.mesh_frequency_range if planned.fast is not None else (0.0, 0.0)


def _pieces(planned: Plan, found: xr.Dataset) -> list[CertifiedRow]:
    """Return the certified rows of ``methods.boundaries``."""
    ends = found["certificate_frequency"].transpose(*planned.rows, "piece", "side").values
    numbers = found["certificate"].transpose(*planned.rows, "piece", "entry").values
    rows = []
    for place, named, system in _systems(planned, found):
        there = ~np.isnan(numbers[place][:, 0])
        rows.append(CertifiedRow(named, system, unpacked(ends[place][there], numbers[place][there])))
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
    if piece is not None and (piece.outside == 0) == bool(stable):
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


def _of_row(row: CertifiedRow, proved: Sequence[Sequence[bool]], start: float, stop: float) -> ProvedRow:
    fine = [answer for part in proved for answer in part]
    ends = [(piece.low, piece.high) for piece, good in zip(row.pieces, fine, strict=True) if good]
    covered, widest = union_length(np.array(ends).reshape(-1, 2), start, stop)
    refused = [piece for piece, good in zip(row.pieces, fine, strict=True) if not good]
    share, widest = (len(ends) / row.points, 0.0) if row.points else (covered / (stop - start), widest)
    return ProvedRow(row.place, len(fine), share, widest, refused, row.points)


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
