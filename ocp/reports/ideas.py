"""What may help a plan for which no feasible change was found: `ideas`, rows of its report.

None of them is planned, unlike relaxations. If there is a relaxation, positions inside the frame are left out.
Positions are checked at rest.
"""

from collections.abc import Iterator
from itertools import chain

import numpy as np

from ...base.display import Fact
from ...base.text import quantity, quantity_row
from ..audits.excess import TENSIONS
from ..global_path.at_rest import AtRest
from ..global_path.shortest_shifts import shortest_shifts
from ..global_path.space import Space
from ..proofs.too_heavy import OF_WEIGHT
from ..result import PlanData
from ..tasks.paths import LinePath
from ..tasks.scenario import ATTITUDE, Scenario
from ..tasks.task_limits import OF_BODY
from ..tasks.wind_set import WindBox, WindDisc
from ..warnings.long_turns import OTHER_WAY
from ..warnings.outside_frame import LEAVES
from ..warnings.slipped_units import READS

IN_THE_WAY = {"keep_out", "cable_clearance", *OF_BODY}
TO_MOVE = 1.5  # times what carries the weight: tilted thrust and acceleration need more
FELT = 0.02  # of the weight: a wind with less force is hardly why tensions are missing
STEPS = 100  # at least, in the robot's size: positions are offered in round steps
ALONG = 51  # positions of a line that are checked
ENDS = ("start", "end")


def ideas(plan: PlanData) -> list[Fact]:
    """Return what may help, the most likely first; empty for a feasible plan, or if nothing is known to."""
    if plan.feasible:
        return []
    more = [("more", "other changes may be feasible: the search for changes was cut short")] * plan.cut_short
    found = [*_directions(plan), *_obstacles(plan), *_carriers(plan), *_strength(plan), *_wind(plan)]
    if plan.relaxations:
        return found + more
    found += _frame(plan)
    tried = "shorter line, weaker wind, lighter platform or load, stronger cables or lower t_min"
    nothing = [("no single change", f"of those tried makes it feasible: no duration, limit, {tried}")]
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
    kept = [("another path", f"one that keeps {', '.join(names)} as at home, outside `platform.dof`")] if names else []
    return shorter + kept


def _obstacles(plan: PlanData) -> list[Fact]:
    """Return other ends where an end of the path is inside a region, else a way round."""
    scenario = plan.scenario
    if not {excess.limit for excess in plan.audit.excess} & IN_THE_WAY:
        return []
    moved, inside = _clear_ends(scenario)
    if inside or (width := scenario.task.tube.position) == "free":
        return moved
    now = f" instead of {quantity(width, 'm')}" if width else ""
    robot = scenario.robot
    leaves = all(robot.carriers[index].confined for index in robot.carrier_of_cable) and robot.workspace_box is None
    leaves &= robot.floor is None and scenario.task.limits.platform_box is None
    kept = "; `limits.platform_box` keeps it above the floor and in the frame of the robot" if leaves else ""
    return [
        *moved,
        (
            "a way round",
            f"`tube: {{position: free}}`{now}: the planner then searches for a path round the obstacle{kept}",
        ),
    ]


def _clear_ends(scenario: Scenario) -> tuple[list[Fact], bool]:
    """Return, for each end of the path at which the robot cannot rest, a near one at which it can.

    If there is none, as where cables cross a wall through the robot, no path leads from there either. Also return
    whether something is in the way of the robot at an end; if not, only tensions are missing there.
    """
    space = Space(scenario)
    platform, carriers = space.references
    kept = AtRest(scenario, space.size, spare=0.0)
    limits_alone = AtRest(scenario, space.size, balance=False)(platform, carriers)
    facts, blocked, inside = [], [], False
    held, others = kept(platform, carriers).slack >= 0, platform[:, :3].copy()
    for end, (slack, worst) in enumerate(zip(limits_alone.slack, limits_alone.worst, strict=True)):
        limit = scenario.limits.all[worst]
        in_the_way = slack < 0 and limit.name in IN_THE_WAY
        if not in_the_way and (slack < 0 or held[end]):
            continue
        inside |= in_the_way
        place, straight = _nearest(scenario, kept, space, end, others[1 - end])
        # A place beside an obstacle that only cables cross helps if the line from there is clear of it.
        if place is not None and (straight or not in_the_way or not limit.labels[0].startswith("cable ")):
            away = quantity(float(np.linalg.norm(place - platform[end, :3])), "m")
            where = f"({quantity_row(place + 0.0)}) m, {away} away, is clear of everything (checked at rest)"
            facts.append((f"another {ENDS[end]}", where))
            others[end] = place
        elif in_the_way and limit.name == "keep_out":
            blocked.append(ENDS[end])
    if blocked:
        where = f"at the {' and at the '.join(blocked)} the platform or a cable is inside a region"
        why = "no shift along x, y or z was found that clears it and the line to the other end"
        facts.append(("other regions", f"or other anchors: {where}, and {why}"))
    return facts, inside


