"""A Dask cluster of real processes that are killed, stopped and lost: nothing lost, nothing twice."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bgars
import pytest
from line_captures import RECIPE, captures
from test_batch import kept, parts_of, wait_for_parts

pytest.importorskip("distributed", reason="distributed is not installed (pip install 'bgars[dask]')")
pytestmark = pytest.mark.timeout(600)
RUN = """
import json, sys
import bgars
from bgars.line import dask_pool
if __name__ == "__main__":
    dask_pool.LOST_S = 3.0
    try:
        done = bgars.inspect_many([sys.argv[2]], store=sys.argv[3], scheduler=sys.argv[1])
        print(json.dumps([done.inspected, done.known, done.failures]))
    except bgars.BgarsError as error:
        print(json.dumps(str(error)))
"""
LOCAL = """
import sys
import bgars
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        seen = bgars.inspect_many([sys.argv[1]], sys.argv[2], store=sys.argv[3], scheduler=address)
        sent = bgars.inspect_many([sys.argv[1]], sys.argv[2], store=sys.argv[4], scheduler=address, send_images=True)
    print(seen.inspected, sent.inspected)
"""


class Cluster:
    """`dask scheduler` and `dask worker` as processes of their own."""

    def __init__(self, log: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.log = log.open("wb")
        self.running: list[subprocess.Popen[bytes]] = []

    def start(self, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *arguments, "--no-dashboard"]
        process = subprocess.Popen(command, stdout=self.log, stderr=self.log, cwd=Path(self.log.name).parent)
        self.running.append(process)
        return process

    def scheduler(self) -> subprocess.Popen[bytes]:
        started = self.start("scheduler", "--host", "127.0.0.1", "--port", str(self.port))
        deadline = time.monotonic() + 60
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1).close()
            except OSError:
                assert started.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.1)
            else:
                return started

    def worker(self) -> subprocess.Popen[bytes]:
        return self.start("worker", self.address, "--nthreads", "1", "--no-nanny", "--death-timeout", "60")

    def end(self) -> None:
        for process in self.running:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
            process.wait()
        self.log.close()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path / "dask.log")
    yield made
    made.end()


def start(cluster: Cluster, folder: Path, store: Path) -> subprocess.Popen[str]:
    script = store.parent / "run.py"
    script.write_text(RUN)
    command = [sys.executable, script, cluster.address, folder, store]
    return subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def answer(running: subprocess.Popen[str]) -> object:
    out, err = running.communicate(timeout=300)
    assert "Traceback" not in err, err
    return json.loads(out)


def test_a_local_cluster_gives_what_one_process_gives_with_files_seen_or_sent(tmp_path: Path) -> None:
    captures(tmp_path / "in", "A1", "A2")
    recipe = tmp_path / "part.toml"
    recipe.write_text(RECIPE)
    stores = [tmp_path / name for name in ("seen", "sent", "here")]
    script = tmp_path / "local.py"
    script.write_text(LOCAL)
    arguments = [sys.executable, script, tmp_path / "in", recipe, *stores[:2]]
    done = subprocess.run([*map(str, arguments)], capture_output=True, text=True, timeout=300, check=False)
    assert done.stdout.split() == ["2", "2"], done.stderr
    bgars.inspect_many([tmp_path / "in"], recipe, store=stores[2], processes=1)
    here = kept(stores[2])
    assert kept(stores[0]) == here
    assert kept(stores[1]) == here


def test_killed_and_slow_workers_lose_nothing(tmp_path: Path, cluster: Cluster) -> None:
    names = [f"A{n}" for n in range(6)]
    captures(tmp_path / "in", *names)
    cluster.scheduler()
    killed, slow = cluster.worker(), cluster.worker()
    running = start(cluster, tmp_path / "in", tmp_path / "store")
    wait_for_parts(tmp_path / "store", 1)
    os.kill(slow.pid, signal.SIGSTOP)
    killed.kill()
    time.sleep(2.0)
    os.kill(slow.pid, signal.SIGCONT)
    assert answer(running) == [6, 0, []]
    assert list(kept(tmp_path / "store")) == names


def test_a_scheduler_that_is_started_anew_gets_its_jobs_again(tmp_path: Path, cluster: Cluster) -> None:
    names = [f"A{n}" for n in range(6)]
    captures(tmp_path / "in", *names)
    scheduler = cluster.scheduler()
    cluster.worker()
    running = start(cluster, tmp_path / "in", tmp_path / "store")
    wait_for_parts(tmp_path / "store", 1)
    scheduler.kill()
    scheduler.wait()
    cluster.scheduler()
    cluster.worker()
    told = answer(running)
    if isinstance(told, str):  # the machine was too slow for the three seconds that the test allows
        assert "the scheduler is lost" in told
        told = answer(start(cluster, tmp_path / "in", tmp_path / "store"))
    inspected, known, failures = told
    assert (inspected + known, failures) == (6, [])
    assert list(kept(tmp_path / "store")) == names


def test_a_lost_scheduler_gets_one_line_and_the_next_run_goes_on(tmp_path: Path, cluster: Cluster) -> None:
    captures(tmp_path / "in", *(f"A{n}" for n in range(4)))
    scheduler = cluster.scheduler()
    cluster.worker()
    running = start(cluster, tmp_path / "in", tmp_path / "store")
    wait_for_parts(tmp_path / "store", 1)
    scheduler.kill()
    told = answer(running)
    assert told == f"{cluster.address}: the scheduler is lost; what was done is in the store, run again to go on"
    first = parts_of(tmp_path / "store")
    done = bgars.inspect_many([tmp_path / "in"], store=tmp_path / "store", processes=1)
    assert (done.known, done.inspected) == (first, 4 - first)
    assert len(kept(tmp_path / "store")) == 4


def test_a_scheduler_that_is_not_there_gets_one_line(tmp_path: Path) -> None:
    captures(tmp_path / "in", "A1")
    script = (
        "import sys; from bgars.line import dask_pool; dask_pool.CONNECT_S = 1.0; from bgars.cli import main; main()"
    )
    command = [sys.executable, "-c", script, "batch", tmp_path / "in", "-o", tmp_path / "s"]
    done = subprocess.run(
        [*map(str, command), "--scheduler", "tcp://127.0.0.1:1"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "tcp://127.0.0.1:1: no Dask scheduler answers within 1 s" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
