"""Where finished blocks wait for the end of the sweep: in memory for a short one, in part files for a longer one."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from time import monotonic

from gearstab.sweep.parts import Finished, Part, PartFolder

MOST_SECONDS, MOST_BYTES = 2.0, 1 << 26
"""How much work, and how much memory, an unforeseen end of the process may cost."""


class Store:
    """All finished blocks of a sweep, by key."""

    def __init__(self, folder: PartFolder, found: Mapping[str, Finished]) -> None:
        self.folder = folder
        self.finished: dict[str, Finished] = dict(found)
        self._start = monotonic()
        self._waiting: dict[str, Part] = {}
        self._size = 0

    def __contains__(self, key: str) -> bool:
        return key in self.finished

    def add(self, part: Finished) -> None:
        """Take a finished block. Raises OSError if it had to be written and could not be."""
        self.finished[part.key] = part
        if isinstance(part, Part):
            self._waiting[part.key] = part
            self._size += part.size()
            if monotonic() - self._start > MOST_SECONDS or self._size > MOST_BYTES:
                self.flush()

    def flush(self) -> None:
        """Write what is in memory only to part files. Raises OSError."""
        for key in list(self._waiting):
            self.finished[key] = self.folder.write(self._waiting[key])
            del self._waiting[key]
        self._size = 0

    def rescue(self) -> int:
        """Write what can be written when the sweep ends early; the number of blocks that a next run will find."""
        with suppress(OSError):
            self.flush()
        return self.folder.count()
