"""Where jobs run: in this process, in processes of this machine, or on a Dask cluster.

Each of the three is an executor of `concurrent.futures`. Enough jobs are submitted at once that no worker waits, and
no more: memory does not grow with the number of jobs.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any, TypedDict, TypeVar
from weakref import WeakSet

from . import processors
from .checkpoint import Checkpoint, Kind, open_checkpoint
from .errors import InputError, SolverError
from .inputs import file_path, flag, shown, whole_number
from .quiet import quiet

LEFT_TO_PARENT = {signal.SIGINT, signal.SIGTERM}

_running: WeakSet[_Spawning] = WeakSet()
MOST_WORKERS = 1024
AHEAD = 3  # jobs for each worker, one of which it works on
CONNECT_WITHIN = 5.0  # [s]
WORKERS_WITHIN = 30.0  # [s]
LOOK_EVERY = 1.0  # [s]
WITHOUT_WORKERS = 5.0  # [s]; a scheduler's worker that was killed is often started again
NOISY = ("distributed", "distributed.client", "asyncio", "tornado.application")  # of a scheduler that ends
Result = TypeVar("Result")
Progress = Callable[[int, int, int], None]


class _Processes(ProcessPoolExecutor):
    """Processes that leave signals that end a command to its first process, from their first instruction on."""

    def submit(self, fn: Callable[..., Result], /, *args: Any, **kwargs: Any) -> Future[Result]:
        if not hasattr(signal, "pthread_sigmask"):
            return super().submit(fn, *args, **kwargs)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, LEFT_TO_PARENT)  # which a process that starts inherits
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Process(SpawnProcess):
    """A process whose start is whole: an interrupt in the middle would leave one that ends in a traceback."""

    started_by: _Spawning

    @staticmethod
    def _Popen(process_obj: Any) -> Any:
        with ThreadPoolExecutor(1) as other_thread:  # Python raises KeyboardInterrupt in the main thread only
            return other_thread.submit(process_obj.started_by.launch, process_obj).result()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "started_by"}


class _Spawning(SpawnContext):
    """Start new processes, until all are ended."""

    def __init__(self) -> None:
        super().__init__()
        self._launched: list[Any] = []
        self._launching = threading.Lock()  # held until one that starts has been given all that it reads
        self._ended = False
        _running.add(self)

    def Process(self, *args: Any, **kwargs: Any) -> SpawnProcess:  # pyrefly: ignore[bad-override]
        """Return a process that is not started yet, as the executor makes it."""
        process = _Process(*args, **kwargs)
        process.started_by = self
        return process

    def launch(self, process: SpawnProcess) -> Any:
        """Start a process.

        Raises `InterruptedError` if they are ended: what interrupts the main thread does not wait for the
        thread that starts one.
        """
        with self._launching:
            if self._ended:
                raise InterruptedError
            self._launched.append(SpawnProcess._Popen(process))
            return self._launched[-1]

    def kill(self) -> None:
        """End all processes at once, whatever they are doing."""
        with self._launching:
            self._ended = True
            for each in self._launched:
                with suppress(OSError):  # it has already ended
                    each.kill()


def end_processes() -> None:
    """End all processes at once, for a process that ends without unwinding its blocks."""
    for each in tuple(_running):
        each.kill()


@contextmanager
def processes(workers: int) -> Iterator[Executor]:
    """Start worker processes, which end with the block."""
    # New processes, not copies of this one: a copy would have its locks, but not the threads that hold them.
    context = _Spawning()
    _start_tracker()
    alive, stop = context.Pipe(duplex=False)
    pool = _Processes(workers, mp_context=context, initializer=_begin_worker, initargs=(alive,))
    with alive, stop, processors.one_thread_each():
        try:
            yield pool
        except BaseException:
            context.kill()  # nobody wants the rest
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _start_tracker() -> None:
    """Start Python's process that removes the semaphores of a process which ends early; nobody needs its report."""
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (before, "ignore:resource_tracker")))
    try:
        resource_tracker.ensure_running()
    finally:
        if before is None:
            del os.environ["PYTHONWARNINGS"]
        else:
            os.environ["PYTHONWARNINGS"] = before


