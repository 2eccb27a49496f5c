"""What may help a plan for which no feasible change was found: `ideas`, rows of its report.

None of them is planned, unlike relaxations. If there is a relaxation, positions inside the frame are left out.
"""

import numpy as np

from ...base.display import Fact
from ...base.text import quantity, quantity_row
from ...models.carriers import TILT
from ..audits.excess import TENSIONS, Excess
from ..proofs.too_heavy import OF_WEIGHT, too_heavy
from ..result import PlanData
from ..tasks.scenario import ATTITUDE
from ..tasks.wind_set import WindBox, WindDisc
from ..warnings.long_turns import OTHER_WAY
from ..warnings.outside_frame import LEAVES
from ..warnings.slipped_units import READS

TO_MOVE = 1.5  # times what carries the weight: tilted thrust and acceleration need more
FELT = 0.02  # of the weight: a wind with less force is hardly why tensions are missing


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
