"""Changes to a slower motion: longer durations, of the whole or of phases, a smaller feed, slower given states."""

import numpy as np

from ...base.text import quantity
from ..audits.audit import Audit
from ..result import Relaxed
from ..tasks.lay_out import with_task
from ..tasks.paths import CirclePath, FeedPath, RestPath, SequencePath
from ..tasks.scenario import Scenario
from .largest_share import Change, Variation, along, largest_share
from .relaxations import LONGEST, at_ease, planned, rounded
from .search import Search

AT_EASE = 10.0  # times the duration with small accelerations: speeds are small too
HALVINGS = 5  # of given speeds: each solves a program
STATES = "initial", "final"


def longer_phases(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the shortest feasible durations of the phases that exceed something, all longer by one factor.

    `audit` says which phases these are. Other phases keep their durations; the motion is that of the paths.
    """
    times = [excess.time for excess in audit.excess if excess.time is not None]
    times += audit.times[audit.violation > audit.tolerance].tolist()
    change = longer(scenario, np.array(times)) if scenario.task.phases else None
    return largest_share(search, change, rates=True)


def longer(scenario: Scenario, times: np.ndarray | None = None) -> Change | None:
    """Return the change of the duration, or those of the phases that move, to longer ones by one factor.

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
    """Return the change of the feed or angular velocity of a path that has its own to a smaller one."""
    path = scenario.task.path
    if not isinstance(path, FeedPath | CirclePath):
        return None
    fed = isinstance(path, FeedPath)
    fastest = path.rate if isinstance(path, CirclePath) else path.feed or max(path.feeds or (0.0,))
    others = ", the others by the same factor" if fed and path.feed is None else ""
    least = scenario.duration / scenario.longest  # else it would last too long to be audited

    def at(share: float) -> Variation:
        share = max(share, least)
        data = path.model_dump()  # a copy of the path would keep its law
        for name, power in (("rate", 1), ("drift", 1), ("feed", 1), ("feeds", 1), ("acceleration", 2)):
            if data.get(name) is not None:
                data[name] = (share**power * np.array(data[name])).tolist()
        push = f"{others}, with an acceleration of {quantity(data['acceleration'], 'm/s^2')}" if fed else ""
        return along(scenario, type(path).model_validate(data)), share * fastest, push.removeprefix(", ")

    name, unit = ("path.feed", "m/s") if fed else ("path.rate", "rad/s")
    return Change(name, unit, at, up=fastest < 0)


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
