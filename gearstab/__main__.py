"""The entry of ``gearstab`` and of ``python -m gearstab``: signals first, as the imports take a while themselves."""

import os
import sys

from gearstab.interrupts import install


def main() -> None:
    """Run the command line as a process of its own."""
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
