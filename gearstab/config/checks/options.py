"""Whether the options of the methods fit the system."""

from __future__ import annotations

from gearstab.config.configuration import Config
from gearstab.config.document.problems import ConfigError
from gearstab.methods import OptionError, chosen
from gearstab.system import GearSystem


def check(config: Config, base: GearSystem) -> None:
    """Raise ConfigError where the options of methods do not fit the base system, with one problem a method."""
    found = []
    for method in chosen(config.methods, base):
        try:
            method.check()
        except OptionError as error:
            found.append(config.problem(("methods", method.name, *error.path), "option", str(error), error.remedy))
    if found:
        raise ConfigError(found)
