"""Configurations: YAML with positions, validated models, axes; every message names place, value and remedy."""

from gearstab.config.configuration import Config
from gearstab.config.document.problems import ConfigError, Problem
from gearstab.config.loading import load, parameters_with, require
from gearstab.config.model.axes import Assignment, Axis, alike, parameters_at

__all__ = [
    "Assignment", "Axis", "Config", "ConfigError", "Problem", "alike", "load", "parameters_at", "parameters_with",
    "require",
]  # fmt: skip
