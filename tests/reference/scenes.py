"""Where things lie in the source tree, texts of configurations, and what a program says to them."""

import os
import signal
import time
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner, Result
from hypothesis import HealthCheck, settings
from pydantic import BaseModel
from ruamel.yaml import YAML

from gearstab.cli import group, main
from gearstab.config import Config, ConfigError, Problem, load
from gearstab.results import open_result
from gearstab.sweep import Reporter, plan, run

ROOT = Path(__file__).resolve().parents[2]
CONFIGS, DOCS, DATA = ROOT / "configs", ROOT / "docs", ROOT / "tests" / "data"
CONFIGURATIONS = sorted(path for path in CONFIGS.rglob("*.yaml") if path.parent.name != "benchmarks")
"""All that the program reads itself; a benchmark refers to one and adds published numbers."""


def scene_text(name: str) -> str:
    """Text of a configuration in ``tests/data/scenes``."""
    return (DATA / "scenes" / f"{name}.yaml").read_text()


def scene_data(name: str) -> dict[str, Any]:
    """A configuration of ``tests/data/scenes``, or its system."""
    return YAML(typ="safe").load(scene_text(name))


def table(name: str) -> dict[str, Any]:
    """A table of ``tests/data/config``."""
    return tomllib.loads((DATA / "config" / f"{name}.toml").read_text())


TRAIN = scene_text("train")
"""Lin & Parker's two-stage train (2002, Table 1)."""

REDUCER = scene_text("reducer")
"""A motor and a machine that a pair of gears couples, by teeth."""


@dataclass
class SweepFolder:
    """A folder with the output ``out.h5`` of a sweep, and what that keeps meanwhile."""

    folder: Path

    @property
    def out(self) -> Path:
        return self.folder / "out.h5"

    @property
    def parts(self) -> list[Path]:
        return sorted((self.folder / "out.h5.parts").rglob("*.part"))


def written(folder: Path, text: str | bytes, name: str = "case.yaml") -> Path:
    """Write a configuration into a folder."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def read(folder: Path, text: str | bytes, *overrides: str) -> Config:
    """Write a configuration and load it."""
    return load(written(folder, text), overrides)


def problems(folder: Path, text: str | bytes, *overrides: str) -> Sequence[Problem]:
    """Problems of a configuration, at least one."""
    with pytest.raises(ConfigError) as caught:
        read(folder, text, *overrides)
    return caught.value.problems


def result_of(folder: Path, text: str | bytes, method: str, jobs: int = 1) -> xr.Dataset:
    """Sweep a configuration and read what one of its methods found."""
    out = folder / "case.h5"
    run(plan(read(folder, text)), out, jobs=jobs, overwrite=True)
    return opened(out)[method].to_dataset()


def ran(*words: object) -> Result:
    """The end of a command line, whatever it is."""
    return CliRunner().invoke(group, [str(word) for word in words])


def succeeds(*words: object) -> Result:
    """The end of a command line, which must be a good one."""
    done = ran(*words)
    assert done.exit_code == 0, done.output
    return done


def refused(*words: object) -> str:
    """The one line that a command says of a mistake of its user, and nothing else."""
    done = ran(*words)
    assert (done.exit_code, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.output
    return done.stderr


def opened(path: Path | str) -> xr.DataTree:
    """A whole result in memory."""
    with open_result(path) as tree:
        return tree.load()


def code(*words: str) -> int:
    """The exit code of a command line as the entry point gives it, its messages on the streams of the test."""
    with pytest.raises(SystemExit) as raised:
        main(words)
    assert isinstance(raised.value.code, int)
    return raised.value.code


def examples(few: int, many: int) -> settings:
    """Generated examples by number: many where slow tests are run. They may take long, and share a folder."""
    count = many if "GEARSTAB_THOROUGH" in os.environ else few
    return settings(max_examples=count, suppress_health_check=list(HealthCheck))


def data_of(path: Path) -> dict[str, tuple[tuple[int, ...], bytes]]:
    """Shapes and bytes of all variables of a result."""
    found = {}
    with h5py.File(path) as file:

        def keep(name: str, item: object) -> None:
            if isinstance(item, h5py.Dataset):
                values = item.asstr()[...].astype("U") if item.dtype.kind == "O" else item[...]
                found[name] = item.shape, np.asarray(values).tobytes()

        file.visititems(keep)
    return found


class Told(Reporter):
    """Keeps what is said."""

    def __init__(self) -> None:
        self.messages: list[str] = []

    def message(self, text: str) -> None:
        self.messages.append(text)


def until(done: Callable[[], bool], what: str) -> None:
    """Wait for something that comes soon; ten minutes are for machines that have much else to do."""
    end = time.monotonic() + 600.0
    while not done():
        if time.monotonic() > end:
            pytest.fail(f"still waiting for {what}")
        time.sleep(0.01)


def heed() -> None:
    """Heed all signals, also where the tests run in the background or under nohup, which ignore some."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def plain(value: Any) -> Any:
    """A section of a configuration as nested dicts and lists of what its fields hold, without fields that are None."""
    if isinstance(value, BaseModel):
        return {name: plain(item) for name, item in value if item is not None}
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value
