"""Many runs with one reference, each with its own seed: `fly_block`, and their dataset, `flights`."""

from __future__ import annotations

import copy
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError
from ..base.inputs import check_ending, file_path
from ..base.netcdf import Contents, Variable, save_netcdf
from ..base.text import counted, quantity
from ..control import ANSWERS, Controller
from ..figures.report import Report, Section
from ..models.motion_file import over
from ..models.parsing import parse_yaml, to_yaml
from ..models.robot import Robot
from ..plant import Plant
from .data import TENSION_TOLERANCE
from .experiment import Experiment
from .flying import fly
from .room import LEAST
from .run_statistics import PARTS, Extremes

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
