"""Simulate one reference many times with different seeds, on workers and with a checkpoint: `fly_many`."""

import hashlib
import inspect
import io
import pickle
from collections.abc import Callable, Iterator
from contextlib import suppress
from time import perf_counter
from typing import Any

import numpy as np
from pydantic import BaseModel
from typing_extensions import override

from ..base.checkpoint import Kind
from ..base.errors import InputError
from ..base.execution import Execution, started
from ..base.version import __version__
from ..control import Controller
from ..plant import Plant
from .conditions import Experiment, MeanWind
from .flights import FIGURES, copies, fly_block, passed

SIDE_BY_SIDE = 250  # flights in one block, at most
BLOCK_TIME = 3.0  # [s] that a block should take: what is computed is stored so often, and lost if the process ends
TRIED = 10  # periods of one flight, which tell how large the first block may be
FASTER = 8  # times as many flights in a block as in the longest that has been measured, at most
PARTS = 4  # blocks for each worker, as far as there are flights, so that none waits long for the last
FEWEST = 25  # flights in a block, unless they take long; with fewer side by side each takes longer
KIND = Kind("flights", "block")  # a result is the figures of a block, by the number of its first flight
Part = tuple[int, np.ndarray, float]  # of all flights: the first, figures, and the time that they took [s]


def fly_many(
    plant: Plant, controller: Controller, conditions: Experiment, seeds: range, tolerance: float, execution: Execution
) -> np.ndarray:
    """Return the statistics of one run per seed, (N,) of `FIGURES`; they do not depend on the workers.

    Raises `InputError` if the controller cannot be copied, controller or wind cannot be sent to a process or
    stored, the checkpoint cannot be used, or the scheduler does not exist; `SolverError` if workers end before
    their work is done.
    """
    copies(controller, 1)  # before anything else that needs one: this is the message that names what to do
    everything = plant, controller, conditions
    figures, done = np.zeros(len(seeds), dtype=FIGURES), np.zeros(len(seeds), dtype=bool)
    workers, scheduler, progress = execution.workers, execution.scheduler, execution.progress
    packed = None if workers == 1 and scheduler is None else _packed(everything, scheduler)
    with started(execution, KIND, lambda: _header(*everything, seeds)) as (working, stored):
        for first, content in () if stored is None else stored.items():
            block = np.frombuffer(content, dtype=FIGURES)
            figures[first : first + len(block)] = block
            done[first : first + len(block)] = True
        shares = None if packed is None else working.limit if scheduler is not None else lambda: workers
        sizes = _Sizes(_estimated(everything, seeds), shares, stored is not None or progress is not None)
        fly = (lambda *job: fly_part(everything, *job)) if packed is None else fly_packed
        jobs = ((some.start, seeds[some.start : some.stop]) for some in _blocks(done, sizes))
        jobs = jobs if packed is None else ((packed, *job) for job in jobs)
        for first, result, seconds in working.map(fly, jobs, in_order=False):
            sizes.learn(len(result), seconds)
            if stored is not None:
                stored.put(first, result.tobytes())
            figures[first : first + len(result)] = result
            done[first : first + len(result)] = True
            if progress is not None:
                good = passed(figures[done], len(conditions.references), tolerance)
                progress(int(done.sum()), len(seeds), int(good.sum()))
    return figures


