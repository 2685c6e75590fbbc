"""What is finished, and where it waits for the end of a sweep: in memory for a short one, else in part files."""

from __future__ import annotations

from contextlib import suppress
from time import monotonic

from gearstab.sweep.compute import fits
from gearstab.sweep.hold import Hold
from gearstab.sweep.parts import Part, PartFolder
from gearstab.sweep.plan import Layout, Plan

MOST_SECONDS, MOST_BYTES = 2.0, 1 << 26
"""How much work, and how much memory, an unforeseen end of the process may cost."""


class Store:
    """All finished blocks of a sweep, by key."""

    def __init__(self, folder: PartFolder) -> None:
        self.folder = folder
        self.finished: dict[str, Part] = {}
        self._hold = Hold(folder.path)
        self._start = monotonic()
        self._waiting: dict[str, Part] = {}
        self._size = 0

    def __contains__(self, key: str) -> bool:
        return key in self.finished

    def find(self, plan: Plan) -> None:
        """Take what an earlier run of the plan finished, and remove what it left half-written. Raises OSError."""
        if not self.folder.path.is_dir():
            return
        self._hold.take()
        if self._hold.alone():
            for path in self.folder.path.glob("*.tmp"):
                path.unlink(missing_ok=True)
            self._hold.share()
        blocks = {block.key: block for layout in plan.layouts for block in layout.blocks()}
        found = self.folder.find(set(blocks))
        self.finished |= {key: part for key, part in found.items() if fits(plan, blocks[key], part)}

    def open_folder(self) -> None:
        """Make the folder, for other processes to write to, and write what is in memory. Raises OSError."""
        self._hold.take()
        self.flush()

    def add(self, part: Part) -> None:
        """Take a finished block. Raises OSError if it had to be written and could not be."""
        self.finished[part.key] = part
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
            self.finished[key] = self.folder.write(self._waiting[key])
            del self._waiting[key]
        self._size = 0

    def rescue(self) -> int:
        """Write what can be written when the sweep ends early; the number of blocks that a next run will find."""
        with suppress(OSError):
            self.flush()
        return self.folder.count()

    def remove(self) -> None:
        """Remove the part files, unless another process that computes the same plan needs them: it then will."""
        if self._hold.alone():
            self.folder.remove()

    def collect(self, keys: set[str]) -> list[Part]:
        """Take what other processes wrote to the folder of these blocks, seen or not."""
        found = self.folder.find(keys)
        self.finished |= found
        return list(found.values())

    def of(self, layout: Layout) -> list[Part]:
        """Return what is finished of a method."""
        return [self.finished[block.key] for block in layout.blocks() if block.key in self.finished]

    def close(self) -> None:
        """Leave the part files to other processes."""
        self._hold.drop()
