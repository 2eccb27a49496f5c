"""Where the jobs run: in this process, in processes of this machine, or on a Dask cluster; results keep their order.

Enough jobs are submitted at once that no worker waits, and no more: memory does not grow with the number of samples.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from ..errors import InputError, SolverError
from ..inputs import shown
from .jobs import Job, JobResult, evaluate, prepare

AHEAD = 3  # jobs for each worker, one of which it works on
CONNECT_WITHIN = 5.0  # [s]
WORKERS_WITHIN = 30.0  # [s]

Evaluate = Callable[[Iterable[Job]], Iterator[JobResult]]


@contextmanager
def executor(packed: bytes, workers: int, scheduler: str | None) -> Iterator[Evaluate]:
    """Return a function that evaluates jobs and yields their results in the same order.

    Parameters
    ----------
    packed
        From `RunSettings.packed`.
    workers
        Processes of this machine; 1: this process.
    scheduler
        Address of a Dask scheduler, which has workers of its own; default: this machine.

    Raises
    ------
    InputError
        If there is no such scheduler.
    SolverError
        If workers end before their work is done.
    """
    if scheduler is not None:
        with _cluster(scheduler) as client:
            yield lambda jobs: _on_cluster(client, packed, jobs)
    elif workers == 1:
        yield lambda jobs: (evaluate(packed, job) for job in jobs)
    else:
        prepare(packed)
        # New processes, not copies of this one: a copy would have its locks, but not the threads that hold them.
        context = multiprocessing.get_context("spawn")
        alive, stop = context.Pipe(duplex=False)
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin_worker, initargs=(alive,))
        with alive, stop, _one_thread_each():
            try:
                yield lambda jobs: _on_processes(pool, packed, jobs, AHEAD * workers)
            except BaseException:
                stop.close()  # nobody wants the rest: workers end at once, whatever they are doing
                raise
            finally:
                pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that start inside the block do linear algebra with one thread: there is a process a processor.

    Environment variables that the user has set keep their values.
    """
    names = [name for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS") if name not in os.environ]
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name in names:
            os.environ.pop(name, None)


def _begin_worker(alive: Any) -> None:
    """Leave interrupts to the process that started this one, and end when it ends or closes its end of a pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def end_with_it() -> None:
        alive.poll(None)
        os._exit(1)

    threading.Thread(target=end_with_it, daemon=True).start()


def _submit(pool: ProcessPoolExecutor, packed: bytes, job: Job) -> Future[JobResult]:
    """Submit a job; a worker that starts for it ignores interrupts of the terminal from its first instruction on."""
    if not hasattr(signal, "pthread_sigmask"):
        return pool.submit(evaluate, packed, job)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which a new process inherits
    try:
        return pool.submit(evaluate, packed, job)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _on_processes(pool: ProcessPoolExecutor, packed: bytes, jobs: Iterable[Job], most: int) -> Iterator[JobResult]:
    try:
        yield from _in_order(lambda job: _submit(pool, packed, job), jobs, lambda: most)
    except BrokenProcessPool:
        raise SolverError(
            "a worker process ended before its work was done (killed, out of memory, or a script without "
            "`if __name__ == '__main__':`); a checkpoint can be resumed"
        ) from None


@contextmanager
def _cluster(address: str) -> Iterator[Any]:
    try:
        import distributed
        from distributed.comm.addressing import get_address_host
    except ModuleNotFoundError:
        raise SolverError("scheduler needs the extra cluster: pip install 'towline[cluster]'") from None
    accepted = "scheduler must be the address of a running Dask scheduler, such as tcp://host:8786"
    try:
        # A client of something that is no address is never closed, which takes long and prints many lines.
        get_address_host(address)
        client = distributed.Client(address, timeout=CONNECT_WITHIN, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = "no answer" if isinstance(error, OSError) else "not an address"
        raise InputError(f"{accepted}, got {shown(address)} ({reason})") from None
    try:
        try:
            client.wait_for_workers(1, timeout=WORKERS_WITHIN)
        except TimeoutError:
            raise InputError(f"scheduler must have a worker at least, got {shown(address)} without any") from None
        yield client
    finally:
        client.close(timeout=CONNECT_WITHIN)


def _on_cluster(client: Any, packed: bytes, jobs: Iterable[Job]) -> Iterator[JobResult]:
    import distributed
    from distributed import CancelledError

    def threads() -> int:
        """Return how many threads the workers have now: a cluster may grow and shrink."""
        return AHEAD * max(sum(client.nthreads().values()), 1)

    try:
        # Not pure: Dask would take a hash of the job instead of a name of its own.
        yield from _in_order(lambda job: client.submit(evaluate, packed, job, pure=False), jobs, threads)
    except distributed.KilledWorker:
        raise SolverError(
            "one job ended several workers of the scheduler (out of memory?); a checkpoint can be resumed"
        ) from None
    except ModuleNotFoundError as error:
        raise SolverError(f"the scheduler's workers do not have {error.name!r}: install towline there") from None
    except (CancelledError, OSError):
        raise SolverError("the scheduler ended before the work was done; a checkpoint can be resumed") from None


def _in_order(submit: Callable[[Job], Any], jobs: Iterable[Job], most: Callable[[], int]) -> Iterator[JobResult]:
    """Yield the results in the jobs' order, while the next jobs are being evaluated."""
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
