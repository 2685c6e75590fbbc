"""Chunks of an array, encoded as HDF5's filters shuffle and deflate store them.

Encoding them here rather than in the HDF5 library lets the threads or processes that computed the values do it too
(HDF5 runs under one lock), and lets a merge of any number of parts copy bytes.
"""

from __future__ import annotations

import zlib

import numpy as np

Array = np.ndarray

LEVEL = 1
"""Higher levels shrink growth rates by another 3 % for half as much time again."""


def encode(values: Array, chunk: tuple[int, ...]) -> bytes:
    """One chunk: ``values``, filled up with zeros to the shape ``chunk``, shuffled and deflated."""
    full = np.ascontiguousarray(values)
    if values.shape != chunk:
        full = np.zeros(chunk, dtype=values.dtype)
        full[tuple(slice(0, n) for n in values.shape)] = values
    octets = full.reshape(-1).view(np.uint8)
    if full.itemsize > 1:
        octets = np.ascontiguousarray(octets.reshape(-1, full.itemsize).T)
    return zlib.compress(octets.data, LEVEL)


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
    octets = np.frombuffer(zlib.decompress(data), dtype=np.uint8)
    return np.ascontiguousarray(octets.reshape(kind.itemsize, -1).T).view(kind).reshape(chunk)
