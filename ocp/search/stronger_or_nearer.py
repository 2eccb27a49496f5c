"""What else would make a fixed motion feasible: a nearer end, a lighter platform, or stronger cables."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.text import quantity
from ...models import Robot
from ...solvers import solve_batch
from ..audits.audit import Audit
from ..plan import Plan
from ..result import Relaxed
from ..tasks.lay_out import lay_out
from ..tasks.paths import LinePath
from ..tasks.scenario import Scenario
from ..tasks.status import MotionStatus
from ..tasks.wind_set import WindBox
from .relaxations import LONGER, rounded, slower
from .search import Search

INSTANTS = 120  # at which tensions are asked for before a motion is audited
HALVINGS = 10
RESERVES = 1.0, 0.98, 0.9  # of what has tensions at these instants, one after the other until the audit passes
STRONGEST = 100.0  # times t_max: a motion that needs more is not one that stronger cables make feasible


def stronger_or_nearer(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return feasible variations of what a task does not name: where its line ends, the platform's mass, t_max.

    Each is one change; if speeds or accelerations are exceeded too, it may need a longer duration beside. The list is
    empty if the motion exceeds other limits, or for tasks in phases, boxes of winds and uncertain robots.
    """
    task = scenario.task
    if task.phases is not None or isinstance(task.wind, WindBox) or task.robust is not None or scenario.count:
        return []
    others = [excess for excess in audit.excess if excess.limit != "tensions"]
    factors = [slower(excess) for excess in others]
    if min(factors, default=2.0) <= 1.0 or (others and not scenario.stretches):
        return []
    found = list[Relaxed]()
    for make in (_nearer_end, _lighter_platform, _stronger_cables):
        its = make(search, scenario)
        if not its and others:
            seconds = rounded(LONGER * max(factors) * scenario.duration, up=True)
            longer = lay_out(scenario.robot, task.model_copy(update={"duration": seconds}))
            with_it = f", with a duration of {quantity(seconds, 's')}"
            its = [replace(each, detail=each.detail + with_it) for each in make(search, longer)]
        found += its
    return found


def _nearer_end(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the farthest end of a straight line, as far from its start, up to which it is feasible."""
    path = scenario.task.path
    if not isinstance(path, LinePath):
        return []
    start, way = np.array(path.start), np.array(path.end) - np.array(path.start)

    def to(share: float) -> Scenario:
        nearer = path.model_copy(update={"end": tuple((start + share * way).tolist())})
        return lay_out(scenario.robot, scenario.task.model_copy(update={"path": nearer}))

    def offer(share: float) -> tuple[float, str]:
        end = ", ".join(f"{value:.4g}" for value in (start + share * way)[:3])
        return share * float(np.linalg.norm(way[:3])), f"of {quantity(float(np.linalg.norm(way[:3])), 'm')}, to ({end})"

    return _largest(search, to, "length of the line", "m", offer)


def _lighter_platform(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the heaviest platform that is feasible, with the moments of inertia that go with its mass."""
    platform = scenario.robot.platform

    def with_mass(share: float) -> Scenario:
        inertia = None if platform.inertia is None else [share * value for value in platform.inertia]
        return _with_robot(scenario, {"platform": {"mass": share * platform.mass, "inertia": inertia}})

    def offer(share: float) -> tuple[float, str]:
        return share * platform.mass, f"instead of {quantity(platform.mass, 'kg')}"

    return _largest(search, with_mass, "platform.mass", "kg", offer)


def _stronger_cables(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the smallest factor of all t_max that is feasible, as the largest t_max."""
    robot, largest = scenario.robot, float(scenario.robot.t_max.max())

    def with_limits(share: float) -> Scenario:
        factor = 1 + (STRONGEST - 1) * (1 - share) ** 4  # fine steps near one
        return _with_robot(scenario, {"cables": [{"t_max": factor * high} for high in robot.t_max]})

    def offer(share: float) -> tuple[float, str]:
        factor = 1 + (STRONGEST - 1) * (1 - share) ** 4
        return factor * largest, f"instead of {quantity(largest, 'N')}" + (
            "" if np.ptp(robot.t_max) == 0 else ", and others alike"
        )

    return _largest(search, with_limits, "cables.t_max", "N", offer, up=True)


def _with_robot(scenario: Scenario, changes: dict[str, Any]) -> Scenario:
    """Return the scenario with other numbers of its robot, by the structure of its file."""
    data = scenario.robot.model_dump()
    data["platform"] |= {name: value for name, value in changes.get("platform", {}).items() if value is not None}
    for cable, change in zip(data["cables"], changes.get("cables", []), strict=False):
        cable |= change
    return lay_out(Robot.model_validate(data), scenario.task)


def _largest(
    search: Search,
    make: Callable[[float], Scenario],
    name: str,
    unit: str,
    offer: Callable[[float], tuple[float, str]],
    up: bool = False,
) -> list[Relaxed]:
    """Return the variation with the largest share, from 0 to 1, that passes its audit; nothing if none is found."""
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if _has_tensions(make(middle)) else (low, middle)
    if low == 0.0:
        return []
    for reserve in RESERVES:
        share = reserve * low
        varied = make(share)
        audit = search.audit_motion(varied, None, f"audit, other {name}")
        if audit.passed:
            value, detail = offer(share)
            plan = Plan(varied, MotionStatus.FEASIBLE, None, audit, 0.0, 0.0)
            return [Relaxed(name, unit, offer(1.0)[0], rounded(value, up), plan, detail)]
    return []


def _has_tensions(scenario: Scenario) -> bool:
    """Return whether tensions inside their limits exist at some instants of a fixed motion."""
    times = np.linspace(0.0, scenario.duration, INSTANTS)
    platform, carriers = scenario.motion(times, None)
    mask = scenario.robot.dof_mask
    A = scenario.dynamics.wrench_matrix(platform.pose, carriers.pose) * mask[:, None]
    w = scenario.required_wrench(times, platform, carriers, scenario.wind) * mask
    low, high = scenario.bounds_at(times)
    return bool((solve_batch(A, w, low, high, length=scenario.robot.length).code == 0).all())
