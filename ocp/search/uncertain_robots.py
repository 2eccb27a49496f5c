"""Plan for uncertain geometry: tighten the tension limits by the tension spread until it suffices.

The tensions of a robot with other anchors and attachments differ from the planned ones (`towline.statics.robust`). The
spread depends on the plan, so the planner iterates: plan, compute the largest spread of each cable along the plan,
tighten its limits by this, and plan again from there, until the requested fraction of the robots keeps the limits at
all audited instants. The spread grows with the tensions, so the limits are tightened by a little more.

If it does not suffice, what is offered is what makes the task of tightened limits feasible, a smaller fraction of the
robots, or smaller errors of all.

The tensions of other robots differ from planned ones by changes that are normally distributed, and linear in the
planned ones (`towline.statics.robust`). For a share P of the robots a tension keeps a limit only if it is at least k
standard deviations away from it, k the quantile P of the normal distribution. A standard deviation is a norm, nowhere
below its tangent planes, so a linear program with such planes finds no less distance than there is.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from ...base.text import quantity
from ...models import Robot, Uncertainty
from ...statics.robust import Spread, motion_factor
from ..audits.excess import Excess
from ..audits.robust_margin import RobustMargin, closest_to_limit
from ..audits.tensions import scaled, tolerance_of
from ..plan import Plan
from ..result import Offers, PlannerStep, Relaxed
from ..tasks.deviation import Deviation
from ..tasks.lay_out import lay_out
from ..tasks.scenario import Scenario
from ..tasks.task import MotionStatus, Task

PLACES = 41
PLANES = 10  # rounds in which the tangent planes of all cables are added
TINY = 1e-300  # [N]
ROUNDS = 8  # after the plan for the robot of the file; two suffice as a rule
GROWTH = 1.05  # of what limits are tightened by: the next plan's tensions may be larger
AT_ONCE = 4096  # instants
MOST_OF_CURVE = 2000  # instants for the lengths of the curves
HALVINGS = 3  # of what limits are tightened by, for offers
FEWEST = 50  # [%] of the robots: plans for fewer are not offered
LEAST_ERRORS = 5  # [%] of the given ones: smaller ones are not offered
Climb = Callable[[Scenario, Deviation | None], Plan]
"""Plans a scenario from a start."""


def too_uncertain(scenario: Scenario, share: float) -> list[Excess]:
    """Return the excess at the instant of a fixed motion that is farthest from being possible; [] if none is proven."""
    from scipy.optimize import linprog
    from scipy.special import ndtri

    times = np.linspace(0.0, scenario.duration, PLACES)
    times = times[~scenario.phases.resting(times)]
    if not scenario.is_fixed or scenario.wind_set is not None or not len(times):
        return []
    robot, k, m = scenario.robot, float(ndtri(share)), scenario.robot.m
    platform, carriers = scenario.motion(times, None)
    A = scaled(scenario, scenario.dynamics.wrench_matrix(platform.pose, carriers.pose))
    w = scaled(scenario, scenario.required_wrench(times, platform, carriers, scenario.wind))
    low, high = scenario.bounds_at(times)
    spread, each = Spread(robot, platform.pose, carriers.pose), np.eye(m)
    changes = k * np.stack([spread.changes(np.broadcast_to(one, (len(times), m))) for one in each], axis=-1)
    cost, unit = np.append(np.zeros(m), -1.0), robot.force_scale
    worst, farthest = list[Excess](), -tolerance_of(robot)
    for row, time in enumerate(times.tolist()):
        # Unknown are the tensions, in units of the robot's force, and the least of their distances from the limits.
        rows, bounds = np.zeros((0, m + 1)), np.zeros(0)
        equal, slopes = np.column_stack([A[row], np.zeros(6)]), np.zeros((m, m))
        for _ in range(PLANES if k > 0 else 0):
            planes = np.vstack([slopes - each, slopes + each])
            rows = np.vstack([rows, np.column_stack([planes, np.ones(2 * m)])])
            bounds = np.concatenate([bounds, -low[row] / unit, high[row] / unit])
            found = linprog(cost, rows, bounds, equal, w[row] / unit, (None, None), method="highs")
            if not found.success:
                break
            tensions, distance = found.x[:-1] * unit, float(found.x[-1] * unit)
            change = changes[row] @ tensions  # (m, r)
            reach = np.linalg.norm(change, axis=1)
            if distance < farthest:
                why = f"; whatever the tensions, one is too close to a limit by {quantity(-distance, 'N')} or more"
                worst = [closest_to_limit(time, tensions, reach, low[row], high[row], share, why)]
                farthest = distance
                break
            if (np.minimum(tensions - low[row], high[row] - tensions) - reach).min() >= farthest:
                break
            slopes = np.einsum("mr,mrj->mj", change / np.maximum(reach, TINY)[:, None], changes[row])
    return worst


def for_robots(first: Plan, task: Task, share: float, climb: Climb) -> Plan:
    """Return the plan of a task for a share of the robots.

    The `first` plan counts the robot of the file as exact; where the planner chose its durations, tightened limits need
    others.
    """
    robot = first.scenario.robot
    plan, stages = judged(first, robot, share), list(first.stages)
    if not first.feasible:
        return replace(plan, offers=partial(_for_others, first, task, share, climb))
    spent = np.array([first.build_s, first.solve_s])
    tightened, kept, reason, tried = np.zeros(robot.m), np.zeros(robot.m), "", [first]
    for _ in range(ROUNDS):
        if plan.robust is None or plan.robust.holds:
            break
        tightened = np.maximum(tightened, GROWTH * plan.robust.reach.max(axis=0))
        narrow = np.flatnonzero(_narrow(robot, tightened, task))
        if narrow.size:
            reason = f"the tension spread exceeds the range of the tension limits of cable {narrow[0] + 1}"
            break
        again = climb(lay_out(_tightened(robot, tightened), task), plan.deviation)
        if not again.feasible and first.scenario.duration_range is not None:
            # A fast motion's tensions spread more than those of the slower motion to which tightened limits lead.
            tightened = (tightened + kept) / 2
            again = climb(lay_out(_tightened(robot, tightened), task), plan.deviation)
        tried.append(again)
        cable = int(np.argmax(tightened))
        by = f"limits tightened by up to {quantity(tightened[cable], 'N')} (cable {cable + 1})"
        stages += [PlannerStep(f"for {quantity(100 * share, '%')} of the robots", by, 0.0), *again.stages]
        spent += again.build_s, again.solve_s
        if not again.feasible:
            reason = f"no motion was found with {by}"
            break
        plan, kept = judged(again, robot, share), tightened
    else:
        reason = f"the tension spread is still too large after {ROUNDS} rounds"
    plan = replace(plan, stages=tuple(stages), build_s=float(spent[0]), solve_s=float(spent[1]))
    if plan.robust is None or plan.robust.holds:
        return plan
    plan = replace(plan, reason=reason, offers=partial(_near, robot, task, share, climb, tried, tightened))
    if proven := too_uncertain(first.scenario, share):
        audit = replace(plan.audit, excess=proven)
        return replace(plan, status=MotionStatus.INFEASIBLE, reason="", audit=audit)
    return plan


def _near(robot: Robot, task: Task, share: float, climb: Climb, tried: list[Plan], tightened: np.ndarray) -> Offers:
    """Return what makes a task feasible for the robots: what tightened limits need, fewer robots, or smaller errors.

    The latter two are those that one of the `tried` plans allows, or one for limits that are tightened by a part of
    (m,) [N].
    """
    made = Offers() if tried[-1].feasible else _that_hold(tried[-1], robot, share)
    found = [*made.found]
    plans, low, high = [plan for plan in tried if plan.feasible], 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        by = middle * tightened
        again = None if _narrow(robot, by, task).any() else climb(lay_out(_tightened(robot, by), task), None)
        if again is not None and again.feasible:
            plans.append(again)
            low = middle
        else:
            high = middle
    if most := _most(plans, lambda plan, part: judged(plan, robot, part), FEWEST, int(np.ceil(round(100 * share, 6)))):
        found.append(Relaxed("robust", "", share, *most))
    if most := _most(plans, lambda plan, part: judged(plan, _surer(robot, part), share), LEAST_ERRORS, 100):
        found.append(Relaxed("uncertainty", "", 1.0, *most, "of its standard deviations"))
    return Offers(found, made.cut_short)


def _most(
    plans: list[Plan], judge: Callable[[Plan, float], Plan], least: int, beyond: int
) -> tuple[float, Plan] | None:
    """Return the largest fraction, in per cent from `least` to less than `beyond`, with which a plan is feasible."""
    best: tuple[float, Plan] | None = None
    low = least - 1
    for plan in plans:
        high = beyond
        while high - low > 1:
            middle = (low + high) // 2
            held = judge(plan, middle / 100)
            low, high = (middle, high) if held.feasible else (low, middle)
            best = (middle / 100, held) if held.feasible else best
    return best


def _for_others(first: Plan, task: Task, share: float, climb: Climb) -> Offers:
    """Return what makes a task feasible for the robots that is not even so for the robot of the file.

    It is what the file's robot needs, if that suffices with tightened limits, or else what these limits need.
    """
    robot, plans = first.scenario.robot, {id(offer.plan): offer.plan for offer in first.relaxations}
    held = {key: for_robots(plan, plan.scenario.task, share, climb) for key, plan in plans.items()}
    found = [replace(offer, plan=held[id(offer.plan)]) for offer in first.relaxations]
    found = [offer for offer in found if offer.plan.feasible]
    spread = next((GROWTH * plan.robust.reach.max(axis=0) for plan in held.values() if plan.robust is not None), None)
    if found or spread is None or _narrow(robot, spread, task).any():
        return Offers(found, first.cut_short)
    return _that_hold(climb(lay_out(_tightened(robot, spread), task), None), robot, share)


def _that_hold(plan: Plan, robot: Robot, share: float) -> Offers:
    """Return the offers of a plan for tightened limits that suffice for a share of the robots."""
    limited, found = plan.scenario.robot.cables, list[Relaxed]()
    for offer in plan.relaxations:
        its = offer.plan.scenario.robot
        if its.cables != limited:  # what the cables would need without tightened limits is another number
            continue
        held = judged(offer.plan, its.model_copy(update={"cables": robot.cables}), share)
        found += [replace(offer, plan=held)] if held.feasible else []
    return Offers(found, plan.cut_short)


def judged(plan: Plan, robot: Robot, share: float) -> Plan:
    """Return a plan of the robot with tightened limits as one of `robot` itself; not feasible if the share is less."""
    scenario, audit = plan.scenario, plan.audit
    tightened = scenario.robot.t_min - robot.t_min
    task = scenario.task.model_copy(update={"robust": share})
    own = lay_out(robot, task)
    scenario = replace(scenario, robot=robot, task=task, dynamics=own.dynamics, limits=own.limits, tightened=tightened)
    plan = replace(plan, scenario=scenario, offers=Offers)
    if not np.isfinite(audit.tensions).all():
        return plan
    margin = _margin(scenario, plan, share)
    plan = replace(plan, robust=margin)
    if margin.holds:
        return plan
    audit = replace(audit, excess=[*audit.excess, _excess(scenario, plan, margin)])
    status = MotionStatus.NOT_FOUND if plan.feasible else plan.status
    return replace(plan, status=status, audit=audit)


def _margin(scenario: Scenario, plan: Plan, share: float) -> RobustMargin:
    robot, audit = scenario.robot, plan.audit
    n = len(audit.times)
    some = np.unique(np.linspace(0, n - 1, min(n, MOST_OF_CURVE)).round().astype(int))
    curve, sigmas = [], np.empty((n, robot.m))
    for start in range(0, n, AT_ONCE):
        part = slice(start, min(start + AT_ONCE, n))
        changes = Spread(robot, audit.motion.pose[part], audit.carriers.pose[part]).changes(audit.tensions[part])
        sigmas[part] = np.linalg.norm(changes, axis=2)
        curve.append(changes[some[(some >= part.start) & (some < part.stop)] - start])
    factor = motion_factor(np.concatenate(curve), share)
    reach = factor * sigmas
    low, high = _limits(scenario, audit.times)
    outside = np.maximum(low + reach - audit.tensions, audit.tensions + reach - high)
    tightened, violation = np.zeros(robot.m) + scenario.tightened, np.maximum(outside, 0.0)
    return RobustMargin(share, factor, reach, tightened, violation, tolerance_of(robot))


def _limits(scenario: Scenario, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the limits of the robot less the task's margin, not tightened, (n, m) and (m,) [N]."""
    return scenario.t_min_at(times) + scenario.hard_margin, scenario.robot.t_max - scenario.hard_margin


