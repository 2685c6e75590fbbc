"""A folder that several sweeps may use at once, and that the last one of them removes.

Every sweep holds a shared lock on a file in it. A lock ends with its process, however that ends. Where the system has
no such locks a sweep takes itself to be the only one.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

NAME = "lock"
ATTEMPTS = 100


class Hold:
    """This process's hold on a folder; not to be passed to other processes."""

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
                handle = os.open(self.folder / NAME, os.O_RDWR | os.O_CREAT, 0o666)
                with suppress(OSError):
                    fcntl.flock(handle, fcntl.LOCK_SH)
                with suppress(FileNotFoundError):
                    if os.path.samestat(os.fstat(handle), os.stat(self.folder / NAME)):
                        self._handle = handle
                        return
                os.close(handle)
        raise FileNotFoundError(2, "is removed again and again by another process", str(self.folder))

    def alone(self) -> bool:
        """Whether no other process holds the folder; if so none can until :meth:`drop` or :meth:`share`."""
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
