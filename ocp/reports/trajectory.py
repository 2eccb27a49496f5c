"""`trajectory`: the motion of a plan as a dataset; `drawings`: all its figures by name."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.netcdf import Contents, Variable
from ...figures import plan as plan_figures
from ...figures.drawing import Drawing
from ...figures.limits import Limited, limits
from ...figures.plan import convergence, phase_plane
from ...figures.scene import outline_variables
from ...figures.views import views
from ...models.motion_file import dimensions, motion_variables, over
from ...models.motion_jumps import SAME, with_jumps
from ...models.parsing import to_yaml
from ...statics.scene import scene
from ..audits.instants import instants
from ..audits.peaks import BESIDE, law_jumps
from ..result import PlanData
from ..tasks.task_limits import AnyKeepOut, Block, ConvexMesh, Sphere
from ..tasks.wind_set import WindBox, WindDisc

if TYPE_CHECKING:
    import xarray as xr

ROUND = np.linspace(0.0, 2 * np.pi, 41)
INSTANTS = 60  # along the carriers' paths in the views


def trajectory(plan: PlanData) -> Contents:
    """Return the motion and the audited tensions at the task's output rate.

    Dimensions: time, coordinate, carrier, cable; of a task in phases also phase; of a time law also jump.
    """
    robot, task = plan.scenario.robot, plan.scenario.task
    rows = output_rows(plan)
    audit = plan.audit
    variables = motion_variables((part[rows] for part in audit.motion), (part[rows] for part in audit.carriers))
    variables["tensions"] = over(("time", "cable"), audit.tensions[rows], "N", "cable tensions")
    lengths = plan.scenario.dynamics.cable_lengths(audit.motion.pose[rows], audit.carriers.pose[rows])
    variables["cable_lengths"] = over(("time", "cable"), lengths, "m", "from anchor to attachment")
    about = "tensions of least norm without limits; negative: the cable would push"
    variables["tensions_unlimited"] = over(("time", "cable"), audit.tensions_unlimited[rows], "N", about)
    variables["violation"] = over(
        ("time",), audit.violation[rows], "N", "shortfall of the wrench, moments divided by the length"
    )
    variables["tracking_error"] = over(("time",), audit.tracking_error[rows], "m", "distance from the path")
    variables["t_min"] = over(("cable",), robot.t_min, "N", "smallest tension allowed")
    variables["t_max"] = over(("cable",), robot.t_max, "N", "largest tension allowed")
    variables |= outline_variables([outline(place) for place in task.limits.keep_out if place.frame == "world"])
    coordinates = {}
    if phases := plan.phases:
        total = np.zeros(len(rows)) if audit.supports is None else audit.supports[rows].sum(axis=1)
        variables["ground_reaction"] = over(("time",), total, "N", "sum of the forces of the ground")
        for name, unit, about in (("start", "s", "start"), ("end", "s", "end"), ("load", "kg", "mass of the load")):
            values = np.array([getattr(phase, name) for phase in phases])
            variables[f"phase_{name}"] = over(("phase",), values, unit, f"{about} of each phase")
        coordinates["phase"] = Variable(("phase",), np.array([phase.name for phase in phases]))
    attributes: dict[str, Any] = {
        "title": f"{robot.name}, {task.name}: {plan.status.value}",
        "status": plan.status.value,
        "robot": to_yaml(robot),
        "task": to_yaml(task.in_file()),
        "report": json.dumps(plan.to_dict()),
    }
    if plan.law is not None and not plan.feasible:
        attributes["no_reference"] = "one of time_along without a feasible time law"
    if task.wind is not None and not isinstance(task.wind, WindBox | WindDisc):
        attributes["wind"] = np.array(task.wind)  # [m/s] in G
    coordinates |= dimensions(robot, audit.times[rows])
    return with_jumps(Contents(variables, coordinates, attributes), _at_jumps(plan))


def _at_jumps(plan: PlanData) -> dict[str, Variable]:
    """Return time, motion and tensions just before and after each jump of accelerations or loads, (2 k, ...) each."""
    scenario = plan.scenario
    times = np.unique(np.concatenate([law_jumps(scenario), scenario.phases.jumps]))
    beside = BESIDE * scenario.duration
    times = np.repeat(times[(times > beside + SAME) & (times < scenario.duration - beside - SAME)], 2)
    if not times.size:
        return {}
    sides = times + beside * np.resize([-1, 1], len(times))
    seen, (platform, carriers) = instants(scenario, plan.deviation, sides), scenario.motion(times, plan.deviation)
    variables = motion_variables(
        platform._replace(acceleration=seen.motion.acceleration),
        carriers._replace(acceleration=seen.carriers.acceleration),
    )
    variables["tensions"] = over(("time", "cable"), seen.tensions, "N", "cable tensions")
    variables["time"] = over(("time",), times, "s", "each jump twice: just before it and just after")
    return variables


def output_rows(plan: PlanData) -> np.ndarray:
    """Return the rows of the audit that are saved, equally spaced in time."""
    return np.arange(0, len(plan.audit.times), (len(plan.audit.times) - 1) // plan.scenario.output_samples)


def outline(place: AnyKeepOut) -> list[np.ndarray]:
    """Return lines (n, 3) in {G} [m] along the surface of a keep-out region."""
    if isinstance(place, Block | ConvexMesh):
        return list(place.body.edges)
    if isinstance(place, Sphere):
        centre = np.array(place.centre)
        return [centre + ring for ring in _rings(place.radius, np.eye(3))]
    start, end = np.array(place.start), np.array(place.end)
    # The axis first: the rings across it sit at the ends, and straight lines join them.
    _, _, axes = np.linalg.svd(np.array([end - start]))
    rings = [at + ring for at in (start, end) for ring in _rings(place.radius, axes)]
    sides = [place.radius * sign * axis for axis in axes[1:] for sign in (1, -1)]
    return rings + [np.stack([start + side, end + side]) for side in sides]


def _rings(radius: float, axes: np.ndarray) -> list[np.ndarray]:
    """Return three circles about the origin, one across each axis of (3, 3)."""
    pairs = ((axes[1], axes[2]), (axes[2], axes[0]), (axes[0], axes[1]))
    return [radius * (np.cos(ROUND)[:, None] * u + np.sin(ROUND)[:, None] * v) for u, v in pairs]


def drawings(plan: PlanData, trajectory: xr.Dataset) -> dict[str, Drawing]:
    """Return the figures by the names of their files, without suffix; a figure without content is left out."""
    times = np.linspace(0.0, plan.scenario.duration, INSTANTS)
    drawn = {
        "views": Drawing("Path, with the robot at both ends", views(scene(plan.scenario.robot, trajectory, times))),
        "tensions": Drawing("Tensions against their limits", plan_figures.tensions(trajectory)),
    }
    if plan.law is not None and plan.law.exists:
        active = [(each.start, each.end, each.limit) for each in plan.law.bottlenecks]
        drawn["law"] = Drawing(
            "The fastest time law and its active limits", phase_plane(plan.law.s, plan.law.sd, active)
        )
    if trajectory["carrier_moves"].any():
        drawn["path"] = Drawing("Path of the platform and positions of the carriers", plan_figures.path(trajectory))
        drawn["base"] = Drawing("Carriers relative to the platform", plan_figures.base_offset(trajectory))
    rows = output_rows(plan)
    quantities = limited(plan, rows)
    if any(each.used() is not None for each in quantities):
        drawn["limits"] = Drawing("Other limits", limits(plan.audit.times[rows], quantities))
    if plan.iterates:
        drawn["convergence"] = Drawing("Convergence of the solver", convergence(plan.iterates))
    return drawn


def limited(plan: PlanData, rows: np.ndarray) -> list[Limited]:
    """Return the limits of task, robot and carriers at the audit's `rows`, limits of one name and bound together."""
    gathered: dict[tuple[str, str, float, float], tuple[list[str], list[np.ndarray]]] = {}
    shown = [limit for limit in plan.scenario.limits if limit.shown]
    for limit, values in zip(shown, plan.audit.limiting(rows, shown), strict=True):
        labels, curves = gathered.setdefault((limit.title, limit.unit, limit.low, limit.high), ([], []))
        labels += limit.labels
        curves.append(values)
    return [
        Limited(name, unit, labels, np.hstack(curves), low, high)
        for (name, unit, low, high), (labels, curves) in gathered.items()
    ]
