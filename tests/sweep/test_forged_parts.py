"""Parts that somebody made, with a right checksum: they are computed again; and all that sweeps write are taken."""

from __future__ import annotations

import errno
import os
import shutil
import sys
import zlib
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cache
from itertools import cycle
from pathlib import Path

import pytest
from scenes import TRAIN, SweepFolder, Told, data_of, written

from gearstab.config import load
from gearstab.results import OutputError
from gearstab.sweep import Plan, Summary, SweepError, plan, run
from gearstab.sweep.storage import merge, store
from gearstab.sweep.storage.parts import (
    MOST_BYTES,
    FinishedBlock,
    PartFolder,
    checksum,
    head_of,
    places_of,
    read_part,
)

GRID = "mesh_frequency: {start: 4, stop: 6, num: 24}, epsilon: {start: 0.1, stop: 0.4, num: 24}"
DAMPED = TRAIN + "  damping_ratio: 0.01\n"
UNCERTAIN = "tolerance: {samples: 16, parameters: {input_shaft_stiffness: {uniform: [0.4, 0.6]}}}"
SWEEPS = {
    "floquet": (TRAIN, GRID, "floquet: {exponents: true}"),
    "damped": (DAMPED, GRID, "floquet: {}"),
    "boundaries": (DAMPED, GRID, "boundaries: {}"),
    "merged": (TRAIN.replace("tooth_ratio: 1", "tooth_ratio: 3/5"), GRID, "boundaries: {}"),
    "of modes": (TRAIN, GRID, "boundaries: {modes: [2, 3]}"),
    "perturbation": (TRAIN, GRID, "perturbation: {order: 2}, uncoupled: {}, natural_frequencies: {}"),
    "ratio": (TRAIN.replace("tooth_ratio: 1", "tooth_ratio: 3/5"), GRID, "perturbation: {order: 2}"),
    "required_damping": (TRAIN, GRID, "required_damping: {}"),
    "passage": (TRAIN, "mesh_frequency: [5.0, 5.6], epsilon: {start: 0.1, stop: 0.4, num: 9}", "passage: {rate: [3]}"),
    "response": (DAMPED + "  load: [0, 0, 1]\n", GRID, "response: {}"),
    "tolerance": (TRAIN, "mesh_frequency: [4, 5], epsilon: {start: 0.1, stop: 0.4, num: 12}", UNCERTAIN),
    "tongue_probability": (
        TRAIN, "mesh_frequency: [4, 5], epsilon: [0.1, 0.2, 0.3]", f"tongue_probability: {{samples: 32}}, {UNCERTAIN}",
    ),
}  # fmt: skip
"""By name: the system, the axes, the methods."""


@dataclass
class Scene(SweepFolder):
    """A sweep of which all is finished but the result."""

    planned: Plan

    def forge(self, victim: Path, how: Forgery) -> None:
        part = read_part(victim, self.planned.digest)
        assert part is not None
        forged = how(part)
        head = head_of(forged, self.planned.digest)
        victim.write_bytes(head + forged.held + checksum(head, forged.held))

    def run(self) -> tuple[Summary, list[str]]:
        told = Told()
        return run(self.planned, self.out, 1, progress=told), told.messages


def prepared(folder: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> Scene:
    """A sweep in small blocks whose result did not fit on the disk."""
    system, axes, methods = SWEEPS[name]
    path = written(folder, f"{system}sweep: {{{axes}}}\nmethods: {{{methods}}}\n", "train.yaml")
    monkeypatch.setattr(sys.modules["gearstab.sweep.plan"], "MOST", 1 << 7)
    monkeypatch.setattr(store, "MOST_SECONDS", 0.0)
    scene = Scene(folder, plan(load(path)))

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "out.h5")

    with monkeypatch.context() as patched:
        patched.setattr(merge, "write", full)
        with pytest.raises(SweepError, match="no space left"):
            scene.run()
    assert len(scene.parts) == scene.planned.blocks
    return scene


