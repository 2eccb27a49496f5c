"""What leads past keep-out regions: `past_regions`, other ends of a line and waypoints round what is in the way."""

from collections.abc import Iterator
from itertools import chain

import numpy as np

from ...base.text import quantity, quantity_row
from ...models.part import Box
from ..global_path.at_rest import AtRest
from ..global_path.global_path import find_global_path
from ..global_path.shortest_shifts import shortest_shifts
from ..global_path.space import Space
from ..plan import Plan
from ..proofs.durations import durations
from ..result import Relaxed
from ..tasks.lay_out import with_task
from ..tasks.paths import LinePath, WaypointPath
from ..tasks.scenario import POSITION, Scenario
from ..tasks.task_limits import OF_BODY
from .largest_share import along, by_programs, exceeds
from .relaxations import other_duration, planned, rounded
from .search import Search

IN_THE_WAY = {"keep_out", "cable_clearance", *OF_BODY}  # limits
ENDS = ("start", "end")
STEPS = 100  # at least, in the robot's size: positions are offered in round steps
PLACES = 51  # of a line that are checked
CONFIGURATIONS = 2_000, 3_000  # that are evaluated with each reserve for a way round: it need not be found
SHAPES = ("legs", "straight through"), ("spline", "as a spline through")
MOST_POINTS = 12  # of a way round, between its ends
LOOKS = 301  # at a way round before it is audited


