"""Many runs with one reference, each with its own seed: `fly_block`, and their dataset, `flights`."""

from __future__ import annotations

import copy
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError
from ..base.inputs import check_ending, file_path
from ..base.netcdf import Contents, Variable, save_netcdf
from ..base.text import quantity
from ..control import ANSWERS, Controller
from ..figures.report import Report, Section
from ..models.motion_file import over
from ..models.parsing import parse_yaml, to_yaml
from ..models.robot import Robot
from ..plant import Plant
from .data import TENSION_TOLERANCE
from .experiment import Experiment
from .flying import fly
from .run_statistics import Extremes

if TYPE_CHECKING:
    import xarray as xr


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


def fly_block(plant: Plant, controller: Controller, conditions: Experiment, seeds: Sequence[int]) -> np.ndarray:
    """Simulate a block of runs in parallel, and return the statistics of each, (N,) of `FIGURES`."""
    kept = Extremes(conditions, plant.robot, len(seeds))
    lasted, _ = fly(plant, copies(controller, len(seeds)), conditions, seeds, kept.take)
    return kept.figures(lasted)


def passed(of: np.ndarray, periods: int, tolerance: float) -> np.ndarray:
    """Return which runs passed, (N,), from their statistics: complete, near the reference, with tensions in range."""
    lasted_near = (of["lasted"] == periods) & (of["error_max"] <= tolerance)
    return lasted_near & (of["exceeded"] <= TENSION_TOLERANCE) & (of["slack"] == 0)


def flights(robot: Robot, conditions: Experiment, seeds: Sequence[int], tolerance: float, of: np.ndarray) -> xr.Dataset:
    """Return the statistics of all runs, (N,) of `FIGURES`, as a dataset indexed by their seeds."""
    periods, period = len(conditions.references), conditions.period
    variables = {
        "passed": Variable(("seed",), passed(of, periods, tolerance), {"long_name": "error, tensions and slack hold"}),
        "duration": over(("seed",), of["lasted"] * period, "s", "simulated time"),
        "error_rms": over(("seed",), of["error_rms"], "m", "rms position error"),
        "error_max": over(("seed",), of["error_max"], "m", "largest position error"),
        "tension_min": over(("seed",), of["tension_min"], "N", "smallest tension"),
        "tension_max": over(("seed",), of["tension_max"], "N", "largest tension"),
        "slack_s": over(("seed",), of["slack"] * period, "s", "time with a slack cable whose t_min is above zero"),
        "answered": Variable(
            ("seed", "answer"), of["answered"], {"long_name": "number of control steps with each status"}
        ),
    }
    coordinates = {"seed": Variable(("seed",), np.array(seeds)), "answer": Variable(("answer",), np.array(ANSWERS))}
    attributes = {"title": f"towline simulations of {robot.name}", "robot": to_yaml(robot), "tolerance_m": tolerance}
    if conditions.doubt:
        attributes["reference"] = conditions.doubt
    return Contents(variables, coordinates, attributes).dataset()


def summary(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the output of `towline simulate --runs N --json`, ready for JSON."""
    worst = dataset["error_max"].values
    return {
        "runs": int(dataset.sizes["seed"]),
        "passed": int(dataset["passed"].values.sum()),
        "error_max": {
            "median": float(np.median(worst)),
            "p95": float(np.percentile(worst, 95)),
            "worst": float(worst.max()),
        },
        "worst_seed": int(dataset["seed"].values[int(worst.argmax())]),
    }


def report(dataset: xr.Dataset) -> Report:
    """Return the report of many runs: how many passed, then the details."""
    short = summary(dataset)
    name = parse_yaml(dataset.attrs["robot"], Robot, "robot").name
    longest = quantity(float(dataset["duration"].values.max()), "s")
    counts = dataset["answered"].values.sum(axis=0)
    largest, slack = short["error_max"], dataset["slack_s"].values
    doubt = dataset.attrs.get("reference")
    rows = ({"reference": doubt} if doubt else {}) | {
        "largest error": f"median {quantity(1e3 * largest['median'], 'mm')}, 95 % below "
        f"{quantity(1e3 * largest['p95'], 'mm')}, worst {quantity(1e3 * largest['worst'], 'mm')} "
        f"(seed {short['worst_seed']})",
        "tolerance": quantity(1e3 * float(dataset.attrs["tolerance_m"]), "mm"),
        "tensions": f"{quantity(float(dataset['tension_min'].values.min()), 'N')} to "
        f"{quantity(float(dataset['tension_max'].values.max()), 'N')}",
        "slack": f"in {int((slack > 0).sum())} runs, up to {quantity(float(slack.max()), 's')}"
        if slack.any()
        else "none",
        "controller status": ", ".join(
            f"{quantity(int(count))} {answer}" for answer, count in zip(ANSWERS, counts, strict=True) if count
        ),
    }
    return Report(
        about=f"{name}, {short['runs']} runs of {longest}",
        status="passed" if short["passed"] == short["runs"] else "failed",
        summary=f"{short['passed']} passed",
        parts=[Section("", list(rows.items()))],
    )


def save(dataset: xr.Dataset, file: str | os.PathLike[str]) -> Path:
    """Save the statistics of many runs as NetCDF atomically; the same seeds give the same bytes.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    return save_netcdf(Contents.of(dataset), check_ending("file", file_path("file", file), ".nc"))
