"""A Dask scheduler with one worker, in processes of their own, as a cluster beside the commands that use it."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

STARTED = 60.0  # [s] that it may take to start
FORGOTTEN = 10.0  # [s] until the work of a client that has gone is dropped, its running job among it


class Cluster:
    """Its address, and what is left in it of commands that have ended."""

    def __init__(self, address: str, processes: list[subprocess.Popen[bytes]]):
        self.address = address
        self._processes = processes

    def left(self) -> str:
        """Return what commands have left or broken in the cluster, or "" if nothing."""
        import distributed

        def count(own: str, dask_scheduler: Any) -> tuple[int, int]:  # inside, so that its code is sent, not its name
            return len(dask_scheduler.tasks), len(set(dask_scheduler.clients) - {own, "fire-and-forget"})

        if any(process.poll() is not None for process in self._processes):
            return "the scheduler or its worker has ended"
        deadline = time.perf_counter() + FORGOTTEN
        client: Any = distributed.Client(self.address, set_as_default=False)
        with contextlib.closing(client):
            while True:
                jobs, others = client.run_on_scheduler(count, own=client.id)
                if not jobs and not others:
                    return ""
                if time.perf_counter() > deadline:
                    return f"{jobs} jobs and {others} clients left in the scheduler"
                time.sleep(0.05)


@contextlib.contextmanager
def cluster() -> Iterator[Cluster]:
    """Start a scheduler and its worker, and end both."""
    with TemporaryDirectory() as place:
        described = Path(place, "scheduler.json")
        common = ["--no-dashboard", "--scheduler-file", str(described)]
        parts = {
            "dask_scheduler": ["--host", "127.0.0.1", "--port", "0"],
            "dask_worker": ["--no-nanny", "--nthreads", "1", "--local-directory", place],
        }
        processes = [
            subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{name}", *options, *common],
                cwd=place,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
            for name, options in parts.items()
        ]
        try:
            yield Cluster(_address(described), processes)
        finally:
            for process in reversed(processes):
                process.terminate()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(STARTED / 6)
                process.kill()
                process.wait()


def _address(described: Path) -> str:
    """Return the address that a scheduler writes once it listens."""
    deadline = time.perf_counter() + STARTED
    while time.perf_counter() < deadline:
        with contextlib.suppress(OSError, ValueError):
            return str(json.loads(described.read_text())["address"])
        time.sleep(0.05)
    raise TimeoutError(f"no Dask scheduler within {STARTED:g} s")
