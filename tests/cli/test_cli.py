"""The command line: what it imports, its exit codes, one line for a mistake, a traceback for a bug."""

from __future__ import annotations

import errno
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest
from scenes import ROOT, TRAIN, code, ran, written

from gearstab import __version__, version
from gearstab.cli import COMMANDS, group, main, terminal
from gearstab.sweep.progress import duration, octets, quantity

HEAVY = {"numpy", "scipy", "pydantic", "h5py", "xarray", "matplotlib", "rich", "pint", "joblib", "ruamel", "h5netcdf"}


SHOW_MODULES = """
import sys
from gearstab.cli import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    assert not end.code
sys.stderr.write(" ".join(sys.modules))
"""


@pytest.mark.parametrize("args", [["--help"], ["-h"], ["--version"], ["sweep", "--help"], ["export", "--help"]])
def test_help_imports_nothing_but_click(args: list[str]) -> None:
    command = [sys.executable, "-c", SHOW_MODULES, *args]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "gearstab" in done.stdout
    assert not HEAVY & set(done.stderr.split())


def test_a_sweep_imports_nothing_that_reads_draws_or_pools(tmp_path: Path) -> None:
    """xarray and pandas alone would add half to the time of the gear train's map."""
    config = written(tmp_path, TRAIN + "sweep: {mesh_frequency: [1, 2]}\nmethods: {floquet: {}, boundaries: {}}\n")
    command = [sys.executable, "-c", SHOW_MODULES, "sweep", config, "-o", tmp_path / "o.h5", "-q"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert not {"xarray", "pandas", "matplotlib", "joblib", "pint"} & set(done.stderr.split())


def test_a_sweep_imports_what_its_methods_need(tmp_path: Path) -> None:
    """A third of the start of a sweep of growth rates was theory that it does not ask for."""
    config = written(tmp_path, TRAIN + "sweep: {mesh_frequency: [1, 2]}\nmethods: {floquet: {}}\n")
    command = [sys.executable, "-c", SHOW_MODULES, "sweep", config, "-o", tmp_path / "o.h5", "-q"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    rooms = {"perturbation", "floquet.boundaries", "floquet.general", "floquet.smooth"}
    assert not {"scipy", *(f"gearstab.{room}" for room in rooms)} & set(done.stderr.split())


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_there_and_helps(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    context = click.Context(group)
    command = group.get_command(context, name)
    assert isinstance(command, click.Command)
    assert command.help
    assert code(name, "--help") == 0
    assert name in capsys.readouterr().out


def test_help_lists_all_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert code("--help") == 0
    shown = capsys.readouterr().out
    assert all(name in shown and summary in shown for name, (_, summary) in COMMANDS.items())


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert code("--version") == 0
    assert __version__ in capsys.readouterr().out


def test_a_misspelt_command_is_corrected(capsys: pytest.CaptureFixture[str]) -> None:
    assert code("swep") == 2
    assert "did you mean 'sweep'?" in capsys.readouterr().err


def test_an_unknown_option_is_wrong_input(capsys: pytest.CaptureFixture[str]) -> None:
    assert code("sweep", "x.yaml", "--fast") == 2
    assert "--fast" in capsys.readouterr().err


def test_the_module_is_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "gearstab", "--version"], capture_output=True, text=True, check=True)
    assert __version__ in done.stdout


def test_an_interrupt_is_130(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    @click.command()
    def command() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(group, "get_command", lambda context, name: command)
    assert code("check") == 130
    assert "interrupted" in capsys.readouterr().err


def test_our_own_errors_keep_their_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    @click.command()
    def command() -> None:
        with terminal.user_errors():
            raise ZeroDivisionError

    monkeypatch.setattr(group, "get_command", lambda context, name: command)
    with pytest.raises(ZeroDivisionError):
        main(["check"])


def wrapped() -> RuntimeError:
    """Return the error that Python 3.11 makes of a lack of memory where a class is made."""
    error = RuntimeError("Error calling __set_name__ on 'property' instance")
    error.__cause__ = MemoryError()
    return error


def expected() -> list[tuple[Exception, int]]:
    from gearstab.config import ConfigError, Problem
    from gearstab.errors import PlotError
    from gearstab.results import ResultError
    from gearstab.sweep import Interrupted, RequestError, SweepError

    problem = Problem("a.yaml", 1, "system", "", "missing", "is missing", "add it")
    return [
        (ConfigError([problem]), 2), (PlotError("no axis"), 2), (ResultError("a.h5: no"), 2), (RequestError("no"), 2),
        (SweepError("killed"), 1), (Interrupted("stopped"), 130),
        (PermissionError(errno.EACCES, "Permission denied", "f"), 2),
        (OSError(errno.ENOSPC, "No space left on device", "f"), 1),
        (MemoryError(), 1), (wrapped(), 1), (RuntimeError("can't start new thread"), 1),
        (ImportError("libhdf5.so: failed to map segment from shared object"), 1),
    ]  # fmt: skip


@pytest.mark.parametrize(("error", "code"), expected(), ids=lambda value: type(value).__name__)
def test_expected_errors_are_a_line_and_a_code(error: Exception, code: int, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(click.exceptions.Exit) as raised, terminal.user_errors():
        raise error
    assert raised.value.exit_code == code
    assert capsys.readouterr().err.count("\n") == 1


def test_other_errors_of_those_kinds_keep_their_traceback() -> None:
    for error in (RuntimeError("Error calling __set_name__"), ImportError("no module named numpy")):
        with pytest.raises(type(error)), terminal.user_errors():
            raise error


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits are those of Linux")
@pytest.mark.parametrize("megabytes", range(50, 220, 10))
def test_a_lack_of_memory_is_a_line(tmp_path: Path, megabytes: int) -> None:
    """Wherever it comes, among the imports as well; what OpenBLAS prints it prints by itself."""
    source = ROOT / "configs" / "lin_parker_2002" / "fig5.yaml"
    own = "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv.pop(1)) << 20,) * 2); "
    command = [sys.executable, "-c", own + "from gearstab.__main__ import main; main()", str(megabytes)]
    words = ["sweep", str(source), "-o", str(tmp_path / "out.h5"), "-q", "--set", "sweep.mesh_frequency.num=20"]
    done = subprocess.run([*command, *words], capture_output=True, text=True, timeout=120)
    assert done.returncode in (0, 1)
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") == done.returncode


def test_numbers_as_people_read_them() -> None:
    assert [quantity(v) for v in (0, 12.34, 999.6, 1234, 999_600, 45.6e6, 2e9)] == [
        "0", "12.3", "1 k", "1.23 k", "1 M", "45.6 M", "2 G",
    ]  # fmt: skip
    assert [octets(v) for v in (0, 999, 8192, 1.3e7, 2e9)] == ["0 B", "999 B", "8.19 kB", "13 MB", "2 GB"]
    assert [duration(v) for v in (0.0123, 9.96, 59.4, 60, 200, 3599.7, 18720, 183_600)] == [
        "0.012 s", "10 s", "59 s", "1 min", "3 min 20 s", "1 h", "5 h 12 min", "2 d 3 h",
    ]  # fmt: skip


def test_an_entry_point_is_declared() -> None:
    text = (ROOT / "pyproject.toml").read_text()
    assert 'gearstab = "gearstab.__main__:main"' in text


# --- the commit that the version tells, from git or from a file that a build left


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    package = tmp_path / "source" / "gearstab"
    package.mkdir(parents=True)
    shutil.copy(ROOT / "gearstab" / "version.py", package)
    return package.parent


def commit_of(folder: Path) -> str:
    return str(runpy.run_path(str(folder / "gearstab" / "version.py"))["commit"]())


def git(folder: Path, *words: str) -> str:
    person = ("-c", "user.name=A", "-c", "user.email=a@b", "-c", "init.defaultBranch=main")
    return subprocess.run(["git", *person, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git to make a repository")
def test_the_commit_is_that_of_git(repository: Path, tmp_path: Path) -> None:
    assert commit_of(repository) == ""
    git(repository, "init", "-q")
    git(repository, "add", ".")
    git(repository, "commit", "-qm", "first")
    wanted = git(repository, "rev-parse", "HEAD")[: version.DIGITS]
    assert commit_of(repository) == wanted
    git(repository, "pack-refs", "--all")
    assert commit_of(repository) == wanted
    git(repository, "worktree", "add", "-q", str(tmp_path / "second"))
    assert commit_of(tmp_path / "second") == wanted
    git(repository, "checkout", "-q", "--detach")
    assert commit_of(repository) == wanted
    (repository / "gearstab" / version.BUILT).write_text("0123456789abcdef\n")
    assert commit_of(repository) == "0123456789ab"


def test_a_broken_repository_is_no_error(repository: Path) -> None:
    (repository / ".git").mkdir()
    for head in ("", "ref: refs/heads/main\n", "no commit\n"):
        (repository / ".git" / "HEAD").write_text(head)
        assert commit_of(repository) == ""


def test_the_version_tells_the_commit() -> None:
    found = ran("--version").stdout
    assert found.startswith(f"gearstab, version {version.__version__}")
    assert version.commit() in found
    assert ("commit" in found) == bool(version.commit())