def _begin_worker(alive: Any) -> None:
    """Leave signals to the process that started this one, and end when it ends, which closes its end of a pipe."""
    for each in LEFT_TO_PARENT:
        signal.signal(each, signal.SIG_IGN)

    def end_with_it() -> None:
        alive.poll(None)
        os._exit(1)

    threading.Thread(target=end_with_it, daemon=True).start()


class ExecutionOptions(TypedDict, total=False):
    """The fields of `Execution`, by their names."""

    workers: int
    scheduler: str | None
    checkpoint: str | os.PathLike[str] | None
    resume: bool
    progress: Progress | None


@dataclass(frozen=True)
class Execution:
    """Workers and checkpoint of many jobs.

    Attributes:
        workers: Processes of this machine that share the jobs; 1: this process. Results do not depend on it.
        scheduler: Address of a Dask scheduler whose workers are used instead (extra `cluster`).
        checkpoint: File to which results are written every few seconds.
        resume: True to continue the checkpoint if the file exists. It must belong to the same jobs.
        progress: Function that is called with (jobs done, jobs in total, those with a good result).

    Raises:
        InputError: If a field has a wrong value.
    """

    workers: int = 1
    scheduler: str | None = None
    checkpoint: str | os.PathLike[str] | None = None
    resume: bool = False
    progress: Progress | None = None

    def __post_init__(self) -> None:
        """Check all fields, and make a path of the checkpoint."""
        whole_number("workers", self.workers, 1, MOST_WORKERS)
        if self.scheduler is not None and not (isinstance(self.scheduler, str) and self.scheduler):
            accepted = "the address of a Dask scheduler or None"
            raise InputError(f"scheduler must be {accepted}, got {shown(self.scheduler)}")
        path = None if self.checkpoint is None else file_path("checkpoint", self.checkpoint, "a path or None")
        if flag("resume", self.resume) and path is None:
            raise InputError("checkpoint must be a path if resume is True, got None")
        if self.progress is not None and not callable(self.progress):
            raise InputError(f"progress must be a function or None, got {shown(self.progress)}")
        object.__setattr__(self, "checkpoint", path)

    def check_alone(self) -> None:
        """Check that no field is set that applies only to many runs.

        Raises:
            InputError: If one is.
        """
        if self.workers != 1:
            raise InputError(f"workers must be 1 without runs, got {self.workers}")
        if self.checkpoint is not None or self.scheduler is not None:
            name, value = ("scheduler", self.scheduler) if self.checkpoint is None else ("checkpoint", self.checkpoint)
            raise InputError(f"{name} must be None without runs, got {shown(str(value))}")


@dataclass(frozen=True)
class Workers:
    """Evaluate jobs by an executor."""

    executor: Executor
    limit: Callable[[], int]  # returns how many jobs may be under way now; a cluster may grow and shrink
    # Exceptions that mean that workers have failed, each with its message; {0} stands for the exception.
    failures: Mapping[type[Exception], str] = field(default_factory=dict)
    # Raises SolverError if there are no workers any more; called again and again while a result is awaited.
    look: Callable[[], None] = lambda: None

    def map(
        self, function: Callable[..., Result], jobs: Iterable[tuple[Any, ...]], in_order: bool = True
    ) -> Iterator[Result]:
        """Yield `function(*job)` of each job while the next ones are being evaluated.

        Results come in the order of the jobs, or else as soon as they are there, so that no worker waits for a slow
        job. Raises `SolverError` if workers end before their work is done.
        """
        under_way: list[Future[Result]] = []
        try:
            for job in jobs:
                under_way.append(self.executor.submit(function, *job))
                while len(under_way) >= self.limit():
                    yield from self._done(under_way, in_order)
            while under_way:
                yield from self._done(under_way, in_order)
        except tuple(self.failures) as error:
            message = next(text for kind, text in self.failures.items() if isinstance(error, kind))
            raise SolverError(message.format(error)) from None
        finally:
            for future in under_way:
                future.cancel()

    def _done(self, under_way: list[Future[Result]], in_order: bool) -> Iterator[Result]:
        """Wait until the first job is done, or any; remove those that are and yield their results."""
        awaited = under_way[:1] if in_order else under_way
        while not (done := wait(awaited, timeout=LOOK_EVERY, return_when=FIRST_COMPLETED).done):
            self.look()
        for future in done:
            under_way.remove(future)
            yield future.result()


