"""Configurations: YAML with positions, validated models, axes; every message names place, value and remedy."""

from gearstab.config.configuration import Config
from gearstab.config.document import ConfigError, Problem
from gearstab.config.loading import load, require, system_with
from gearstab.config.model import Assignment, Axis, alike

__all__ = [
    "Assignment", "Axis", "Config", "ConfigError", "Problem", "alike", "load", "require", "system_with",
]  # fmt: skip
