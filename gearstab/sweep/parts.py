"""Finished blocks, in memory or as part files.

A part file is built in memory, written under a temporary name, synchronised with the disk and renamed, so that it is
whole or not there; it carries the digest of its sweep, its own key and a checksum, and what does not agree is ignored:

    MAGIC, length of the header (8 bytes), header (JSON), chunks of all variables, SHA-256 of everything before
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import accumulate
from pathlib import Path
from typing import Protocol

from gearstab.perturbation import Tongue
from gearstab.results.write import write_bytes
from gearstab.sweep.methods import Key

MAGIC = b"gearstab part 1\n"
CHECKSUM = 32


class Finished(Protocol):
    """A finished block, wherever its chunks are."""

    @property
    def key(self) -> str: ...

    @property
    def tongues(self) -> tuple[Key, ...]: ...

    @property
    def points(self) -> int: ...

    @property
    def unstable(self) -> int: ...

    @property
    def failed(self) -> int: ...

    @property
    def kernels(self) -> tuple[str, ...]: ...

    def size(self, variable: str | None = None) -> int:
        """Bytes of a variable's chunks, of all variables without a name."""

    def pieces(self, variable: str) -> list[bytes]:
        """The encoded chunks of a variable: one, or one a tongue."""


@dataclass(frozen=True)
class Part:
    """A finished block in memory.

    key: of the block. tongues: of the dimension ``tongue`` of this block. chunks: by variable, one, or one a tongue.
    points: how many it holds; unstable, failed: how many of them are. kernels: which ones computed it.
    """

    key: str
    tongues: tuple[Key, ...]
    chunks: Mapping[str, list[bytes]]
    points: int
    unstable: int
    failed: int
    kernels: tuple[str, ...] = ()

    def size(self, variable: str | None = None) -> int:
        """Bytes of a variable's chunks, of all variables without a name."""
        return sum(len(chunk) for name, chunks in self.chunks.items() if variable in (None, name) for chunk in chunks)

    def pieces(self, variable: str) -> list[bytes]:
        """The encoded chunks of a variable."""
        return self.chunks[variable]


@dataclass(frozen=True)
class StoredPart:
    """A finished block in a file; places: by variable, (offset, length) of its chunks."""

    path: Path
    key: str
    tongues: tuple[Key, ...]
    places: Mapping[str, list[tuple[int, int]]]
    points: int
    unstable: int
    failed: int
    kernels: tuple[str, ...] = ()

    def size(self, variable: str | None = None) -> int:
        """Bytes of a variable's chunks, of all variables without a name."""
        return sum(length for name, places in self.places.items() if variable in (None, name) for _, length in places)

    def pieces(self, variable: str) -> list[bytes]:
        """The encoded chunks of a variable."""
        found = []
        with open(self.path, "rb") as file:
            for offset, length in self.places[variable]:
                file.seek(offset)
                found.append(file.read(length))
        return found


def to_bytes(part: Part, digest: str) -> bytes:
    """The contents of a part file."""
    header = {
        "digest": digest, "key": part.key,
        "tongues": [[asdict(tongue), occurrence] for tongue, occurrence in part.tongues],
        "chunks": {name: [len(chunk) for chunk in chunks] for name, chunks in part.chunks.items()},
        "points": part.points, "unstable": part.unstable, "failed": part.failed, "kernels": part.kernels,
    }  # fmt: skip
    text = json.dumps(header).encode()
    payload = [chunk for chunks in part.chunks.values() for chunk in chunks]
    data = b"".join([MAGIC, len(text).to_bytes(8, "little"), text, *payload])
    return data + hashlib.sha256(data).digest()


def from_bytes(data: bytes, path: Path, digest: str) -> StoredPart | None:
    """A part file by its contents, or None where it is damaged, cut short, or of another sweep or block."""
    body = memoryview(data)[:-CHECKSUM]
    if not data.startswith(MAGIC) or hashlib.sha256(body).digest() != data[-CHECKSUM:]:
        return None
    start = len(MAGIC) + 8
    offset = start + int.from_bytes(data[len(MAGIC) : start], "little")
    header = json.loads(bytes(body[start:offset]))
    if header["digest"] != digest or header["key"] != path.stem:
        return None
    places: dict[str, list[tuple[int, int]]] = {}
    for name, lengths in header["chunks"].items():
        ends = list(accumulate(lengths, initial=offset))
        places[name] = list(zip(ends[:-1], lengths, strict=True))
        offset = ends[-1]
    tongues = tuple((Tongue(**tongue), occurrence) for tongue, occurrence in header["tongues"])
    counts = (header["points"], header["unstable"], header["failed"])
    return StoredPart(path, header["key"], tongues, places, *counts, tuple(header.get("kernels", ())))


def read_part(path: Path, digest: str) -> StoredPart | None:
    """The part file at a path, None where there is no valid one."""
    try:
        return from_bytes(path.read_bytes(), path, digest)
    except OSError:
        return None


class PartFolder:
    """The part files of one sweep: ``OUT.parts/<digest>/``."""

    def __init__(self, out: Path, digest: str) -> None:
        self.every = out.with_name(out.name + ".parts")
        self.path = self.every / digest[:32]
        self.digest = digest

    def write(self, part: Part) -> StoredPart:
        """Write a part file. Raises OSError."""
        self.path.mkdir(parents=True, exist_ok=True)
        path = self.path / f"{part.key}.part"
        data = to_bytes(part, self.digest)
        write_bytes(path, data)
        stored = from_bytes(data, path, self.digest)
        if stored is None:
            raise ValueError(f"{path}: a part that cannot be read back")
        return stored

    def find(self, keys: set[str]) -> dict[str, StoredPart]:
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
        shutil.rmtree(self.path, ignore_errors=True)
        with suppress(OSError):
            self.every.rmdir()

    def remove_all(self) -> None:
        """Remove the part files of every sweep of this output."""
        shutil.rmtree(self.every, ignore_errors=True)
