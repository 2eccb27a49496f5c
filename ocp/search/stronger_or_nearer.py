"""What else would make a motion feasible: another path (`other_paths`), less wind or mass, other cables."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...base.text import quantity
from ...models import Robot
from ...models.part import Vector3
from ..audits.audit import Audit
from ..audits.excess import TENSIONS
from ..plan import Plan
from ..proofs.durations import durations
from ..result import Relaxed
from ..tasks.deviation import Deviation
from ..tasks.ends import fixed_values
from ..tasks.lay_out import lay_out
from ..tasks.phase import Load
from ..tasks.scenario import Scenario
from ..tasks.status import MotionStatus
from ..tasks.task import Tube
from ..tasks.wind_set import WindBox, WindDisc
from .given_states import near_given_states
from .largest_share import Change, Variation, by_programs, exceeds, largest_share, together
from .longer_phases import longer_phases
from .other_paths import near_home, nearer_end, other_yaws, shifted_path, slower_path, slower_rate, smaller_circle
from .relaxations import (
    LONGER,
    LONGEST,
    at_ease,
    longer_durations,
    near_motion,
    other_duration,
    planned,
    rounded,
    slower,
)
from .search import Search
from .tilting import tilting_platform

AT_EASE = 10.0  # times the duration with small accelerations: speeds are small too
STRONGEST = 100.0  # times t_max: a motion that needs more is not one that stronger cables make feasible


def near_chosen_motion(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> list[Relaxed]:
    """Return what would make a motion that the planner chooses feasible; `audit` is that of the closest one.

    If no duration and no limit of the task does, it is what the platform could do exactly on its path. A longer
    duration is only tried if nothing proves it infeasible.
    """
    span = longer_durations(scenario)
    slower_helps = span[0] < span[1] or not scenario.stretches
    longer = longer_phases(search, scenario, audit) if slower_helps else []
    found = (
        _fewer_regions(search, scenario, deviation, audit)
        or near_motion(search, scenario, deviation, audit, span)
        or near_given_states(search, scenario, audit)
    )
    if found:
        return longer + found
    if by_programs(scenario):
        return longer + _by_a_program(search, scenario)
    if np.abs([fixed.value for fixed in fixed_values(scenario)]).max(initial=0.0) > 0:
        return []  # no motion is exactly on the path
    along = search.audit_motion(scenario, None, "audit of the path")
    exact = lay_out(scenario.robot, scenario.task.model_copy(update={"tube": Tube()}))
    found = other_duration(search, scenario, durations(exact), along) if slower_helps else []
    return longer + (found or stronger_or_nearer(search, scenario, along))


def stronger_or_nearer(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return feasible variations of what a task does not name: where its path is, the platform's mass, t_max, t_min.

    `audit` is that of the motion exactly on the path. Each variation is one change. If there is none, it is a path of
    the same form near the platform's home, or else several changes together, unless a region is in the way. The list is
    empty for uncertain robots.
    """
    task = scenario.task
    if task.robust is not None:
        return []
    if by_programs(scenario):
        return _by_a_program(search, scenario)
    found = _changes(search, scenario, audit)
    if found or _blocked(audit):
        return found
    return largest_share(search, near_home(scenario), rates=True) or together(search, scenario, TOGETHER)


def _fewer_regions(search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit) -> list[Relaxed]:
    """Return, for a free position, how many regions can stay without those that the closest motion passes through."""
    limits = scenario.task.limits
    through = {
        excess.about.partition(" outside ")[2]
        for excess in audit.excess
        if excess.limit == "keep_out" and excess.value < 0
    }
    kept = tuple(region for region in limits.keep_out if region.name not in through)
    if len(kept) == len(limits.keep_out) or scenario.task.tube.position != "free":
        return []
    task = scenario.task.model_copy(update={"limits": limits.model_copy(update={"keep_out": kept})})
    without, name = lay_out(scenario.robot, task), "number of keep-out regions"
    without = without.lasting(scenario.duration)
    closest = search.audit_motion(without, deviation, f"audit, other {name}")
    plan = Plan(without, MotionStatus.FEASIBLE, deviation, closest, 0.0, 0.0) if closest.passed else None
    plan = plan or planned(search, without, f"audit, other {name}", deviation)
    detail = f"of {len(limits.keep_out)}, without {', '.join(map(repr, sorted(through)))}"
    return [] if plan is None else [Relaxed(name, "", len(limits.keep_out), len(kept), plan, detail)]


def _blocked(audit: Audit) -> bool:
    return any(excess.limit == "keep_out" for excess in audit.excess)


