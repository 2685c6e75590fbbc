"""Whether the options of the methods fit the system."""

from __future__ import annotations

from gearstab.config.configuration import Config
from gearstab.config.document.problems import ConfigError
from gearstab.methods import METHODS, POINTS, OptionError, chosen
from gearstab.system import GearSystem


def check(config: Config, base: GearSystem) -> None:
    """Raise ConfigError where the options of methods do not fit the base system, with one problem a method."""
    found = []
    for method in chosen(config.methods, base):
        try:
            method.check()
            # Of others the section itself has been asked; this one needs a speed for this system only.
            asked = METHODS[method.name].frequency == POINTS
            if method.frequency == POINTS and not asked and all(a.mesh_frequency is None for a in config.axes):
                message = "needs a mesh_frequency axis: speeds of rotation follow it"
                raise OptionError((), message, "add mesh_frequency: {start: .., stop: .., num: ..} to sweep")
        except OptionError as error:
            found.append(config.problem(("methods", method.name, *error.path), "option", str(error), error.remedy))
    if found:
        raise ConfigError(found)
