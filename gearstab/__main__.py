"""The entry of ``gearstab`` and of ``python -m gearstab``: signals first, as the imports take a while themselves."""

from gearstab.interrupts import install


def main() -> None:
    """Run the command line as a process of its own."""
    install()
    from gearstab.cli import main as run

    run()


if __name__ == "__main__":
    main()
