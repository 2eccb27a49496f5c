"""Plan random tasks of several families, and check what each plan claims.

    python -m tests.soak tasks [--start 0] [--count 200] [--only rack,...]

A family and a seed determine a task (`random_families`). A feasible plan must have tensions inside their limits that
give the force, by equations that are written here again, and keep its platform outside every ball and box. An
infeasible plan must have a certificate, which is verified again, or a limit that the task itself exceeds. Plans of
status "not-found" are counted, and must state why; more than 2 % of them are too many.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from towline.base.errors import TowlineError
from towline.ocp import MotionStatus, Plan, plan
from towline.statics.distribution import wrench_problem

from .random_families import random_task
from .recheck import rechecked

MOST_NOT_FOUND = 0.02
AUDIT_RATE = 1000.0  # [1/s], of the saved motion
DIFFERENCES = 5e-5  # of the weight: what second differences over a millisecond miss where the jerk jumps


class Outcome(NamedTuple):
    """Hold the result of one task."""

    family: str
    seed: int
    robot: str
    result: str  # a `MotionStatus`, or "wrong: ..." with the reason
    reason: str
    seconds: float  # of processor time


def soak(start: int, count: int, families: Sequence[str]) -> bool:
    """Plan `count` tasks, of each family in turn, print a summary, and return whether all is well."""
    outcomes = []
    for number in range(count):
        family = families[number % len(families)]
        outcomes.append(last := attempt(family, start + number // len(families)))
        if last.result not in (MotionStatus.FEASIBLE, MotionStatus.INFEASIBLE):
            of = f"{family}, seed {last.seed}, {last.robot}"
            print(f"{of}: {last.result}, {last.reason} ({last.seconds:.1f} s)", flush=True)
    for family in families:
        mine = [outcome for outcome in outcomes if outcome.family == family]
        if mine:
            print(f"{family:9} {_summary(mine)}")
    print(f"{'all':9} {_summary(outcomes)}")
    counts = _counts(outcomes)
    return counts["wrong"] == 0 and counts[MotionStatus.NOT_FOUND] <= MOST_NOT_FOUND * len(outcomes)


def _counts(outcomes: list[Outcome]) -> Counter[str]:
    return Counter(outcome.result.split(":")[0] for outcome in outcomes)


def _summary(outcomes: list[Outcome]) -> str:
    """Return counts, and median, 95 % and largest processor time."""
    times = np.array([outcome.seconds for outcome in outcomes])
    slowest = max(outcomes, key=lambda outcome: outcome.seconds)
    counts = ", ".join(f"{count} {name}" for name, count in sorted(_counts(outcomes).items()))
    spread = f"median {np.median(times):.2f} s, 95 % {np.quantile(times, 0.95):.2f} s"
    return f"{counts}; {spread}, longest {slowest.seconds:.1f} s (seed {slowest.seed}, {slowest.robot})"


def attempt(family: str, seed: int) -> Outcome:
    """Plan a task and check what the plan claims."""
    robot, task = random_task(family, seed)
    start, reason = time.process_time(), ""
    try:
        planned = plan(robot, task.model_copy(update={"output_rate": AUDIT_RATE}))
        seconds = time.process_time() - start
        result, reason = wrong(planned) or planned.status.value, planned.reason
    except TowlineError as error:
        result, seconds = f"wrong: {error}", time.process_time() - start
    return Outcome(family, seed, robot.name, result, reason, seconds)


def wrong(planned: Plan) -> str:
    """Return which claim of a plan is not true, "wrong: ..."; empty if all are."""
    audit, robot = planned.audit, planned.scenario.robot
    low, high = robot.t_min, robot.t_max
    if planned.status is MotionStatus.FEASIBLE:
        tensions = audit.tensions
        if not ((tensions >= low) & (tensions <= high)).all():
            return "wrong: feasible, but a tension is beyond its limits"
        A = planned.scenario.dynamics.wrench_matrix(audit.motion.pose, audit.carriers.pose)
        w = planned.scenario.dynamics.required_wrench(*audit.motion, *audit.carriers, wind=planned.scenario.wind)
        load, known, ground = _carried(planned)
        short = ((np.einsum("nij,nj->ni", A, tensions) - w - load) * robot.dof_mask)[known, :3]
        short[ground[known], 2] = np.maximum(short[ground[known], 2], 0.0)
        tolerance = DIFFERENCES * robot.force_scale if load.any() else 1e-6
        if np.linalg.norm(short, axis=1).max() > max(audit.tolerance, tolerance):
            return "wrong: feasible, but the tensions do not give the force"
        if audit.excess:
            return "wrong: feasible, but a limit is exceeded"
        found = rechecked(planned.trajectory, audit.tolerance)
        return f"wrong: feasible, but {'; '.join(found)}" if found else ""
    if planned.status is MotionStatus.INFEASIBLE and not audit.excess:
        certificate = planned.certificate
        if certificate is None or certificate.time is None:
            return "wrong: infeasible, but nothing proves it"
        row = int(np.argmin(np.abs(audit.times - certificate.time)))
        platform, carriers = audit.motion, audit.carriers
        if not planned.scenario.task.phases:  # the worst time may lie between two instants
            platform, carriers = planned.scenario.motion(np.array([certificate.time]), planned.deviation)
            row = 0
        motions = [part[row] for part in (*platform, *carriers)]
        A = planned.scenario.dynamics.wrench_matrix(motions[0], motions[3])
        wind = certificate.wind or planned.scenario.wind
        w = planned.scenario.dynamics.required_wrench(*motions, wind=wind)
        load, known, ground = _carried(planned)
        if ground[row] or not known[row]:
            return ""
        if not planned.scenario.task.phases:
            proves = certificate.verify(wrench_problem(robot, A, w, *planned.scenario.bounds()))
        else:  # to what the differences are accurate to
            pull, direction = A.T @ certificate.direction, np.array(certificate.direction)
            proves = direction @ (w + load[row]) > np.maximum(pull * low, pull * high).sum()
        return "" if proves else "wrong: infeasible, but its certificate proves nothing"
    if planned.status is MotionStatus.NOT_FOUND and not planned.reason:
        return "wrong: not found, but no reason is stated"
    return ""


def _carried(planned: Plan) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what loads need beside the platform (n, 6), where that is known, and where the ground bears them, (n,).

    The acceleration of a load is a difference of its positions, which needs instants of the same phase around it.
    """
    times, pose, task = planned.audit.times, planned.audit.motion.pose, planned.scenario.task
    turned = Rotation.from_euler("ZYX", pose[:, 5:2:-1]).as_matrix()
    robot = planned.scenario.robot
    wrench, known, ground = np.zeros((len(times), 6)), np.ones(len(times), bool), np.zeros(len(times), bool)
    for phase, laid in zip(task.phases or (), planned.scenario.phases.all, strict=True):
        begin, end = laid.start, laid.end
        inside = np.flatnonzero((times > begin) & (times < end))
        known[(times >= begin) & (times <= end)] = False
        known[inside[2:-2]] = True
        ground[(times >= begin) & (times <= end)] |= phase.ground is not None
        if phase.load is None:
            continue
        where = pose[inside, :3] + turned[inside] @ np.array(phase.load.com)
        speed = np.gradient(where, times[inside], axis=0)
        force = phase.load.mass * (np.gradient(speed, times[inside], axis=0) - np.array(robot.gravity))
        arm = turned[inside] @ (np.array(phase.load.com) - np.array(robot.platform.com))
        wrench[inside] = np.hstack([force, np.cross(arm, force)])
    return wrench, known, ground
