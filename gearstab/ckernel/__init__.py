"""The compiled kernel, where it was built: numerical loops in C over contiguous arrays, for any layer to use.

The environment variable GEARSTAB_SIMD (plain, avx2, avx512) limits the vector instructions used, which by default are
the best that the processor has.
"""

from __future__ import annotations

import os
from types import ModuleType

library: ModuleType | None
"""The extension module, or None where it was not built."""

try:
    from gearstab.ckernel import _kernel as library
except ImportError:
    library = None


def simd() -> str:
    """The level of vector instructions in use; raises ValueError where GEARSTAB_SIMD asks for one that is not there."""
    if library is None:
        raise ValueError("the compiled kernel was not built")
    available: list[str] = library.levels()
    asked = os.environ.get("GEARSTAB_SIMD")
    if asked and asked not in available:
        raise ValueError(f"GEARSTAB_SIMD={asked}: this processor offers {', '.join(available)}")
    return asked or available[-1]