def _nearest(
    scenario: Scenario, kept: AtRest, space: Space, end: int, other: np.ndarray
) -> tuple[np.ndarray | None, bool]:
    """Return the position nearest to an end, along an axis of {G}, at which the robot can rest; None if none is found.

    For a line that the platform follows, the nearest from which that line to the `other` end is clear is preferred.
    Also return whether it is, or whether the tube is wide enough for the planner to leave the line by that distance.
    """
    (from_, loose), anchors = space.references, scenario.robot.home_anchors
    size = float(np.linalg.norm(np.ptp(np.vstack([anchors, from_[:, :3]]), axis=0)))
    step, start = 10.0 ** np.floor(np.log10(size / STEPS)), from_[end, :3]

    def holds(*moved: np.ndarray) -> bool:
        return bool((_slack(kept, space, from_[end], loose[end], np.array(moved)) >= 0).all())

    def clear() -> Iterator[np.ndarray]:
        """Yield the nearest clear positions, a step farther than necessary, at a round distance."""
        for shift in shortest_shifts(scenario, size, holds):
            far = np.linalg.norm(shift)
            by = shift * (step * (np.ceil(far / step) + 1) / far)
            if holds(by):
                yield start + by

    places = clear()
    nearest = next(places, None)
    width = scenario.task.tube.position or 0.0
    leaves = width == "free" or (nearest is not None and float(np.linalg.norm(nearest - start)) <= width)
    if nearest is None or leaves or not isinstance(scenario.task.path, LinePath):
        return nearest, True
    share = np.linspace(0.0, 1.0, ALONG)[:, None]
    lines = ((place, place - start + share * (other - place)) for place in chain([nearest], places))
    straight = next((place for place, line in lines if holds(*line)), None)
    return nearest if straight is None else straight, straight is not None


def _slack(kept: AtRest, space: Space, pose: np.ndarray, carriers: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Return by how much limits are kept at rest, (n,), by a robot moved by (n, 3) [m] with its flying carriers.

    Where no anchor is below z = 0, that is the floor.
    """
    platform = np.tile(pose, (len(moved), 1))
    every = np.tile(carriers, (len(moved), 1, 1))
    platform[:, :3] += moved
    every[:, space.scenario.loose, :3] += moved[:, None]
    found = kept(platform, every)
    lowest = float(kept.scenario.robot.home_anchors[:, 2].min())
    below = found.points[..., 2].min(axis=1) < 0
    return np.where(below & (lowest >= 0), -np.inf, found.slack)


def _carriers(plan: PlanData) -> list[Fact]:
    """Suggest moving carriers, or else a tilting platform, if the task forbids them and no tensions exist."""
    robot, task = plan.scenario.robot, plan.scenario.task
    if not _lacks_tensions(plan):
        return []
    if task.base.kind == "hold" and any(carrier.free_coordinates(robot.drive) for carrier in robot.carriers):
        return [("moving carriers", "`base: {kind: free}`: the planner then chooses how the carriers move")]
    if task.base.kind == "free" and not task.tube.turn and robot.dof_mask[ATTITUDE].any():
        tilts = "the platform may then tilt by 0.2 rad as it accelerates"
        return [("a tilting platform", f"`tube: {{attitude: 0.2}}`: {tilts}")]
    return []


def _strength(plan: PlanData) -> list[Fact]:
    """Return how much stronger what is too weak for the weight must be."""
    for excess in plan.audit.excess:
        if excess.limit in OF_WEIGHT:
            least = excess.bound / excess.value
            larger, enough = (quantity(times, digits=3) for times in (TO_MOVE * least, least))
            why = f"{enough} times would carry the weight at rest, but tilt and acceleration need more"
            return [(f"a larger {excess.limit}", f"{larger} times as large; {why}")]
    return []


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
    return [("a nearer path", f"inside the frame: {outside[0].partition(':')[2].partition(';')[0].strip()}")]
