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
from .largest_share import Variation, by_programs, exceeds, largest_share
from .longer_phases import longer_phases
from .other_paths import near_home, nearer_end, other_yaws, shifted_path, slower_path, smaller_circle
from .relaxations import LONGER, longer_durations, near_motion, other_duration, planned, rounded, slower
from .search import Search
from .tilting import tilting_platform

AT_EASE = 10.0  # times the time in which a force like the platform's weight moves it across the robot
LIGHTEST = 0.01  # of the platform's mass, of one that is tried near home
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

    `audit` is that of the motion exactly on the path. Each variation is one change; if speeds or accelerations are
    exceeded too, it may also need a longer duration, which is not tried in phases. If there is none, it is a path of
    the same form near the platform's home, if necessary at ease, unless a region is in the way. The list is empty for
    uncertain robots.
    """
    task = scenario.task
    if task.robust is not None:
        return []
    if by_programs(scenario):
        return _by_a_program(search, scenario)
    found = _changes(search, scenario, audit)
    if found or _blocked(audit):
        return found
    return near_home(search, scenario) or _at_ease_near_home(search, scenario)


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


def _at_ease_near_home(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the largest feasible path near the platform's home without margin and wind, and with a longer duration.

    If there is none, it is one of a lighter platform.
    """
    eased: dict[str, object] = {"margin": 0.0, "wind": None}
    conditions = ["a margin of 0 N"] * bool(scenario.hard_margin) + ["no wind"] * (scenario.task.wind is not None)
    robot, size = scenario.robot, float(np.linalg.norm(np.ptp(scenario.robot.home_anchors, axis=0)))
    seconds = rounded(AT_EASE * np.sqrt(size * robot.platform.mass / robot.force_scale), up=True)
    if scenario.stretches and scenario.duration < seconds <= scenario.longest:
        eased["duration"] = seconds
        conditions.append(f"a duration of {quantity(seconds, 's')}")
    calm = lay_out(robot, scenario.task.model_copy(update=eased))
    found = near_home(search, calm) if conditions else []
    mass = robot.platform.mass
    while not found and mass > LIGHTEST * robot.platform.mass:  # it is too heavy even there
        mass = rounded(mass / 2, up=False)
        found = near_home(search, _weighing(calm, mass))
    conditions += [f"a platform of {quantity(mass, 'kg')}"] * (mass < robot.platform.mass)
    return [replace(each, detail=f"{each.detail}, with {', '.join(conditions)}") for each in found]


