"""Try an installed wheel: the kernel is there with all levels of the processor, and a sweep comes out right.

python scripts/try_wheel.py
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import gearstab as gs
from gearstab import ckernel

PAIR = {"kind": "gear_pair", "equivalent_mass": 1.0,
        "meshes": [{"mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}]}  # fmt: skip


def main() -> None:
    """Exit with a message where something is wrong, else print where the package lies and its vector instructions."""
    ckernel.check()
    # Of a Meissner equation with the natural frequency 1: in its primary tongue, and beside it.
    if list(gs.floquet(PAIR, [2.0, 1.5]).stable) != [0, 1]:
        raise SystemExit("a gear pair is not unstable at twice its natural frequency and stable beside it")
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        command = [sys.executable, "-m", "gearstab"]
        kind = subprocess.run([*command, "init", "two_stage"], capture_output=True, text=True, check=True).stdout
        (here / "train.yaml").write_text(kind, encoding="utf-8")
        subprocess.run([*command, "sweep", "train.yaml", "-o", "train.h5", "-q"], cwd=here, check=True)
        subprocess.run([*command, "plot", "train.h5", "-o", "train.pdf"], cwd=here, check=True)
    print(gs.__file__)
    print(*ckernel.library.levels())


if __name__ == "__main__":
    main()
