"""Changes to a slower motion: longer durations, of the whole or of phases, a smaller feed, slower given states."""

from dataclasses import replace

import numpy as np

from ...base.text import quantity
from ...models.part import PositiveRange
from ..audits.audit import Audit
from ..audits.excess import Excess
from ..plan import Plan
from ..proofs.durations import Durations, durations
from ..proofs.infeasible_ends import infeasible_ends
from ..result import Relaxed
from ..tasks.lay_out import with_task
from ..tasks.paths import CirclePath, FeedPath, RestPath, SamplePath, SequencePath, WaypointPath
from ..tasks.scenario import Scenario
from ..tasks.task import MotionStatus
from .largest_share import ORDERS, Change, Variation, along, at_ease, largest_share
from .refinement import planned, rounded, solved
from .search import Search

LONGER = 1.002  # than the shortest duration: between the places that were checked slightly more can be needed
LONGEST = 100.0  # times the duration that is requested, or else needed by tensions: a longer one does not help
TRIES = 3  # of a duration: not all that is exceeded falls as speeds and accelerations do
TIME_COUNTS = 1e-4  # of a feasible duration: it adds one to the objective, so that other costs hardly matter
LONGEST_CHOSEN = 20.0  # times the shortest duration
SHORTER = "(shorter ones may be feasible)"
LONGER_CHOSEN = 1.1  # than the shortest duration, at which almost nothing is left to choose
NEAR = 1.05  # times the longest duration that is proven to be too short
AT_EASE = 10.0  # times the duration with small accelerations: speeds are small too
HALVINGS = 5  # of given speeds: each solves a program
STATES = "initial", "final"


def other_duration(search: Search, scenario: Scenario, left: Durations | None, audit: Audit) -> list[Relaxed]:
    """Return the nearest duration at which a scenario's motion exactly on its path is possible, if one is known.

    Speeds fall with the duration, accelerations with its square; `left` are the durations that the tensions allow, and
    `audit` is this motion's.
    """
    if not scenario.stretches or (left is not None and not left.exist):
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
            between = durations(scenario, audit.times[[audit.violation.argmax()]] / near)
            if left is None or between is None or not between.exist:
                return []
            left = Durations(max(left.shortest, between.shortest), min(left.longest, between.longest), between.at)
            near = min(max(near, LONGER * left.shortest), left.longest / LONGER)
    return []


def slower(excess: Excess) -> float:
    """Return the factor of the duration that brings a power, speed or its derivative to its bound, or 1 for others."""
    if not excess.bound or not excess.value / excess.bound > 1:
        return 1.0
    order = next((order for end, order in ORDERS.items() if excess.unit.endswith(end)), np.inf)
    return (excess.value / excess.bound) ** (1 / order)


def longer_duration(search: Search, audit: Audit) -> list[Relaxed]:
    """Return a longer duration at which the planner finds a motion, if one is found; `audit` is of the closest motion.

    Durations between nearly the longest that is proven to be too short, or what is requested, and `LONGEST_CHOSEN`
    times as much are possible. A motion at ease is found most easily; from there the program with a free duration
    looks for a shorter one.
    """
    scenario, task = search.scenario, search.scenario.task
    if not scenario.stretches or infeasible_ends(scenario.lasting(scenario.longest)) is not None:
        return []
    requested = scenario.duration_range.max if scenario.duration_range is not None else scenario.duration
    shortest, possible = requested, scenario.longest
    if infeasible_ends(scenario.lasting(shortest)) is not None:
        while possible > NEAR * shortest:
            middle = float(np.sqrt(shortest * possible))
            proven = infeasible_ends(scenario.lasting(middle)) is not None
            shortest, possible = (middle, possible) if proven else (shortest, middle)
    longest = min(LONGEST_CHOSEN * shortest, scenario.longest)
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


def _lasting(search: Search, seconds: float) -> Plan | None:
    """Return the plan of the search's task with another duration."""
    longer = with_task(search.scenario, duration=rounded(seconds, up=True))
    return planned(search, longer, "audit, longer duration")