def _by_a_program(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the first change with which a program finds a motion; only one, since each solves programs."""
    changes = (_less_wind, _lighter_load, _lighter_platform, nearer_end, near_home)
    return next((found for make in changes if (found := make(search, scenario))), [])


def _changes(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the changes of the path, of the task and of the robot with which a fixed motion is feasible."""
    task, others = scenario.task, [excess for excess in audit.excess if excess.limit != TENSIONS]
    if others and task.phases is not None:
        return []
    factors = [slower(excess) for excess in others]
    found = slower_path(search, scenario, audit)
    if min(factors, default=2.0) <= 1.0 or (others and not scenario.stretches):
        if _blocked(audit):  # ideas name other places and ways round
            inside = exceeds(scenario, np.array([scenario.duration]), rates=False)
            return found + (nearer_end(search, scenario) if inside else [])
        return found + (shifted_path(search, scenario, audit) or nearer_end(search, scenario))
    seconds = rounded(LONGER * max(factors, default=1.0) * scenario.duration, up=True)
    for make in (
        tilting_platform,
        nearer_end,
        smaller_circle,
        other_yaws,
        _less_wind,
        _lighter_load,
        _surer_load,
        _lighter_platform,
        partial(_other_limits_of_cables, limit="t_max"),
        partial(_other_limits_of_cables, limit="t_min"),
    ):
        its = make(search, scenario)
        if not its and others and seconds <= scenario.longest:
            longer = lay_out(scenario.robot, task.model_copy(update={"duration": seconds}))
            with_it = f", with a duration of {quantity(seconds, 's')}"
            its = [replace(each, detail=each.detail + with_it) for each in make(search, longer)]
        found += its
    return found + shifted_path(search, scenario, audit)


def _less_wind(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the strongest wind, or set of winds, from the same directions that is feasible."""
    wind = scenario.task.wind
    fastest = max(_speeds(wind), default=0.0)
    if wind is None or not fastest:
        return []

    def with_wind(share: float) -> Variation:
        if isinstance(wind, tuple):
            weaker: Any = tuple(share * value for value in wind)
        else:
            fields = {name: (share * np.array(value)).tolist() for name, value in wind.model_dump().items()}
            weaker = type(wind).model_validate(fields)
        task = scenario.task.model_copy(update={"wind": weaker})
        return lay_out(scenario.robot, task), share * fastest, f"instead of {quantity(fastest, 'm/s')}"

    return largest_share(search, with_wind, "wind", "m/s")


def _speeds(wind: Vector3 | WindBox | WindDisc | None) -> list[float]:
    """Return the speeds [m/s] of a wind, of the corners of a box of winds or of the fastest of a disc."""
    if isinstance(wind, WindDisc):
        return [wind.speed]
    corners = [wind.min, wind.max] if isinstance(wind, WindBox) else [] if wind is None else [wind]
    return [float(np.linalg.norm(corner)) for corner in corners]


def _lighter_load(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the heaviest loads of phases that are feasible, by one factor, with moments of inertia in proportion."""
    phases = scenario.task.phases or ()
    masses = [0.0 if phase.load is None else phase.load.mass for phase in phases]
    mass = max(masses, default=0.0)
    if mass == 0.0:
        return []
    others = "in each phase" if len({*masses, 0.0}) == 2 else "the others by the same factor"
    every = f", {others}" if sum(each > 0 for each in masses) > 1 else ""

    def with_loads(share: float) -> Variation:
        def lighter(load: Load) -> Load:
            inertia = tuple(share * value for value in load.inertia)
            return load.model_copy(update={"mass": share * load.mass, "inertia": inertia})

        return _carrying(scenario, lighter), share * mass, f"instead of {quantity(mass, 'kg')}{every}"

    return largest_share(search, with_loads, f"phases[{masses.index(mass)}].load.mass", "kg")


def _surer_load(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the largest tolerances of the loads with which it is feasible, all in proportion to the task's."""
    if not scenario.phases.extremes:
        return []

    def with_loads(share: float) -> Variation:
        def surer(load: Load) -> Load:
            x, y, z = (share * tolerance for tolerance in load.com_tolerance)
            return load.model_copy(update={"mass_tolerance": share * load.mass_tolerance, "com_tolerance": (x, y, z)})

        return _carrying(scenario, surer), 100 * share, "of the task's"

    return largest_share(search, with_loads, "mass_tolerance and com_tolerance of the loads", "%")


def _carrying(scenario: Scenario, change: Callable[[Load], Load]) -> Scenario:
    """Return the scenario with other loads, laid out."""
    carried = tuple(
        phase if phase.load is None else phase.model_copy(update={"load": change(phase.load)})
        for phase in scenario.task.phases or ()
    )
    return lay_out(scenario.robot, scenario.task.model_copy(update={"phases": carried}))


def _lighter_platform(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the heaviest platform that is feasible, with the moments of inertia that go with its mass."""
    mass = scenario.robot.platform.mass

    def with_mass(share: float) -> Variation:
        return _weighing(scenario, share * mass), share * mass, f"instead of {quantity(mass, 'kg')}"

    return largest_share(search, with_mass, "platform.mass", "kg")


def _weighing(scenario: Scenario, mass: float) -> Scenario:
    """Return the scenario with a platform of another mass [kg], with moments of inertia in proportion."""
    data = scenario.robot.model_dump()
    platform = data["platform"] | {"mass": mass}
    if platform["inertia"] is not None:
        share = mass / scenario.robot.platform.mass
        platform["inertia"] = [share * value for value in platform["inertia"]]
    return lay_out(Robot.model_validate(data | {"platform": platform}), scenario.task)


def _other_limits_of_cables(search: Search, scenario: Scenario, limit: str) -> list[Relaxed]:
    """Return the largest t_max, or t_min, after all are multiplied by the feasible factor that changes them least."""
    data, values = scenario.robot.model_dump(), getattr(scenario.robot, limit)
    largest, others = float(values.max()), "" if np.ptp(values) == 0 else ", the others by the same factor"
    stronger = limit == "t_max"
    if largest == 0.0:
        return []

    def with_limits(share: float) -> Variation:
        factor = 1 + (STRONGEST - 1) * (1 - share) ** 4 if stronger else share  # fine steps near one
        cables = [cable | {limit: factor * cable[limit]} for cable in data["cables"]]
        varied = lay_out(Robot.model_validate(data | {"cables": cables}), scenario.task)
        return varied, factor * largest, f"instead of {quantity(largest, 'N')}{others}"

    return largest_share(search, with_limits, f"cables.{limit}", "N", up=stronger)
