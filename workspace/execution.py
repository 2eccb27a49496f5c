"""Who works on the jobs: this process, processes of this machine, or a Dask cluster. Tallies come in the jobs' order.

So many jobs are under way at once that nobody waits, and no more: memory does not grow with the number of samples.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from ..errors import InputError, SolverError
from .counts import Counts, Job, count

AHEAD = 3  # jobs for each worker, one of which it works on
CONNECT_WITHIN = 5.0  # [s]
WORKERS_WITHIN = 30.0  # [s]

Run = Callable[[Iterable[Job]], Iterator[Counts]]


@contextmanager
def executor(packed: bytes, workers: int, scheduler: str | None) -> Iterator[Run]:
    """A function that works on jobs and yields their tallies in the same order.

    Parameters
    ----------
    packed
        The question, as bytes.
    workers
        Processes of this machine; 1: this one.
    scheduler
        Address of a Dask scheduler, which has workers of its own; None: this machine.

    Raises
    ------
    InputError
        If there is no such scheduler.
    SolverError
        If workers end before their work.
    """
    if scheduler is not None:
        with _cluster(scheduler) as client:
            yield lambda jobs: _on_cluster(client, packed, jobs)
    elif workers == 1:
        yield lambda jobs: (count(packed, job) for job in jobs)
    else:
        # Processes of their own, not copies of this one: its threads and locks are not theirs.
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin_worker)
        with _one_thread_each():
            try:
                yield lambda jobs: _on_processes(pool, packed, jobs, AHEAD * workers)
            finally:
                pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that begin meanwhile do linear algebra with one thread, as there is one process for each processor.

    What the user has set stays.
    """
    names = [name for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS") if name not in os.environ]
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name in names:
            os.environ.pop(name, None)


def _begin_worker() -> None:
    """Leave an interrupt to the process that started this one, and end with it, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def end_with() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=end_with, daemon=True).start()


def _on_processes(pool: ProcessPoolExecutor, packed: bytes, jobs: Iterable[Job], most: int) -> Iterator[Counts]:
    try:
        yield from _in_order(lambda job: pool.submit(count, packed, job), jobs, lambda: most)
    except BrokenProcessPool:
        raise SolverError(
            "workers: a worker process ended before its work was done (killed, out of memory, or a script without "
            "`if __name__ == '__main__':`); what a checkpoint has is safe"
        ) from None


@contextmanager
def _cluster(address: str) -> Iterator[Any]:
    try:
        import distributed
        from distributed.comm.addressing import get_address_host
    except ModuleNotFoundError:
        raise SolverError("scheduler: needs the extra cluster; install it by: pip install 'towline[cluster]'") from None
    accepted = "the address of a Dask scheduler that is running, as tcp://host:8786"
    try:
        # A client of an address that is none is never closed, which takes long and is told in many lines.
        get_address_host(address)
        client = distributed.Client(address, timeout=CONNECT_WITHIN, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = "no answer" if isinstance(error, OSError) else str(error)
        raise InputError(f"scheduler: {address!r}: {' '.join(reason.split())}; accepted: {accepted}") from None
    try:
        try:
            client.wait_for_workers(1, timeout=WORKERS_WITHIN)
        except TimeoutError:
            raise InputError(f"scheduler: {address!r} has no workers; accepted: one at least") from None
        yield client
    finally:
        client.close(timeout=CONNECT_WITHIN)


def _on_cluster(client: Any, packed: bytes, jobs: Iterable[Job]) -> Iterator[Counts]:
    import distributed
    from distributed import CancelledError

    def threads() -> int:
        """Of the workers that the cluster has now: it may grow and shrink."""
        return AHEAD * max(sum(client.nthreads().values()), 1)

    try:
        # Not pure: Dask would take a hash of the job instead of a name of its own.
        yield from _in_order(lambda job: client.submit(count, packed, job, pure=False), jobs, threads)
    except distributed.KilledWorker:
        raise SolverError(
            "scheduler: one job ended several workers (out of memory?); what a checkpoint has is safe"
        ) from None
    except ModuleNotFoundError as error:
        raise SolverError(f"scheduler: its workers lack the package {error.name!r}; install towline there") from None
    except (CancelledError, OSError):
        raise SolverError("scheduler: it ended before the work was done; what a checkpoint has is safe") from None


def _in_order(submit: Callable[[Job], Any], jobs: Iterable[Job], most: Callable[[], int]) -> Iterator[Counts]:
    """Tallies in the jobs' order, some jobs under way."""
    under_way: deque[Any] = deque()
    limit = most()
    try:
        for job in jobs:
            under_way.append(submit(job))
            if len(under_way) >= limit:
                yield under_way.popleft().result()
                limit = most()
        while under_way:
            yield under_way.popleft().result()
    finally:
        for future in under_way:
            future.cancel()
