"""``python -m gearstab`` is ``gearstab``."""

from gearstab.cli import main

if __name__ == "__main__":
    main()
