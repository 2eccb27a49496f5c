"""Choose durations of phases, and of paths that dwell, from their ranges: `shortest_durations`.

Each is the shortest that is feasible.
"""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from ...base.errors import InputError
from ...base.text import quantity
from ...models.part import PositiveRange
from ..audits.audit import Audit, audit
from ..audits.violation import relative_violation
from ..plan import Plan
from ..proofs.durations import Durations, durations
from ..proofs.infeasible_ends import infeasible_ends
from ..result import PlannerStep
from ..tasks.lay_out import lay_out
from ..tasks.lay_out_phases import LEAST_INSTANTS
from ..tasks.paths import SequencePath
from ..tasks.scenario import AUDIT_RATE, Scenario
from ..tasks.task import MotionStatus, Task
from .time_law import BOUND, audit_of_law, fastest

LEAST = LEAST_INSTANTS / AUDIT_RATE  # [s], that a phase may last
CLOSE = 1e-3  # relative: from the shortest duration that is feasible


class Chosen(NamedTuple):
    """The stage that chose durations, what it proves, and the audit of the motion with them, if it has one."""

    stage: PlannerStep
    proven: bool = True  # whether no motion is feasible if the one with these durations is not
    audit: Audit | None = None

    def judged(self, plan: Plan) -> Plan:
        """Return a plan with these durations, not-found instead of infeasible if they prove nothing."""
        if self.proven or plan.status is not MotionStatus.INFEASIBLE:
            return plan
        reason = "neither the fastest time law nor the path's own is feasible"
        return replace(plan, status=MotionStatus.NOT_FOUND, reason=reason)


def shortest_durations(scenario: Scenario) -> tuple[Scenario, Chosen | None]:
    """Return the scenario with numbers for the ranges of its phases, or for the range of a path that dwells.

    Also return the stage that chose them; None for any other scenario, which is returned as it is.

    Raises `InputError` if a phase has a range although tube or base leave the motion free.
    """
    span = scenario.duration_range
    if span is not None and scenario.path.resting and not scenario.count:
        return _with_dwell(scenario, span)
    return _shortest_phases(scenario)


def _with_dwell(scenario: Scenario, span: PositiveRange) -> tuple[Scenario, Chosen]:
    """Return the scenario with the fastest time law, or else with the path's own law in the least time.

    If ends or path are proven infeasible, that is the longest.
    """
    start, task = time.perf_counter(), scenario.task
    if (proof := infeasible_ends(scenario.lasting(span.max))) is not None:
        stage = PlannerStep("duration with its dwells", proof.describe(), time.perf_counter() - start)
        return scenario.held(span.max), Chosen(stage)
    law, message = fastest(scenario)
    chosen, audited = None, None
    if law is not None and law.law is not None and law.feasible and span.min <= law.duration <= span.max:
        timed = lay_out(scenario.robot, task.model_copy(update={"path": law.law.path, "duration": None}))
        audited = audit_of_law(law, scenario) or audit(timed, None)
        chosen = timed if audited.passed else None
    if chosen is None:
        audited = None
        seconds = _shortest(span, scenario.path.resting, lambda seconds: _beyond(scenario.held(seconds)))
        chosen, message = scenario.held(seconds), f"{quantity(seconds, 's')} with the task's time law"
    too_slow = law is not None and law.feasible and BOUND * law.duration > span.max
    proven = too_slow or (law is not None and law.law is not None and law.law.certificate is not None)
    stage = PlannerStep("duration with its dwells", message, time.perf_counter() - start)
    return chosen, Chosen(stage, proven, audited)


