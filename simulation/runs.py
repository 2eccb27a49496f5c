"""Fly one reference many times, each time with a seed of its own, on workers and with a checkpoint: `fly_many`."""

from __future__ import annotations

import hashlib
import pickle
import struct
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import __version__
from ..checkpoint import ACCEPTED, Checkpoint, Kind, open_checkpoint
from ..control import Controller
from ..errors import InputError
from ..execution import start_workers
from ..models.plant import Plant
from .conditions import Conditions, Wind
from .flights import FIGURES, fly_block, passed
from .identity import identity
from .winds import ConstantWind

__all__ = ["Execution", "fly_many"]

SIDE_BY_SIDE = 250  # flights in one block
PARTS = 4  # blocks for each worker, as far as there are flights, so that none waits long for the last
FEWEST = 25  # flights in a block; with fewer side by side each takes longer

_HEAD = struct.Struct("<QI")  # number of the first flight, flights
KIND = Kind(b"towline flights checkpoint 1\n", "block", _HEAD.size + SIDE_BY_SIDE * FIGURES.itemsize)
Progress = Callable[[int, int, int], None]


class Execution(NamedTuple):
    """A choice of where many flights are computed and stored, see `simulate`."""

    workers: int = 1
    scheduler: str | None = None
    checkpoint: Path | None = None
    resume: bool = False
    progress: Progress | None = None


def fly_many(
    plant: Plant,
    controller: Controller,
    conditions: Conditions,
    seeds: range,
    tolerance: float,
    execution: Execution,
) -> np.ndarray:
    """Return the figures of a flight for each seed, (N,) of `FIGURES`: the same to the last bit for all workers.

    Raises
    ------
    InputError
        If the controller or the wind cannot be sent to a process or stored, the checkpoint cannot be used, or there is
        no such scheduler.
    SolverError
        If workers end before their work is done.
    """
    everything = plant, controller, conditions
    figures, done = np.zeros(len(seeds), dtype=FIGURES), np.zeros(len(seeds), dtype=bool)
    workers, scheduler, checkpoint, resume, progress = execution
    opened = nullcontext()
    if checkpoint is not None:
        opened = open_checkpoint(checkpoint, KIND, _header(*everything, seeds), resume)
    packed = None if workers == 1 and scheduler is None else _packed(everything, scheduler)
    with start_workers(workers, scheduler) as started, opened as stored:
        if stored is not None:
            _restore(stored, figures, done)
        blocks = list(_blocks(done, 1 if packed is None else workers if scheduler is None else started.limit()))
        fly = (lambda some: fly_block(*everything, some)) if packed is None else fly_packed
        jobs = [(seeds[some.start : some.stop],) for some in blocks]
        results = started.map(fly, jobs if packed is None else [(packed, *job) for job in jobs])
        for some, result in zip(blocks, results, strict=True):
            if stored is not None:
                stored.append(_HEAD.pack(some.start, len(some)) + result.tobytes())
            figures[some.start : some.stop] = result
            done[some.start : some.stop] = True
            if progress is not None:
                good = passed(figures[done], len(conditions.references), tolerance)
                progress(int(done.sum()), len(seeds), int(good.sum()))
    return figures


def fly_packed(packed: bytes, seeds: range) -> np.ndarray:
    """Fly a block in another process or thread, with a controller of its own."""
    plant, controller, conditions = pickle.loads(packed)
    return fly_block(plant, controller, conditions, seeds)


def _packed(everything: tuple[Plant, Controller, Conditions], scheduler: str | None) -> bytes:
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


def _blocks(done: np.ndarray, workers: int) -> Iterator[range]:
    """Yield the flights still to be flown, block after block."""
    left = int((~done).sum())
    together = min(SIDE_BY_SIDE, max(FEWEST, -(-left // (workers * PARTS)))) if workers > 1 else SIDE_BY_SIDE
    edges = np.flatnonzero(np.diff(np.concatenate([[True], done, [True]]).astype(int)))
    for first, end in edges.reshape(-1, 2).tolist():
        for start in range(first, end, together):
            yield range(start, min(start + together, end))


def _restore(stored: Checkpoint, figures: np.ndarray, done: np.ndarray) -> None:
    """Copy the flights that the checkpoint has."""
    while (content := stored.read()) is not None:
        first, count = _HEAD.unpack(content[: _HEAD.size])
        some = slice(first, first + count)
        if len(content) != _HEAD.size + count * FIGURES.itemsize or first + count > len(done) or done[some].any():
            raise InputError(f"checkpoint must be {ACCEPTED}, got {stored.path} with flights of another run")
        figures[some] = np.frombuffer(content[_HEAD.size :], dtype=FIGURES)
        done[some] = True


def _header(plant: Plant, controller: Controller, conditions: Conditions, seeds: range) -> dict[str, Any]:
    """Return everything that the figures depend on."""
    controller.reset()  # what an earlier flight has left in it
    references = [part for reference in conditions.references for part in reference if part is not None]
    motion = hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in references)).hexdigest()
    try:
        by, wind = identity(controller), None if conditions.wind is None else _named(conditions.wind)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            f"checkpoint must be None for a controller or a wind that cannot be stored: {str(error).splitlines()[0]}"
        ) from None
    return {
        "robot": f"{plant.robot.name} {identity(plant)}",
        "reference": f"{len(conditions.references)} periods {motion[:16]}",
        "controller": f"{type(controller).__name__} {by}",
        "wind": wind,
        "seeds": f"{seeds.start} to {seeds.stop - 1}",
        **conditions.to_dict(),
        "towline": __version__,
        "numpy": np.__version__,
    }


def _named(wind: Wind) -> str:
    """Return what identifies a wind, readable if it is not a function of a user."""
    known = f"{wind} " if isinstance(wind, ConstantWind) else ""
    return known + identity(wind)
