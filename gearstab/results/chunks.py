"""Chunks of an array, encoded as HDF5's deflate filter stores them.

Encoding them here rather than in the HDF5 library lets the threads or processes that computed the values do it too
(HDF5 runs under one lock), and lets a merge of any number of parts copy bytes. The filter shuffle is left out: with
ISA-L, which encodes growth rates at 4 to 8 ns a value where zlib takes 50, it costs as much again as encoding.
An encoder of ours that looks for whole numbers which recur took half of ISA-L's time, for files larger by 40 %: growth
rates of mirrored parameters recur but for their last digits.
"""

from __future__ import annotations

import zlib
from functools import lru_cache
from math import prod

import numpy as np

try:
    from isal.isal_zlib import compress
except ImportError:  # where it has no wheel
    from zlib import compress

Array = np.ndarray

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
