"""`motion_facts`: duration, path, tracking error, waypoints, speeds and wind of a plan, as its report names them."""

import numpy as np

from ...base.display import Fact
from ...base.text import counted, quantity, quantity_row
from ...models.part import Vector3
from ..result import PlanData
from ..tasks.paths import FeedPath, TimedPath
from ..tasks.task import Task
from ..tasks.wind_set import WindBox, WindDisc

CLOSE = 1e-3  # relative difference of a duration from the shortest allowed
NEARLY_ALL = 0.9  # of the cost of a plan: from here on a minimum of the cost is one of the time
LOADS = "any within their tolerances; the tensions shown are those with the loads as given"


def motion_facts(plan: PlanData) -> list[Fact]:
    """Return the facts of the platform's motion."""
    task, audit = plan.scenario.task, plan.audit
    speed, acceleration = (
        np.linalg.norm(part[:, :3], axis=1).max() for part in (audit.motion.velocity, audit.motion.acceleration)
    )
    kind = counted(len(plan.phases), "phase") if plan.phases else task.path.kind
    path, law = plan.scenario.path, ""
    if isinstance(task.path, TimedPath):
        kind, law = task.path.along.kind, ", with its own time law" if plan.law is None else ""
    if plan.law is not None and plan.feasible:
        law = ", with the fastest time law"
    if isinstance(path, TimedPath) and path is not task.path:
        law = ", with the fastest time law" if path.smoothing is None else ", in a tube about its fastest time law"
    facts = [
        ("duration", quantity(plan.scenario.duration, "s", digits=6) + ("" if law else _chosen(plan))),
        ("path", f"{kind} in {'{G}' if task.path.frame == 'world' else task.path.frame}{law}"),
    ]
    if isinstance(task.path, FeedPath):
        facts.append(("feed", task.path.steadiness()))
        facts += [("ignored words", ", ".join(task.path.ignored))] if task.path.ignored else []
    facts += _accuracy(plan)
    if speed > 0:
        moves = f"up to {quantity(speed, 'm/s')} and {quantity(acceleration, 'm/s^2')}"
    else:
        moves = "turns about the origin of its frame" if audit.motion.velocity.any() else "at rest"
    facts.append(("platform", moves))
    if plan.scenario.phases.extremes:
        facts.append(("loads", LOADS))
    if (stop := plan.stop) is not None:
        worst = f"from t = {stop.begins:.3f} s, over {quantity(stop.distance, 'm')}"
        facts.append(("stops", f"in at most {quantity(stop.duration, 's')} ({worst})"))
    if task.wind is not None:
        facts.append(("wind", _task_wind(task)))
    return facts


def _chosen(plan: PlanData) -> str:
    """Return why a duration that the planner chose is not the shortest: time costs nothing, or not all."""
    span, amount, seconds = plan.scenario.duration_range, plan.scenario.task.objective.time, plan.scenario.duration
    if not plan.feasible or span is None or seconds <= span.min * (1 + CLOSE):
        return ""
    if amount is None:
        return ", which has the lowest cost; to make time add to the cost, set `objective: {time: 1}`"
    share = seconds / amount / plan.objective if plan.objective else 1.0
    if not 0 < share < NEARLY_ALL:  # a reward for margin makes the whole less than its parts
        return ""
    its = quantity(100 * share, "%", 2)
    return f", which has the lowest cost, {its} of it due to time; for a shorter duration, lower `objective.time`"


def _accuracy(plan: PlanData) -> list[Fact]:
    """Return the distance from the path, and that from its waypoints, which the path itself may round."""
    audit, from_waypoints = plan.audit, plan.waypoint_distance
    error = millimetres(plan.tracking_error_max)
    worst = f" at most, at t = {audit.times[int(audit.tracking_error.argmax())]:.3f} s" * (not error.startswith("0 "))
    if from_waypoints is None:
        return [("tracking error", f"{error}{worst}")]
    return [("tracking error", f"{error} from the path{worst}"), ("waypoints", from_waypoints.describe())]


def millimetres(metres: float) -> str:
    """Return a length in millimetres; less than a nanometre is rounding."""
    return quantity(0.0 if metres < 1e-9 else metres * 1e3, "mm")


def wind(velocity: Vector3) -> str:
    """Return a velocity of the wind [m/s]."""
    return f"({quantity_row(velocity)}) m/s"


def _task_wind(task: Task) -> str:
    """Return the task's wind, or its set of winds and the wind of the planned tensions."""
    if isinstance(task.wind, WindDisc):
        most = quantity(task.wind.speed, "m/s")
        return f"any horizontal one up to {most}; the tensions shown are those in still air"
    if isinstance(task.wind, WindBox):
        box = task.wind
        return f"any from {wind(box.min)} to {wind(box.max)}; the tensions shown are those in {wind(box.middle)}"
    return "" if task.wind is None else wind(task.wind)
