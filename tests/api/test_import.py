"""``import gearstab`` is cheap, and its functions keep their names beside the rooms of the package."""

import inspect
import subprocess
import sys
from importlib import import_module

import pytest

import gearstab as gs

HEAVY = {"numpy", "scipy", "pydantic", "h5py", "xarray", "matplotlib", "rich", "pint", "joblib", "ruamel", "click"}


def modules_after(code: str) -> set[str]:
    command = [sys.executable, "-c", f"import sys\n{code}\nprint(*{{n.split('.')[0] for n in sys.modules}})"]
    return set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())


def test_the_import_brings_nothing_with_it() -> None:
    assert not HEAVY & modules_after("import gearstab\ngearstab.__version__\ndir(gearstab)")


def test_a_figure_is_not_needed_to_load() -> None:
    assert not {"matplotlib", "xarray", "joblib"} & modules_after("import gearstab\ngearstab.load")


@pytest.mark.parametrize("name", gs.__all__)
def test_public_functions_are_there_and_say_what_they_do(name: str) -> None:
    function = getattr(gs, name)
    assert inspect.isfunction(function)
    first = (inspect.getdoc(function) or "").splitlines()[0]
    assert first.endswith(".") or ";" in first
    hints = inspect.signature(function)
    assert hints.return_annotation is not inspect.Signature.empty
    assert all(p.annotation is not inspect.Parameter.empty for p in hints.parameters.values())
    assert name in dir(gs)


@pytest.mark.parametrize("name", ["design", "floquet", "perturbation", "sweep"])
def test_a_room_of_the_same_name_does_not_take_its_place(name: str) -> None:
    room = import_module(f"gearstab.{name}")
    assert inspect.ismodule(room)
    assert inspect.isfunction(getattr(gs, name))


def test_what_is_not_there_is_said() -> None:
    with pytest.raises(AttributeError, match="no attribute 'sweeep'"):
        gs.sweeep  # noqa: B018
