"""Plan a motion so slow that the robot can stop on its path in time from every instant: `stopping_within`.

`control.stop` computes the stops. If the robot stops too late and the duration is a choice, longer ones are tried:
first longer by as much as the stop is too long, then between one that is too short and one that suffices.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...base.text import quantity
from ...models.part import PositiveRange
from ...models.rigid_load import RigidLoad
from ...models.trajectory import Motion, Trajectory
from ...statics.stop_result import Stop
from ...statics.stops import beginnings, longest_stop_along
from ..audits.audit import audit
from ..audits.excess import Excess
from ..plan import Plan
from ..result import Offers, PlannerStep, Relaxed
from ..tasks.deviation import Deviation
from ..tasks.lay_out import with_task
from ..tasks.paths import TimedPath
from ..tasks.scenario import Scenario
from ..tasks.task import MotionStatus
from .refinement import planned, rounded
from .search import Search

LEAST_PERIOD, INSTANTS = 0.02, 200  # [s], from one stop's beginning to the next one's; and how many at most
ONE_OF = 8  # stops is computed first, where it is enough to know that one takes too long
ROUNDS = 10
LEAST_STEP, LARGEST_STEP = 1.02, 3.0  # times the duration
STEP = 1.5  # the same, where no stop keeps the tension limits
LEAST_SLOPE = 0.25  # of the logarithms: by how much stops get shorter at least as the duration gets longer
AIM = 0.985  # of the time, for stops of the next plan
CLOSE = 1.01  # times the longest duration that is known to be too short
NEAR = 0.97  # of the time: stops that take so long are not made longer
ROUNDING = 1e-9  # of the time
LEAST_SHARE = 0.1  # of the way between two durations


def stopping_within(
    first: Plan, scenario: Scenario, seconds: float, climb: Callable[[Scenario, Deviation | None], Plan]
) -> Plan:
    """Return the plan of a scenario whose stops take at most so many seconds, from the `first` one.

    `climb` plans a scenario from a start. The plan is not feasible if no such one is found.
    """
    span, begun, tried = scenario.duration_range, time.perf_counter(), 0
    best = plan = _judged(first, scenario, seconds, None if span is None else [])
    if plan.feasible:
        return plan
    short, enough = plan, None  # of two durations, the plan that stops too late and the one that stops in time
    shorter: Plan | None = None  # that stops later still
    suspects: list[float] = []  # shares of the durations at which the longest stops of earlier plans begin
    again = False  # whether the last two durations are on the same side
    shortest = 0.0  # of the durations that `climb` finds
    while tried < ROUNDS and span is not None and plan.stop is not None:
        if plan.feasible and plan.stop.duration >= NEAR * seconds:
            break
        suspects.append(plan.stop.begins / plan.duration)
        before, target = plan, min(_between(short, enough or shorter, seconds, again and enough is not None), span.max)
        if (span.max if enough is None else enough.duration) <= CLOSE * short.duration:
            break
        if target < shortest:
            found = _slowed(short, target)
            if found is None:
                break
        else:
            task = scenario.task.model_copy(update={"duration": PositiveRange(min=target, max=span.max)})
            start = None if plan.deviation is None else plan.deviation.stretched(target / plan.duration)
            found = climb(replace(scenario, task=task, duration=target), start)
            shortest = found.duration if found.duration > CLOSE * target else shortest
        plan, tried = _judged(found, scenario, seconds, suspects), tried + 1
        again = plan.feasible == before.feasible
        if plan.feasible:
            best = enough = plan
        else:
            shorter, short = short, plan
    if not best.feasible and span is not None:
        best = _judged(first, scenario, seconds)
    if not tried:
        return best
    said = f"{tried} tried" + f", {quantity(best.duration, 's')} suffices" * best.feasible
    stages = (*first.stages, PlannerStep("slower, to stop in time", said, time.perf_counter() - begun))
    return replace(best, stages=stages)


def _slowed(plan: Plan, target: float) -> Plan | None:
    """Return the motion of a plan with a time law of its own in `target` seconds, with all speeds in proportion.

    None for other plans, and if the audit of the slower motion does not pass.
    """
    path = plan.scenario.path
    if plan.deviation is not None or not isinstance(path, TimedPath) or path.smoothing is not None or path.dwell:
        return None
    speeds = [plan.duration / target * speed for speed in path.speeds]
    scenario = plan.scenario.along(TimedPath.model_validate(dict(path) | {"speeds": speeds}), target)
    audited = audit(scenario, None)
    found = replace(plan, scenario=scenario, status=MotionStatus.FEASIBLE, audit=audited, stop=None)
    return found if audited.passed else None


def _between(short: Plan, other: Plan | None, seconds: float, halfway: bool = False) -> float:
    """Return the next duration to try [s], from the stops of a plan that stops too late and of another.

    They take as long as the motion is fast, or else as the two show. A duration `halfway` between both is tried where
    stops jump, so that what they take does not lead there.
    """
    stops = [
        np.inf if each is None or each.stop is None or not each.stop.feasible else each.stop.duration
        for each in (short, other)
    ]
    if other is None or other.duration < short.duration:
        if not np.isfinite(stops[0]):
            return short.duration * STEP
        slope = 1.0
        if other is not None and stops[0] < stops[1] < np.inf:
            slope = float(np.log(stops[1] / stops[0]) / np.log(short.duration / other.duration))
        step = (stops[0] / (AIM * seconds)) ** (1 / np.clip(slope, LEAST_SLOPE, 1.0))
        return short.duration * float(np.clip(step, LEAST_STEP, LARGEST_STEP))
    known = np.isfinite(stops[0]) and not halfway
    share = np.log(stops[0] / (AIM * seconds)) / np.log(stops[0] / stops[1]) if known else 0.5
    return short.duration * (other.duration / short.duration) ** float(np.clip(share, LEAST_SHARE, 1 - LEAST_SHARE))


def _judged(plan: Plan, scenario: Scenario, seconds: float, suspects: Sequence[float] | None = None) -> Plan:
    """Return a plan as one of the scenario's task, with its longest stop; not feasible if that takes too long.

    With `suspects`, shares of the duration, stops that begin there and some others come first: if one takes too long,
    the rest is not computed.
    """
    plan = replace(plan, scenario=replace(plan.scenario, task=scenario.task))
    if not plan.feasible:
        return replace(plan, offers=partial(_that_stop, plan.offers, seconds))
    begun = time.perf_counter()
    times = beginnings(_trajectory(plan), max(LEAST_PERIOD, plan.duration / INSTANTS))
    times = times[~plan.scenario.phases.resting(times)]  # on the ground the platform is at rest
    if not len(times):
        return plan
    first = np.zeros(len(times), dtype=bool)
    if suspects is not None:
        first[::ONE_OF] = True
        first[[np.abs(times - share * plan.duration).argmin() for share in suspects]] = True
    stops: list[Stop] = []
    for some in (times[first], times[~first]):
        for extreme in (None, *range(plan.scenario.phases.extremes)) if len(some) else ():
            stops.append(longest_stop_along(scenario.robot, _trajectory(plan, extreme), some))
        its = max(stops, key=lambda each: (not each.feasible, each.duration), default=None)
        in_time = its is not None and its.feasible and its.duration <= seconds * (1 + ROUNDING)
        if its is not None and not in_time:
            break
    assert its is not None
    said = f"in at most {quantity(its.duration, 's')}" if its.feasible else "beyond the tension limits"
    stages = (*plan.stages, PlannerStep("stops", said, time.perf_counter() - begun))
    plan = replace(plan, stop=its, stages=stages)
    if in_time:
        return plan
    why = "" if its.certificate is None else f"no stop keeps the tension limits: {its.certificate.describe()}"
    excess = Excess("stop_within", "platform", its.begins, its.duration, seconds, "s", "at most", why)
    status = MotionStatus.INFEASIBLE if scenario.is_fixed else MotionStatus.NOT_FOUND
    audit = replace(plan.audit, excess=[*plan.audit.excess, excess])

    def offers() -> Offers:
        return Offers([*_longer(plan, seconds), *_longer_stop(plan, seconds)])

    return replace(plan, status=status, audit=audit, offers=offers)


def _longer(plan: Plan, seconds: float) -> list[Relaxed]:
    """Return a longer duration with which a motion stops in so many seconds."""
    short, scenario = plan, plan.scenario
    if not scenario.stretches or scenario.duration_range is not None:
        return []
    search = Search(scenario, {}, None)
    for _ in range(ROUNDS):
        lasts = rounded(_between(short, None, seconds), up=True)
        if lasts > scenario.longest or short.stop is None:
            break
        longer = planned(search, with_task(scenario, duration=lasts), "audit, slower, to stop in time")
        if longer is None:
            break
        before, short = (
            short.stop.duration,
            _judged(longer, longer.scenario, seconds, [short.stop.begins / short.duration]),
        )
        if short.feasible:
            return [Relaxed("duration", "s", plan.duration, lasts, short)]
        if short.stop is not None and short.stop.feasible and short.stop.duration >= before:
            break  # the steps of a stop are as short as they can be
    return []


def _longer_stop(plan: Plan, seconds: float) -> list[Relaxed]:
    """Return the shortest `stop_within` that the plan keeps, as an alternative to a limit of so many seconds."""
    if plan.stop is None or not plan.stop.feasible:
        return []
    enough = rounded(plan.stop.duration, up=True)
    task = plan.scenario.task.model_copy(update={"stop_within": enough})
    status, audited = MotionStatus.FEASIBLE, replace(plan.audit, excess=[])
    as_slow = replace(plan, scenario=replace(plan.scenario, task=task), status=status, audit=audited, offers=Offers)
    return [Relaxed("stop_within", "s", seconds, enough, as_slow)]


def _that_stop(offers: Callable[[], Offers], seconds: float) -> Offers:
    """Return the offers whose plans stop in so many seconds, others together with the `stop_within` that they need."""
    made, cut_short = offers()
    found: list[Relaxed] = []
    for plan in {id(offer.plan): offer.plan for offer in made}.values():
        stopping = _judged(plan, plan.scenario, seconds)
        longer = [] if stopping.feasible else _longer_stop(stopping, seconds)
        for offer in made:
            if offer.plan is plan and (stopping.feasible or longer):
                found.append(replace(offer, plan=longer[0].plan if longer else stopping))
        found += longer
    return Offers(found, cut_short)


def _trajectory(plan: Plan, extreme: int | None = None) -> Trajectory:
    """Return the motion of a plan with one of its extreme loads; after the end of the plan the last state is held."""
    scenario, audit = plan.scenario, plan.audit
    columns = audit.tensions.T.copy()  # NumPy would copy each again for each stop

    def at(times: np.ndarray) -> tuple[Motion, Motion]:
        return scenario.motion(np.minimum(times, scenario.duration), plan.deviation)

    def tensions(times: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(times, audit.times, column) for column in columns], axis=1)

    wind = None if scenario.wind is None else np.array(scenario.wind)
    starts = scenario.phases.boundaries[:-1]
    numbers = scenario.phases.loads_at(starts, extreme) if scenario.phases.carry else []
    loads = [
        # Unchecked: the inertia of an extreme load about its own CoM may be impossible for a body.
        RigidLoad.model_construct(mass=row[0], com=tuple(row[1:4]), inertia=tuple(row[4:])) if row[0] else None
        for row in numbers
    ]
    return Trajectory(
        scenario.duration, at, tensions, wind=wind, loads=list(zip(starts.tolist(), loads, strict=bool(loads)))
    )
