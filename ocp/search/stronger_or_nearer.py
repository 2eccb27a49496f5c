"""What else would make a motion feasible: another path (`other_paths`), less wind or mass, other cables, a tube."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...base.text import quantity
from ...models import Robot
from ..audits.audit import Audit
from ..audits.excess import TENSIONS
from ..plan import Plan
from ..proofs.durations import durations
from ..result import Relaxed
from ..tasks.deviation import Deviation
from ..tasks.lay_out import lay_out, with_task
from ..tasks.paths import CirclePath
from ..tasks.phase import Load
from ..tasks.scenario import ATTITUDE, Scenario
from ..tasks.status import MotionStatus
from ..tasks.task import Tube
from .largest_share import Change, Variation, by_programs, exceeds, largest_share, rests, together
from .other_paths import near_home, nearer_end, other_yaws, shifted_path, shortest_shift, smaller_circle
from .past_regions import IN_THE_WAY, past_regions
from .relaxations import (
    BEYOND,
    LONGER,
    at_ease,
    longer_durations,
    near_motion,
    other_duration,
    planned,
    rounded,
    slower,
    solved,
)
from .search import Search
from .slower import longer, longer_phases, slower_rate, slower_states

STRONGEST = 100.0  # times t_max: a motion that needs more is not one that stronger cables make feasible
MOST = 0.5  # [rad], of a tilt that is offered
SPARE = 1.01  # times the largest tilt at the nodes


def near_chosen_motion(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> list[Relaxed]:
    """Return what would make a motion that the planner chooses feasible; `audit` is that of the closest one.

    If no duration and no limit of the task does, it is what the platform could do exactly on its path. A longer
    duration is only tried if nothing proves it infeasible, and if the platform can rest where it starts and ends.
    """
    chosen, missing = by_programs(scenario), audit.certificate
    # No cable pulls as is necessary, however strong it is, and slower motions hardly need less.
    direction = missing is not None and not (audit.excess or missing.at_max.size or missing.at_min.size)
    slow = at_ease(scenario) <= scenario.duration
    if chosen and direction and slow and (found := tilting_platform(search, scenario)):
        return found
    if chosen and scenario.task.tube.position != "free" and not rests(scenario):
        return _by_a_program(search, scenario, audit)
    span = longer_durations(scenario)
    slower_helps = span[0] < span[1] or not scenario.stretches
    phases = longer_phases(search, scenario, audit) if slower_helps else []
    found = (
        (past_regions(search, scenario) if scenario.task.tube.position == "free" and _in_the_way(audit) else [])
        or _without_regions(search, scenario, deviation, audit)
        or near_motion(search, scenario, deviation, audit, span)
        or as_wide_as_states(search, scenario, audit)
        or slower_states(search, scenario)
    )
    if found:
        return phases + found
    if chosen:
        return phases + _by_a_program(search, scenario, audit)
    along = search.audit_motion(scenario, None, "audit of the path")
    exact = durations(with_task(scenario, tube=Tube()))
    found = other_duration(search, scenario, exact, along) if slower_helps else []
    return phases + (found or stronger_or_nearer(search, scenario, along))


def stronger_or_nearer(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return feasible variations of what a task does not name: where its path is, the platform's mass, t_max, t_min.

    `audit` is that of the motion exactly on the path. Each variation is one change. If there is none, it is a path of
    the same form near the platform's home, or else several changes together, such as fewer regions.
    """
    if by_programs(scenario):
        return _by_a_program(search, scenario, audit)
    fewer = (partial(_fewer_regions, audit=audit),) * _blocked(audit)
    found = past_regions(search, scenario) if _in_the_way(audit) else []
    found += _changes(search, scenario, audit)
    if not found and fewer:
        found = [each for make in (nearer_end, *fewer) for each in largest_share(search, make(scenario))]
    elif not found:
        found = largest_share(search, near_home(scenario), rates=True)
    found = found or together(search, scenario, (*fewer, *OF_CABLES, near_home, *OTHERS))
    if found or (shift := shortest_shift(scenario, balance=False)) is None:
        return found
    makers = *OF_CABLES, partial(shifted_path, shortest=shift), *OTHERS
    return together(search, scenario, makers) or together(search, scenario, (*fewer, *makers))


