"""Many runs with one reference, each with its own seed: `fly_block`, their statistics, and their dataset, `flights`."""

from __future__ import annotations

import copy
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.inputs import InputError, check_ending, file_path
from ..base.netcdf import Contents, Variable, save_netcdf
from ..base.text import counted, quantity
from ..control import ANSWERS, Controller
from ..control.controller import PLANNED
from ..figures.report import Report, Section
from ..models.motion_file import over
from ..models.parsing import parse_yaml, to_yaml
from ..models.robot import Robot
from ..plant import Plant
from .conditions import Experiment
from .data import LEAST, TENSION_TOLERANCE, Period, room_of
from .flying import fly

if TYPE_CHECKING:
    import xarray as xr

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
ROUNDING = 1e-9  # of the duration
FAILED = {
    "error": "position error",
    "tension": "tension",
    "slack": "slack",
    "room": "leaving the room",
    "diverged": "divergence",
}
# The statistics of a run: its number of periods, errors [m], tensions [N] of cables that are not cut, their excess over
# t_max relative to the cable's range, how far the platform was out of its room [m], the number of periods that begin
# with a slack cable whose t_min is above zero, the number of periods with each status, and of each part of the time the
# largest error [m], smallest tension and largest tension [N]: nan in parts that it does not have.
PARTS = 100  # of the time
FIGURES = np.dtype(
    [
        ("lasted", "<i8"),
        *((name, "<f8") for name in ("error_rms", "error_max", "tension_min", "tension_max", "exceeded", "outside")),
        ("slack", "<i8"),
        ("answered", "<i8", (len(ANSWERS),)),
        ("over_time", "<f4", (PARTS, 3)),
    ]
)


def copies(controller: Controller, count: int) -> list[Controller]:
    """Return a controller for each of `count` runs, or the given one if it accepts batches.

    Raises `InputError` if it cannot be copied.
    """
    if controller.batches:
        return [controller]
    try:
        return [copy.deepcopy(controller) for _ in range(count)]
    except Exception as error:  # a user's object, and whatever it raises
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(
            f"controller must be copyable for many runs, got {type(controller).__name__} "
            f"({reason}): simulate one run at a time, open such handles in reset, or give it __deepcopy__"
        ) from None


def plant_of(plant: Plant, conditions: Experiment, seed: int) -> Plant:
    """Return the plant of a run, whose robot may differ from its file."""
    robot = conditions.mismatch.robot(plant.robot, seed)
    return plant if robot is plant.robot else Plant(robot, drive=plant.drive)


def fly_block(plant: Plant, controller: Controller, conditions: Experiment, seeds: Sequence[int]) -> np.ndarray:
    """Simulate a block of runs in parallel, and return the statistics of each, (N,) of `FIGURES`."""
    if conditions.mismatch.varies and len(seeds) > 1:
        return np.concatenate([fly_block(plant, controller, conditions, [seed]) for seed in seeds])
    kept, plant = Extremes(conditions, plant.robot, len(seeds)), plant_of(plant, conditions, seeds[0])
    lasted, _ = fly(plant, copies(controller, len(seeds)), conditions, seeds, kept.take)
    return kept.figures(lasted)


def passed(of: np.ndarray, periods: int, tolerance: float) -> np.ndarray:
    """Return which runs passed, (N,), from their statistics: all conditions of `SimulationData.failures` hold."""
    lasted_near = (of["lasted"] == periods) & (of["error_max"] <= tolerance) & (of["outside"] <= LEAST)
    return lasted_near & (of["exceeded"] <= TENSION_TOLERANCE) & (of["slack"] == 0)


