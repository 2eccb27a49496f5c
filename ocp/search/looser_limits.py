"""Looser limits of a task: those that a motion exceeds, by as much as it exceeds them."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

from ...models.parsing import validate
from ..audits.audit import Audit, other_tensions_may_pass
from ..audits.excess import Excess
from ..limits.bodies import LOAD, PLATFORM
from ..nlp.solver import Outcome
from ..plan import Plan
from ..proofs.infeasible_ends import infeasible_ends
from ..result import Relaxed
from ..tasks.deviation import Deviation
from ..tasks.lay_out import lay_out, with_task
from ..tasks.scenario import Scenario
from ..tasks.status import MotionStatus
from ..tasks.task import Task
from ..tasks.task_limits import TaskLimits
from .largest_share import largest_share
from .other_forces import less_margin
from .other_plans import rounded, solved
from .search import Search

TRIES = 3  # with other limits, the motion may exceed others
HALVINGS = 12  # of a margin
PREFERRED = 1e-3  # of a limit's scale: an excess that costs one, so that other costs hardly matter
BEYOND = 0.05  # of the change of a limit, more than the least, at which almost nothing is left to choose


class Bound(NamedTuple):
    """A field of a task that bounds something, its value, and the looser one that a motion keeps."""

    name: str
    unit: str
    requested: float
    possible: float


def looser_limits(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> list[Relaxed]:
    """Return looser bounds of limits with which a motion is feasible; `audit` is the closest motion's.

    If the planner chooses the motion, or only its tensions matter, the motion that exceeds limits by least counts.
    """
    chosen = scenario.count or other_tensions_may_pass(scenario, audit)
    return (_soft_limits(search) if chosen else []) or _other_limits(search, scenario, deviation, audit)


def _other_limits(
    search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit, beyond: float = 0.0
) -> list[Relaxed]:
    """Return looser bounds for all limits that a motion exceeds; with all of these changes together its audit passes.

    They are looser than the motion needs by `beyond` of their change.
    The list is empty if the motion exceeds what a task cannot loosen: tension limits, limits of the robot's file, the
    ends of the motion, the inside of an obstacle.
    """
    given, changes = scenario.task.model_dump(), dict[str, Bound]()
    least = scenario.hard_margin
    for _ in range(TRIES):
        for excess in audit.excess:
            change = _loosened(given, excess, scenario, beyond)
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
    if given["margin"] != scenario.task.margin and scenario.is_fixed:  # by tensions at few instants
        less = largest_share(search, less_margin(with_task(looser, margin=scenario.task.margin)))
        return [Relaxed(*change, each.plan) for each in less for change in changes.values()] + less
    if given["margin"] != scenario.task.margin:
        low, high = 0.0, least
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            _, tried = _audited(search, scenario, given | {"margin": middle}, deviation)
            low, high = (middle, high) if tried.passed else (low, middle)
        changes["margin"] = Bound("margin", "N", least, rounded(low, up=False))
        looser, audit = _audited(search, scenario, given | {"margin": changes["margin"].possible}, deviation)
    plan = Plan(looser, MotionStatus.FEASIBLE, deviation, audit, 0.0, 0.0)
    return [Relaxed(*change, plan) for change in changes.values()]


def _soft_limits(search: Search) -> list[Relaxed]:
    """Return looser bounds from the motion that exceeds the limits which a task can loosen by least.

    Else it is the motion without these limits; the list is empty if there is none.
    """
    scenario = search.scenario
    limits = scenario.task.limits
    soft = {
        limit.name: PREFERRED * limit.scale
        for limit in scenario.limits
        if limit.soft is None and (limit.name == "keep_out" or getattr(limits, limit.name, None) is not None)
    }
    if scenario.hard_margin:
        soft["margin"] = PREFERRED * scenario.robot.force_scale
    if not soft:
        return []
    softer = limits.model_copy(update={"soft": limits.soft | soft})
    softened = replace(with_task(scenario, limits=softer), path=scenario.path)
    if infeasible_ends(softened) is not None:  # by what is not soft
        return []
    without = _without(search, soft)
    if without is None:
        return []
    for outcome, beyond in ((solved(search, softened, without.deviation), BEYOND), (without, 0.0)):
        if outcome is not None:
            lasting = scenario.lasting(outcome.duration)
            audit = search.audit_motion(lasting, outcome.deviation)
            if found := _other_limits(search, lasting, outcome.deviation, audit, beyond):
                return found
    return []


def _without(search: Search, names: Iterable[str]) -> Outcome | None:
    """Return the solution of the program without limits of the task, such as one far from what carriers can reach."""
    scenario, limits = search.scenario, search.scenario.task.limits
    none = {name: TaskLimits.model_fields[name].default for name in names if name in TaskLimits.model_fields}
    return solved(search, with_task(scenario, limits=limits.model_copy(update=none), margin=0.0), None)


def _audited(
    search: Search, scenario: Scenario, given: dict[str, Any], deviation: Deviation | None
) -> tuple[Scenario, Audit]:
    """Return the scenario of a task with other numbers, and the audit of the same motion for it."""
    kept = scenario.task.limits  # limits of one's own, and what makes them soft, only Python holds
    others = {**given["limits"], "soft": kept.without_own().soft}
    task = validate({**given, "limits": others}, Task, "task")
    held = {"own": kept.own, "soft": kept.soft}
    changed = {"limits": task.limits.model_copy(update=held), "objective": scenario.task.objective}
    task = task.model_copy(update=changed)
    looser = replace(lay_out(scenario.robot, task), path=scenario.path, duration=scenario.duration)
    return looser, search.audit_motion(looser, deviation, "audit, looser limits")


def _loosened(given: dict[str, Any], excess: Excess, scenario: Scenario, beyond: float) -> Bound | None:
    """Return the looser bound of a task's field that accepts an excess, made in `given`; None if there is none."""
    limits, above = given["limits"], excess.value > excess.bound
    value = rounded(excess.value + beyond * (excess.value - excess.bound), above)
    name, bound = f"limits.{excess.limit}", limits.get(excess.limit)
    if excess.limit == "tube.position":
        given["tube"]["position"], name = value, excess.limit
    elif excess.limit == "keep_out":
        subject, _, place = excess.about.partition(" outside ")
        about = "cables" if subject.startswith("cable ") else "carriers"
        about = "platform" if subject in ("platform", PLATFORM, LOAD) else about
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
            name = f"{name}[{axis}]"
    elif isinstance(bound, float) and value != 0:
        limits[excess.limit] = value = abs(value)
    else:
        return None
    return Bound(name, excess.unit, abs(excess.bound) if isinstance(bound, float) else excess.bound, value)