def _shortest_phases(scenario: Scenario) -> tuple[Scenario, Chosen | None]:
    """Return the scenario with a number for each duration of a phase, and the stage that chose them.

    A phase is audited alone, from the shortest duration on that its tensions allow (`durations`), at the durations at
    which its limits seem to be kept (`_shortest`). What its neighbours require of it, such as loads that the ground
    takes up, is only known to the audit of the whole. A phase that is not even feasible at its longest duration keeps
    this, and so do those left when the task's time limit has passed. A scenario without a range of a phase is returned
    as it is.

    Raises `InputError` if a phase has a range although tube or base leave the motion free.
    """
    start, task = time.perf_counter(), scenario.task
    phases = list(task.phases or ())
    ranged = [
        (index, phase.duration) for index, phase in enumerate(phases) if isinstance(phase.duration, PositiveRange)
    ]
    if not ranged:
        return scenario, None
    if scenario.count:
        raise InputError(
            f"task {task.name!r}: phases[{ranged[0][0]}].duration must be a number where tube or base leave the motion "
            "free, got a range"
        )
    message = ""
    assert isinstance(task.path, SequencePath)
    for index, span in ranged:

        def lasting(seconds: float, index: int = index) -> Scenario:
            return lay_out(scenario.robot, _alone(task, index, seconds))

        if time.perf_counter() - start > task.time_limit:
            message, seconds = "time limit", span.max
        else:
            left = _left(lasting(span.max))
            resting = task.path.parts[index].path.resting
            seconds = _shortest(span, resting, lambda seconds: _beyond(lasting(seconds)), left)
        phases[index] = phases[index].model_copy(update={"duration": seconds})
    chosen = lay_out(scenario.robot, task.model_copy(update={"phases": tuple(phases)}))
    message = ", ".join(filter(None, [message, f"motion of {quantity(chosen.duration, 's')}"]))
    return chosen, Chosen(PlannerStep("durations of phases", message, time.perf_counter() - start))


def _shortest(
    of: PositiveRange, resting: float, beyond: Callable[[float], float], left: Durations | None = None
) -> float:
    """Return the shortest feasible duration of a range [s], or its longest if that is not feasible either.

    It is more than the time `resting` [s] for which the path dwells. `beyond` returns by how much a duration exceeds
    its limits, as a share of them. Speeds fall with the rest of the duration and accelerations with its square, so two
    excesses show at which duration the limit is kept. No duration but those that are `left` is feasible, if that is
    known.
    """
    if left is not None and not left.leave(of.min, of.max):
        return of.max
    low = min(max(of.min, LEAST, resting * (1 + CLOSE), 0.0 if left is None else left.shortest), of.max)
    if not (excess := beyond(low)):
        return low
    power, step = 2.0, CLOSE  # first: where the tensions decide, the shortest is near
    while True:
        kept = resting + (1 + excess) ** (1 / power) * (low - resting)
        high = min(max(kept + CLOSE / 2 * low, (1 + step) * low), of.max)
        if not (excess_there := beyond(high)):
            break
        if high == of.max:
            return high
        longer = math.log((high - resting) / (low - resting))
        power = max(1.0, (math.log1p(excess) - math.log1p(excess_there)) / longer)  # also of nan
        low, excess, step = high, excess_there, 4 * step
    middle = high / (1 + CLOSE)
    while high > (1 + CLOSE) * low:
        low, high = (middle, high) if beyond(middle) else (low, middle)
        middle = (low * high) ** 0.5
    return high


def _beyond(scenario: Scenario) -> float:
    """Return by how much a motion of the references alone exceeds its limits, as a share of them."""
    return relative_violation(scenario, audit(scenario, None))


def _left(alone: Scenario) -> Durations | None:
    """Return the durations that the tensions of a phase allow, which is laid out alone; None if they are not known."""
    assert isinstance(alone.path, SequencePath)
    return durations(alone.along(alone.path.parts[0].path, alone.duration))


def _alone(task: Task, index: int, seconds: float) -> Task:
    """Return the task of one phase, with a duration [s]."""
    assert task.phases is not None
    assert isinstance(task.path, SequencePath)
    phase = task.phases[index].model_copy(update={"duration": seconds, "path": task.path.parts[index].path})
    ends = {
        "initial": task.initial if index == 0 else None,
        "final": task.final if index == len(task.phases) - 1 else None,
    }
    return task.model_copy(update={"phases": (phase,), **ends})
