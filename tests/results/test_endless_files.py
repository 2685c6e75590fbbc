"""Files in which HDF5 would never come to an end, or take all memory: refused before it opens them, whoever does."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from scenes import TRAIN, code

from gearstab import hdf5
from gearstab.config.document.files import DataFileError, arrays
from gearstab.hdf5 import endless, holds, overlong
from gearstab.results import ResultError, open_result, read
from gearstab.results.seal import LENGTH, append_seal

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
    """A file without a seal whose first heap has zeros from its second object on."""
    start = data.index(b"GCOL") + 16
    step = 16 + -(-int.from_bytes(data[start + 8 : start + 16], "little") // 8) * 8
    return data[: start + step] + bytes(16) + data[start + step + 16 : -LENGTH]


SEALS: dict[str, Callable[[Path], None]] = {
    "none": lambda path: None,
    "right": append_seal,
    "wrong": lambda path: path.write_bytes(path.read_bytes() + b"\ngearstab crc32 00000000\n") and None,
}
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


@pytest.mark.parametrize("seal", SEALS)
@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_lets_hdf5_open_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str, seal: str
) -> None:
    (folder / "respond.yaml").write_text(RESPOND)
    path = folder / "out.h5"
    path.write_bytes(emptied(path.read_bytes()))
    SEALS[seal](path)
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
    damaged = emptied(path.read_bytes()) + b"\ngearstab crc32 00000000\n"
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
    data = path.read_bytes()
    path.write_bytes(emptied(data + bytes(LENGTH)))
    assert endless(path)
    with pytest.raises(DataFileError, match="holds no real numbers"):
        arrays(path, ["phase"], 100)


@pytest.mark.parametrize(
    ("number", "size", "circles"),
    [
        (0, 0, True),
        pytest.param(1, 2**64 - 16, True, marks=pytest.mark.slow),
        pytest.param(0, 8, True, marks=pytest.mark.slow),
        (1, 2**40, False),
        (0, 2**40, False),
        (7, 18, False),
    ],
    ids=["nothing free", "no length", "nothing after it", "too long", "too much free", "sound"],
)
def test_heaps_that_hold_hdf5_are_those_that_are_told(tmp_path: Path, number: int, size: int, circles: bool) -> None:
    """HDF5 itself, in a process of its own, is the judge; it needs 0.2 s where it comes to an end."""
    path = tmp_path / "heap.h5"
    with h5py.File(path, "w") as file:
        for name in "abcde":
            file.attrs[name] = "eighteen letters ."
    data = bytearray(path.read_bytes())
    place = data.index(b"GCOL") + 16 + 40
    # The third of them is the next one; what is free begins at the sixth, with zeros behind it.
    if size == 8:
        place += 4 * 40
    data[place : place + 2], data[place + 8 : place + 16] = number.to_bytes(2, "little"), size.to_bytes(8, "little")
    path.write_bytes(data)
    assert endless(path) is circles
    text = f"import h5py\nwith h5py.File({str(path)!r}) as file: print(list(file.attrs.items()))"
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        process.wait(2 if circles else 60)
        ended = True
    except subprocess.TimeoutExpired:
        ended = False
        process.kill()
        process.wait()
    assert ended is not circles


def lengths(data: bytes) -> list[int]:
    """Where the lengths of texts and lists stand: before the address of a heap and the number of an object in it."""
    heaps = [hit.start().to_bytes(8, "little") for hit in re.finditer(b"GCOL", data)]
    places = sorted(hit.start() - 4 for heap in heaps for hit in re.finditer(re.escape(heap), data))
    return [place for place in places if 0 < int.from_bytes(data[place + 12 : place + 16], "little") < 1000]


def with_length(data: bytes, place: int, length: int) -> bytes:
    return data[:place] + length.to_bytes(4, "little") + data[place + 4 :]


@pytest.mark.parametrize("seal", ["none", "right"])
def test_no_text_is_longer_than_its_file(folder: Path, seal: str) -> None:
    """HDF5 makes room for the length that it reads, and looks for the text then."""
    path = folder / "out.h5"
    data = path.read_bytes()[:-LENGTH]
    places = lengths(data)
    assert len(places) > 50
    # Of attributes and of variables, one at a time.
    for place in places:
        path.write_bytes(with_length(data, place, 3_000_000_000))
        SEALS[seal](path)
        with pytest.raises(ResultError, match="longer than the file"):
            open_result(path)
    path.write_bytes(data)
    SEALS[seal](path)
    with open_result(path) as tree:
        assert "floquet" in tree.children


@pytest.mark.parametrize("libver", ["earliest", "latest"])
@pytest.mark.parametrize("kind", ["text", "octets", "texts", "references"])
def test_lists_of_every_kind_are_followed(tmp_path: Path, libver: str, kind: str) -> None:
    path = tmp_path / "attribute.h5"
    with h5py.File(path, "w", libver=libver) as file:
        scale = file.create_dataset("x", (7,), "f8")
        if kind == "references":
            scale.make_scale()
            file.create_dataset("y", (7,), "f8").dims[0].attach_scale(scale)
        else:
            file.attrs["a"] = {"text": "eine Zeile", "octets": b"octets", "texts": ["a", "bc"]}[kind]
    data = path.read_bytes()
    assert not overlong(path)
    places = lengths(data)
    assert places
    for place in places:
        for length, told in ((len(data), False), (len(data) + 1, True), (2**32 - 1, True)):
            path.write_bytes(with_length(data, place, length))
            assert overlong(path) is told


@pytest.mark.parametrize("at_once", [1, 3, 7, 64])
def test_texts_are_found_wherever_pieces_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: int) -> None:
    monkeypatch.setattr(hdf5, "AT_ONCE", at_once)
    path = tmp_path / "text"
    for before in range(20):
        data = b"\x05" * before + (5).to_bytes(8, "little") + b"sweep" + b"\x00" * 5
        path.write_bytes(data)
        assert holds(path, "sweep")
        assert not holds(path, "swee")
        assert not holds(path, "weep")
        assert [*hdf5._places(path, b"sw")] == [before + 8]
        assert [*hdf5._places(path, b"sw", b"ed")] == [before + 8]


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
