"""Writing a file so that it is whole or not there, and takes the place of nothing else.

A regular file is written beside its place, kept by the disk and renamed: after a full disk, a signal or a crash what
was there is still there. Until it is whole it has no name, where the system can do that (Linux, most local disks), and
so is gone with a process that is killed; elsewhere it has a temporary name. A symbolic link is followed, and stays. A
device or a pipe is written to, never replaced. All commands write through here.
"""

from __future__ import annotations

import errno
import io
import os
import re
import shutil
import stat
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path
from uuid import uuid4

from gearstab import interrupts
from gearstab.errors import OutputError, one_line

DESCRIPTOR = re.compile(r"/dev/(?:stdout|stderr|fd/(\d+))|/proc/self/fd/(\d+)")
"""Names of files that this process has open; opened anew they would be written from their beginning."""
PATIENCE = 5.0
"""Seconds to wait for another process that is just putting its output in place."""

TYPES = {
    stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFCHR: "a device", stat.S_IFBLK: "a block device",
    stat.S_IFSOCK: "a socket",
}  # fmt: skip

TABLES = (".csv", ".tsv", ".txt", ".dat", ".xls", ".xlsx", ".ods", ".parquet")
FIGURES = (".png", ".pdf", ".svg", ".jpg", ".jpeg", ".gif", ".eps", ".tif", ".tiff")
RESULTS = (".h5", ".hdf5", ".nc", ".nc4")
OTHERS = (
    ".yaml", ".yml", ".json", ".toml", ".xml", ".html", ".htm", ".md", ".py", ".mat", ".npy", ".npz", ".mtx", ".zarr",
    ".zip", ".gz", ".bz2", ".xz", ".zst", ".tar",
)  # fmt: skip
"""Endings of names that promise something."""

Look = Callable[[Path], None]


@dataclass(frozen=True)
class Content:
    """Kind of file that a command writes and may replace.

    name: in messages; ending: of its names. fault: what is wrong with the file at a path, so that it is not replaced;
    "" where it is such a content.
    wrong: endings that promise something else. streams: whether a device or a pipe can take it.
    instead: ending of a name -> the command that writes such a file from a result.
    """

    name: str
    ending: str
    fault: Callable[[Path], str]
    wrong: tuple[str, ...]
    streams: bool
    instead: Mapping[str, str] = field(default_factory=dict)

    def refuse(self, out: Path, *inputs: Path) -> None:
        """Raise OutputError unless this content may be written to ``out``, which must be none of the inputs."""
        found = _status(out)
        if found is not None:
            if any(path.exists() and os.path.samestat(found, path.stat()) for path in inputs):
                raise OutputError(f"{out}: is the input itself; choose another output")
            self._refuse_what_is_there(out, found)
        if out.suffix.lower() in self.wrong:
            message = f"{out}: {self.name} has a name that ends in {self.ending}, not in {out.suffix}"
            command = self.instead.get(out.suffix.lower())
            remedy = f"; write {out.with_suffix(self.ending)}, then: gearstab {command} {out.with_suffix(self.ending)}"
            raise OutputError(message + (f"{remedy} -o {out}" if command else ""))

    def _refuse_what_is_there(self, out: Path, found: os.stat_result) -> None:
        kind = stat.S_IFMT(found.st_mode)
        if kind != stat.S_IFREG or _descriptor(out) is not None:
            if not self.streams or kind not in (stat.S_IFREG, stat.S_IFIFO, stat.S_IFCHR):
                what = "standard output" if kind == stat.S_IFREG else TYPES.get(kind, "no file")
                raise OutputError(f"{out}: is {what}; {self.name} needs a file of its own")
            return
        if found.st_size == 0:
            return
        if fault := self.fault(out):
            raise OutputError(f"{out}: {fault}; it is not overwritten: choose another output or delete it")
        if not found.st_mode & 0o222:
            raise OutputError(f"{out}: is write-protected; choose another output, or allow it with chmod +w")


def prepare(out: Path) -> None:
    """See that files can be written where an output is to be that will take a while. Raises OutputError."""
    place = Path(os.path.realpath(out))
    if out.is_symlink() and not place.parent.is_dir():
        raise OutputError(f"{out}: is a link into a folder that is not there; make {place.parent}, or remove the link")
    try:
        with _removed(_temporary(_standing_folder(out) / out.name)) as probe:
            os.close(_new(probe))
    except OSError as error:
        raise OutputError(f"{out}: cannot be written: {(error.strerror or str(error)).lower()}") from None


def free_bytes(out: Path) -> int:
    """Return how much room there is for an output on its disk. Raises OSError."""
    return shutil.disk_usage(_standing_folder(out)).free


def _standing_folder(out: Path) -> Path:
    """The folder of an output, or the nearest one above that exists."""
    folder = Path(os.path.realpath(out)).parent
    while not folder.exists():
        folder = folder.parent
    return folder


@contextmanager
def writing(out: Path, look: Look | None = None) -> Iterator[Writer]:
    """Open an output for writing; it gets its name, and what had it goes, when the block ends without an exception.

    look: raises where ``out`` must not be written; asked at the beginning, and again when the new file takes its name,
    as another process may have put something there.

    Raises what ``look`` raises, and OSError with the name ``out``.
    """
    if look is not None:
        look(out)
    found = _status(out)
    if _descriptor(out) is not None or (found is not None and not stat.S_ISREG(found.st_mode)):
        with Writer(_stream, out, out) as file:
            yield file
        return
    with temporary_file(out) as temporary:
        with Writer(_new, temporary, out) as file:
            yield file
            with naming(out):
                os.fsync(file.fileno())
                _named(file.fileno(), temporary)
        move(temporary, out, look)


