"""The functions that ``import gearstab as gs`` offers: a whole run in memory, and the theories one by one."""
