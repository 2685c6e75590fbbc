"""Files whose seal does not fit: no command lets HDF5 open them, which might never return."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from scenes import TRAIN, code

from gearstab.config.model.files import DataFileError, arrays
from gearstab.results import ResultError, hdf5, open_result, read
from gearstab.results.hdf5 import holds_text

CONFIG = TRAIN + "sweep: {mesh_frequency: [4.0, 5.0], epsilon: [0.1, 0.2]}\nmethods: {floquet: {}}\n"
RESPOND = CONFIG + "respond: {mesh_frequency: 5, cycles: 20, initial: {velocity: [1, 0, 0]}}\n"


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("original")
    (folder / "train.yaml").write_text(CONFIG)
    assert code("sweep", str(folder / "train.yaml"), "-o", str(folder / "out.h5"), "-q") == 0
    return (folder / "out.h5").read_bytes()


@pytest.fixture
def folder(original: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "train.yaml").write_text(CONFIG)
    (tmp_path / "out.h5").write_bytes(original)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def emptied(data: bytes) -> bytes:
    """A file whose seal does not fit and whose first heap has zeros from its second object on: HDF5 never returns."""
    start = data.index(b"GCOL") + 16
    step = 16 + -(-int.from_bytes(data[start + 8 : start + 16], "little") // 8) * 8
    return data[: start + step] + bytes(16) + data[start + step + 16 :]


OTHER = ["--set", "sweep.epsilon=[0.1, 0.3]"]
COMMANDS = {
    "plot": ["plot", "out.h5", "-o", "out.png"],
    "export": ["export", "out.h5", "-o", "out.csv"],
    "info": ["info", "out.h5"],
    "extend": ["sweep", "train.yaml", "-o", "new.h5", "--extend", "out.h5"],
    "sweep of another": ["sweep", "train.yaml", "-o", "out.h5", *OTHER],
    "resume of another": ["sweep", "train.yaml", "-o", "out.h5", "--resume", *OTHER],
    "respond": ["respond", "respond.yaml", "-o", "out.h5"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_lets_hdf5_open_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    (folder / "respond.yaml").write_text(RESPOND)
    path = folder / "out.h5"
    path.write_bytes(emptied(path.read_bytes()))
    before = path.read_bytes()
    opened: list[object] = []
    monkeypatch.setattr(h5py, "File", lambda *given, **_: opened.extend(given))
    capsys.readouterr()
    assert code(*COMMANDS[command]) == 2
    text = capsys.readouterr().err
    assert text.startswith("out.h5: ")
    assert "damaged" in text
    assert text.count("\n") == 1
    assert not opened
    assert path.read_bytes() == before
    with pytest.raises(ResultError, match="is damaged"):
        open_result(path)


def test_a_sweep_replaces_a_damaged_result_of_its_own_without_opening_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whose it is shows in its digest, a text; with --overwrite any of a sweep is replaced, none of another command."""
    path = folder / "out.h5"
    with open_result(path) as tree:
        digest, expected = str(tree.attrs["config_digest"]), tree["floquet"]["growth_rate"].values
    damaged = emptied(path.read_bytes())
    opened: list[Path] = []
    file = h5py.File

    def watched(name: object, *rest: object, **options: object) -> object:
        if isinstance(name, str | Path) and Path(name).is_file() and Path(name).read_bytes() == damaged:
            opened.append(Path(name))
        return file(name, *rest, **options)

    monkeypatch.setattr(h5py, "File", watched)
    path.write_bytes(damaged)
    assert code("sweep", "train.yaml", "-o", "out.h5") == 0
    assert "is damaged: it is computed again" in capsys.readouterr().err
    with open_result(path) as tree:
        np.testing.assert_array_equal(tree["floquet"]["growth_rate"].values, expected)

    damaged = damaged.replace(digest.encode(), b"0" * len(digest))
    path.write_bytes(damaged)
    assert code("sweep", "train.yaml", "-o", "out.h5") == 2
    assert "is a damaged result, of this or another configuration" in capsys.readouterr().err
    assert code("sweep", "train.yaml", "-o", "out.h5", "--overwrite") == 0

    (folder / "respond.yaml").write_text(RESPOND)
    assert code("respond", "respond.yaml", "-o", "response.h5") == 0
    whole = (folder / "response.h5").read_bytes()
    damaged = whole[:1000] + bytes([whole[1000] ^ 1]) + whole[1001:]
    (folder / "response.h5").write_bytes(damaged)
    capsys.readouterr()
    assert code("sweep", "train.yaml", "-o", "response.h5", "--overwrite") == 2
    assert "is damaged, it does not match its checksum; it is not overwritten" in capsys.readouterr().err
    assert code("respond", "respond.yaml", "-o", "response.h5") == 0
    assert not opened


def test_numbers_of_a_configuration_are_not_read_out_of_lists(tmp_path: Path) -> None:
    path = tmp_path / "wave.h5"
    with h5py.File(path, "w") as file:
        file["phase"] = ["a", "b"]
    path.write_bytes(emptied(path.read_bytes()))
    with pytest.raises(DataFileError, match="holds no real numbers"):
        arrays(path, ["phase"], 100)


@pytest.mark.parametrize("at_once", [1, 3, 7, 64])
def test_texts_are_found_wherever_pieces_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: int) -> None:
    monkeypatch.setattr(hdf5, "AT_ONCE", at_once)
    path = tmp_path / "text"
    for before in range(20):
        data = b"\x05" * before + (5).to_bytes(8, "little") + b"sweep" + b"\x00" * 5
        path.write_bytes(data)
        assert holds_text(path, "sweep")
        assert not holds_text(path, "swee")
        assert not holds_text(path, "weep")


def test_what_lies_still_is_looked_at_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And again when it has changed."""
    looked: list[Path] = []
    whole = read.intact

    def counted(path: Path) -> bool | None:
        looked.append(path)
        return whole(path)

    monkeypatch.setattr(read, "intact", counted)
    path = folder / "out.h5"
    assert read.is_sealed(path)
    assert read.is_sealed(path)
    assert len(looked) == 2  # written just now
    monkeypatch.setattr(read, "STILL", -1.0)
    assert read.is_sealed(path)
    assert read.is_sealed(path)
    assert len(looked) == 3
    path.write_bytes(path.read_bytes()[:-1] + b"!")
    assert read.is_sealed(path) is False
    assert len(looked) == 4
