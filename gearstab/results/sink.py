"""A file that HDF5 writes to through Python, so that it never meets an error of the disk.

Where a write fails the HDF5 library may crash, at the latest when it closes the file. Here it is told that all is well:
the first error is kept, what comes after it goes nowhere, and it is raised when HDF5 has closed its file.
"""

from __future__ import annotations

import gc
import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import h5py


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
