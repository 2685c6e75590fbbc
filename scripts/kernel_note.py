"""Say once, after an install, when the C kernel could not be built."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

SOURCE = Path(__file__).parent.parent / "gearstab" / "ckernel" / "module.c"

if SOURCE.exists() and find_spec("gearstab.ckernel._kernel") is None:
    print(
        "The compiled kernel was not built (no working C compiler or no Python headers): the NumPy kernel serves, "
        "with the same results but slower."
    )