def past_regions(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the path past what is in the way of a line: between clear ends near its own, round what is between them.

    A way round is not searched for where a tube already lets the planner, nor where only programs show if it is
    feasible. It has as few waypoints as pass the audit, with straight legs or a spline. Each end that moves is a
    change, and so is a duration that its length needs.
    """
    line = scenario.task.path
    if not isinstance(line, LinePath) or scenario.relative or scenario.task.phases is not None:
        return []
    moved = _clear_ends(scenario)
    ends, changes = {}, []
    for end, place in moved.items():
        given = np.array(getattr(line, end))
        ends[end] = (*place.tolist(), *given[3:].tolist())
        away = rounded(float(np.linalg.norm(place - given[:3])), up=True)
        changes.append((f"shift of path.{end}", 0.0, away, f"to ({quantity_row(place + 0.0)}) m"))
    between = along(scenario, line.model_copy(update=ends)) if moved else scenario
    plan = _lasting(search, between) if moved else None
    if plan is None and not by_programs(scenario) and scenario.task.tube.position != "free":
        for how, places, way in _ways_round(between):
            if (plan := _lasting(search, way)) is not None:
                length, whole = (
                    np.linalg.norm(np.diff(each, axis=0), axis=1).sum() for each in (places, places[[0, -1]])
                )
                through = ", ".join(f"({quantity_row(place + 0.0)})" for place in places[1:-1])
                way_round = rounded(float(length), up=True)
                changes.append(("length of a way round", float(whole), way_round, f"{how} {through} m"))
                break
    if plan is None:
        return []
    seconds = f", with a duration of {quantity(plan.duration, 's')}" * (plan.duration != scenario.duration)
    return [Relaxed(what, "m", given, now, plan, text + seconds) for what, given, now, text in changes]


def _lasting(search: Search, scenario: Scenario) -> Plan | None:
    """Return the plan of a scenario, or that with the longer duration that its motion needs; None if none is found."""
    if (plan := planned(search, scenario, "audit, past what is in the way")) is not None or scenario.count:
        return plan
    audit = search.audit_motion(scenario, None, "audit, past what is in the way")
    return next((each.plan for each in other_duration(search, scenario, durations(scenario), audit)), None)


def _ways_round(scenario: Scenario) -> Iterator[tuple[str, np.ndarray, Scenario]]:
    """Yield how, through which points (k, 3) and in which scenario a path leads past what is in the way.

    There are ever more points.
    """
    tube, limits = scenario.task.tube, scenario.task.limits
    free = with_task(scenario, tube=tube.model_copy(update={"position": "free"}))
    if limits.platform_box is None:
        low, high = Space(free).box
        low[2] = max(low[2], min(_floor(scenario), *Space(free).references[0][:, 2]))
        box = Box(min=tuple(low.tolist()), max=tuple(high.tolist()))
        free = with_task(free, limits=limits.model_copy(update={"platform_box": box}))
    found, _ = find_global_path(free, most=CONFIGURATIONS)
    if found is None:
        return
    axes = [axis for axis in POSITION if scenario.robot.dof_mask[axis]]
    shares = np.linspace(0.0, 1.0, LOOKS)
    poses, _ = found.space.poses(found.at(shares))
    for pose in poses[1:-1]:
        pose[axes] = [rounded(value, up=False) for value in pose[axes]]
    chosen = [0, LOOKS - 1]
    for _ in range(MOST_POINTS):
        straight = np.stack([np.interp(shares, shares[chosen], column[chosen]) for column in poses.T], axis=1)
        chosen = sorted([*chosen, int(np.linalg.norm((poses - straight)[:, :3], axis=1).argmax())])
        if len(set(chosen)) < len(chosen):
            return
        for shape, how in SHAPES:
            fields = {"kind": "waypoints", "points": poses[chosen].tolist(), "shape": shape}
            way = along(scenario, WaypointPath.model_validate(fields))
            if not exceeds(way, np.linspace(0.0, way.duration, LOOKS), rates=False):
                yield how, poses[chosen, :3], way


def _clear_ends(scenario: Scenario) -> dict[str, np.ndarray]:
    """Return, by the ends of a line at which the robot cannot rest, a near position (3,) at which it can.

    If there is none, as where cables cross a wall through the robot, no path leads from there either.
    """
    space = Space(scenario)
    platform, carriers = space.references
    kept = AtRest(scenario, space.size, spare=0.0)
    limits_alone = AtRest(scenario, space.size, balance=False)(platform, carriers)
    moved, others = {}, platform[:, :3].copy()
    held = kept(platform, carriers).slack >= 0
    for end, (slack, worst) in enumerate(zip(limits_alone.slack, limits_alone.worst, strict=True)):
        if held[end] or (slack < 0 and scenario.limits.all[worst].name not in IN_THE_WAY):
            continue
        if (place := _nearest(scenario, kept, space, end, others[1 - end])) is not None:
            moved[ENDS[end]] = others[end] = place
    return moved


def _nearest(scenario: Scenario, kept: AtRest, space: Space, end: int, other: np.ndarray) -> np.ndarray | None:
    """Return the position nearest to an end, along an axis of {G}, at which the robot can rest; None if none is found.

    The nearest from which the line to the `other` end is clear is preferred, unless the planner may leave the line by
    the shift.
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
    if nearest is None or scenario.task.tube.radius >= float(np.linalg.norm(nearest - start)):
        return nearest
    share = np.linspace(0.0, 1.0, PLACES)[:, None]
    lines = ((place, place - start + share * (other - place)) for place in chain([nearest], places))
    return next((place for place, line in lines if holds(*line)), nearest)


def _slack(kept: AtRest, space: Space, pose: np.ndarray, carriers: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Return by how much limits are kept at rest, (n,), by a robot moved by (n, 3) [m] with its flying carriers."""
    platform = np.tile(pose, (len(moved), 1))
    every = np.tile(carriers, (len(moved), 1, 1))
    platform[:, :3] += moved
    every[:, space.scenario.loose, :3] += moved[:, None]
    found = kept(platform, every)
    return np.where(found.points[..., 2].min(axis=1) < _floor(kept.scenario), -np.inf, found.slack)


def _floor(scenario: Scenario) -> float:
    """Return the height of the floor [m]: z = 0 where no anchor is lower, else there is none."""
    return 0.0 if scenario.robot.home_anchors[:, 2].min() >= 0 else -np.inf
