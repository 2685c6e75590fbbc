"""Finished blocks, in memory or as part files.

A part file is built in memory, written under a temporary name, synchronised with the disk and renamed, so that it is
whole or not there; it carries the digest of its sweep, its own key and a checksum, and what does not agree is ignored:

    MAGIC, length of the header (8 bytes), header (JSON), chunks of all variables, CRC-32 of everything before (4 bytes)

The checksum tells damage. Whoever forges a part can compute it too: what a part says is looked at all the same.
"""

from __future__ import annotations

import json
import os
import shutil
import stat
import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from itertools import accumulate
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearstab.errors import OutputError
from gearstab.methods import Key
from gearstab.results.hdf5 import crc32
from gearstab.results.output import writing
from gearstab.results.tree import Encoded, InFile, octets

if TYPE_CHECKING:
    from gearstab.perturbation import Tongue

MAGIC = b"gearstab part 4\n"
CHECKSUM = 4
MOST_BYTES = 1 << 30
"""Size of a part file: some ten times what the largest block of any method takes."""


@dataclass(frozen=True)
class FinishedBlock:
    """A finished block.

    key: of the block. tongues: of the dimension ``tongue`` of this block. places: by variable, (offset, length) of its
    chunks, one, or one per tongue, in the part file at ``path``, or else in ``held``, in memory.
    points: how many it holds; unstable, failed: how many of them are; flags: how many carry each flag of ``status``.
    """

    key: str
    tongues: tuple[Key, ...]
    places: Mapping[str, list[tuple[int, int]]]
    points: int
    unstable: int
    failed: int
    flags: Mapping[str, int]
    held: bytes = b""
    path: Path | None = None

    @property
    def variables(self) -> Collection[str]:
        """Names of its variables."""
        return self.places.keys()

    def size(self, variable: str | None = None) -> int:
        """Bytes of a variable's chunks, of all variables without a name."""
        return sum(length for name, places in self.places.items() if variable in (None, name) for _, length in places)

    def encoded(self, variable: str) -> list[Encoded]:
        """The encoded chunks of a variable, one, or one per tongue: their bytes, or where these are."""
        if self.path is None:
            return [self.held[offset : offset + length] for offset, length in self.places[variable]]
        return [InFile(self.path, offset, length) for offset, length in self.places[variable]]

    def pieces(self, variable: str) -> list[bytes]:
        """The bytes of these chunks."""
        return [octets(chunk) for chunk in self.encoded(variable)]


def places_of(lengths: Mapping[str, list[int]], offset: int = 0) -> dict[str, list[tuple[int, int]]]:
    """Return (offset, length) of all chunks, which follow one another from ``offset`` on."""
    places = {}
    for name, sizes in lengths.items():
        ends = list(accumulate(sizes, initial=offset))
        places[name] = list(zip(ends[:-1], sizes, strict=True))
        offset = ends[-1]
    return places


def head_of(part: FinishedBlock, digest: str) -> bytes:
    """Head of a part file, before the chunks."""
    header = {
        "digest": digest, "key": part.key,
        "tongues": [[asdict(tongue), occurrence] for tongue, occurrence in part.tongues],
        "chunks": {name: [length for _, length in places] for name, places in part.places.items()},
        "points": part.points, "unstable": part.unstable, "failed": part.failed, "flags": dict(part.flags),
    }  # fmt: skip
    text = json.dumps(header).encode()
    return MAGIC + len(text).to_bytes(8, "little") + text


def checksum(*pieces: bytes | memoryview) -> bytes:
    """Index behind the pieces of a part file."""
    total = 0
    for piece in pieces:
        total = crc32(piece, total)
    return total.to_bytes(CHECKSUM, "little")


def from_bytes(data: bytes, path: Path, digest: str) -> FinishedBlock | None:
    """A part file by its contents, or None where it is damaged, cut short, or of another sweep or block."""
    body = memoryview(data)[:-CHECKSUM]
    if not data.startswith(MAGIC) or checksum(body) != data[-CHECKSUM:]:
        return None
    try:
        part = _from_body(body, path, digest)
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        return None  # somebody made it, with the right checksum
    return part


def _from_body(body: memoryview, path: Path, digest: str) -> FinishedBlock | None:
    start = len(MAGIC) + 8
    offset = start + int.from_bytes(body[len(MAGIC) : start], "little")
    header = json.loads(bytes(body[start:offset]))
    if header["digest"] != digest or header["key"] != path.stem:
        return None
    lengths = {str(name): [index(length) for length in sizes] for name, sizes in header["chunks"].items()}
    places = places_of(lengths, offset)
    tongues = tuple((_tongue(tongue), int(occurrence)) for tongue, occurrence in header["tongues"])
    points, unstable, failed = (int(header[name]) for name in ("points", "unstable", "failed"))
    flags = {str(name): int(count) for name, count in header["flags"].items()}
    if offset + sum(length for chunks in places.values() for _, length in chunks) != len(body):
        return None
    return FinishedBlock(header["key"], tongues, places, points, unstable, failed, flags, path=path)


