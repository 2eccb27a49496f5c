"""What would make an infeasible task feasible: `feasible_changes`, each change with an audited plan.

Nearest to the task are another duration and limits that the closest motion just keeps. Only where these do not help
other changes are tried, of regions, path, loads and cables: first each alone, then several together.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ...base.text import quantity
from ...models.parsing import validate
from ..audits.audit import Audit, other_tensions_may_pass
from ..audits.excess import TENSIONS, Excess
from ..limits.places import LOAD, PLATFORM
from ..nlp.near import regions_near
from ..nlp.solver import Outcome
from ..plan import Plan
from ..proofs.durations import durations
from ..proofs.infeasible_ends import infeasible_ends
from ..result import Offers, Relaxed
from ..tasks.deviation import Deviation
from ..tasks.lay_out import lay_out, with_task
from ..tasks.paths import CirclePath
from ..tasks.scenario import Scenario
from ..tasks.task import MotionStatus, Task, Tube
from ..tasks.task_limits import TaskLimits
from .largest_share import Change, Maker, at_ease, by_programs, exceeds, largest_share, rests, together
from .other_forces import (
    larger_t_max,
    less_margin,
    less_wind,
    lighter_load,
    lighter_platform,
    smaller_t_min,
    surer_load,
)
from .other_paths import (
    as_wide_as_states,
    near_home,
    nearer_end,
    other_yaws,
    shifted_path,
    shortest_shift,
    smaller_circle,
    tilting_platform,
)
from .past_regions import IN_THE_WAY, fewer_regions, past_regions
from .refinement import rounded, solved
from .search import NEAR, OF_AUDIT, Search
from .slower import LONGER, longer, longer_duration, longer_phases, other_duration, slower, slower_rate, slower_states

# Of all offers [us]: one to three seconds, or half of what the plan took if that is longer, or a few audits of its
# length.
EFFORT, OF_PLAN, AUDITS = 3e6, 0.5, 3.0
TRIES = 3  # with other limits, the motion may exceed others
HALVINGS = 12  # of a margin
PREFERRED = 1e-3  # of a limit's scale: an excess that costs one, so that other costs hardly matter
BEYOND = 0.05  # of the change of a limit, more than the least, at which almost nothing is left to choose


_Past: TypeAlias = Callable[[], list[Relaxed]]


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
    regions = limits.keep_out if "keep_out" in soft else ()
    if regions:  # less than no distance is not offered, so that no softer limit helps where even that is impossible
        touched = tuple(region.touched() for region in regions)
        others = {name: amount for name, amount in softer.soft.items() if name != "keep_out"}
        if infeasible_ends(with_task(scenario, limits=limits.model_copy(update={"keep_out": touched, "soft": others}))):
            return []
    without = _without(search, soft)
    if without is None:
        return []
    near = regions_near(scenario, without.deviation, 2 * NEAR) if regions else ()
    if near != regions:  # a program has rows of soft ones at all of its points
        softened = with_task(softened, limits=softer.model_copy(update={"keep_out": near}))
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


def _shifted(scenario: Scenario) -> Change | None:
    """Return the shift of a path to where tensions hold the platform."""
    return shifted_path(scenario, shortest_shift(scenario))


# For a motion exactly on its path each is tried, since this takes little time; for others each solves programs.
OF_PATHS = (
    *(nearer_end, smaller_circle, other_yaws, less_wind, lighter_load, surer_load, lighter_platform),
    *(larger_t_max, smaller_t_min, _shifted),
)
BY_PROGRAMS = less_wind, lighter_load, lighter_platform, nearer_end
# When tried together, the first are left out first. Stronger cables permit what a lighter platform does, at any t_min.
OF_CABLES = smaller_t_min, larger_t_max
OTHERS = lighter_load, less_wind, nearer_end, less_margin, slower_rate, longer


def feasible_changes(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> Offers:
    """Return changes that make a scenario feasible; `audit` is its closest motion's, with a `deviation`."""
    few_audits = AUDITS * OF_AUDIT * audit.tensions.size
    search.most_effort = search.effort + max(EFFORT, OF_PLAN * search.effort, few_audits)
    return Offers(_changes(search, scenario, deviation, audit), search.cut_short)


