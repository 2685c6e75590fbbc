"""A wrong value is told once, and nothing that depends on it; design variables need no base value."""

from typing import Any

import pytest
from ruamel.yaml import YAML
from scenes import CONFIGS

from gearstab.config import ConfigError, load

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
    ("data", "said"),
    [
        (changed("oh_grosh_barber_2005/fig4b.yaml", "system", "torsional_stiffness", 1),
         "system.torsional_stiffness: has 1 entry; give exactly 2"),
        (changed("spinning/planetary.yaml", "system", "teeth", "sun", to=-30),
         "system.teeth.sun: must be a whole number >= 3 (got -30); write a number of teeth"),
        (changed("spinning/rotor.yaml", "system", "rotation", to="abc"),
         'system.rotation: must be a list (got "abc"); write [ ... ]'),
        (changed("spinning/rotor.yaml", "system", "rotation", "gyroscopic", 0, 0, to="abc"),
         'system.rotation.0.gyroscopic.0.0: must be a number (got "abc"); write a number such as 0.5, or one with a '
         'unit such as "0.5 kg"'),
        (changed("parker_2009/contact_ratio.yaml", "system", "meshes", to="abc"),
         'system.meshes: must be a mapping (got "abc"); write keys and values below it, or { ... }'),
        (changed("response/backlash.yaml", "system", "meshes", 0, "backlash", to="abc"),
         'system.meshes.0.backlash: must be a number (got "abc"); write a number such as 0.5'),
        (changed("kuria_kihiu_2008/friction.yaml", "system", "input", to=None),
         "system.input: must be a mapping; write keys and values below it, or { ... }"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_told_alone(data: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load(data)
    assert [str(problem).split(": ", 1)[1] for problem in caught.value.problems] == [said]


def test_the_speed_of_a_wrong_input_is_no_mistake_of_its_own() -> None:
    """The numbers of teeth are known, if not which of them count."""
    data = changed("spinning/planetary.yaml", "system", "input", to="abc")
    assert "input_speed" in data["sweep"]
    with pytest.raises(ConfigError) as caught:
        load(data)
    assert [problem.path for problem in caught.value.problems] == ["system.input"]


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