def _tongue(entries: Mapping[str, Any]) -> Tongue:
    from gearstab.perturbation import Tongue  # takes as long to load as a small sweep to run

    kinds = {"int": int, "float": float, "str": str}
    return Tongue(**{item.name: kinds[str(item.type)](entries[item.name]) for item in fields(Tongue)})


def read_part(path: Path, digest: str) -> FinishedBlock | None:
    """The part file at a path, None where there is no valid one; a link or a pipe is none."""
    try:
        found = path.lstat()
        sound = stat.S_ISREG(found.st_mode) and found.st_size <= MOST_BYTES
        return from_bytes(path.read_bytes(), path, digest) if sound else None
    except OSError:
        return None


LOCK = "lock"
"""The file by which sweeps tell one another that they use a folder."""
WAITS = (0.0, 0.1, 0.3, 0.6)
"""Seconds before each attempt to remove a folder; a worker looks for its parent every half second."""


class PartFolder:
    """The part files of one sweep: ``OUT.parts/<digest>/``."""

    def __init__(self, out: Path, digest: str) -> None:
        self.every = out.with_name(out.name + ".parts")
        self.path = self.every / digest[:32]
        self.digest = digest

    def check(self) -> None:
        """Raise OutputError if there is something in the way of the folder, or in it, that nobody can write over."""
        for path in (self.every, self.path):
            if path.is_symlink() or (path.exists() and not path.is_dir()):
                what = "a link" if path.is_symlink() else "no folder"
                raise OutputError(f"{path}: is {what}, but finished blocks go there; remove it or choose another -o")
            if path.exists() and not os.access(path, os.R_OK | os.W_OK | os.X_OK):
                allow = "allow it with chmod u+rwx, remove it or choose another -o"
                raise OutputError(f"{path}: finished blocks go there, but it cannot be read and written; {allow}")
        # An equal sweep may remove the folder at any moment.
        with suppress(FileNotFoundError), os.scandir(self.path) as entries:
            for found in entries:
                if found.is_dir(follow_symlinks=False) or (found.name == LOCK and not _usable(found)):
                    raise OutputError(f"{found.path}: is in the way of finished blocks; remove it or choose another -o")

    def write(self, part: FinishedBlock) -> FinishedBlock:
        """Write a part file. Raises OSError."""
        path = self.path / f"{part.key}.part"
        head = head_of(part, self.digest)
        if path.is_symlink() or path.is_fifo() or (path.exists() and not os.access(path, os.R_OK)):
            path.unlink()  # which nothing here made, and would be written through, or leave its mode to the new file
        with writing(path) as file:
            for piece in (head, part.held, checksum(head, part.held)):
                file.write(piece)
        lengths = {name: [length for _, length in places] for name, places in part.places.items()}
        return replace(part, places=places_of(lengths, len(head)), held=b"", path=path)

    def find(self, keys: set[str]) -> dict[str, FinishedBlock]:
        """All part files of these blocks that are valid."""
        found = {}
        for path in sorted(self.path.glob("*.part")) if self.path.is_dir() else ():
            if path.stem in keys and (part := read_part(path, self.digest)):
                found[part.key] = part
        return found

    def count(self) -> int:
        """Number of part files."""
        return sum(1 for _ in self.path.glob("*.part"))

    def remove(self) -> None:
        """Remove the part files of this sweep, and the folder if no other sweep has any."""
        # A worker whose sweep was killed may write another part before it notices.
        for wait in WAITS:
            time.sleep(wait)
            shutil.rmtree(self.path, ignore_errors=True)
            if not self.path.exists():
                break
        with suppress(OSError):
            self.every.rmdir()

    def others(self) -> list[Path]:
        """The folders with parts of other sweeps of this output: of earlier states of its configuration, mostly."""
        if not self.every.is_dir():
            return []
        found = [path for path in sorted(self.every.iterdir()) if path.is_dir() and not path.is_symlink()]
        return [path for path in found if path != self.path]


def _usable(lock: os.DirEntry[str]) -> bool:
    """Whether what has the name of the lock is one, or has gone: a link might lead anywhere."""
    usable = lock.is_file(follow_symlinks=False) and os.access(lock, os.R_OK | os.W_OK)
    return usable or not os.path.lexists(lock)
