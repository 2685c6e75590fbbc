"""A wrong value is told once, and nothing that depends on it; design variables need no base value."""

from typing import Any

import pytest
from ruamel.yaml import YAML
from scenes import CONFIGS

from gearstab.config import load

GONE = object()


def changed(name: str, *path: Any, to: Any = GONE) -> dict[str, Any]:
    """Return one of the configurations with another value at a path, or without what is there."""
    data: dict[str, Any] = YAML(typ="safe", pure=True).load(CONFIGS / name)
    place: Any = data
    for key in path[:-1]:
        place = place[key]
    if to is GONE:
        del place[path[-1]]
    else:
        place[path[-1]] = to
    return data


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("design/planetary.yaml", ("teeth", "planet")),
        ("design/countershaft.yaml", ("input_shaft_stiffness",)),
        ("design/countershaft.yaml", ("meshes", 0, "contact_ratio")),
    ],
)
@pytest.mark.parametrize("to", [GONE, None])
def test_design_variables_need_no_base_value(name: str, path: tuple[Any, ...], to: Any) -> None:
    config = load(changed(name, "system", *path, to=to))
    value, variables = config.tree["system"], config.tree["design"]["variables"]
    for key in path:
        value = value[key]
    spec = next(spec for key, spec in variables.items() if key.endswith(str(path[-1])))
    limits = spec["integers"] if isinstance(spec, dict) else spec
    assert limits[0] <= value <= limits[1]
