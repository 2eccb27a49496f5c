"""A plan over time as a dataset: the motion in {G} and the audited tensions, with units."""

from __future__ import annotations

import json

import numpy as np

from ...models.parsing import to_yaml
from ...models.robot import COORDINATES
from ...netcdf import Contents, Variable
from .finding import Finding

__all__ = ["output_rows", "trajectory"]


def trajectory(found: Finding) -> Contents:
    """Return the motion and the audited tensions at the task's output rate.

    Dimensions: time, coordinate, carrier, cable.
    """
    robot, task = found.scenario.robot, found.scenario.task
    rows = output_rows(found)
    seen = found.audit

    def over(dims: tuple[str, ...], values: np.ndarray, unit: str, about: str) -> Variable:
        return Variable(dims, values, {"units": unit, "long_name": about})

    body, base = ("time", "coordinate"), ("time", "carrier", "coordinate")
    names = {"pose": "m, rad", "velocity": "m/s, rad/s", "acceleration": "m/s^2, rad/s^2"}
    variables = {}
    for name, part, carrier_part in zip(names, seen.motion, seen.carriers, strict=True):
        variables[name] = over(body, part[rows], names[name], f"{name} of the platform frame in G")
        variables[f"carrier_{name}"] = over(base, carrier_part[rows], names[name], f"{name} of each carrier in G")
    variables["tensions"] = over(("time", "cable"), seen.tensions[rows], "N", "cable tensions")
    lengths = found.scenario.dynamics.cable_lengths(seen.motion.pose[rows], seen.carriers.pose[rows])
    variables["cable_lengths"] = over(("time", "cable"), lengths, "m", "from anchor to attachment")
    about = "tensions of least norm without limits; negative: to push"
    variables["tensions_unlimited"] = over(("time", "cable"), seen.tensions_unlimited[rows], "N", about)
    variables["violation"] = over(("time",), seen.violation[rows], "N", "missing wrench, moments over length")
    variables["tracking_error"] = over(("time",), seen.tracking_error[rows], "m", "distance from the path")
    variables["t_min"] = over(("cable",), robot.t_min, "N", "smallest tension allowed")
    variables["t_max"] = over(("cable",), robot.t_max, "N", "largest tension allowed")
    attributes = {
        "title": f"towline plan of {robot.name}: {task.name}",
        "status": found.status.value,
        "robot": to_yaml(robot),
        "task": to_yaml(task),
        "report": json.dumps(found.summary()),
    }
    coordinates = {
        "time": Variable(("time",), seen.times[rows], {"units": "s"}),
        "coordinate": Variable(("coordinate",), np.array(COORDINATES)),
        "carrier": Variable(("carrier",), np.array([carrier.name for carrier in robot.carriers])),
        "carrier_kind": Variable(("carrier",), np.array([carrier.kind for carrier in robot.carriers])),
        "cable": Variable(("cable",), np.arange(1, robot.m + 1)),
    }
    return Contents(variables, coordinates, attributes)


def output_rows(found: Finding) -> np.ndarray:
    """Rows of the audit that are saved: at equal times, and each of them audited."""
    return np.arange(0, len(found.audit.times), (len(found.audit.times) - 1) // found.scenario.output_samples)
