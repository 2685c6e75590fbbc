"""Writing a large result in a process of its own: on a full disk HDF5 may crash even if the error is caught."""

from __future__ import annotations

import errno
import os
import pickle
import subprocess
import sys
from pathlib import Path

from gearstab import interrupts
from gearstab.results.tree import ResultTree
from gearstab.results.write import write_on_disk


def write_apart(tree: ResultTree, out: Path, path: Path) -> None:
    """Write a result to ``path``, a temporary name. The process imports little: it gets the tree ready to be written.

    Raises OSError with the name ``out``.
    """
    command = [sys.executable, "-c", "from gearstab.results.apart import main; main()", str(path)]
    # Its own session: an interrupt from the terminal is handled here.
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    try:
        _, words = child.communicate(pickle.dumps(tree.gathered()))
    except BaseException:
        child.kill()
        child.wait()
        raise
    if child.returncode == 0:
        return
    last = words.decode(errors="replace").strip().rpartition("\n")[2]
    number, _, message = last.partition(" ") if child.returncode == 1 else ("", "", "")
    raise OSError(
        int(number) if number.isdigit() else errno.EIO,
        os.strerror(int(number)) if number.isdigit() else message or "the process that writes it ended unexpectedly",
        str(out),
    )


def main() -> None:
    """Run in a child process: read the tree from standard input, write the result to the given path."""
    parent = os.getppid()
    tree = pickle.load(sys.stdin.buffer)
    interrupts.end_with(parent)
    try:
        write_on_disk(Path(sys.argv[1]), tree)
    except OSError as error:
        sys.stderr.write(f"\n{error.errno or errno.EIO} {' '.join(str(error).split())}\n")
        sys.stderr.flush()
        # Not through the clean-up of the HDF5 library.
        os._exit(1)