@pytest.mark.parametrize("name", SWEEPS)
def test_all_parts_that_a_sweep_writes_are_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    scene = prepared(tmp_path, name, monkeypatch)
    summary, said = scene.run()
    assert summary.reused == summary.blocks
    assert not any("damaged" in text for text in said)


Forgery = Callable[[FinishedBlock], FinishedBlock]


def with_pieces(part: FinishedBlock, change: Callable[[str, list[bytes]], list[bytes]]) -> FinishedBlock:
    """A part with other chunks of every variable."""
    pieces = {name: change(name, part.pieces(name)) for name in part.variables}
    held = b"".join(data for found in pieces.values() for data in found)
    places = places_of({name: [len(data) for data in found] for name, found in pieces.items()})
    return replace(part, places=places, held=held, path=None)


def doubled(name: str, pieces: list[bytes]) -> list[bytes]:
    """Two chunks a region instead of one."""
    return 2 * pieces if name in ("boundary_frequency", "tolerance", "status", "holder") else pieces


def same(part: FinishedBlock) -> FinishedBlock:
    return with_pieces(part, lambda _, pieces: pieces)


def chunks(change: Callable[[bytes], bytes]) -> Forgery:
    return lambda part: with_pieces(part, lambda _, pieces: [change(data) for data in pieces])


def header(**entries: object) -> Forgery:
    return lambda part: replace(same(part), **entries)  # type: ignore[arg-type]


@cache
def packed_gigabyte() -> bytes:
    packer = zlib.compressobj(1)
    return b"".join([packer.compress(bytes(1 << 24)) for _ in range(64)]) + packer.flush()


def inflated(change: Callable[[bytes], bytes]) -> Forgery:
    return chunks(lambda data: zlib.compress(change(zlib.decompress(data))))


