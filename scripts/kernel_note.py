"""Say once, after an install, when the C kernel could not be built."""

from gearstab import ckernel

if ckernel.library is None:
    print(
        "The compiled kernel was not built (no working C compiler or no Python headers): the NumPy kernel serves, "
        "with the same results but slower."
    )
