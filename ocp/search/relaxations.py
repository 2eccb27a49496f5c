"""Search for feasible tasks near an infeasible one, by another duration or looser limits, and audit each."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...base.text import quantity
from ...models.parsing import validate
from ...models.part import PositiveRange
from ..audits.audit import Audit, other_tensions_may_pass
from ..audits.excess import Excess
from ..limits.bodies import LOAD, PLATFORM
from ..nlp.rows import Mesh
from ..nlp.solver import MOST_ITERATIONS, Outcome
from ..plan import Plan
from ..proofs.durations import Durations
from ..proofs.infeasible_ends import infeasible_ends
from ..result import Relaxed
from ..tasks.deviation import Deviation
from ..tasks.lay_out import lay_out, with_task
from ..tasks.scenario import Scenario
from ..tasks.status import MotionStatus
from ..tasks.task import Task
from ..tasks.task_limits import TaskLimits
from .refinement import refine
from .search import Search

LONGER = 1.002  # than the shortest duration: between the places that were checked slightly more can be needed
LONGEST = 100.0  # times the duration that is requested, or else needed by tensions: a longer one does not help
TRIES = 3  # of a duration: not all that is exceeded falls as speeds and accelerations do
DIGITS = 4  # of what is offered: reports print no more
HALVINGS = 12  # of a margin, and of the ratio of two durations
PREFERRED = 1e-3  # of a limit's scale: an excess that costs one, so that other costs hardly matter
TIME_COUNTS = 1e-4  # of a feasible duration: it adds one to the objective, so that other costs hardly matter
ORDERS = {"/s": 1, "W": 1, "/s^2": 2, "/s^3": 3}  # of the rates with such units, which fall with 1/T to that power
LONGEST_CHOSEN = 20.0  # times the shortest duration
SHORTER = "(shorter ones may be feasible)"
EASE = 0.1  # of the acceleration of gravity, along the path
PLACES = 61  # of it
LONGER_CHOSEN = 1.1  # than the shortest duration, at which almost nothing is left to choose
BEYOND = 0.05  # of the change of a limit, more than the least, at which almost nothing is left to choose
SHRINK = 5e-3  # of the limits, for what happens between the nodes
# Of all programs of relaxations, as iterations times free coordinates at their nodes: as much as the plan took, within
# these bounds, of a few seconds.
LEAST_EFFORT, MOST_EFFORT = 8e4, 1.2e5
PART = 0.6  # of the remaining effort, for one program
LEAST_ITERATIONS = 15  # fewer find nothing
LARGE, FEWEST = 600, 20  # free coordinates at all nodes of a mesh, and its steps


class Bound(NamedTuple):
    """A field of a task that bounds something, its value, and the looser one that a motion keeps."""

    name: str
    unit: str
    requested: float
    possible: float


def near_fixed_motion(search: Search, scenario: Scenario, left: Durations | None, audit: Audit) -> list[Relaxed]:
    """Return what would make a fixed motion feasible; `left` are the durations that the tensions allow."""
    chosen = _soft_limits(search) if other_tensions_may_pass(scenario, audit) else []
    return other_duration(search, scenario, left, audit) + (chosen or _other_limits(search, scenario, None, audit))


def near_motion(
    search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit, span: tuple[float, float]
) -> list[Relaxed]:
    """Return what would make a motion that the planner chooses feasible; `audit` is that of the closest one.

    A longer duration is searched for in a `span` [s], unless its ends are equal.
    """
    open_ended = span[0] < span[1]
    fast = at_ease(scenario) > span[0] or any(slower(excess) > 1 for excess in audit.excess)
    longer = _longer_duration(search, audit, *span) if open_ended and fast else []
    limits = _soft_limits(search) or _other_limits(search, scenario, deviation, audit)
    if open_ended and not (fast or limits):  # it hardly helps where nothing is fast
        longer = _longer_duration(search, audit, *span)
    return longer + limits


def other_duration(search: Search, scenario: Scenario, left: Durations | None, audit: Audit) -> list[Relaxed]:
    """Return the nearest duration at which a scenario's fixed motion is possible, if one is known.

    Speeds fall with the duration, accelerations with its square; `left` are the durations that the tensions allow.
    """
    if left is not None and not left.exist:
        return []
    if not scenario.stretches:
        return []
    missing = audit.violation.max() > audit.tolerance
    if left is None and missing:
        return []
    requested = near = lasts = scenario.duration
    if left is not None:
        near = min(max(near, LONGER * left.shortest), left.longest / LONGER)
    for _ in range(TRIES):
        factor = max((slower(excess) for excess in audit.excess), default=1.0)
        near = max(near, LONGER * factor * lasts) if factor > 1 else near
        if near == lasts:  # no duration changes what is exceeded, and this one is audited
            return []
        lasts = near = rounded(near, up=near >= requested)
        shortest = requested if left is None else max(requested, left.shortest)
        if (left is not None and not left.shortest <= near <= left.longest) or near > min(
            LONGEST * shortest, scenario.longest
        ):
            return []
        longer = replace(scenario, task=scenario.task.model_copy(update={"duration": near}), duration=near)
        audit = search.audit_motion(longer, None, f"audit, duration {quantity(near, 's')}")
        if audit.passed:
            plan = Plan(longer, MotionStatus.FEASIBLE, None, audit, 0.0, 0.0)
            return [Relaxed("duration", "s", requested, near, plan)]
        if audit.violation.max() > audit.tolerance:
            return []
    return []


def slower(excess: Excess) -> float:
    """Return the factor of the duration that brings a power, speed or its derivative to its bound, or 1 for others."""
    if not excess.bound or not excess.value / excess.bound > 1:
        return 1.0
    order = next((order for end, order in ORDERS.items() if excess.unit.endswith(end)), np.inf)
    return (excess.value / excess.bound) ** (1 / order)


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


def _longer_duration(search: Search, audit: Audit, shortest: float, longest: float) -> list[Relaxed]:
    """Return a longer duration at which a scenario's motion, which the planner chooses, is possible, if it is shown.

    A motion at ease is found most easily; from there the program with a free duration looks for a shorter one.
    """
    scenario, task = search.scenario, search.scenario.task
    requested = scenario.duration_range.max if scenario.duration_range is not None else scenario.duration
    if LONGER_CHOSEN * shortest > longest:
        return []
    ease = at_ease(scenario)
    slowest = max(ease, 2 * shortest, *(slower(excess) * requested for excess in audit.excess))
    plan = _lasting(search, min(slowest, max(ease, longest), scenario.longest))
    if plan is None:
        return []
    objective = task.objective.model_copy(update={"time": TIME_COUNTS * plan.duration})
    open_ended = with_task(scenario, duration=PositiveRange(min=shortest, max=plan.duration), objective=objective)
    outcome = solved(search, open_ended, plan.deviation)
    # Without a guess, as when it is planned anew.
    near = None if outcome is None else _lasting(search, LONGER_CHOSEN * max(outcome.duration, requested))
    found = near or plan
    return [Relaxed("duration", "s", requested, found.duration, found, "" if near else SHORTER)]


def at_ease(scenario: Scenario) -> float:
    """Return the duration in which the platform's acceleration on its path is at most `EASE` of gravity's [s]."""
    times = np.linspace(0.0, scenario.duration, PLACES)
    fastest = np.linalg.norm(scenario.motion(times, None)[0].acceleration[:, :3], axis=1).max()
    of_weight = scenario.robot.force_scale / scenario.robot.platform.mass
    return float(scenario.duration * np.sqrt(fastest / (EASE * of_weight)))


def _lasting(search: Search, seconds: float) -> Plan | None:
    """Return the plan of the search's task with another duration."""
    longer = with_task(search.scenario, duration=rounded(seconds, up=True))
    return planned(search, longer, "audit, longer duration")