def _without_regions(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> list[Relaxed]:
    """Return, for a free position, how many regions can stay: without those that the closest motion passes through.

    If no motion is found with these, it is without any; a motion that is not found without any is not with some.
    """
    found = list[Relaxed]()
    changes = (_fewer_regions(scenario, None), _fewer_regions(scenario, audit)) if _blocked(audit) else ()
    for change in changes if scenario.task.tube.position == "free" else ():
        if change is None:
            break
        without, name = change.at(0.0)[0].lasting(scenario.duration), f"audit, other {change.name}"
        closest = search.audit_motion(without, deviation, name)
        plan = Plan(without, MotionStatus.FEASIBLE, deviation, closest, 0.0, 0.0) if closest.passed else None
        plan = plan or planned(search, without, name, deviation if found else None)
        if plan is None:
            break
        found = [change.offer(0.0, plan)]
    return found


def _fewer_regions(scenario: Scenario, audit: Audit | None) -> Change | None:
    """Return the change to the regions that the audited motion keeps clear of, or without an audit to no regions."""
    limits, given = scenario.task.limits, scenario.task.limits.keep_out
    excesses = () if audit is None else audit.excess
    through = {excess.about.partition(" outside ")[2] for excess in excesses if excess.limit == "keep_out"}
    kept = () if audit is None else tuple(region for region in given if region.name not in through)
    through = through or {region.name for region in given}
    if len(kept) == len(given):
        return None

    def without(share: float) -> Variation:
        left = given if share == 1.0 else kept
        varied = with_task(scenario, limits=limits.model_copy(update={"keep_out": left}))
        return varied, len(left), f"of {len(given)}, without {', '.join(map(repr, sorted(through)))}"

    return Change("number of keep-out regions", "", without)


def _blocked(audit: Audit) -> bool:
    return any(excess.limit == "keep_out" for excess in audit.excess)


def _in_the_way(audit: Audit) -> bool:
    return any(excess.limit in IN_THE_WAY for excess in audit.excess)


def _by_a_program(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the first change with which a program finds a motion, or else all together, since each solves programs."""
    fewer = (partial(_fewer_regions, audit=audit),) * _blocked(audit)
    found = past_regions(search, scenario) if _in_the_way(audit) else []
    # A smaller t_min alone helps where the formation does not rest.
    singles = (*((_smaller_t_min,) * (not rests(scenario))), *BY_PROGRAMS, *fewer)
    found = found or next(filter(None, (largest_share(search, make(scenario)) for make in singles)), [])
    found = found or largest_share(search, near_home(scenario), rates=True)
    others = (*fewer, _smaller_t_min, _less_wind, _lighter_load, nearer_end, longer)
    # A lighter platform needs a smaller t_min too.
    return found or together(search, scenario, others) or together(search, scenario, (_lighter_platform, *others))


def _changes(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the changes of the path, of the task and of the robot with which a fixed motion is feasible.

    If speeds or accelerations are exceeded too, each may also need a longer duration, which is not tried in phases.
    """
    found = largest_share(search, slower_rate(scenario), rates=True)
    factors = [slower(excess) for excess in audit.excess if excess.limit != TENSIONS]
    if min(factors, default=2.0) <= 1.0 or (factors and not scenario.stretches):
        if _blocked(audit) and not isinstance(scenario.task.path, CirclePath):
            inside = exceeds(scenario, np.array([scenario.duration]), rates=False).any()
            return found + (largest_share(search, nearer_end(scenario)) if inside else [])
        shift = largest_share(search, shifted_path(scenario, shortest_shift(scenario)))
        return found + (shift or largest_share(search, nearer_end(scenario)))
    found += tilting_platform(search, scenario)
    seconds = rounded(LONGER * max(factors, default=1.0) * scenario.duration, up=True)
    for make in SINGLE:
        its = largest_share(search, make(scenario))
        if not its and factors and scenario.task.phases is None and seconds <= scenario.longest:
            lasting, with_it = with_task(scenario, duration=seconds), f", with a duration of {quantity(seconds, 's')}"
            its = [replace(each, detail=each.detail + with_it) for each in largest_share(search, make(lasting))]
        found += its
    return found + largest_share(search, shifted_path(scenario, shortest_shift(scenario)))


def _less_margin(scenario: Scenario) -> Change | None:
    """Return the change of the margin of tensions to a smaller one."""
    margin = scenario.hard_margin

    def with_margin(share: float) -> Variation:
        varied = with_task(scenario, margin=rounded(share * margin, up=False))
        return varied, share * margin, f"instead of {quantity(margin, 'N')}"

    return Change("margin", "N", with_margin) if margin else None


def _less_wind(scenario: Scenario) -> Change | None:
    """Return the change of the wind, or set of winds, to a weaker one from the same directions."""
    wind = scenario.task.wind
    given = {} if wind is None else {"wind": wind} if isinstance(wind, tuple) else wind.model_dump()
    fastest = max((float(np.linalg.norm(value)) for value in given.values()), default=0.0)
    if wind is None or not fastest:
        return None

    def with_wind(share: float) -> Variation:
        fields: Any = {name: (share * np.array(value)).tolist() for name, value in given.items()}
        weaker = tuple(fields["wind"]) if isinstance(wind, tuple) else type(wind).model_validate(fields)
        return with_task(scenario, wind=weaker), share * fastest, f"instead of {quantity(fastest, 'm/s')}"

    return Change("wind", "m/s", with_wind)


def _lighter_load(scenario: Scenario) -> Change | None:
    """Return the change of the loads of phases to lighter ones by one factor, with moments of inertia in proportion."""
    phases = scenario.task.phases or ()
    masses = [0.0 if phase.load is None else phase.load.mass for phase in phases]
    mass = max(masses, default=0.0)
    if mass == 0.0:
        return None
    others = "in each phase" if len({*masses, 0.0}) == 2 else "the others by the same factor"
    every = f", {others}" if sum(each > 0 for each in masses) > 1 else ""

    def with_loads(share: float) -> Variation:
        def lighter(load: Load) -> Load:
            inertia = tuple(share * value for value in load.inertia)
            return load.model_copy(update={"mass": share * load.mass, "inertia": inertia})

        return _carrying(scenario, lighter), share * mass, f"instead of {quantity(mass, 'kg')}{every}"

    return Change(f"phases[{masses.index(mass)}].load.mass", "kg", with_loads)


def _surer_load(scenario: Scenario) -> Change | None:
    """Return the change of the tolerances of the loads to smaller ones, all in proportion to the task's."""
    if not scenario.phases.extremes:
        return None

    def with_loads(share: float) -> Variation:
        def surer(load: Load) -> Load:
            x, y, z = (share * tolerance for tolerance in load.com_tolerance)
            return load.model_copy(update={"mass_tolerance": share * load.mass_tolerance, "com_tolerance": (x, y, z)})

        return _carrying(scenario, surer), 100 * share, "of the task's"

    return Change("mass_tolerance and com_tolerance of the loads", "%", with_loads)


def _carrying(scenario: Scenario, change: Callable[[Load], Load]) -> Scenario:
    """Return the scenario with other loads, laid out."""
    carried = tuple(
        phase if phase.load is None else phase.model_copy(update={"load": change(phase.load)})
        for phase in scenario.task.phases or ()
    )
    return with_task(scenario, phases=carried)


def _lighter_platform(scenario: Scenario) -> Change:
    """Return the change of the platform to a lighter one, with moments of inertia in proportion."""
    given, mass = scenario.robot.model_dump()["platform"], scenario.robot.platform.mass

    def with_mass(share: float) -> Variation:
        inertia = None if given["inertia"] is None else [share * value for value in given["inertia"]]
        varied = _with_robot(scenario, platform=given | {"mass": share * mass, "inertia": inertia})
        return varied, share * mass, f"instead of {quantity(mass, 'kg')}"

    return Change("platform.mass", "kg", with_mass)


def _other_limits_of_cables(scenario: Scenario, limit: str) -> Change | None:
    """Return the change of all t_max to larger ones, or of all t_min to smaller ones, by one factor."""
    given, values = scenario.robot.model_dump()["cables"], getattr(scenario.robot, limit)
    largest, others = float(values.max()), "" if np.ptp(values) == 0 else ", the others by the same factor"
    stronger = limit == "t_max"
    if largest == 0.0:
        return None

    def with_limits(share: float) -> Variation:
        factor = 1 + (STRONGEST - 1) * (1 - share) ** 4 if stronger else share  # fine steps near one
        varied = _with_robot(scenario, cables=[cable | {limit: factor * cable[limit]} for cable in given])
        return varied, factor * largest, f"instead of {quantity(largest, 'N')}{others}"

    return Change(f"cables.{limit}", "N", with_limits, up=stronger)


def _with_robot(scenario: Scenario, **changes: Any) -> Scenario:
    """Return the scenario of a robot with other values of some fields, laid out for the same task."""
    return lay_out(Robot.model_validate(scenario.robot.model_dump() | changes), scenario.task)


_larger_t_max = partial(_other_limits_of_cables, limit="t_max")
_smaller_t_min = partial(_other_limits_of_cables, limit="t_min")
SINGLE = (
    *(nearer_end, smaller_circle, other_yaws, _less_wind, _lighter_load, _surer_load, _lighter_platform),
    *(_larger_t_max, _smaller_t_min),
)
# Of changes together the first are left out first. Stronger cables permit what a lighter platform does, at any t_min.
OF_CABLES = _smaller_t_min, _larger_t_max
OTHERS = _lighter_load, _less_wind, nearer_end, _less_margin, slower_rate, longer
BY_PROGRAMS = _less_wind, _lighter_load, _lighter_platform, nearer_end


def as_wide_as_states(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the radius of the tube that reaches the given state farthest outside it."""
    tube = scenario.task.tube
    off = max((excess.value for excess in audit.excess if excess.limit == "tube.position"), default=0.0)
    if off <= tube.radius:
        return []
    radius = rounded((1 + BEYOND) * off, up=True)
    plan = planned(search, _with_tube(scenario, position=radius), "audit, wider tube")
    return [] if plan is None else [Relaxed("tube.position", "m", tube.radius, radius, plan)]


def tilting_platform(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the tube in which the platform must be allowed to tilt, so that few cables can hold it on its path.

    Cables fewer than the degrees of freedom balance the weight in few attitudes, which change from place to place.
    """
    task, robot = scenario.task, scenario.robot
    angles = [axis for axis in ATTITUDE if robot.dof_mask[axis]]
    if task.tube.turn or task.phases is not None or not angles or robot.m >= robot.dof_mask.sum():
        return []
    free = _with_tube(scenario, attitude=MOST)
    outcome = solved(search, free, None)
    if outcome is None:
        return []
    turns = [column for column, (owner, axis) in enumerate(free.owners()) if owner is None and axis in angles]
    tilt = min(rounded(SPARE * float(np.abs(outcome.deviation.q[:, turns]).max()), up=True), MOST)
    if not tilt:
        return []
    tilting = _with_tube(scenario, attitude=tilt)
    plan = planned(search, tilting, "audit, tilting platform", outcome.deviation)
    return [] if plan is None else [Relaxed("tube.attitude", "rad", task.tube.turn, tilt, plan, "about each axis")]


def _with_tube(scenario: Scenario, **changes: float) -> Scenario:
    return with_task(scenario, tube=scenario.task.tube.model_copy(update=changes))