@contextmanager
def temporary_file(out: Path) -> Iterator[Path]:
    """Give a name beside an output for a file that is to get its name; whatever is left there is removed.

    Raises OSError with the name ``out`` if there is no place for it.
    """
    with naming(out):
        temporary = _temporary(_place(out))
    with _removed(temporary):
        yield temporary


@contextmanager
def _removed(path: Path) -> Iterator[Path]:
    """Remove what is left at a path in the end, also when a signal ends the process."""
    interrupts.temporary.add(str(path))
    try:
        yield path
    finally:
        with suppress(OSError):
            path.unlink()
        interrupts.temporary.discard(str(path))


def move(temporary: Path, out: Path, look: Look | None = None) -> None:
    """Give a finished file the name of an output, with the mode and owner of what had it.

    Raises what ``look`` raises, and OSError with the name ``out``.
    """
    with naming(out):
        place = _place(out)
    # Where nothing is looked at there is nothing to be alone for.
    with naming(out), _alone(place.parent) if look is not None else nullcontext():
        if look is not None:
            look(out)
        with suppress(OSError):
            before = place.stat()
            os.chmod(temporary, stat.S_IMODE(before.st_mode))
            if hasattr(os, "chown"):
                os.chown(temporary, before.st_uid, before.st_gid)
        os.replace(temporary, place)
    sync(place.parent)


def write_bytes(out: Path, data: bytes | memoryview, look: Look | None = None) -> None:
    """Write an output at once, see :func:`writing`."""
    with writing(out, look) as file:
        file.write(data)


def sync(path: Path) -> None:
    """Have the disk keep a file, or the names in a folder (where the system can do that)."""
    with suppress(PermissionError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _status(out: Path) -> os.stat_result | None:
    """Return the file at an output, links followed; None for nothing. Raises OutputError where there can be nothing."""
    number = _descriptor(out)
    try:
        return os.stat(out) if number is None else os.fstat(number)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OutputError(f"{out}: cannot be written: {(error.strerror or str(error)).lower()}") from None


def _descriptor(out: Path) -> int | None:
    """The number of the open file that a name means, None for any other name."""
    found = DESCRIPTOR.fullmatch(os.path.abspath(out))
    if found is None:
        return None
    return int(found[1] or found[2] or (2 if out.name == "stderr" else 1))


def _place(out: Path) -> Path:
    """The file that is meant, links followed; its folder is made, but not behind a link."""
    if not out.is_symlink():
        out.parent.mkdir(parents=True, exist_ok=True)
    return Path(os.path.realpath(out))


def _temporary(place: Path) -> Path:
    return place.with_name(f".gearstab-{os.getpid()}-{uuid4().hex[:8]}.tmp")


def _new(path: Path) -> int:
    """Create a file for a name, to write and to read, without it if it can be given later; never through a link that
    somebody put there.

    Raises OSError.
    """
    if hasattr(os, "O_TMPFILE"):
        with suppress(OSError):
            handle = os.open(path.parent, os.O_RDWR | os.O_TMPFILE, 0o666)
            if os.path.lexists(_opened(handle)):
                return handle
            os.close(handle)
    return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)


def _named(handle: int, path: Path) -> None:
    """Give an open file its name, unless it has one. Raises OSError."""
    if os.fstat(handle).st_nlink == 0:
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            # With a folder to start from Python asks the system to follow the link to the file.
            os.link(_opened(handle), path.name, src_dir_fd=folder, dst_dir_fd=folder, follow_symlinks=True)
        finally:
            os.close(folder)


def _opened(handle: int) -> str:
    """The link by which Linux gives access to an open file."""
    return f"/proc/self/fd/{handle}"


def _stream(out: Path) -> int:
    """Open a device, a pipe or an open file for writing; never waits for a reader of a pipe. Raises OSError."""
    number = _descriptor(out)
    if number is not None:
        for text in (sys.stdout, sys.stderr):
            if text is not None:
                text.flush()
        return os.dup(number)
    handle = os.open(out, os.O_WRONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))
    os.set_blocking(handle, True)
    return handle


class Writer(io.RawIOBase):
    """A file open for writing, whose errors carry the name of the output. ``write`` writes everything."""

    def __init__(self, opened: Callable[[Path], int], path: Path, out: Path) -> None:
        self._out = out
        with naming(out):
            self._handle = opened(path)

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._handle

    def write(self, data: bytes | bytearray | memoryview) -> int:  # type: ignore[override]
        rest = memoryview(data).cast("B")
        count = len(rest)
        with naming(self._out):
            while rest:
                rest = rest[os.write(self._handle, rest) :]
        return count

    def close(self) -> None:
        if not self.closed:
            super().close()
            with naming(self._out):
                os.close(self._handle)


@contextmanager
def naming(out: Path) -> Iterator[None]:
    """Let errors of the system carry the name that the user knows."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or one_line(error)  # of HDF5, which names no number
        if error.errno == errno.ENXIO and out.is_fifo():
            reason = "nobody reads from this pipe"
        raise OSError(error.errno, reason, str(out)) from error


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Let one process at a time look at an output in a folder and replace it, where the system can do that."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                time.sleep(0.01)
            except OSError:
                break
        yield
    finally:
        os.close(handle)
