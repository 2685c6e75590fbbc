"""Choice of the kernel by the environment, and one line where it is missing or asked for too much."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from scenes import scene_text

from gearstab import ckernel
from gearstab.cli import main
from gearstab.errors import SettingError


@pytest.fixture(autouse=True)
def nothing_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("GEARSTAB_KERNEL", "GEARSTAB_SIMD", "GEARSTAB_THREADS"):
        monkeypatch.delenv(name, raising=False)


def test_one_line_says_that_the_kernel_is_missing(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(TRAIN + "methods: {floquet: {}}\n")
    without = "import sys; sys.modules['gearstab.ckernel._kernel'] = None; from gearstab.cli import main; main()"
    for command in ("sweep", "info"):
        call = [sys.executable, "-c", without, command, "scene.yaml"]
        done = subprocess.run(call, cwd=tmp_path, env=os.environ, capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert done.stdout == ""
        assert done.stderr.splitlines() == [ckernel.MISSING]


def test_one_line_says_that_an_update_left_the_kernel_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    ckernel.outdated.cache_clear()
    assert not ckernel.outdated()
    monkeypatch.setattr(ckernel.library, "sources", lambda: 1)
    ckernel.outdated.cache_clear()
    try:
        with pytest.raises(SettingError, match="make install") as caught:
            ckernel.simd()
    finally:
        ckernel.outdated.cache_clear()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["numpy", "fortran"])
def test_other_kernels_are_refused(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv("GEARSTAB_KERNEL", name)
    with pytest.raises(SettingError, match=f"GEARSTAB_KERNEL={name}: .*none in NumPy"):
        ckernel.check()
    monkeypatch.setenv("GEARSTAB_KERNEL", "c")
    ckernel.check()


def test_unknown_instructions_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSTAB_SIMD", "mmx")
    with pytest.raises(SettingError, match="GEARSTAB_SIMD=mmx: this processor offers plain"):
        ckernel.check()


@pytest.mark.parametrize("text", ["0", "-1", "many", "1.5"])
def test_threads_must_be_a_positive_number(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("GEARSTAB_THREADS", text)
    with pytest.raises(SettingError, match="positive whole number"):
        ckernel.threads()


def test_threads_follow_the_environment_and_the_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    assert ckernel.threads() >= 1
    monkeypatch.setenv("GEARSTAB_THREADS", "3")
    assert ckernel.threads() == 3
    with ckernel.using(threads=2):
        # A new thread has no context of its own; what it was started in holds for it.
        with ThreadPoolExecutor(1) as pool:
            assert pool.submit(ckernel.threads).result() == 2
        with ckernel.using(threads=4):
            assert ckernel.threads() == 4
        assert ckernel.threads() == 2
    assert ckernel.threads() == 3


TRAIN = scene_text("kernel_choice")


@pytest.mark.parametrize("command", ["sweep", "sweep --dry-run", "info", "bench --no-plot", "respond"])
@pytest.mark.parametrize("setting", ["GEARSTAB_KERNEL=numpy", "GEARSTAB_SIMD=mmx"])
def test_a_wrong_setting_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str, setting: str
) -> None:
    name, _, value = setting.partition("=")
    monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    Path("scene.yaml").write_text(
        TRAIN + "methods: {floquet: {}}\nrespond: {mesh_frequency: 2.0, cycles: 3, initial: "
        "{displacement: [0.1, 0, 0], velocity: [0, 0, 0]}}\n"
    )
    with pytest.raises(SystemExit) as ended:
        main([*command.split(), "scene.yaml"])
    assert ended.value.code == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.splitlines()[-1].startswith(setting)
    assert not list(tmp_path.rglob("*.h5"))
