"""HDF5 behind a file whose disk is full, or that an interrupt stops: one exception, and no crash of the process."""

from __future__ import annotations

import errno
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from gearstab.results.hdf5 import Sink

DATA = np.random.default_rng(0).bytes(5000)
PIECES, GROUPS = 40, 12
WHOLE = len(DATA) * PIECES * GROUPS

FULL = """
import resource, signal, sys
from pathlib import Path
sys.path[:0] = {path}
from test_sink import filled
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
for limit in {limits}:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    try:
        filled(Path({name}))
    except OSError as error:
        print(error.errno)
"""


def filled(path: Path, sink: type[Sink] = Sink) -> None:
    """Fill a file with groups of chunked variables and long attributes."""
    with open(path, "w+b") as file, sink(file.fileno()) as through, through.hdf5() as target:
        for k in range(GROUPS):
            group = target.create_group(f"g{k}", track_order=True)
            group.attrs["text"] = "x" * 1000
            data = group.create_dataset("d", shape=(PIECES, 1000), chunks=(1, 1000), dtype="f8", compression="gzip")
            for place in range(PIECES):
                data.id.write_direct_chunk((place, 0), DATA)


def test_what_is_written_is_an_ordinary_file(tmp_path: Path) -> None:
    filled(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert len(file) == GROUPS
        assert file["g3/d"].id.read_direct_chunk((5, 0))[1] == DATA


def test_a_disk_that_is_full_at_any_point_is_an_error_of_the_system(tmp_path: Path) -> None:
    """In a process of its own, which a crash inside the library would end."""
    pytest.importorskip("resource")
    limits = sorted((0, 1, 100, 2000, 20_000, *range(WHOLE // 7, WHOLE, WHOLE // 7)), reverse=True)
    script = FULL.format(path=[str(Path(__file__).parent), *sys.path], limits=limits, name=repr(str(tmp_path / "a.h5")))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == [str(errno.EFBIG)] * len(limits)


@pytest.mark.parametrize("after", [0, 1, 7, 300])
def test_an_interrupt_comes_out_when_the_file_is_closed(tmp_path: Path, after: int) -> None:
    class Interrupted(Sink):
        left = after

        def write(self, data: object) -> int:
            if self.left == 0 and self.error is None:
                self.error = KeyboardInterrupt()
            self.left -= 1
            return super().write(data)

    with pytest.raises(KeyboardInterrupt):
        filled(tmp_path / "a.h5", Interrupted)