def _excess(scenario: Scenario, plan: Plan, margin: RobustMargin) -> Excess:
    """Return the largest excess of a tension with its spread."""
    row, audit = int(margin.violation.max(axis=1).argmax()), plan.audit
    low, high = _limits(scenario, audit.times)
    return closest_to_limit(audit.times[row], audit.tensions[row], margin.reach[row], low[row], high, margin.share)


def _narrow(robot: Robot, by: np.ndarray, task: Task) -> np.ndarray:
    """Return for which cables nothing is left between limits that are tightened by (m,) [N], less the margin."""
    return robot.t_min + by + task.margin > robot.t_max - by - task.margin


def _surer(robot: Robot, part: float) -> Robot:
    """Return the robot whose errors have so much of their standard deviations."""
    given = robot.uncertainty
    assert given is not None
    surer = Uncertainty(parameters=given.parameters, covariance=tuple(map(tuple, part**2 * given.matrix)))
    return robot.model_copy(update={"uncertainty": surer})


def _tightened(robot: Robot, by: np.ndarray) -> Robot:
    """Return the robot with tension limits that are tightened by (m,) [N]."""
    cables = zip(robot.cables, (robot.t_min + by).tolist(), (robot.t_max - by).tolist(), strict=True)
    new = [cable.model_copy(update={"t_min": low, "t_max": high}) for cable, low, high in cables]
    return robot.model_copy(update={"cables": tuple(new)})
