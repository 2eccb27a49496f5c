"""Worker processes of this machine: they leave signals to the process that started them, and end when it does."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, TypeVar
from weakref import WeakSet

from . import processors

LEFT_TO_PARENT = {signal.SIGINT, signal.SIGTERM}

_running: WeakSet[_Spawning] = WeakSet()
Result = TypeVar("Result")


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
