"""Sampling on a Dask cluster: the same result, also when a worker is killed, and what is told without a cluster."""

import contextlib
import json
import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from towline.base import execution
from towline.base.errors import InputError
from towline.models import load
from towline.workspace import StaticEquilibrium, sample, save
from towline.workspace.sampling import CHUNK

TOWLINE = Path(sys.executable).with_name("towline")
distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as started:
        yield started


def test_a_killed_worker_leaves_the_file_identical(cluster, tmp_path):
    robot, samples = load("wang-flying"), 400_000
    begun = threading.Event()

    def progress(done, total, accepted):
        if done > samples // 10:
            begun.set()

    def kill():
        assert begun.wait(100)
        with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
            process = next(iter(client.run(os.getpid).values()))
        os.kill(process, signal.SIGKILL)
        killed.append(time.monotonic())

    killed: list[float] = []
    killer = threading.Thread(target=kill)
    killer.start()
    address = cluster.scheduler_address
    files = {"checkpoint": tmp_path / "cluster.checkpoint", "scheduler": address, "progress": progress}
    shared = sample(robot, StaticEquilibrium(), samples=samples, **files)
    ended = time.monotonic()
    killer.join()
    assert killed[0] < ended, "the worker was killed after the work"
    alone = sample(robot, StaticEquilibrium(), samples=samples, checkpoint=tmp_path / "alone.checkpoint")
    assert save(shared, tmp_path / "shared.nc").read_bytes() == save(alone, tmp_path / "alone.nc").read_bytes()
    assert results(tmp_path / "cluster.checkpoint") == results(tmp_path / "alone.checkpoint")
    assert len(results(tmp_path / "alone.checkpoint")) == -(-samples // CHUNK)


def results(file):
    with contextlib.closing(sqlite3.connect(file)) as database:
        return database.execute("SELECT * FROM record WHERE number >= 0").fetchall()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense://x", "no such host:1", "tcp://"])
def test_a_scheduler_that_is_not_there_is_told_in_time(address, tmp_path, monkeypatch):
    monkeypatch.setattr(execution, "CONNECT_WITHIN", 1.0)
    start = time.monotonic()
    with pytest.raises(InputError, match="scheduler must be the address of a running Dask scheduler") as caught:
        sample(load("wang-flying"), StaticEquilibrium(), scheduler=address, checkpoint=tmp_path / "file")
    assert time.monotonic() - start < 60
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "file").exists()


def test_a_cluster_without_workers_is_told(monkeypatch):
    monkeypatch.setattr(execution, "WORKERS_WITHIN", 0.5)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as empty,
        pytest.raises(InputError, match="scheduler must have at least one worker"),
    ):
        sample(load("wang-flying"), StaticEquilibrium(), scheduler=empty.scheduler_address)


def test_wrong_input_is_told_before_any_worker(cluster):
    with pytest.raises(InputError, match="samples must be"):
        sample(load("wang-flying"), StaticEquilibrium(), samples=0, scheduler=cluster.scheduler_address)


@pytest.mark.parametrize(
    ("killed", "message"),
    [
        ("worker", "all workers of the scheduler ended before the work was done"),
        ("scheduler", "the scheduler ended before the work was done"),
    ],
)
def test_a_cluster_that_ends_is_one_line_within_ten_seconds(killed, message, tmp_path):
    """Processes of their own: a worker of `LocalCluster` that is killed is started again."""
    described, checkpoint = tmp_path / "scheduler.json", tmp_path / "c"
    started = {}
    python = [sys.executable, "-m"]
    common = ["--no-dashboard", "--scheduler-file", str(described)]
    nowhere = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    try:
        scheduler = [*python, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", *common]
        started["scheduler"] = subprocess.Popen(scheduler, **nowhere)
        worker = [*python, "distributed.cli.dask_worker", "--no-nanny", "--nthreads", "1", *common]
        started["worker"] = subprocess.Popen(worker, **nowhere)
        until(described.exists)
        until(lambda: "address" in (text := described.read_text()) and text.rstrip().endswith("}"))
        address = json.loads(described.read_text())["address"]
        options = ["--samples", "2e7", "--scheduler", address, "--checkpoint", str(checkpoint)]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": tmp_path}
        started["command"] = subprocess.Popen([TOWLINE, "workspace", "wang-flying", *options], **pipes)
        sizes = set()
        log = tmp_path / "c-wal"
        until(lambda: sizes.add(log.exists() and log.stat().st_size) or len(sizes) > 2)
        began = time.monotonic()
        started[killed].kill()
        out, err = started["command"].communicate(timeout=60)
        assert time.monotonic() - began < 40
        assert (started["command"].returncode, out) == (2, "")
        assert err == f"towline: {message}; a checkpoint can be resumed\n"
    finally:
        for process in started.values():
            process.kill()
            process.wait()


def until(condition):
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)
