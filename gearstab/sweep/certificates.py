"""The certificates of a result, proved again piece by piece.

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
from typing import Any

import numpy as np

from gearstab.certificates.equations import Segments, flow
from gearstab.certificates.segments import segments
from gearstab.certificates.shares import union_length
from gearstab.certificates.stored import unpacked
from gearstab.certificates.verifier import Certificate, proves
from gearstab.config import Config, ConfigError, load, parameters_at
from gearstab.config.document.yaml import parse
from gearstab.errors import ResultError
from gearstab.results.output import write_bytes
from gearstab.results.read import attributes, reading
from gearstab.sweep.plan import Plan, plan
from gearstab.sweep.reporter import Reporter
from gearstab.systems import build

AT_ONCE = 16
"""Pieces between two notes of what was looked at."""


@dataclass(frozen=True)
class CertifiedRow:
    """A row of a result: its values on the axes, its system, its pieces."""

    place: Mapping[str, Any]
    system: Segments
    pieces: Sequence[Certificate]


@dataclass(frozen=True)
class ProvedRow:
    """What of a row is proved: share of the mesh frequencies, widest rest relative to them; pieces that are not."""

    place: Mapping[str, Any]
    pieces: int
    share: float
    widest: float
    refused: Sequence[Certificate]


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
        found = tree["boundaries"].to_dataset() if "boundaries" in tree.children else None
        if found is None or "certificate" not in found:
            raise ResultError(f"{path}: holds no certificates; methods.boundaries: {{certificate: true}} stores them")
        axes = [str(dim) for dim in found["certificate_frequency"].dims[2:]]
        ends = found["certificate_frequency"].transpose(*axes, "piece", "side").values
        numbers = found["certificate"].transpose(*axes, "piece", "entry").values
        labels = {name: found[name].values for name in axes}
    rows = []
    for place in np.ndindex(*ends.shape[:-2]):
        index = dict(zip(axes, place, strict=True))
        there = ~np.isnan(numbers[place][:, 0])
        system = build(parameters_at(planned.config, {name: np.array([k]) for name, k in index.items()}))
        named = {name: labels[name][k] for name, k in index.items()}
        rows.append(CertifiedRow(named, segments(system)[0], unpacked(ends[place][there], numbers[place][there])))
    return rows, planned.mesh_frequency_range


def _plan(path: Path) -> Plan:
    """What the result was computed from."""
    found = attributes(path)
    source = path.parent / found.get("config_file", path.name)
    try:
        config: Config = load(parse(found["config"], str(path)).data, source=source)
    except (ConfigError, KeyError) as error:
        raise ResultError(f"{path}: its configuration cannot be read: {str(error).splitlines()[0]}") from None
    if config.digest != found.get("config_digest"):
        raise ResultError(f"{path}: files that its configuration refers to have changed")
    return plan(config)


def _proved(
    rows: Sequence[CertifiedRow], parts: Sequence[tuple[int, int]], jobs: int
) -> Iterator[tuple[tuple[int, int], list[bool]]]:
    """Which pieces of each part are proved, as soon as it is known."""
    work = {part: (rows[part[0]].system, rows[part[0]].pieces[part[1] : part[1] + AT_ONCE]) for part in parts}
    if jobs == 1:
        for part, given in work.items():
            yield part, prove(*given)
        return
    with ProcessPoolExecutor(jobs) as pool:
        try:
            futures = {pool.submit(prove, *given): part for part, given in work.items()}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def prove(system: Segments, pieces: Sequence[Certificate]) -> list[bool]:
    """Return which pieces are proved."""
    known = flow(system)
    return [proves(known, piece) for piece in pieces]


def _of_row(row: CertifiedRow, proved: Sequence[Sequence[bool]], start: float, stop: float) -> ProvedRow:
    fine = [answer for part in proved for answer in part]
    ends = [(piece.low, piece.high) for piece, good in zip(row.pieces, fine, strict=True) if good]
    covered, widest = union_length(np.array(ends).reshape(-1, 2), start, stop)
    refused = [piece for piece, good in zip(row.pieces, fine, strict=True) if not good]
    return ProvedRow(row.place, len(fine), covered / (stop - start), widest, refused)


class _Notes:
    """What of a result was looked at, in a file beside it that counts while the result stays as it is."""

    def __init__(self, result: Path) -> None:
        self.path = result.with_name(result.name + ".verified")
        found = result.stat()
        self.of = [found.st_size, found.st_mtime_ns]
        self.proved: dict[tuple[int, int], list[bool]] = {}
        if self.path.exists():
            with suppress(ValueError, KeyError, TypeError):  # cut short: begin anew
                kept = json.loads(self.path.read_text())
                if kept["of"] == self.of:
                    self.proved = {(row, at): answers for row, at, answers in kept["proved"]}

    def add(self, part: tuple[int, int], answers: list[bool]) -> None:
        """Keep an answer."""
        self.proved[part] = answers
        kept = {"of": self.of, "proved": [[*part, answers] for part, answers in self.proved.items()]}
        write_bytes(self.path, json.dumps(kept).encode())

    def remove(self) -> None:
        """Nothing is left to go on with."""
        self.path.unlink(missing_ok=True)
