"""Why a plan is as it is: reasons, facts and ideas, as rows of its report.

None of them is planned, unlike relaxations. If there is a relaxation, positions inside the frame are left out.
"""

import numpy as np

from ...base.display import Fact
from ...base.text import counted, numbered, quantity, quantity_range, quantity_row
from ...models.carriers import TILT
from ...models.part import Vector3
from ...solvers import Certificate
from ..audits.excess import TENSIONS, Excess
from ..proofs.too_heavy import OF_WEIGHT, too_heavy
from ..result import PlanData
from ..tasks.paths import FeedPath, TimedPath
from ..tasks.scenario import ATTITUDE
from ..tasks.task import Task
from ..tasks.wind_set import WindBox, WindDisc
from ..warnings.positions import LEAVES
from ..warnings.values import OTHER_WAY, READS

CLOSE = 1e-3  # relative difference of a duration from the shortest allowed
NEARLY_ALL = 0.9  # of the cost of a plan: from here on a minimum of the cost is one of the time
LOADS = "any within their tolerances; the tensions shown are those with the loads as given"
LEVEL = 1e-3  # [rad]: of a smaller attitude nothing is said
TO_MOVE = 1.5  # times what carries the weight: tilted thrust and acceleration need more
FELT = 0.02  # of the weight: a wind with less force is hardly why tensions are missing


def motion_facts(plan: PlanData) -> list[Fact]:
    """Return the facts of the platform's motion."""
    task, audit = plan.scenario.task, plan.audit
    speed, acceleration = (
        np.linalg.norm(part[:, :3], axis=1).max() for part in (audit.motion.velocity, audit.motion.acceleration)
    )
    kind = counted(len(plan.phases), "phase") if plan.phases else task.path.kind
    path, law = plan.scenario.path, ""
    if isinstance(task.path, TimedPath):
        kind, law = task.path.along.kind, ", with its own time law" if plan.law is None else ""
    if plan.law is not None and plan.feasible:
        law = ", with the fastest time law"
    if isinstance(path, TimedPath) and path is not task.path:
        law = ", with the fastest time law" if path.smoothing is None else ", in a tube about its fastest time law"
    facts = [
        ("duration", quantity(plan.scenario.duration, "s", digits=6) + ("" if law else _chosen(plan))),
        ("path", f"{kind} in {'{G}' if task.path.frame == 'world' else task.path.frame}{law}"),
    ]
    if isinstance(task.path, FeedPath):
        facts.append(("feed", task.path.steadiness()))
        facts += [("ignored words", ", ".join(task.path.ignored))] if task.path.ignored else []
    facts += _accuracy(plan)
    if speed > 0:
        moves = f"up to {quantity(speed, 'm/s')} and {quantity(acceleration, 'm/s^2')}"
    else:
        moves = "turns about the origin of its frame" if audit.motion.velocity.any() else "at rest"
    facts.append(("platform", moves))
    if plan.scenario.phases.extremes:
        facts.append(("loads", LOADS))
    if (stop := plan.stop) is not None:
        worst = f"from t = {stop.begins:.3f} s, over {quantity(stop.distance, 'm')}"
        facts.append(("stops", f"in at most {quantity(stop.duration, 's')} ({worst})"))
    if task.wind is not None:
        facts.append(("wind", _task_wind(task)))
    return facts


def _chosen(plan: PlanData) -> str:
    """Return why a duration that the planner chose is not the shortest: time costs nothing, or not all."""
    span, amount, seconds = plan.scenario.duration_range, plan.scenario.task.objective.time, plan.scenario.duration
    if not plan.feasible or span is None or seconds <= span.min * (1 + CLOSE):
        return ""
    if amount is None:
        return ", which has the lowest cost; to make time add to the cost, set `objective: {time: 1}`"
    share = seconds / amount / plan.objective if plan.objective else 1.0
    if not 0 < share < NEARLY_ALL:  # a reward for margin makes the whole less than its parts
        return ""
    its = quantity(100 * share, "%", 2)
    return f", which has the lowest cost, {its} of it due to time; for a shorter duration, lower `objective.time`"