def _changes(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> list[Relaxed]:
    chosen, missing = by_programs(scenario), audit.certificate
    # No cable pulls as is necessary, however strong it is, and slower motions hardly need less.
    direction = missing is not None and not (audit.excess or missing.at_max.size or missing.at_min.size)
    slow = at_ease(scenario) <= scenario.duration
    if chosen and direction and slow and (found := tilting_platform(search, scenario)):
        return found
    phases = longer_phases(search, scenario, audit)
    # Where the robot cannot rest at the ends, no duration and no limit helps.
    held = not chosen or scenario.task.tube.position == "free" or rests(scenario)
    past = cache(partial(past_regions, search, scenario))
    if held and (found := _near(search, scenario, deviation, audit, past)):
        return phases + found
    if scenario.count and not chosen:  # else what the platform could do exactly on its path
        audit = search.audit_motion(scenario, None, "audit of the path")
        if found := other_duration(search, scenario, durations(with_task(scenario, tube=Tube())), audit):
            return phases + found
    return phases + _farther(search, scenario, audit, past)


def _near(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit, past: _Past) -> list[Relaxed]:
    """Return other durations, and looser limits, at which a motion near the closest one is feasible.

    If the planner chooses the motion, a longer duration is tried first where the motion is fast, and last where not.
    `past` returns what leads past regions.
    """
    if not scenario.count:
        found = other_duration(search, scenario, search.timing.durations, audit)
        found += looser_limits(search, scenario, deviation, audit)
        return found and largest_share(search, slower_rate(scenario)) + found
    if scenario.task.tube.position == "free" and (found := _past_what_is_in_the_way(search, scenario, audit, past)):
        return found
    if at_ease(scenario) > scenario.duration or any(slower(excess) > 1 for excess in audit.excess):
        found = longer_duration(search, audit) + looser_limits(search, scenario, deviation, audit)
    else:
        found = looser_limits(search, scenario, deviation, audit) or longer_duration(search, audit)
    return found or as_wide_as_states(search, scenario, audit) or slower_states(search, scenario)


def _past_what_is_in_the_way(search: Search, scenario: Scenario, audit: Audit, past: _Past) -> list[Relaxed]:
    """Return what leads a platform with a free position past regions, or how many of these can stay."""
    found = past() if _in_the_way(audit) else []
    blocking = (audit, None) if _blocked(audit) else ()
    return found or _first(search, scenario, [partial(fewer_regions, audit=each) for each in blocking])


def _farther(search: Search, scenario: Scenario, audit: Audit, past: _Past) -> list[Relaxed]:
    """Return changes of regions, path, loads, platform and cables: each alone, or else several together.

    `audit` is for the motion exactly on the path, `past` returns what leads past regions.
    """
    chosen = by_programs(scenario)
    fewer = (_once(partial(fewer_regions, audit=audit)),) * _blocked(audit)
    found = past() if _in_the_way(audit) else []
    if chosen:  # a smaller t_min alone helps where the formation does not rest
        singles = (*((smaller_t_min,) * (not rests(scenario))), *BY_PROGRAMS, *fewer, near_home)
        found = found or _first(search, scenario, singles)
    else:
        found += _each(search, scenario, audit)
        others = (nearer_end, *fewer) if fewer else (near_home,)
        found = found or [each for make in others for each in largest_share(search, make(scenario))]
    found = found or together(search, scenario, (*fewer, *OF_CABLES, near_home, *OTHERS))
    if found or chosen:  # a lighter platform needs a smaller t_min too
        return found or together(search, scenario, (*fewer, lighter_platform, smaller_t_min, *OTHERS))
    shift = partial(shifted_path, shortest=shortest_shift(scenario, balance=False))
    return together(search, scenario, (*fewer, *OF_CABLES, shift, *OTHERS))


def _first(search: Search, scenario: Scenario, makers: Sequence[Maker]) -> list[Relaxed]:
    """Return the first of some changes that makes a motion feasible."""
    return next(filter(None, (largest_share(search, make(scenario)) for make in makers)), [])


def _each(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return all changes with which a motion exactly on its path is feasible.

    If speeds or accelerations are exceeded too, each may also need a longer duration, which is not tried in phases.
    """
    found = largest_share(search, slower_rate(scenario))
    factors = [slower(excess) for excess in audit.excess if excess.limit != TENSIONS]
    if min(factors, default=2.0) <= 1.0 or (factors and not scenario.stretches):
        if _blocked(audit) and not isinstance(scenario.task.path, CirclePath):
            inside = exceeds(scenario, np.array([scenario.duration]), rates=False).any()
            return found + (largest_share(search, nearer_end(scenario)) if inside else [])
        return found + _first(search, scenario, (_shifted, nearer_end))
    found += tilting_platform(search, scenario)
    seconds, with_it = rounded(LONGER * max(factors, default=1.0) * scenario.duration, up=True), ""
    if factors and scenario.task.phases is None and seconds <= scenario.longest:
        scenario, with_it = with_task(scenario, duration=seconds), f", with a duration of {quantity(seconds, 's')}"
    for make in OF_PATHS:
        found += [replace(each, detail=each.detail + with_it) for each in largest_share(search, make(scenario))]
    return found


def _once(make: Maker) -> Maker:
    """Return a maker that makes the change of a scenario once: limits of fewer regions take long to build."""
    made: list[tuple[Scenario, Change | None]] = []

    def change(scenario: Scenario) -> Change | None:
        known = [each for given, each in made if given is scenario]
        if not known:
            known = [make(scenario)]
            made.append((scenario, known[0]))
        return known[0]

    return change


def _blocked(audit: Audit) -> bool:
    return any(excess.limit == "keep_out" for excess in audit.excess)


def _in_the_way(audit: Audit) -> bool:
    return any(excess.limit in IN_THE_WAY for excess in audit.excess)
