"""A sweep on workers of a real scheduler: the same data as the pool's, whatever dies on the way."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scenes import ROOT, code, until, written
from sweep_faults import CONFIG, FOLDER, faulty

from gearstab.sweep import Interrupted, Reporter, SweepError, run
from gearstab.sweep import cluster as cluster_module
from gearstab.sweep.extension import extended
from gearstab.sweep.storage.previous import Previous

distributed = pytest.importorskip("distributed")

FOREIGN = "import gearstab.version as v; v.__version__ = '0.0.0'; "
WORKER = "from distributed.cli.dask_worker import main; main()"
ONE_DEATH = "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES"
ALONE = ["--no-nanny", "--no-dashboard", "--nthreads", "1"]
PATIENCE = 600.0
"""Seconds for what comes soon, on a machine that has much else to do."""


def answers(port: int) -> bool:
    with socket.socket() as tried:
        return tried.connect_ex(("127.0.0.1", port)) == 0


@dataclass
class Cluster:
    """A scheduler and workers on the loopback interface, and the folder that tells blocks what to do."""

    folder: Path
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)
    address: str = ""
    aside: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(1))

    def start(self, *command: str) -> subprocess.Popen[bytes]:
        places = os.pathsep.join([str(ROOT / "tests" / "reference"), str(ROOT)])
        settings = {
            "PYTHONPATH": places,
            FOLDER: str(self.folder),
            "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0",
        }
        process = subprocess.Popen([sys.executable, *command], env=os.environ | settings, stderr=subprocess.DEVNULL)
        self.processes.append(process)
        return process

    def open(self) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        place = ["--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
        self.start("-c", "from distributed.cli.dask_scheduler import main; main()", *place)
        until(lambda: answers(port), "the scheduler")

    def worker(self, before: str = "") -> subprocess.Popen[bytes]:
        return self.start("-c", before + WORKER, self.address, *ALONE)

    def ready(self, workers: int) -> None:
        with distributed.Client(self.address, timeout=PATIENCE) as client:
            client.wait_for_workers(workers, timeout=PATIENCE)

    def tell(self, **files: object) -> None:
        for name, content in files.items():
            (self.folder / name.replace("_", "-")).write_text(str(content))

    def begun(self) -> list[str]:
        path = self.folder / "log"
        return path.read_text().split() if path.exists() else []

    def run(self, out: str, **options: object) -> Path:
        run(faulty(self.folder / "train.yaml"), self.folder / out, **{"jobs": 1, **options})  # type: ignore[arg-type]
        return self.folder / out

    def parts(self, out: str) -> list[str]:
        return sorted(path.stem for path in (self.folder / f"{out}.parts").rglob("*.part"))


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Cluster]:
    (tmp_path / "train.yaml").write_text(CONFIG)
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr(cluster_module, "CONNECT", PATIENCE)
    found = Cluster(tmp_path)
    found.open()
    yield found
    for process in found.processes:
        process.kill()
        process.wait()
    # A sweep that still runs ends without its scheduler.
    found.aside.shutdown()


def same(left: Path, right: Path) -> None:
    with h5py.File(left) as one, h5py.File(right) as other:
        assert one["floquet"].keys() == other["floquet"].keys()
        for name in one["floquet"]:
            np.testing.assert_array_equal(one["floquet"][name][()], other["floquet"][name][()])


def test_a_worker_that_is_killed_costs_nothing(cluster: Cluster) -> None:
    first, _ = cluster.worker(), cluster.worker()
    cluster.ready(2)
    cluster.tell(hold=4)
    sweep = cluster.aside.submit(cluster.run, "workers.h5", scheduler=cluster.address)
    until(lambda: len([row for row in cluster.begun() if row >= "4"]) == 2, "two workers at blocks that are held")
    first.kill()
    (cluster.folder / "hold").unlink()
    out = sweep.result(timeout=PATIENCE)
    assert not cluster.parts("workers.h5")
    same(out, cluster.run("pool.h5"))


def test_workers_are_sent_what_an_earlier_result_has(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    config = written(cluster.folder, CONFIG.replace("1.0, 2.0, 3.0, 4.0, 5.0", "3.0, 5.0"), "train.yaml")
    old = cluster.run("old.h5")
    (cluster.folder / "log").unlink()
    config.write_text(CONFIG)
    grown, _ = extended(faulty(config), old)
    read: list[object] = []
    outcome = Previous.outcome

    def counting(self: Previous, *arguments: Any) -> Any:
        read.append(outcome(self, *arguments))
        return read[-1]

    monkeypatch.setattr(Previous, "outcome", counting)
    cluster.worker()
    cluster.ready(1)
    run(grown, cluster.folder / "grown.h5", 1, scheduler=cluster.address)
    assert len(read) == 5
    assert sorted(cluster.begun()) == ["1", "2", "4"]
    same(cluster.folder / "grown.h5", cluster.run("whole.h5"))


@pytest.mark.slow
def test_a_block_that_kills_its_workers_is_named_and_the_pool_goes_on(cluster: Cluster) -> None:
    # Two of them die, and what waited with the block at fault may be tried again after it.
    for _ in range(3):
        cluster.worker()
    cluster.ready(3)
    cluster.tell(kill_3=2)
    with pytest.raises(SweepError, match=r"block floquet-000002 .* was killed twice") as raised:
        cluster.run("out.h5", scheduler=cluster.address)
    assert "\n" not in str(raised.value)
    assert len(cluster.parts("out.h5")) == 7
    (cluster.folder / "log").unlink()
    out = cluster.run("out.h5", resume=True)
    assert cluster.begun() == ["3"]
    same(out, cluster.run("pool.h5"))


@pytest.mark.slow
def test_an_interrupt_keeps_what_is_finished(cluster: Cluster) -> None:
    class Impatient(Reporter):
        blocks = 0

        def advance(self, points: int, unstable: int, failed: int) -> None:
            self.blocks += points > 0
            if self.blocks == 3:
                os.kill(os.getpid(), signal.SIGTERM)

    cluster.worker()
    cluster.ready(1)
    with pytest.raises(Interrupted, match="3 of 8 blocks are kept"):
        cluster.run("out.h5", scheduler=cluster.address, progress=Impatient())
    assert len(cluster.parts("out.h5")) == 3
    with distributed.Client(cluster.address, timeout=PATIENCE) as client:
        until(lambda: not any(client.processing().values()), "the worker to be rid of what is not wanted any more")
    same(cluster.run("out.h5", scheduler=cluster.address), cluster.run("pool.h5"))


def test_another_version_is_refused_before_anything_is_computed(cluster: Cluster) -> None:
    cluster.worker(FOREIGN)
    cluster.ready(1)
    with pytest.raises(SweepError, match=r"worker tcp://.* has gearstab 0\.0\.0, .*: install the same") as raised:
        cluster.run("out.h5", scheduler=cluster.address)
    assert "\n" not in str(raised.value)
    assert cluster.begun() == []


@pytest.mark.slow
def test_a_scheduler_that_ends_is_one_line(cluster: Cluster) -> None:
    cluster.worker()
    cluster.ready(1)
    cluster.tell(hold=1)
    sweep = cluster.aside.submit(cluster.run, "out.h5", scheduler=cluster.address)
    until(lambda: len(cluster.begun()) == 1, "a block that is held")
    cluster.processes[0].kill()
    with pytest.raises(SweepError, match="the connection to the scheduler is lost") as raised:
        sweep.result(timeout=PATIENCE)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("address", "exit_code", "said"),
    [("tcp://127.0.0.1:9", 1, "no scheduler answers"), ("nearby", 2, "write tcp://HOST:PORT, or local")],
)
def test_an_address_where_no_scheduler_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    address: str, exit_code: int, said: str,
) -> None:  # fmt: skip
    monkeypatch.setattr(cluster_module, "CONNECT", 0.5)
    (tmp_path / "train.yaml").write_text(CONFIG)
    assert (
        code("sweep", str(tmp_path / "train.yaml"), "-o", str(tmp_path / "o.h5"), "--scheduler", address) == exit_code
    )
    text = capsys.readouterr().err
    assert said in text
    assert text.count("\n") == 1


def test_without_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    (tmp_path / "train.yaml").write_text(CONFIG)
    assert code("sweep", str(tmp_path / "train.yaml"), "-o", str(tmp_path / "o.h5"), "--scheduler", "local") == 2
    assert capsys.readouterr().err.endswith("pip install 'gearstab[cluster]'\n")


LOOK_AT_WORKERS = """
import signal
from distributed import Client
from gearstab.sweep.cluster import _own_cluster
if __name__ == "__main__":
    with _own_cluster(1) as cluster, Client(cluster) as client:
        (held,) = client.run(signal.pthread_sigmask, signal.SIG_BLOCK, []).values()
    print(signal.SIGINT in held)
"""


def test_an_interrupt_from_a_terminal_does_not_reach_workers_of_our_own() -> None:
    """In a process that started nothing before: what cleans up after others would let interrupts through."""
    done = subprocess.run([sys.executable, "-c", LOOK_AT_WORKERS], capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"
