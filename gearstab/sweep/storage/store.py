"""Store of finished blocks until the end of a sweep: in memory for a short one, else in part files."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from time import monotonic

import numpy as np

from gearstab.results.hdf5 import holds
from gearstab.sweep.plan import GridBlock, Layout, Plan, VariableLayout
from gearstab.sweep.storage.parts import LOCK, FinishedBlock, PartFolder
from gearstab.system import Array

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

MOST_SECONDS, MOST_BYTES = 2.0, 1 << 26
"""How much work, and how much memory, an unforeseen end of the process may cost."""


class Store:
    """Finished blocks of a plan, by key, in memory and on the disk.

    kept: whether they outlive a sweep that does not end; else nothing is worth finishing after an interrupt.
    """

    def __init__(self, plan: Plan, folder: PartFolder, kept: bool = True) -> None:
        self.folder, self.kept = folder, kept
        self.plan = plan
        self.blocks: dict[str, FinishedBlock] = {}
        self._hold = Hold(folder.path)
        self._start = monotonic()
        self._waiting: dict[str, FinishedBlock] = {}
        self._size = 0

    def of(self, layout: Layout) -> list[FinishedBlock]:
        """Return what is there of a method, in the order of its blocks."""
        return [self.blocks[block.key] for block in layout.blocks() if block.key in self.blocks]

    def missing(self, layout: Layout) -> list[GridBlock]:
        """Return what is not there of a method."""
        return [block for block in layout.blocks() if block.key not in self.blocks]

    @property
    def size(self) -> int:
        """Bytes of all chunks."""
        return sum(block.size() for block in self.blocks.values())

    def flags(self, layout: Layout) -> dict[str, int]:
        """Count the points of a method that carry each flag of ``status``."""
        total: Counter[str] = Counter()
        for block in self.of(layout):
            total.update(block.flags)
        return dict(total)

    def rows(self, layout: Layout, variable: str) -> Array:
        """Return a variable of one value per row of a method, over all rows."""
        (own,) = (known for known in layout.results if known.variable.name == variable)
        parts = []
        for block in layout.blocks():
            (data,) = self.blocks[block.key].pieces(variable)
            parts.append(own.decoded(data, block).ravel())
        return np.concatenate(parts)

    def find(self) -> int:
        """Take what an earlier run of the plan finished, and remove what it left half-written.

        Returns how many part files are of no use: damaged, or made by something else. Raises OSError.
        """
        if not self.folder.path.is_dir():
            return 0
        if self._hold.alone():
            for path in self.folder.path.glob("*.tmp"):
                path.unlink(missing_ok=True)
            self._hold.share()
        there = self.folder.count()
        every = [block for layout in self.plan.layouts for block in layout.blocks()]
        return max(0, there - len(self.collect(every)))

    def take(self) -> None:
        """Make the folder, and keep others from removing it. Raises OSError."""
        self._hold.take()

    def add(self, part: FinishedBlock) -> None:
        """Take a finished block. Raises OSError if it had to be written and could not be."""
        self.blocks[part.key] = part
        if part.path is None:
            self._waiting[part.key] = part
            self._size += part.size()
            if monotonic() - self._start > MOST_SECONDS or self._size > MOST_BYTES:
                self.flush()

    def flush(self) -> None:
        """Write what is in memory only to part files. Raises OSError."""
        if self._waiting:
            self._hold.take()
        for key in list(self._waiting):
            self.blocks[key] = self.folder.write(self._waiting[key])
            del self._waiting[key]
        self._size = 0

    def rescue(self) -> int:
        """Write what can be written when the sweep ends early; the number of blocks that a next run will find."""
        with suppress(OSError):
            self.flush()
        return self.folder.count()

    def remove(self) -> None:
        """Remove the part files, unless another process that computes the same plan needs them: it then will.

        A sweep that wrote none may find those of an equal one that began later. What cannot be held stays.
        """
        with suppress(OSError):
            if self.folder.path.is_dir() and self._hold.alone():
                self.folder.remove()
                self._hold.drop()

    def collect(self, blocks: Iterable[GridBlock]) -> list[FinishedBlock]:
        """Take what other processes wrote to the folder of these blocks, seen or not."""
        wanted = {block.key: block for block in blocks}
        found = self.folder.find(set(wanted))
        valid = {key: part for key, part in found.items() if fits(self.plan, wanted[key], part)}
        self.blocks.update(valid)
        return list(valid.values())

    def close(self) -> None:
        """Leave the part files to other processes; a folder without any goes."""
        if self._hold.held() and not self.folder.count():
            self.remove()
        self._hold.drop()


def fits(plan: Plan, block: GridBlock, part: FinishedBlock) -> bool:
    """Whether a finished block has the variables of this one, in chunks of their number and size.

    The checksum tells damage; this, parts that another program made, so that no later step fails.
    """
    results = plan.layout(block.method).results
    if part.points != block.points or set(part.variables) != {own.variable.name for own in results}:
        return False
    try:
        return all(_complete(own, part) for own in results)
    except OSError:
        return False  # its file went meanwhile, or was cut


def _complete(own: VariableLayout, part: FinishedBlock) -> bool:
    pieces = part.pieces(own.variable.name)
    listed = len(part.tongues) if "tongue" in own.variable.dims else 1
    count = max(1, len(pieces)) if own.variable.of_parts else listed
    return len(pieces) == count and all(holds(data, own.piece_bytes) for data in pieces)


ATTEMPTS = 100


class Hold:
    """This process's hold on a folder that several sweeps may use at once; not to be passed to other processes.

    The last of them removes the folder: every sweep holds a shared lock on a file in it. A lock ends with its process,
    however that ends. Where the system has no such locks a sweep takes itself to be the only one.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._handle: int | None = None

    def take(self) -> None:
        """Make the folder, if need be, and keep others from removing it. Raises OSError."""
        if self._handle is not None:
            return
        for _ in range(ATTEMPTS):
            self.folder.mkdir(parents=True, exist_ok=True)
            if fcntl is None:
                return
            # Another sweep may remove the folder at any moment up to the lock.
            with suppress(FileNotFoundError):
                handle = os.open(self.folder / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
                with suppress(OSError):
                    fcntl.flock(handle, fcntl.LOCK_SH)
                with suppress(FileNotFoundError):
                    if os.path.samestat(os.fstat(handle), os.stat(self.folder / LOCK)):
                        self._handle = handle
                        return
                os.close(handle)
        raise FileNotFoundError(2, "is removed again and again by another process", str(self.folder))

    def held(self) -> bool:
        """Whether this process holds the folder, where the system has locks."""
        return self._handle is not None

    def alone(self) -> bool:
        """Take hold of the folder: whether no other process does; if so none can until :meth:`drop` or :meth:`share`.

        Raises OSError as :meth:`take` does.
        """
        self.take()
        if self._handle is None:
            return True
        try:
            fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            with suppress(OSError):
                fcntl.flock(self._handle, fcntl.LOCK_SH)
            return False
        except OSError:
            pass  # a file system without locks
        return True

    def share(self) -> None:
        """Let others hold the folder again."""
        if self._handle is not None:
            with suppress(OSError):
                fcntl.flock(self._handle, fcntl.LOCK_SH)

    def drop(self) -> None:
        """Give the hold up."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None