ANY: dict[str, Forgery] = {
    "zip bomb": chunks(lambda _: packed_gigabyte()),
    "cut streams": chunks(lambda data: data[:-1]),
    "half a stream": chunks(lambda data: data[: len(data) // 2]),
    "two streams": chunks(lambda data: data + data),
    "wrong inner checksum": chunks(lambda data: data[:-1] + bytes([data[-1] ^ 1])),
    "nothing": chunks(lambda _: b""),
    "a byte more": inflated(lambda octets: octets + b"\0"),
    "another type": inflated(lambda octets: octets[: len(octets) // 2]),
    "another block": header(key="floquet-999999"),
    "other names": lambda part: replace(same(part), places={f"{k}x": v for k, v in same(part).places.items()}),
}  # fmt: skip
REGIONS: dict[str, Forgery] = ANY | {
    "two chunks a region": lambda part: with_pieces(part, doubled),
    "no stretches": lambda part: with_pieces(part, lambda name, p: [] if name == "proved_frequency" else p),
}


@pytest.fixture(scope="module", params=["floquet", "boundaries"])
def original(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path, object]:
    """A sweep that is all but complete, and what its result holds."""
    with pytest.MonkeyPatch.context() as patched:
        folder = tmp_path_factory.mktemp("original")
        scene = prepared(folder, request.param, patched)
        copy = folder.with_name("whole")
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder, copy)
        Scene(copy, scene.planned).run()
        return request.param, folder, data_of(copy / "out.h5")


def test_forged_parts_are_computed_again(
    original: tuple[str, Path, object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, folder, expected = original
    monkeypatch.setattr(sys.modules["gearstab.sweep.plan"], "MOST", 1 << 7)
    shutil.copytree(folder, tmp_path / "copy")
    scene = Scene(tmp_path / "copy", plan(load(folder / "train.yaml")))
    victims, spoilt = cycle(scene.parts), set()
    for label, how in (ANY if name == "floquet" else REGIONS).items():
        victim = next(victims)
        spoilt.add(victim)
        original_data = (folder / victim.relative_to(scene.folder)).read_bytes()
        victim.write_bytes(original_data)
        valid = found(scene)
        scene.forge(victim, how)
        assert valid - found(scene) == {victim.stem}, label
    summary, said = scene.run()
    assert summary.reused == summary.blocks - len(spoilt)
    assert said[0].endswith(
        f"{len(spoilt)} finished blocks are damaged, or not as this sweep writes them: computed again"
    )
    assert data_of(scene.out) == expected


def found(scene: Scene) -> set[str]:
    """The finished blocks that a sweep goes on from."""
    with closing(store.Store(scene.planned, PartFolder(scene.out, scene.planned.digest))) as there:
        there.find()
        return set(there.blocks)


def test_a_part_far_too_large_is_not_even_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = prepared(tmp_path, "floquet", monkeypatch)
    os.truncate(scene.parts[0], MOST_BYTES + 1)
    summary, _ = scene.run()
    assert summary.reused == summary.blocks - 1


def test_parts_that_were_refused_are_not_taken_when_a_worker_dies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Results of workers are looked for then."""
    scene = prepared(tmp_path, "floquet", monkeypatch)
    scene.forge(scene.parts[0], ANY["a byte more"])
    with closing(store.Store(scene.planned, PartFolder(scene.out, scene.planned.digest))) as there:
        blocks = list(scene.planned.layouts[0].blocks())
        assert {part.key for part in there.collect(blocks)} == {block.key for block in blocks[1:]}


def test_a_part_that_is_cut_short_while_it_is_used_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = prepared(tmp_path, "floquet", monkeypatch)
    write = merge.write

    def cut(*words: object) -> None:
        os.truncate(scene.parts[0], 1000)
        write(*words)  # type: ignore[arg-type]

    monkeypatch.setattr(merge, "write", cut)
    with pytest.raises(SweepError, match=r"floquet-000000\.part: was cut short") as raised:
        scene.run()
    assert "\n" not in str(raised.value)
    assert not scene.out.exists()


def unreadable(path: Path) -> None:
    path.chmod(0)


def a_folder(path: Path) -> None:
    path.unlink(missing_ok=True)
    path.mkdir()


def a_link(path: Path) -> None:
    path.unlink(missing_ok=True)
    path.symlink_to(path.parent.parent.parent / "made")


WAYS = {
    "no access to all": (lambda scene: unreadable(scene.parts[0].parents[1]), "cannot be read and written"),
    "no access to this": (lambda scene: unreadable(scene.parts[0].parent), "cannot be read and written"),
    "a folder for a part": (lambda scene: a_folder(scene.parts[0]), "is in the way"),
    "a folder for the lock": (lambda scene: a_folder(scene.parts[0].with_name("lock")), "is in the way"),
    "a link for the lock": (lambda scene: a_link(scene.parts[0].with_name("lock")), "is in the way"),
    "a folder for what is temporary": (lambda scene: a_folder(scene.parts[0].with_name("x.tmp")), "is in the way"),
}


@pytest.mark.parametrize(("how", "said"), WAYS.values(), ids=list(WAYS))
def test_what_is_in_the_way_is_said_before_anything_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: Callable[[Scene], None], said: str
) -> None:
    scene = prepared(tmp_path, "floquet", monkeypatch)
    scene.parts[1].unlink()
    folders = [scene.parts[0].parents[1], scene.parts[0].parent]
    how(scene)
    if said.startswith("cannot") and os.geteuid() == 0:
        monkeypatch.setattr(os, "access", lambda path, _: Path(path).stat().st_mode & 0o700 == 0o700)
    with pytest.raises(OutputError, match=said) as raised:
        scene.run()
    assert "\n" not in str(raised.value)
    for folder in folders:
        folder.chmod(0o755)
    assert not (tmp_path / "made").exists()
    assert not scene.out.exists()


def test_links_beside_the_parts_are_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One to the root of the disk made a sweep look at every file there."""
    scene = prepared(tmp_path, "floquet", monkeypatch)
    (scene.parts[0].parents[1] / "other").symlink_to("/")
    _, said = scene.run()
    assert not any("earlier state" in text for text in said)


def test_an_output_behind_a_link_to_nowhere_is_refused_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = prepared(tmp_path, "floquet", monkeypatch)
    scene.out.symlink_to("nowhere/out.h5")
    with pytest.raises(OutputError, match="is a link into a folder that is not there"):
        scene.run()
