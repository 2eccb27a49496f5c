"""Search for feasible tasks near an infeasible one, by another duration or looser limits, and audit each."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..models.parsing import validate
from ..text import quantity
from .audits.audit import Audit
from .audits.excess import Excess
from .durations import Durations
from .result import Plan, Relaxed
from .search import Search
from .status import MotionStatus
from .tasks.deviation import Deviation
from .tasks.lay_out import lay_out
from .tasks.scenario import Scenario
from .tasks.task import Task

__all__ = ["other_duration", "other_limits"]

LONGER = 1.002  # than the shortest duration: between the places that were checked slightly more can be needed
LONGEST = 100.0  # times the requested duration: a longer one does not help
TRIES = 3  # of a duration: not all that is exceeded falls as speeds and accelerations do
DIGITS = 4  # of what is offered: reports print no more
HALVINGS = 12  # of a margin


class Change(NamedTuple):
    """A field of a task, and another value for it."""

    name: str
    unit: str
    requested: float
    possible: float


def other_duration(search: Search, scenario: Scenario, left: Durations | None, audit: Audit) -> list[Relaxed]:
    """Return the nearest duration at which a scenario's fixed motion is possible, if one is known.

    Speeds fall with the duration, accelerations with its square; `left` are the durations that the tensions allow.
    """
    if left is not None and not left.exist:
        return []
    if not all(path.stretches for path in (scenario.path, *scenario.carrier_paths.values())):
        return []
    missing = audit.violation.max() > audit.tolerance
    if left is None and missing:
        return []
    requested = near = lasts = scenario.duration
    if left is not None:
        near = min(max(near, LONGER * left.shortest), left.longest / LONGER)
    for _ in range(TRIES):
        factor = max((_slower(excess) for excess in audit.excess), default=1.0)
        near = max(near, LONGER * factor * lasts) if factor > 1 else near
        if near == lasts:  # no duration changes what is exceeded, and this one is audited
            return []
        lasts = near = _rounded(near, up=near >= requested)
        if (left is not None and not left.shortest <= near <= left.longest) or near > LONGEST * requested:
            return []
        longer = replace(scenario, task=scenario.task.model_copy(update={"duration": near}), duration=near)
        audit = search.audit_motion(longer, None, f"audit, duration {quantity(near, 's')}")
        if audit.passed:
            plan = Plan(longer, MotionStatus.FEASIBLE, None, audit, 0.0, 0.0)
            return [Relaxed("duration", "s", requested, near, plan)]
        if audit.violation.max() > audit.tolerance:
            return []
    return []


def _slower(excess: Excess) -> float:
    """Return the factor of the duration that brings a speed or an acceleration to its bound; 1 for other limits."""
    if not excess.bound or not excess.value / excess.bound > 1:
        return 1.0
    ratio = excess.value / excess.bound
    return ratio**0.5 if excess.unit.endswith("/s^2") else ratio if excess.unit.endswith("/s") else 1.0


def other_limits(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> list[Relaxed]:
    """Return looser bounds for all limits that a motion exceeds; with all of these changes together its audit passes.

    The list is empty if the motion exceeds what a task cannot loosen: tension limits, limits of the robot's file, the
    ends of the motion, the inside of an obstacle.
    """
    given, changes = scenario.task.model_dump(), dict[str, Change]()
    least = scenario.hard_margin
    for _ in range(TRIES):
        for excess in audit.excess:
            change = _loosened(given, excess, scenario)
            if change is None:
                return []
            first = changes.get(change.name, change)
            changes[change.name] = change._replace(requested=first.requested)
        if audit.violation.max() > audit.tolerance:
            if not given["margin"] or not least:
                return []
            given["margin"] = 0.0
        looser, audit = _audited(search, scenario, given, deviation)
        if audit.passed:
            break
    else:
        return []
    if given["margin"] != scenario.task.margin:
        low, high = 0.0, least
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            _, tried = _audited(search, scenario, given | {"margin": middle}, deviation)
            low, high = (middle, high) if tried.passed else (low, middle)
        changes["margin"] = Change("margin", "N", least, _rounded(low, up=False))
        looser, audit = _audited(search, scenario, given | {"margin": changes["margin"].possible}, deviation)
    plan = Plan(looser, MotionStatus.FEASIBLE, deviation, audit, 0.0, 0.0)
    return [Relaxed(*change, plan) for change in changes.values()]


def _rounded(value: float, up: bool) -> float:
    """Return a number of as many digits as reports print, on the side that keeps what it is for."""
    if not value:
        return value
    exponent = int(np.floor(np.log10(abs(value)))) - DIGITS + 1
    digits = (np.ceil if up else np.floor)(value / 10.0**exponent - (1e-9 if up else -1e-9))
    return float(f"{int(digits)}e{exponent}")


def _audited(
    search: Search, scenario: Scenario, given: dict[str, Any], deviation: Deviation | None
) -> tuple[Scenario, Audit]:
    """Return the scenario of a task with other numbers, and the audit of the same motion for it."""
    kept = scenario.task.limits  # limits of one's own, and what makes them soft, only Python holds
    others = {**given["limits"], "soft": kept.without_own().soft}
    task = validate({**given, "limits": others}, Task, "task")
    held = {"own": kept.own, "soft": kept.soft}
    task = task.model_copy(update={"limits": task.limits.model_copy(update=held)})
    looser = replace(lay_out(scenario.robot, task), path=scenario.path, duration=scenario.duration)
    return looser, search.audit_motion(looser, deviation, "audit, looser limits")


def _loosened(given: dict[str, Any], excess: Excess, scenario: Scenario) -> Change | None:
    """Return the change of a task's field that accepts an excess, made in `given`; None if there is no such field."""
    limits, value = given["limits"], excess.value
    above = value > excess.bound
    value = _rounded(value, above)
    name, bound = f"limits.{excess.limit}", limits.get(excess.limit)
    if excess.limit == "tube.position":
        given["tube"]["position"], name = value, excess.limit
    elif excess.limit == "keep_out":
        subject, _, place = excess.about.partition(" outside ")
        about = "platform" if subject == "platform" else "cables" if subject.startswith("cable ") else "carriers"
        names = [each.name for each in scenario.task.limits.keep_out]
        if value < 0 or names.count(place) != 1:
            return None
        limits["keep_out"][names.index(place)][about] = value
        name = f"clearance of {about} from {place}"
    elif isinstance(bound, dict):
        side, name = ("max", f"{name}.max") if above else ("min", f"{name}.min")
        if isinstance(bound[side], float):
            bound[side] = value
        else:
            axis = "xyz".index(excess.about[-1])
            bound[side] = tuple(value if i == axis else old for i, old in enumerate(bound[side]))
            name = f"{name}, {'xyz'[axis]}"
    elif isinstance(bound, float) and value != 0:
        limits[excess.limit] = value = abs(value)
    else:
        return None
    return Change(name, excess.unit, abs(excess.bound) if isinstance(bound, float) else excess.bound, value)
