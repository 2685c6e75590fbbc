"""An error that users meet is one class: its text is printed, a line and no traceback, and its code is returned."""

from pathlib import Path

import pytest
from scenes import TRAIN, ran, written

from gearstab.errors import FAILED, UserError
from gearstab.systems import KINDS

SWEPT = f"{TRAIN}sweep: {{mesh_frequency: [1.0, 2.0]}}\nmethods: {{floquet: {{}}}}\n"


class Overheated(UserError):
    """A machine that must cool down."""

    exit_code = FAILED


@pytest.mark.parametrize("command", [["check"], ["info"], ["sweep", "--dry-run"]], ids=" ".join)
def test_a_class_is_all_it_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str]) -> None:
    def build(*_: object) -> None:
        raise Overheated("the train is too hot; wait a minute")

    monkeypatch.setattr(KINDS["two_stage"], "build", build)
    done = ran(command[0], written(tmp_path, SWEPT), *command[1:])
    assert (done.exit_code, done.stdout) == (FAILED, "")
    assert done.stderr == "the train is too hot; wait a minute\n"
    assert isinstance(done.exception, SystemExit)