def _accuracy(plan: PlanData) -> list[Fact]:
    """Return the distance from the path, and that from its waypoints, which the path itself may round."""
    audit, from_waypoints = plan.audit, plan.waypoint_distance
    error = millimetres(plan.tracking_error_max)
    worst = f" at most, at t = {audit.times[int(audit.tracking_error.argmax())]:.3f} s" * (not error.startswith("0 "))
    if from_waypoints is None:
        return [("tracking error", f"{error}{worst}")]
    return [("tracking error", f"{error} from the path{worst}"), ("waypoints", from_waypoints.describe())]


def millimetres(metres: float) -> str:
    """Return a length in millimetres; less than a nanometre is rounding."""
    return quantity(0.0 if metres < 1e-9 else metres * 1e3, "mm")


def wind(velocity: Vector3) -> str:
    """Return a velocity of the wind [m/s]."""
    return f"({quantity_row(velocity)}) m/s"


def _task_wind(task: Task) -> str:
    """Return the task's wind, or its set of winds and the wind of the planned tensions."""
    if isinstance(task.wind, WindDisc):
        most = quantity(task.wind.speed, "m/s")
        return f"any horizontal one up to {most}; the tensions shown are those in still air"
    if isinstance(task.wind, WindBox):
        box = task.wind
        return f"any from {wind(box.min)} to {wind(box.max)}; the tensions shown are those in {wind(box.middle)}"
    return "" if task.wind is None else wind(task.wind)


def reasons(plan: PlanData) -> list[Fact]:
    """Return what the motion of an infeasible plan violates, and where; empty for a feasible one."""
    if plan.feasible:
        return []
    facts: list[Fact] = []
    if plan.law is not None and not plan.law.exists:
        place = f"s = {plan.law.at:.4g} of the path (0 at its start, 1 at its end)"
        if plan.law.certificate is None:
            facts.append(("search ended at", place))
        else:
            facts.append(("worst position", f"{place}, where no time law is feasible"))
        facts.append(
            ("motion", f"the path, shown by a motion of {quantity(plan.duration, 's')} without a feasible time law")
        )
    if (certificate := plan.certificate) is not None:
        text, phase = certificate.text(up(plan)), in_phase(plan, certificate.time)
        facts += [
            *([("cause", cause)] if (cause := _cause(plan, certificate)) else []),
            ("time", f"t = {certificate.time:.3f} s of {quantity(plan.scenario.duration, 's')}{phase}"),
            ("pose", _pose_then(plan, certificate.time)),
            *([("wind", wind(certificate.wind))] if certificate.wind is not None else []),
            *([("load", certificate.load_text)] if certificate.load is not None else []),
            ("direction", text.along),
            ("needed", text.needed),
            ("available", text.available),
            ("short by", text.short_by),
            ("limits", _bounds(plan, certificate) or text.limits),
        ]
    facts += [("limit exceeded", f"{excess}{in_phase(plan, excess.time)}") for excess in exceeded(plan)]
    return facts


def exceeded(plan: PlanData) -> list[Excess]:
    """Return the limits that a motion exceeds; a certificate says more than a wrench error."""
    return [each for each in plan.audit.excess if plan.certificate is None or each.limit != TENSIONS]


def _cause(plan: PlanData, certificate: Certificate) -> str:
    """Return in a sentence where the platform is and which tensions would help; empty where no cable pulls."""
    scenario, time = plan.scenario, certificate.time
    low, high = scenario.bounds_in(None if time is None else scenario.phases.at(time))
    ways = [
        f"{_one_of(cables, scenario.robot.m)} would have to go {way} {quantity_range(bound[cables], 'N')}"
        for way, cables, bound in (("below", certificate.at_min, low), ("above", certificate.at_max, high))
        if cables.size
    ]
    nothing = f"no cable pulls along {certificate.text(up(plan)).along.partition('; ')[0]}"
    return f"at {_pose_then(plan, time)}, {', or '.join(ways) or nothing}"