def planned(search: Search, scenario: Scenario, name: str, guess: Deviation | None = None) -> Plan | None:
    """Return a feasible plan of another scenario, whose audit is a stage with a `name`; None if none is found.

    Without free coordinates it is the motion itself, else the solution of the program, refined as that of any task,
    unless the scenario is proven infeasible.
    """
    if not scenario.count:
        audit = search.audit_motion(scenario, None, name)
        return Plan(scenario, MotionStatus.FEASIBLE, None, audit, 0.0, 0.0) if audit.passed else None
    if infeasible_ends(scenario) is not None:
        return None
    with _solved_beside(search, scenario, guess) as found:
        if found is None:
            return None
        refine(*found)
        plan = found[0].best()
    return plan if plan.feasible else None


def longer_durations(scenario: Scenario) -> tuple[float, float]:
    """Return the range of durations in which a feasible one is searched for; its ends are equal if none can be.

    It begins with what is requested, or nearly the longest duration that is proven to be too short.
    """
    if not scenario.stretches:
        return scenario.duration, scenario.duration
    span = scenario.duration_range
    shortest, longest = scenario.duration if span is None else span.max, scenario.longest
    if infeasible_ends(scenario.lasting(longest)) is not None:
        return longest, longest
    if infeasible_ends(scenario.lasting(shortest)) is not None:
        possible = longest
        while possible > (1 + BEYOND) * shortest:
            middle = float(np.sqrt(shortest * possible))
            proven = infeasible_ends(scenario.lasting(middle)) is not None
            shortest, possible = (middle, possible) if proven else (shortest, middle)
    return shortest, min(LONGEST_CHOSEN * shortest, longest)


def solved(search: Search, scenario: Scenario, guess: Deviation | None) -> Outcome | None:
    """Return the solution of another scenario's program; None if there is none."""
    with _solved_beside(search, scenario, guess) as found:
        return found and found[1]


@contextmanager
def _solved_beside(
    search: Search, scenario: Scenario, guess: Deviation | None
) -> Iterator[tuple[Search, Outcome] | None]:
    """Yield the search for a motion of another scenario, in the time that the task's limit left, and its solution.

    Its programs may take a part of the iterations that are left for offers: with a limit in seconds, a busy machine
    would find other results. None if too few are left, so that the search for offers is cut short, or if there is no
    solution. The mesh has fewer steps than a large task, since the refinement adds some.
    """
    left = min(max(search.effort, LEAST_EFFORT), MOST_EFFORT) - search.offers_effort
    count, steps = max(scenario.count, 1), scenario.task.steps
    most = int(PART * left / (count * steps))
    if most < LEAST_ITERATIONS:
        search.cut_short = True
        yield None
        return
    left_s = scenario.task.time_limit - search.solve_s
    beside = Search(scenario, {}, search.progress, left_s, min(most, MOST_ITERATIONS))
    mesh = Mesh(steps if scenario.phases.all else min(steps, max(LARGE // count, FEWEST)))
    outcome = beside.solve("program of a relaxation", mesh, guess)
    yield (beside, outcome) if outcome.success else None
    search.offers_effort += beside.effort


def rounded(value: float, up: bool) -> float:
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