def _by_a_program(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the first change with which a program finds a motion; only one, since each solves programs."""
    makers = (_less_wind, _lighter_load, _lighter_platform, nearer_end)
    every = partial(largest_share, search)
    return next(filter(None, (every(make(scenario)) for make in makers)), []) or every(near_home(scenario), rates=True)


def _changes(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the changes of the path, of the task and of the robot with which a fixed motion is feasible.

    If speeds or accelerations are exceeded too, each may also need a longer duration, which is not tried in phases.
    """
    found = slower_path(search, scenario, audit)
    factors = [slower(excess) for excess in audit.excess if excess.limit != TENSIONS]
    if min(factors, default=2.0) <= 1.0 or (factors and not scenario.stretches):
        if _blocked(audit):  # ideas name other places and ways round
            inside = exceeds(scenario, np.array([scenario.duration]), rates=False)
            return found + (largest_share(search, nearer_end(scenario)) if inside else [])
        return found + (shifted_path(search, scenario, audit) or largest_share(search, nearer_end(scenario)))
    found += tilting_platform(search, scenario)
    seconds = rounded(LONGER * max(factors, default=1.0) * scenario.duration, up=True)
    for make in SINGLE:
        its = largest_share(search, make(scenario))
        if not its and factors and scenario.task.phases is None and seconds <= scenario.longest:
            longer = lay_out(scenario.robot, scenario.task.model_copy(update={"duration": seconds}))
            with_it = f", with a duration of {quantity(seconds, 's')}"
            its = [replace(each, detail=each.detail + with_it) for each in largest_share(search, make(longer))]
        found += its
    return found + shifted_path(search, scenario, audit)


def _longer(scenario: Scenario) -> Change | None:
    """Return the change of the duration to a longer one."""
    if not scenario.stretches or scenario.task.phases is not None:
        return None
    most = min(max(AT_EASE * at_ease(scenario), LONGEST * scenario.duration), scenario.longest) / scenario.duration
    if most <= 1.0:
        return None

    def lasting(share: float) -> Variation:
        seconds = rounded(scenario.duration * most ** (1 - share), up=True)
        varied = lay_out(scenario.robot, scenario.task.model_copy(update={"duration": seconds}))
        return varied, seconds, f"instead of {quantity(scenario.duration, 's')}"

    return Change("duration", "s", lasting, up=True)


def _less_margin(scenario: Scenario) -> Change | None:
    """Return the change of the margin of tensions to a smaller one."""
    margin = scenario.hard_margin

    def with_margin(share: float) -> Variation:
        less = {"margin": rounded(share * margin, up=False)}
        varied = lay_out(scenario.robot, scenario.task.model_copy(update=less))
        return varied, share * margin, f"instead of {quantity(margin, 'N')}"

    return Change("margin", "N", with_margin) if margin else None


def _less_wind(scenario: Scenario) -> Change | None:
    """Return the change of the wind, or set of winds, to a weaker one from the same directions."""
    wind = scenario.task.wind
    fastest = max(_speeds(wind), default=0.0)
    if wind is None or not fastest:
        return None

    def with_wind(share: float) -> Variation:
        if isinstance(wind, tuple):
            weaker: Any = tuple(share * value for value in wind)
        else:
            fields = {name: (share * np.array(value)).tolist() for name, value in wind.model_dump().items()}
            weaker = type(wind).model_validate(fields)
        task = scenario.task.model_copy(update={"wind": weaker})
        return lay_out(scenario.robot, task), share * fastest, f"instead of {quantity(fastest, 'm/s')}"

    return Change("wind", "m/s", with_wind)


def _speeds(wind: Vector3 | WindBox | WindDisc | None) -> list[float]:
    """Return the speeds [m/s] of a wind, of the corners of a box of winds or of the fastest of a disc."""
    if isinstance(wind, WindDisc):
        return [wind.speed]
    corners = [wind.min, wind.max] if isinstance(wind, WindBox) else [] if wind is None else [wind]
    return [float(np.linalg.norm(corner)) for corner in corners]


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
    return lay_out(scenario.robot, scenario.task.model_copy(update={"phases": carried}))


def _lighter_platform(scenario: Scenario) -> Change:
    """Return the change of the platform to a lighter one, with moments of inertia in proportion."""
    data, mass = scenario.robot.model_dump(), scenario.robot.platform.mass

    def with_mass(share: float) -> Variation:
        platform = data["platform"] | {"mass": share * mass}
        if platform["inertia"] is not None:
            platform["inertia"] = [share * value for value in platform["inertia"]]
        varied = lay_out(Robot.model_validate(data | {"platform": platform}), scenario.task)
        return varied, share * mass, f"instead of {quantity(mass, 'kg')}"

    return Change("platform.mass", "kg", with_mass)


def _other_limits_of_cables(scenario: Scenario, limit: str) -> Change | None:
    """Return the change of all t_max to larger ones, or of all t_min to smaller ones, by one factor."""
    data, values = scenario.robot.model_dump(), getattr(scenario.robot, limit)
    largest, others = float(values.max()), "" if np.ptp(values) == 0 else ", the others by the same factor"
    stronger = limit == "t_max"
    if largest == 0.0:
        return None

    def with_limits(share: float) -> Variation:
        factor = 1 + (STRONGEST - 1) * (1 - share) ** 4 if stronger else share  # fine steps near one
        cables = [cable | {limit: factor * cable[limit]} for cable in data["cables"]]
        varied = lay_out(Robot.model_validate(data | {"cables": cables}), scenario.task)
        return varied, factor * largest, f"instead of {quantity(largest, 'N')}{others}"

    return Change(f"cables.{limit}", "N", with_limits, up=stronger)


_larger_t_max = partial(_other_limits_of_cables, limit="t_max")
_smaller_t_min = partial(_other_limits_of_cables, limit="t_min")
SINGLE = (
    *(nearer_end, smaller_circle, other_yaws, _less_wind, _lighter_load, _surer_load, _lighter_platform),
    *(_larger_t_max, _smaller_t_min),
)
# The first are left out first. Stronger cables permit what a lighter platform does, at any t_min.
TOGETHER = (
    *(_smaller_t_min, _larger_t_max, near_home, _lighter_load, _less_wind, nearer_end, _less_margin),
    *(slower_rate, _longer),
)
