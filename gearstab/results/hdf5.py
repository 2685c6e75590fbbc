"""Bytes of a result file: the file that HDF5 writes to, the seal at its end, and the chunks of arrays.

Where a write fails the HDF5 library may crash, at the latest when it closes the file. It writes to a :class:`Sink`,
which tells it that all is well: the first error is kept and raised when HDF5 has closed its file.

The seal, a file's last bytes, is a checksum of all others. HDF5 pays no heed to what follows the end that its own
header states, and cuts it off when it changes a file. So a file is one of three: sealed (every byte is as gearstab
wrote it), broken (bytes were damaged), or without a seal (changed or written by another program). The checksum shows
damage, not forgery, which no checksum without a secret could; CRC-32 misses one damage in 4 * 10^9, and is computed at
16 GB/s by ISA-L, at 2 GB/s by zlib, where BLAKE2b and SHA-256 do 1 GB/s.

Chunks are encoded here as HDF5's deflate filter stores them: the threads or processes that computed the values can then
do it too (HDF5 runs under one lock), and a merge of any number of parts copies bytes. The filter shuffle is left out:
with ISA-L, which encodes growth rates at 4 to 8 ns a value where zlib takes 50, it costs as much again as encoding.
"""

from __future__ import annotations

import gc
import io
import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

try:
    from isal.isal_zlib import compress, crc32
except ImportError:  # where it has no wheel
    from zlib import compress, crc32

if TYPE_CHECKING:
    import h5py

Array = np.ndarray


class Sink(io.FileIO):
    """An open file as the driver ``fileobj`` of h5py wants it; closing it leaves the file open."""

    def __init__(self, handle: int) -> None:
        super().__init__(handle, "r+", closefd=False)
        self.error: BaseException | None = None

    def write(self, data: Any) -> int:
        """Write all of it. An interrupt is kept like an error: neither may pass through HDF5."""
        rest = memoryview(data).cast("B")
        count = len(rest)
        try:
            while rest and self.error is None:
                rest = rest[super().write(rest) or 0 :]
        except BaseException as error:
            self.error = error
        return count

    def settle(self) -> None:
        """Raise what was kept, if anything."""
        if self.error is not None:
            raise self.error

    @contextmanager
    def hdf5(self) -> Iterator[h5py.File]:
        """Give an empty HDF5 file to fill. Raises what was kept, in place of whatever followed from it.

        No garbage is collected meanwhile: what h5py left in it would call HDF5 from inside one of its own calls.
        """
        import h5py

        collects = gc.isenabled()
        gc.disable()
        try:
            with h5py.File(self, "w", track_order=True) as file:
                yield file
        finally:
            if collects:
                gc.enable()
            self.settle()


MARK = b"\ngearstab crc32 "
DIGITS = 8
LENGTH = len(MARK) + DIGITS + 1
AT_ONCE = 1 << 20


def seal_of(file: io.FileIO, size: int) -> bytes:
    """Return the seal that is to follow the first ``size`` bytes of an open file. Raises OSError."""
    total, buffer = 0, memoryview(bytearray(AT_ONCE))
    file.seek(0)
    while size > 0 and (count := file.readinto(buffer[:size])):
        total = crc32(buffer[:count], total)
        size -= count
    return MARK + f"{total:0{DIGITS}x}\n".encode()


def append_seal(path: Path) -> None:
    """Append its seal to a file. Raises OSError."""
    with io.FileIO(path, "r+") as file:
        mark = seal_of(file, os.fstat(file.fileno()).st_size)
        file.seek(0, os.SEEK_END)
        file.write(mark)


def intact(path: str | Path) -> bool | None:
    """Return whether the seal of a file fits its contents, None where there is no seal. Raises OSError."""
    with io.FileIO(path) as file:
        size = os.fstat(file.fileno()).st_size - LENGTH
        if size < 0:
            return None
        file.seek(size)
        end = file.read(LENGTH)
        return end == seal_of(file, size) if end.startswith(MARK) else None


def holds_text(path: str | Path, text: str) -> bool:
    """Return whether a text is one of those in a file, told without HDF5. Raises OSError."""
    octets = text.encode()
    wanted, last = len(octets).to_bytes(8, "little") + octets, b""
    with open(path, "rb", buffering=0) as file:
        while piece := file.read(AT_ONCE):
            if wanted in (found := last + piece):
                return True
            last = found[1 - len(wanted) :]
    return False


LEVEL = 1
"""The fastest that looks for repetitions, of ISA-L and of zlib: higher levels of ISA-L gain nothing."""
FILTER = {"compression": "gzip", "compression_opts": LEVEL, "shuffle": False}
"""Arguments for :meth:`h5py.Group.create_dataset`."""
PROBE = 4093
"""Distance of the bytes that are looked at first: a prime, so that they are no column of an array."""


def encode(values: Array, chunk: tuple[int, ...]) -> bytes:
    """One chunk: ``values``, filled up with zeros to the shape ``chunk``, deflated.

    What deflating does not shrink is stored in it as it is, within 0.1 % and a few bytes, and read four times as fast.
    HDF5 could leave out the filter of such a chunk; but then no checksum of the chunk would tell damage.
    """
    if values.dtype.kind in "iu" and not values.any():
        # Told before it is brought into the order of the chunk. Among floats a zero may have a sign.
        return _zeros(prod(chunk) * values.itemsize)
    full = np.ascontiguousarray(values)
    if values.shape != chunk:
        full = np.zeros(chunk, dtype=values.dtype)
        full[tuple(slice(0, n) for n in values.shape)] = values
    octets = full.reshape(-1).view(np.uint8)
    if _nothing(octets):
        return _zeros(octets.size)
    data = bytes(compress(octets.data, LEVEL))
    return data if len(data) < octets.size else zlib.compress(octets.data, 0)


def _nothing(octets: Array) -> bool:
    """Whether all bytes are zero. NumPy reads all of them even if the first is not: a few tell that sooner."""
    if octets[::PROBE].any():
        return False
    whole = octets.size // 8 * 8
    return not octets[:whole].view(np.uint64).any() and not octets[whole:].any()


@lru_cache(maxsize=64)
def _zeros(size: int) -> bytes:
    """A chunk of nothing but zeros, as those of flags that no point carries."""
    return zlib.compress(bytes(size), LEVEL)


def holds(data: bytes, size: int) -> bool:
    """Whether an encoded chunk is sound and holds ``size`` bytes; never takes much more memory than that."""
    try:
        inflate = zlib.decompressobj()
        return len(inflate.decompress(data, size + 1)) == size and inflate.eof and not inflate.unused_data
    except zlib.error:
        return False


def decode(data: bytes, chunk: tuple[int, ...], dtype: str) -> Array:
    """The inverse of :func:`encode`, filled up as it is."""
    kind = np.dtype(dtype)
    return np.frombuffer(bytearray(zlib.decompress(data)), dtype=kind).reshape(chunk)
