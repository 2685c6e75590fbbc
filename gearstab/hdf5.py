"""Whether HDF5 may open a file: in a damaged one it may go round in circles for ever, or take all memory there is.

Texts and references of any length lie in *global heaps*, a structure without a checksum: the letters ``GCOL``, the
version 1, three bytes, the size (8 bytes), and objects, each of a number (2 bytes), a count (2), four bytes and a size
(8). Number 0 is free space, of that size with its head; any other is followed by its contents, padded to 8 bytes (HDF5
File Format Specification, version 3.0, III.E). HDF5 goes from one object to the next until it is beyond the heap: never
where one has no size, as in a heap that was overwritten by zeros. In 6000 files damaged at random HDF5 2.0 hung 40
times, and always there.

What refers to a text is 16 bytes: its length (4 bytes), the address of its heap (8) and the number of the object (4).
HDF5 makes room for the length, up to 4 GB, before it looks whether the heap has so much. In an attribute these bytes
follow its type (class 9, 16 bytes in size, then that of an element) and its dimensions (the same, IV.A.2).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import BinaryIO

import numpy as np

START = b"GCOL\x01"
HEAD = 16
"""Bytes of the head of a heap, and of an object."""
SMALLEST = 4096
"""Bytes of a heap: HDF5 refuses a smaller one."""
AT_ONCE = 1 << 20
SIZES = 1 << 64
"""Sums of sizes are taken modulo this."""
REFERENCE = np.dtype([("length", "<u4"), ("heap", "<u8"), ("object", "<u4")])
LIST = 9
"""Class of the type of lists."""
SIZED = REFERENCE.itemsize.to_bytes(4, "little")
ELEMENTS = {0: 12, 3: 8, 7: 8}
"""Class of the type of an element -> bytes of that type: a text is one of octets or of characters; references."""
OF = bytes(version << 4 | kind for version in (1, 2, 3) for kind in ELEMENTS)
"""How the type of an element may begin."""
MOST_DIMENSIONS = 32


def endless(path: str | Path) -> bool:
    """Return whether a heap of a file would hold HDF5 for ever. Reads all of the file, 2 GB/s. Raises OSError."""
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        return any(_circles(file, start, size) for start in _places(path, START))


def overlong(path: str | Path) -> bool:
    """Return whether an attribute of a file has a text, or a list, longer than the file.

    Reads all of the file, 2 GB/s. Raises OSError.
    """
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        places = _places(path, SIZED, OF)
        return any(exceeds(path, *_list(file, place - 4), size) for place in places)


def exceeds(path: str | Path, place: int, count: int, size: int) -> bool:
    """Return whether one of ``count`` references at a place of a file claims more than ``size`` bytes.

    Raises OSError.
    """
    found = np.fromfile(path, REFERENCE, min(count, size // REFERENCE.itemsize), offset=place)
    return bool((found["length"] > size).any())


def holds(path: str | Path, text: str) -> bool:
    """Return whether a text is one of those in a file, told without HDF5. Raises OSError."""
    octets = text.encode()
    return next(_places(path, len(octets).to_bytes(8, "little") + octets), None) is not None


def _places(path: str | Path, wanted: bytes, then: bytes = b"") -> Iterator[int]:
    """Where these bytes stand in a file, followed by one of others where some are given."""
    pattern = re.compile(re.escape(wanted) + (b"[" + re.escape(then) + b"]" if then else b""))
    end, last, length = 0, b"", len(wanted) + bool(then)
    with open(path, "rb", buffering=0) as file:
        while piece := file.read(AT_ONCE):
            held = last + piece
            yield from (end - len(last) + hit.start() for hit in pattern.finditer(held))
            end, last = end + len(piece), held[1 - length :]


def _circles(file: BinaryIO, start: int, most: int) -> bool:
    """Whether the objects of a heap never come to its end; what looks like one by chance has no possible size."""
    size = _number(file, start + 8)
    if not SMALLEST <= size <= most - start:
        return False
    place, end = start + HEAD, start + size
    while place + HEAD <= end:
        size = _number(file, place + 8)
        if _number(file, place, 2):
            size = (HEAD + -(-size // 8) * 8) % SIZES
        if size == 0 or size >= SIZES // 2:  # the latter leads back
            return True
        place += size
    return False


def _list(file: BinaryIO, start: int) -> tuple[int, int]:
    """Where the references of an attribute are whose type begins here, and how many; none where it is no such type."""
    if start < 0 or _number(file, start, 1) & 15 != LIST:
        return 0, 0
    place = start + 8 + ELEMENTS[_number(file, start + 8, 1) & 15]
    # Older attributes pad the type to 8 bytes, and dimensions never begin with a zero.
    if not (version := _number(file, place, 1)):
        place += 4
        version = _number(file, place, 1)
    rank, flags = _number(file, place + 1, 1), _number(file, place + 2, 1)
    if version not in (1, 2) or rank > MOST_DIMENSIONS or flags > 1:
        return 0, 0
    if version == 1 and _number(file, place + 3, 5):
        return 0, 0
    place += 8 if version == 1 else 4
    sizes = [_number(file, place + 8 * k) for k in range(rank)]
    return place + 8 * rank * (1 + flags), prod(sizes)


def _number(file: BinaryIO, place: int, octets: int = 8) -> int:
    file.seek(place)
    return int.from_bytes(file.read(octets), "little")