def _one_of(cables: np.ndarray, m: int) -> str:
    """Return "cable 3", "cable 3 or 5", "one of cables 1, 3, 4" or "one of the cables"."""
    numbers = [str(k + 1) for k in cables]
    if len(numbers) < 3:
        return f"cable {' or '.join(numbers)}"
    return "one of the cables" if len(numbers) == m else f"one of cables {', '.join(numbers)}"


def _pose_then(plan: PlanData, time: float | None) -> str:
    """Return where the platform is at a time, and its attitude if it is not level."""
    row = int(np.argmin(np.abs(plan.audit.times - (0.0 if time is None else time))))
    pose = plan.audit.motion.pose[row]
    place = f"({', '.join(f'{value + 0.0:.4g}' for value in np.round(pose[:3], 6))}) m"
    turned = ", ".join(f"{np.rad2deg(value) + 0.0:.3g}" for value in np.round(pose[3:], 6))
    return place if np.abs(pose[3:]).max() < LEVEL else f"{place}, roll, pitch, yaw ({turned}) degrees"


def _bounds(plan: PlanData, certificate: Certificate) -> str:
    """Return the tension limits of a certificate with their values; empty if no cable pulls along it."""
    scenario, time = plan.scenario, certificate.time
    low, high = scenario.bounds_in(None if time is None else scenario.phases.at(time))
    limits = [
        f"{name} of {numbered('cable', cables)} ({quantity_row(np.unique(bound[cables]), 'N')})"
        for name, cables, bound in (("t_min", certificate.at_min, low), ("t_max", certificate.at_max, high))
        if cables.size
    ]
    margin = plan.scenario.hard_margin
    return "; ".join(limits) + (f", with a margin of {quantity(margin, 'N')}" if limits and margin else "")


def in_phase(plan: PlanData, time: float | None) -> str:
    """Return the phase of a time, to follow it; empty for a task without phases."""
    phase = None if time is None else plan.scenario.phases.at(time)
    return "" if phase is None else f" in phase {phase.name!r}"


def up(plan: PlanData) -> np.ndarray:
    """Return the direction against gravity in {G}, (3,)."""
    return -np.array(plan.scenario.robot.gravity)


def ideas(plan: PlanData) -> list[Fact]:
    """Return what may help, the most likely first; empty for a feasible plan, or if nothing is known to."""
    robot = plan.scenario.robot
    if plan.feasible:
        return []
    more = [("more", "other changes may be feasible: the search for changes was cut short")] * plan.cut_short
    found = [*_directions(plan), *_carriers(plan), *_strength(plan), *_wind(plan)]
    if plan.relaxations:
        return found + more
    found += _frame(plan)
    tried = "shorter line, weaker wind, lighter platform or load, stronger cables or lower t_min"
    nothing = [("no single change", f"of those tried makes it feasible: no duration, limit, {tried}")]
    if plan.certificate is not None and plan.certificate.singular and robot.m >= len(robot.platform.dof):
        nothing.append(
            ("another geometry", "cables that cross, or `platform.dof` with only what the cables can control")
        )
    return found + more or (nothing if _lacks_tensions(plan) and not units(plan) else [])


def _lacks_tensions(plan: PlanData) -> bool:
    """Return whether tensions are missing: at an instant, or proven so in every attitude at an end."""
    return plan.certificate is not None or any(excess.limit == TENSIONS for excess in plan.audit.excess)


def units(plan: PlanData) -> list[Fact]:
    """Return the numbers of an infeasible task that seem to be in another unit; these come before all else."""
    if plan.feasible:
        return []
    return [("other units", sentence) for sentence in plan.warnings if READS in sentence]


