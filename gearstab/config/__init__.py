"""Configurations: YAML with positions, validated models, axes; every message names place, value and remedy."""

from gearstab.config.axes import Assignment, Axis, Config, parameters_at
from gearstab.config.loading import load
from gearstab.config.problems import ConfigError, Problem

__all__ = ["Assignment", "Axis", "Config", "ConfigError", "Problem", "load", "parameters_at"]