def longer_phases(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the shortest feasible durations of the phases that exceed something, all longer by one factor.

    `audit` says which phases these are. Other phases keep their durations; the motion follows the paths.
    """
    times = [excess.time for excess in audit.excess if excess.time is not None]
    times += audit.times[audit.violation > audit.tolerance].tolist()
    change = longer(scenario, np.array(times)) if scenario.task.phases else None
    return largest_share(search, change)


def longer(scenario: Scenario, times: np.ndarray | None = None) -> Change | None:
    """Return the change of the duration, or of the durations of phases that move, to longer ones by one factor.

    With `times` only the phases in which one of them is become longer.
    """
    path, phases, given = scenario.path, list(scenario.task.phases or ()), dict[str, float]()
    if not phases and scenario.stretches:
        given["duration"] = scenario.duration
    elif phases and isinstance(path, SequencePath) and not scenario.carrier_free:
        for k, (phase, part) in enumerate(zip(scenario.phases.all, path.parts, strict=True)):
            moves = part.path.stretches and not isinstance(part.path, RestPath)
            if moves and (times is None or scenario.phases.within(phase, times).any()):
                given[f"phases[{k}].duration"] = part.seconds
    most = min(max(AT_EASE * at_ease(scenario), LONGEST * scenario.duration), scenario.longest) / scenario.duration
    if not given or most <= 1.0:
        return None
    first, *others = given

    def lasting(share: float) -> Variation:
        seconds = {name: rounded(each * most ** (1 - share), up=True) for name, each in given.items()}
        changed = [
            phase.model_copy(update={"duration": seconds.get(f"phases[{k}].duration", phase.duration)})
            for k, phase in enumerate(phases)
        ]
        varied = with_task(scenario, **({"phases": tuple(changed)} if phases else seconds))
        every = [f"{name} {quantity(seconds[name], 's')}" for name in others]
        return varied, seconds[first], ", ".join([f"instead of {quantity(given[first], 's')}", *every])

    return Change(first, "s", lasting, up=True)


def slower_rate(scenario: Scenario) -> Change | None:
    """Return the change of the feed, angular velocity or times of a path that has its own to a slower one."""
    path, order = scenario.task.path, 1
    if isinstance(path, CirclePath):
        name, unit, given, details = "rate", "rad/s", path.rate, []
    elif isinstance(path, FeedPath):
        name, unit, given = "feed", "m/s", path.feed or max(path.feeds or (0.0,))
        details = ["the others by the same factor"] if path.feed is None else []
    elif isinstance(path, WaypointPath | SamplePath) and path.times is not None and scenario.task.duration is None:
        name, unit, given, order = "times", "s", path.times[-1], -1
        details = [f"for the last point instead of {quantity(given, 's')}", "the others by the same factor"]
    else:
        return None
    least = scenario.duration / scenario.longest  # else it would last too long to be audited

    def at(share: float) -> Variation:
        share = max(share, least)
        data = path.model_dump()  # a copy of the path would keep its law
        for key, power in (("rate", 1), ("drift", 1), ("feed", 1), ("feeds", 1), ("acceleration", 2), ("times", -1)):
            if data.get(key) is not None:
                data[key] = (share**power * np.array(data[key])).tolist()
        push = [f"with an acceleration of {quantity(data['acceleration'], 'm/s^2')}"] if name == "feed" else []
        return along(scenario, type(path).model_validate(data)), share**order * given, ", ".join(details + push)

    return Change(f"path.{name}", unit, at, up=order * given < 0)


def slower_states(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the highest given speed with which a program finds a motion; others change by the same factor."""
    change, low, high, best = _of_states(scenario), 0.0, 1.0, None
    if change is None:
        return []
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        plan = planned(search, change.at(middle)[0], f"audit, other {change.name}")
        low, high, best = (low, middle, best) if plan is None else (middle, high, plan)
    return [] if best is None else [change.offer(low, best)]


def _of_states(scenario: Scenario) -> Change | None:
    """Return the change of the speeds and accelerations of given states to smaller ones, all by one factor."""
    states = {name: getattr(scenario.task, name) for name in STATES}
    given = {
        (name, key): values
        for name, state in states.items()
        for key in ("velocity", "acceleration")
        if (values := getattr(state, key, None)) is not None
    }
    moving = [name for name, key in given if key == "velocity" and np.any(given[name, key])]
    changed = np.any([np.abs(rates) > 0 for rates in given.values()], axis=0)
    if not moving or not set(np.flatnonzero(changed)) <= set(scenario.platform_free):
        return None  # what the path prescribes there cannot change
    velocity = np.array(given[moving[0], "velocity"])
    part, unit = (velocity[:3], "m/s") if velocity[:3].any() else (velocity[3:], "rad/s")
    speed = float(np.linalg.norm(part))

    def at(share: float) -> Variation:
        share = rounded(speed * share, up=False) / speed
        slower = {
            name: state
            and state.model_copy(
                update={key: tuple(share * np.array(given[name, key])) for of, key in given if of == name}
            )
            for name, state in states.items()
        }
        others = "all given speeds and accelerations by the same factor"
        return with_task(scenario, **slower), share * speed, f"instead of {quantity(speed, unit)}; {others}"

    return Change(f"{moving[0]}.velocity", unit, at)
