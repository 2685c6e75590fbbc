"""The entry of ``gearstab`` and of ``python -m gearstab``: signals first, as the imports take a while themselves."""

import atexit
import gc
import os
import sys

from gearstab.interrupts import install

NEW_OBJECTS = 20_000
"""After how many the collector of cyclic garbage runs. Python's own number, 700 or 2000, is a sixth of the time of a
short command: nearly all that imports and models make stays."""


def main() -> None:
    """Run the command line as a process of its own."""
    gc.set_threshold(NEW_OBJECTS, *gc.get_threshold()[1:])
    # Python looks for garbage four times as it ends, a sixth of a short command: what is frozen it leaves alone.
    atexit.register(gc.freeze)
    install()
    open_standard_streams()
    from gearstab.cli import main as run

    run()


def open_standard_streams() -> None:
    """Put something in place of standard streams that were closed, or the next file opened would be taken for one.

    What is printed to standard error is lost then; to print a result to standard output fails.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    sys.stdout = sys.stdout or open(os.devnull)  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115


if __name__ == "__main__":
    main()