@contextmanager
def started(
    execution: Execution, kind: Kind, header: Callable[[], dict[str, Any]]
) -> Iterator[tuple[Workers, Checkpoint | None]]:
    """Start workers and open the checkpoint, if there is one, until the end of the block.

    - `header`: function that returns everything on which the results depend.

    Raises `InputError` if there is no such scheduler, or the checkpoint cannot be used.
    """
    opened = nullcontext()
    if execution.checkpoint is not None:
        opened = open_checkpoint(Path(execution.checkpoint), kind, header(), execution.resume)
    with _workers(execution.workers, execution.scheduler) as workers, opened as stored:
        yield workers, stored


@contextmanager
def _workers(workers: int, scheduler: str | None) -> Iterator[Workers]:
    if scheduler is not None:
        with _cluster(scheduler) as started:
            yield started
    elif workers == 1:
        yield Workers(_ThisProcess(), lambda: 1)
    else:
        with processes(workers) as executor:
            ended = (
                "a worker process ended before its work was done (killed, out of memory, or a script without "
                "`if __name__ == '__main__':`); a checkpoint can be resumed"
            )
            yield Workers(executor, lambda: AHEAD * workers, {BrokenProcessPool: ended})


class _ThisProcess(Executor):
    """Evaluate a job when it is submitted."""

    def submit(self, fn: Callable[..., Result], /, *args: Any, **kwargs: Any) -> Future[Result]:
        future: Future[Result] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class _Cluster(Executor):
    """Evaluate jobs by the workers of a Dask scheduler.

    If the worker of a finished job is killed before its result arrives, Dask's own executor raises an exception.
    """

    def __init__(self, client: Any):
        self._client = client

    def submit(self, fn: Callable[..., Result], /, *args: Any, **kwargs: Any) -> Future[Result]:
        future: Future[Result] = Future()

        def finish(task: Any) -> None:
            """Pass the result on; if the worker was killed, wait until another worker has done the job."""
            if not future.set_running_or_notify_cancel():
                return
            try:
                result = task.result()
            except BaseException as error:
                future.set_exception(error)
            else:
                future.set_result(result)

        # Not pure: Dask would take a hash of the job instead of a name of its own.
        task = self._client.submit(fn, *args, pure=False, **kwargs)
        task.add_done_callback(finish)
        future.add_done_callback(lambda ended: task.cancel() if ended.cancelled() else None)
        return future


@contextmanager
def _cluster(address: str) -> Iterator[Workers]:
    try:
        import distributed
        from distributed.comm.addressing import get_address_host
    except ModuleNotFoundError:
        raise SolverError("scheduler needs the extra cluster: pip install 'towline[cluster]'") from None
    accepted = "scheduler must be the address of a running Dask scheduler, such as tcp://host:8786"
    try:
        # A client of something that is no address is never closed, which takes long and prints many lines.
        get_address_host(address)
        client: Any = distributed.Client(address, timeout=CONNECT_WITHIN, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = "no result" if isinstance(error, OSError) else "not an address"
        raise InputError(f"{accepted}, got {shown(address)} ({reason})") from None
    ended = "the scheduler ended before the work was done; a checkpoint can be resumed"
    seen = time.monotonic()

    def look() -> None:
        nonlocal seen
        now = time.monotonic()
        if client.nthreads():
            seen = now
        elif now - seen > WITHOUT_WORKERS:
            raise SolverError(
                "all workers of the scheduler ended before the work was done; a checkpoint can be resumed"
            )

    failures: dict[type[Exception], str] = {
        distributed.KilledWorker: "one job ended several workers of the scheduler (out of memory?); a checkpoint can "
        "be resumed",
        ModuleNotFoundError: "the scheduler's workers do not have {0.name!r}: install it there",
        CancelledError: ended,
        OSError: ended,
    }
    with quiet(*NOISY):
        try:
            try:
                client.wait_for_workers(1, timeout=WORKERS_WITHIN)
            except TimeoutError:
                raise InputError(f"scheduler must have at least one worker, got {shown(address)} without any") from None
            yield Workers(_Cluster(client), lambda: AHEAD * max(sum(client.nthreads().values()), 1), failures, look)
        finally:
            client.close(timeout=CONNECT_WITHIN)