def _directions(plan: PlanData) -> list[Fact]:
    """Return the shorter ways of lines to their attitudes, and which coordinates must not change without `dof`."""
    shorter = [("another path", sentence) for sentence in plan.warnings if OTHER_WAY in sentence]
    names = [excess.about.removeprefix("platform ") for excess in plan.audit.excess if excess.limit == "dof"]
    them = ", ".join(names)
    kept = [("another path", f"one that leaves {them} as at home: `platform.dof` does not contain {them}")]
    return shorter + kept * bool(names)


def _carriers(plan: PlanData) -> list[Fact]:
    """Suggest moving carriers, or else a tilting platform, if the task forbids them and no tensions exist."""
    robot, task = plan.scenario.robot, plan.scenario.task
    if not _lacks_tensions(plan) or _too_weak(plan):
        return []
    if _holds(plan):
        return [("moving carriers", "`base: {kind: free}`: the planner then chooses how the carriers move")]
    if task.base.kind == "free" and not task.tube.turn and robot.dof_mask[ATTITUDE].any():
        turn = "tilt" if robot.dof_mask[list(TILT)].any() else "turn"
        then = f"the platform may then {turn} by 0.2 rad as it accelerates"
        return [(f"a {turn}ing platform", f"`tube: {{attitude: 0.2}}`: {then}")]
    return []


def _holds(plan: PlanData) -> bool:
    """Return whether the task holds carriers that could move."""
    robot = plan.scenario.robot
    return plan.scenario.task.base.kind == "hold" and any(each.free_coordinates(robot.drive) for each in robot.carriers)


def _too_weak(plan: PlanData) -> list[Excess]:
    """Return the limits that are too small for the weight, even if carriers that the task holds moved."""
    audit = plan.audit
    if not _holds(plan):
        return [excess for excess in audit.excess if excess.limit in OF_WEIGHT]
    ends = [(audit.motion.velocity[k], *audit.carriers.velocity[k]) for k in (0, -1)]
    return list(too_heavy(plan.scenario, np.array([[not part.any() for part in end] for end in ends])))


def _strength(plan: PlanData) -> list[Fact]:
    """Return how much stronger what is too weak for the weight must be."""
    facts = []
    for excess in _too_weak(plan):
        least = excess.bound / excess.value
        larger, enough = (quantity(times, digits=3) for times in (TO_MOVE * least, least))
        why = f"{enough} times would carry the weight at rest, but tilt and acceleration need more"
        facts.append((f"a larger {excess.limit}", f"{larger} times as large; {why}"))
    return facts


def _wind(plan: PlanData) -> list[Fact]:
    """Return the force of a task's wind on the platform at rest, if tensions are missing and it is not negligible."""
    wind, scenario = plan.scenario.task.wind, plan.scenario
    if wind is None or isinstance(wind, WindBox | WindDisc) or not _lacks_tensions(plan):
        return []
    home, still = scenario.robot.home, np.zeros(6)
    force = float(np.linalg.norm(scenario.dynamics.aerodynamic_wrench(home, still, wind=np.array(wind))[:3]))
    if force < FELT * scenario.robot.weight:
        return []
    half = quantity_row(np.array(wind) / 2)
    pushes = f"{quantity(force, 'N')} on a platform that weighs {quantity(scenario.robot.weight, 'N')}"
    return [("a weaker wind", f"this one exerts {pushes}; ({half}) m/s exerts a quarter of that")]


def _frame(plan: PlanData) -> list[Fact]:
    """Return where the platform leaves the robot's frame, if no number is in another unit."""
    outside = [sentence for sentence in plan.warnings if sentence.startswith(LEAVES)]
    if not outside or units(plan):
        return []
    return [("a path inside the frame", f"now {outside[0].partition(':')[2].partition(';')[0].strip()}")]
