"""Finding the numbers of a gear system that suppress its instability over a range of speeds: ``gearstab design``."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.results import ResultTree


def check(config: Config) -> None:
    """Raise ConfigError for what the section ``design`` asks of a system that cannot give it."""
    from gearstab.config import ConfigError
    from gearstab.design.problem import DesignProblem
    from gearstab.design.quantities import SUPPORTS
    from gearstab.design.search import combinations
    from gearstab.system import Feature, unsupported

    if config.design is None:
        return
    system, train = config.system.build(), config.system.train()
    relieved = train is not None and any(mesh.teeth.relieved for mesh in train.meshes)
    asked: list[tuple[tuple[str, ...], str]] = []
    asked += [(("design", "minimise"), name) for weights in config.design.objectives for name in weights]
    asked += [(("design", "constraints", limit.name), limit.name) for limit in config.design.limits if not limit.paths]
    found = []
    for path, name in asked:
        if refused := unsupported(system, SUPPORTS[name], {Feature.PERIODIC_TERMS: "use growth_rate"}):
            wrong = f"{name}: {refused[0]}", refused[1]
        elif name == "load_factor" and not system.forced:
            wrong = "nothing drives the system, which load_factor needs", "give a load"
        elif name == "root_stress" and (train is None or system.load is None):
            hint = "describe the gears in a gearbox and give input.torque"
            wrong = "root_stress needs the teeth of a gearbox and a torque", hint
        elif name == "root_stress" and relieved:
            hint = "remove the relief, or minimise something else"
            wrong = "root_stress does not know how teeth with relief share the load", hint
        elif name == "transmission_error" and not relieved:
            wrong = "transmission_error needs a mesh with relief", "give a mesh of a gearbox relief"
        else:
            continue
        found.append(config.problem(path, "needs_other", *wrong))
    if found:
        raise ConfigError(found)
    combinations(DesignProblem(config, config.design))


def design(config: Config, say: Callable[[str], None] = lambda text: None) -> ResultTree:
    """Find the best design of a configuration that has a section ``design``.

    say: is told what is being done. The result does not depend on the machine: the search begins from fixed seeds and
    is serial.

    Raises ConfigError and NotPossible.
    """
    from gearstab.design.problem import DesignProblem
    from gearstab.design.result import group
    from gearstab.design.solution import solved
    from gearstab.results import Group, ResultTree
    from gearstab.results.provenance import modes_group, root_attributes
    from gearstab.results.read import DESIGN

    if config.design is None:
        raise ValueError("the configuration has no section design")
    check(config)
    solution = solved(DesignProblem(config, config.design), say)
    groups = {"modes": modes_group(solution.initial_system), "design": group(solution)}
    return ResultTree(Group((), root_attributes(DESIGN, config)), groups)
