"""The seal of a result file: its last bytes are a checksum of all others.

HDF5 pays no heed to what follows the end that its own header states, and cuts it off when it changes a file. So a file
is one of three: sealed (every byte is as gearstab wrote it), broken (bytes were damaged), or without a seal (changed or
written by another program). The checksum is BLAKE2b, computed at about 1 GB/s.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

MARK = b"\ngearstab blake2b "
DIGITS = 32
LENGTH = len(MARK) + DIGITS + 1
AT_ONCE = 1 << 20


def seal(data: bytes | memoryview) -> bytes:
    """Return the seal that is to follow ``data``."""
    return _seal(_checksum(data))


def append_seal(path: Path) -> None:
    """Append its seal to a file."""
    with open(path, "rb") as file:
        mark = _seal(_checksum_of(file, os.fstat(file.fileno()).st_size))
    with open(path, "ab") as file:
        file.write(mark)


def intact(path: str | Path) -> bool | None:
    """Return whether the seal of a file fits its contents, None where there is no seal. Raises OSError."""
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size - LENGTH
        if size < 0:
            return None
        file.seek(size)
        end = file.read(LENGTH)
        if not end.startswith(MARK):
            return None
        file.seek(0)
        return end == _seal(_checksum_of(file, size))


def _checksum(data: bytes | memoryview = b"") -> hashlib.blake2b:
    return hashlib.blake2b(data, digest_size=DIGITS // 2)


def _checksum_of(file: BinaryIO, size: int) -> hashlib.blake2b:
    total = _checksum()
    while size > 0 and (data := file.read(min(size, AT_ONCE))):
        total.update(data)
        size -= len(data)
    return total


def _seal(total: hashlib.blake2b) -> bytes:
    return MARK + total.hexdigest().encode() + b"\n"