def flights(robot: Robot, conditions: Experiment, seeds: Sequence[int], tolerance: float, of: np.ndarray) -> xr.Dataset:
    """Return the statistics of all runs, (N,) of `FIGURES`, as a dataset indexed by their seeds."""
    periods, period = len(conditions.references), conditions.period
    variables = {
        "passed": Variable(
            ("seed",), passed(of, periods, tolerance), {"long_name": "error, tensions, slack and room hold"}
        ),
        "duration": over(("seed",), of["lasted"] * period, "s", "simulated time"),
        "error_rms": over(("seed",), of["error_rms"], "m", "rms position error"),
        "error_max": over(("seed",), of["error_max"], "m", "largest position error"),
        "tension_min": over(("seed",), of["tension_min"], "N", "smallest tension"),
        "tension_max": over(("seed",), of["tension_max"], "N", "largest tension"),
        "tension_excess": over(("seed",), of["exceeded"], "1", "largest excess over t_max, relative to t_max - t_min"),
        "outside": over(("seed",), of["outside"], "m", "largest distance out of the room or below the floor"),
        "slack_s": over(("seed",), of["slack"] * period, "s", "time with a slack cable whose t_min is above zero"),
        "answered": Variable(
            ("seed", "answer"), of["answered"], {"long_name": "number of control steps with each status"}
        ),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of parts of the time that no run has reached
        quantiles = np.nanquantile(of["over_time"].astype(float), QUANTILES, axis=0)
    for k, (name, unit, about) in enumerate(
        (("error", "m", "largest position error"), ("tension_min", "N", "smallest tension"),
         ("tension_max", "N", "largest tension"))
    ):  # fmt: skip
        about = f"quantiles over the runs of the {about} in each part of the time"
        variables[f"{name}_quantiles"] = over(("quantile", "time"), quantiles[..., k], unit, about)
    coordinates = {
        "seed": Variable(("seed",), np.array(seeds)),
        "answer": Variable(("answer",), np.array(ANSWERS)),
        "quantile": Variable(("quantile",), np.array(QUANTILES)),
        "time": over(("time",), (np.arange(PARTS) + 0.5) / PARTS * periods * period, "s", "middle of the part"),
    }
    attributes: dict[str, Any] = {"title": f"towline simulations of {robot.name}", "robot": to_yaml(robot)}
    attributes |= {"tolerance_m": tolerance, "duration_s": periods * period}
    if conditions.doubt:
        attributes["reference"] = conditions.doubt
    return Contents(variables, coordinates, attributes).dataset()


def summary(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the output of `towline simulate --runs N --json`, ready for JSON."""
    from ..workspace.volume import share_interval  # of 95 %; its package takes longer to load than a short run

    worst, passes, count = dataset["error_max"].values, dataset["passed"].values, int(dataset.sizes["seed"])
    independent = 1 if _all_same(dataset) else count
    likely = dict(zip(("low", "high"), share_interval(int(passes[:independent].sum()), independent), strict=True))
    return {
        "runs": count,
        "passed": int(passes.sum()),
        "share_passed": {"share": float(passes.mean()), **likely},
        "failed": _failed(dataset),
        "error_max": {
            "median": float(np.median(worst)),
            "p95": float(np.percentile(worst, 95)),
            "worst": float(worst.max()),
        },
        "worst_seed": int(dataset["seed"].values[int(np.where(passes & ~passes.all(), -1.0, worst).argmax())]),
        "worst_cause": dataset.attrs.get("worst"),
    }


def _all_same(dataset: xr.Dataset) -> bool:
    """Return whether all runs are the same run, as they are where nothing is random."""
    return not np.ptp(dataset["error_rms"].values)


def _failed(dataset: xr.Dataset) -> dict[str, int]:
    """Return how many runs failed by each condition; a run may fail by several."""
    ended = dataset["duration"].values >= (1 - ROUNDING) * float(dataset.attrs["duration_s"])
    holds = {
        "error": dataset["error_max"].values <= float(dataset.attrs["tolerance_m"]),
        "tension": dataset["tension_excess"].values <= TENSION_TOLERANCE,
        "slack": dataset["slack_s"].values == 0,
        "room": dataset["outside"].values <= LEAST,
        "diverged": ended,
    }
    return {name: int((~rows).sum()) for name, rows in holds.items()}


def report(dataset: xr.Dataset) -> Report:
    """Return the report of many runs: how many passed, then the details."""
    short = summary(dataset)
    name = parse_yaml(dataset.attrs["robot"], Robot, "robot").name
    longest = quantity(float(dataset["duration"].values.max()), "s")
    counts = dataset["answered"].values.sum(axis=0)
    largest, slack = short["error_max"], dataset["slack_s"].values
    doubt = dataset.attrs.get("reference")
    likely, failed = short["share_passed"], {FAILED[name]: n for name, n in short["failed"].items() if n}
    rows = {"reference": doubt} if doubt else {}
    if short["runs"] > 1 and _all_same(dataset):
        rows["runs"] = "identical, because nothing is random (see --gusts, --noise and --mismatch); treated as one run"
    rows["probability of a pass"] = f"{100 * likely['low']:.3g} to {100 * likely['high']:.3g} % (95 % confidence)"
    if failed:
        rows["failed"] = ", ".join(f"{quantity(n)} by {name}" for name, n in failed.items())
    rows["worst run"] = f"seed {short['worst_seed']}" + (f": {cause}" if (cause := short["worst_cause"]) else "")
    rows |= {
        "largest error": f"median {quantity(1e3 * largest['median'], 'mm')}, 95 % below "
        f"{quantity(1e3 * largest['p95'], 'mm')}, worst {quantity(1e3 * largest['worst'], 'mm')}",
        "tolerance": quantity(1e3 * float(dataset.attrs["tolerance_m"]), "mm"),
        "tensions": f"{quantity(float(dataset['tension_min'].values.min()), 'N')} to "
        f"{quantity(float(dataset['tension_max'].values.max()), 'N')}",
        "slack": f"in {counted((slack > 0).sum(), 'run')}, up to {quantity(float(slack.max()), 's')}"
        if slack.any()
        else "none",
        "controller status": ", ".join(
            f"{quantity(int(count))} {answer}" for answer, count in zip(ANSWERS, counts, strict=True) if count
        ),
    }
    return Report(
        about=f"{name}, {counted(short['runs'], 'run')} of {longest}",
        status="passed" if short["passed"] == short["runs"] else "failed",
        summary=f"{short['passed']} passed",
        parts=[Section("", list(rows.items()))],
    )


def save(dataset: xr.Dataset, file: str | os.PathLike[str]) -> Path:
    """Save the statistics of many runs as NetCDF atomically; the same seeds give the same bytes.

    Raises `InputError` if the file cannot be written.
    """
    return save_netcdf(Contents.of(dataset), check_ending("file", file_path("file", file), ".nc"))


class Extremes:
    """Accumulate per-run statistics. Each period takes a few operations on whole arrays."""

    def __init__(self, conditions: Experiment, robot: Robot, flights: int):
        self._references, self._t_max, self._range = conditions.references, robot.t_max, robot.t_max - robot.t_min
        periods = np.arange(len(conditions.references))
        self._taut = (robot.t_min > 0) & ~conditions.cut(robot.m, periods)  # where a slack cable is a failure
        self._cut = conditions.cut(robot.m, periods + 1)  # also inside the period
        self._kept: np.ndarray | None = None  # cables that are not released, (N, m); None: all
        self._rows = np.arange(flights)
        self._squares, self._largest = np.zeros(flights), np.zeros(flights)  # of the errors: sum, and largest
        self._slack, self._answers = np.zeros(flights, dtype=int), np.zeros((flights, len(ANSWERS)), dtype=int)
        # Squared error, negative tension and tension, of which the largest count.
        self._over_time = np.full((flights, PARTS, 3), np.nan, dtype="f4")
        room = room_of(robot)
        self._room, self._outside = room if room and room.is_known else None, np.zeros(flights)
        self._least, self._most = np.full(flights, np.inf), np.full((flights, robot.m), -np.inf)

    def take(self, period: Period) -> None:
        """Keep a period."""
        alive, command = period.alive, period.command
        rows = slice(None) if alive.all() else np.flatnonzero(alive)
        tensions = period.tensions[rows]
        off = period.motions[rows, 0, :3] - self._references[period.number].pose[:3]
        off *= off
        square = off[:, 0] + off[:, 1] + off[:, 2]
        self._squares[rows] += square
        self._largest[rows] = np.maximum(self._largest[rows], square)
        if self._room is not None:
            beyond = self._room.beyond(period.motions[rows, 0, :6]).max(axis=1)
            self._outside[rows] = np.fmax(self._outside[rows], beyond)
        cut, taut = self._cut[period.number], self._taut[period.number]
        whole = ~cut if cut.any() else True  # a mask takes longer
        if command.released is not None:
            kept = ~np.broadcast_to(np.asarray(command.released, dtype=bool), period.tensions.shape)
            self._kept = kept if self._kept is None else self._kept & kept
        if self._kept is not None:
            whole, taut = whole & self._kept[rows], taut & self._kept[rows]
        self._most[rows] = np.maximum(self._most[rows], tensions, where=whole, out=self._most[rows])
        least = tensions.min(axis=1, where=whole, initial=np.inf)
        most = tensions.max(axis=1, where=whole, initial=-np.inf)
        self._least[rows] = np.minimum(self._least[rows], least)
        part = period.number * PARTS // len(self._references)
        for k, each in enumerate((square, -least, most)):
            self._over_time[rows, part, k] = np.fmax(self._over_time[rows, part, k], each)
        if not tensions.min() > 0:
            self._slack[rows] += ((tensions <= 0) & taut).any(axis=1)
        answered = np.atleast_1d(command.answered)[rows]
        if answered.any():
            self._answers[self._rows[rows], answered] += 1
        else:
            self._answers[rows, PLANNED] += 1

    def figures(self, lasted: np.ndarray) -> np.ndarray:
        """Return the statistics of runs of `lasted` periods each, (N,) of `FIGURES`; no tensions are 0 N."""
        result = np.zeros(len(lasted), dtype=FIGURES)
        result["lasted"], result["slack"], result["answered"] = lasted, self._slack, self._answers
        result["error_rms"] = np.sqrt(self._squares / np.maximum(lasted, 1))
        result["error_max"], result["outside"] = np.sqrt(self._largest), self._outside
        for name, each in (("tension_min", self._least), ("tension_max", self._most.max(axis=1))):
            result[name] = np.where(np.isinf(each), 0.0, each)
        # With fewer periods than parts, some parts have none and keep the values before.
        filled = np.unique(np.arange(len(self._references)) * PARTS // len(self._references))
        over_time = self._over_time[:, filled[np.searchsorted(filled, np.arange(PARTS), side="right") - 1]]
        over_time[..., 0], over_time[..., 1] = np.sqrt(over_time[..., 0]), -over_time[..., 1]
        result["over_time"] = np.where(np.isinf(over_time), np.nan, over_time)
        result["exceeded"] = np.maximum(((self._most - self._t_max) / self._range).max(axis=1), 0.0)
        return result