class _Sizes:
    """Choose the number of runs of the next block from the time per run so far."""

    def __init__(self, each: float, workers: Callable[[], int] | None, awaited: bool):
        self._each, self._longest, self._workers = each, SIDE_BY_SIDE, workers
        self._alone = 2 if awaited else 1  # blocks of a process alone, at least, if something is told after each

    def learn(self, count: int, seconds: float) -> None:
        """Update the estimate: a block of `count` runs took `seconds`."""
        self._each, self._longest = seconds / count, FASTER * count

    def choose(self, left: int) -> int:
        """Return the number of runs of the next block if `left` runs remain."""
        parts = self._alone if self._workers is None else self._workers() * PARTS
        left = min(left, max(FEWEST, -(-left // parts)))
        return max(1, min(SIDE_BY_SIDE, left, self._longest, int(BLOCK_TIME / max(self._each, 1e-9))))


def _estimated(everything: tuple[Plant, Controller, Experiment], seeds: range) -> float:
    """Return the estimated time of a run [s], among as many as can be side by side, from their first periods."""
    plant, controller, conditions = everything
    some = seeds[: SIDE_BY_SIDE if controller.batches else 1]

    def lasts(periods: int) -> float:  # the first of two loads what flights need
        short = plant, controller, conditions._replace(references=conditions.references[:periods])
        return min(fly_part(short, 0, some)[2] for _ in range(2))

    return max(lasts(1 + TRIED) - lasts(1), 0.0) / TRIED * len(conditions.references) / len(some)


def fly_part(everything: tuple[Plant, Controller, Experiment], first: int, seeds: range) -> Part:
    """Simulate a block; return the number of its first run, its statistics and its time [s]."""
    start = perf_counter()
    return first, fly_block(*everything, seeds), perf_counter() - start


def fly_packed(packed: bytes, first: int, seeds: range) -> Part:
    """Simulate a block in another process or thread, with a separate controller."""
    return fly_part(pickle.loads(packed), first, seeds)


def _packed(everything: tuple[Plant, Controller, Experiment], scheduler: str | None) -> bytes:
    dumps = pickle.dumps
    if scheduler is not None:
        with suppress(ModuleNotFoundError):  # Dask's own, which also sends classes and functions of a script
            from cloudpickle import dumps
    try:
        return dumps(everything)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        accepted = "workers must be 1" if scheduler is None else "scheduler must be None"
        raise InputError(
            f"{accepted} for a controller or a wind that no process can receive: {str(error).splitlines()[0]}"
        ) from None


def _blocks(done: np.ndarray, sizes: _Sizes) -> Iterator[range]:
    """Yield the remaining runs, block after block."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], done, [True]]).astype(int))).reshape(-1, 2)
    left = int((~done).sum())
    for start, end in edges.tolist():
        while start < end:
            stop = min(start + sizes.choose(left), end)
            yield range(start, stop)
            left, start = left - (stop - start), stop


def _header(plant: Plant, controller: Controller, conditions: Experiment, seeds: range) -> dict[str, Any]:
    """Return everything on which the statistics depend."""
    controller.reset()  # what an earlier flight has left in it
    # Without loads, which are among the events.
    references = [part for reference in conditions.references for part in reference[:7] if part is not None]
    motion = hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in references)).hexdigest()
    try:
        by, wind = identity(controller), None if conditions.wind is None else identity(conditions.wind)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            f"checkpoint must be None for a controller or a wind that cannot be stored: {str(error).splitlines()[0]}"
        ) from None
    return {
        "robot": f"{plant.robot.name} {identity(plant)}",
        "reference": f"{len(conditions.references)} periods {motion[:16]}",
        "controller": f"{type(controller).__name__} {by}",
        "wind": f"{conditions.wind} {wind}" if isinstance(conditions.wind, MeanWind) else wind,  # readable if it can be
        "seeds": f"{seeds.start} to {seeds.stop - 1}",
        **conditions.to_dict(),
        "statistics": f"{FIGURES.itemsize} bytes a run",
        "towline": __version__,
        "numpy": np.__version__,
    }


class _Pickler(pickle.Pickler):
    """Pickle to bytes that are the same in each process, which are never read again."""

    @override
    def persistent_id(self, obj: Any) -> Any:
        # Sets of names are iterated in another order in each process; models have one of the keys in their file.
        if isinstance(obj, BaseModel):
            return type(obj).__name__, obj.model_dump_json()
        if isinstance(obj, set | frozenset):
            return sorted(map(repr, obj))
        return None


def identity(something: Any) -> str:
    """Return a hash of an object's content and of the source of its class or function, as far as there is one.

    Raises `pickle.PicklingError`, `AttributeError` or `TypeError` if the object cannot be pickled.
    """
    stream = io.BytesIO()
    _Pickler(stream).dump(something)
    code = something if inspect.isroutine(something) else type(something)
    try:
        source = inspect.getsource(code)
    except (OSError, TypeError):  # built in, or typed into a console
        source = ""
    return hashlib.sha256(stream.getvalue() + source.encode()).hexdigest()[:16]
