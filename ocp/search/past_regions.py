"""What leads past keep-out regions: other ends of a line, waypoints round what is in the way, or fewer regions."""

from collections.abc import Iterator
from itertools import chain
from typing import TypeAlias

import numpy as np

from ...base.text import quantity, quantity_row
from ...models.part import Box
from ..audits.audit import Audit
from ..global_path.at_rest import AtRest
from ..global_path.global_path import find_global_path
from ..global_path.space import Space
from ..plan import Plan
from ..proofs.durations import durations
from ..result import Relaxed
from ..tasks.ends import platform_ends
from ..tasks.lay_out import with_task
from ..tasks.paths import FeedPath, LinePath, WaypointPath
from ..tasks.scenario import POSITION, Scenario
from ..tasks.task_limits import OF_BODY
from .largest_share import Change, Variation, along, by_programs, exceeds
from .other_paths import shortest_shifts
from .refinement import planned, rounded
from .search import Search
from .slower import other_duration

IN_THE_WAY = {"keep_out", "cable_clearance", *OF_BODY}  # limits
STEPS = 100  # at least, in the robot's size: positions are offered in round steps
PLACES = 51  # of a line that are checked
CONFIGURATIONS = 2_000, 3_000  # that are evaluated with each reserve for a way round: it need not be found
SHAPES = ("legs", "with `kind: waypoints` through"), ("spline", "with `kind: waypoints` and `shape: spline` through")
MOST_POINTS = 12  # of a way round, between its ends
LOOKS = 301  # at a way round before it is audited
Lines: TypeAlias = LinePath | WaypointPath | FeedPath


def past_regions(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the path past what is in the way of lines: through clear points near its own, round what is between them.

    A way round is not searched for where a tube already lets the planner, nor where only programs show if it is
    feasible. It has as few further points as pass the audit; a line becomes straight legs or a spline. Each point that
    moves is a change, and so is a duration that its length needs.
    """
    path = scenario.task.path
    if not isinstance(path, Lines) or scenario.relative or scenario.task.phases is not None:
        return []
    line = isinstance(path, LinePath)
    given = np.array([path.start, path.end] if line else path.points)
    moved, changes, points = _clear_points(scenario, given), [], given.copy()
    for k, place in moved.items():
        name = ("start", "end")[k] if line else f"points[{k}]"
        points[k, :3] = place
        away = rounded(float(np.linalg.norm(place - given[k, :3])), up=True)
        changes.append((f"shift of path.{name}", 0.0, away, f"to ({quantity_row(place + 0.0)}) m"))
    between = along(scenario, _through(path, points, np.arange(len(points)))) if moved else scenario
    plan = _lasting(search, between) if moved else None
    if plan is None and not by_programs(scenario) and scenario.task.tube.position != "free":
        for how, places, new, way in _ways_round(between, path, points):
            if (plan := _lasting(search, way)) is not None:
                length, whole = (
                    np.linalg.norm(np.diff(each, axis=0), axis=1).sum() for each in (places, points[:, :3])
                )
                through = ", ".join(f"({quantity_row(place + 0.0)})" for place in places[new])
                way_round = rounded(float(length), up=True)
                changes.append(("length of a way round", float(whole), way_round, f"{how} {through} m"))
                break
    if plan is None:
        return []
    seconds = f", with a duration of {quantity(plan.duration, 's')}" * (plan.duration != scenario.duration)
    return [Relaxed(what, "m", given, now, plan, text + seconds) for what, given, now, text in changes]


def _through(path: Lines, points: np.ndarray, at: np.ndarray) -> Lines:
    """Return a path through points (n, 6) that lie `at` places (n,) among its own, which are 0, 1, 2 and so on."""
    if isinstance(path, LinePath):
        return path.model_copy(update={"start": tuple(points[0].tolist()), "end": tuple(points[-1].tolist())})
    data, own = path.model_dump(), np.arange(len(path.points))
    for name in ("times", "shares"):
        if data.get(name) is not None:
            data[name] = np.interp(at, own, data[name]).tolist()
    if data["dwell"] is not None:
        data["dwell"] = [data["dwell"][int(k)] if k in own else 0.0 for k in at]
    if data.get("feeds") is not None:
        data["feeds"] = [data["feeds"][int(k)] for k in at[:-1]]
    if "order" in data:
        data["order"] = "given"
    return type(path).model_validate(data | {"points": points.tolist()})


def _lasting(search: Search, scenario: Scenario) -> Plan | None:
    """Return the plan of a scenario, or that with the longer duration that its motion needs; None if none is found."""
    if (plan := planned(search, scenario, "audit, past what is in the way")) is not None or scenario.count:
        return plan
    audit = search.audit_motion(scenario, None, "audit, past what is in the way")
    return next((each.plan for each in other_duration(search, scenario, durations(scenario), audit)), None)


def _ways_round(
    scenario: Scenario, path: Lines, points: np.ndarray
) -> Iterator[tuple[str, np.ndarray, np.ndarray, Scenario]]:
    """Yield how, through which places (n, 3), of which some are new (n,), and in which scenario a path leads past.

    Obstacles are between `points` (k, 6) of the path. Each way has more places than the one before.
    """
    shares = np.linspace(0.0, 1.0, LOOKS)
    passed, blocked = _passed(scenario, points), exceeds(scenario, shares * scenario.duration, rates=False)
    legs = np.searchsorted(passed[1:-1], np.flatnonzero(blocked) if blocked.any() else passed[:-1], side="right")
    found = {leg: _way_round(scenario, points[leg], points[leg + 1]) for leg in np.unique(legs).tolist()}
    ways = {leg: way for leg, way in found.items() if way is not None}
    if len(ways) < len(found):
        return
    chosen = {leg: [0, LOOKS - 1] for leg in ways}
    for _ in range(MOST_POINTS):
        for leg, poses in ways.items():
            its = chosen[leg]
            straight = np.stack([np.interp(shares, shares[its], column[its]) for column in poses.T], axis=1)
            farthest = int(np.linalg.norm((poses - straight)[:, :3], axis=1).argmax())
            chosen[leg] = sorted({*its, farthest or LOOKS // 2})
        own = {leg: (np.zeros(1), points[[leg]]) for leg in range(len(points))}
        own |= {leg: (shares[its[:-1]], ways[leg][its[:-1]]) for leg, its in chosen.items()}
        at = np.concatenate([leg + share for leg, (share, _) in own.items()])
        through = np.vstack([poses for _, poses in own.values()])
        for shape, how in SHAPES if isinstance(path, LinePath) else ((None, "through"),):
            fields = {"kind": "waypoints", "points": through.tolist(), "shape": shape}
            way = along(scenario, WaypointPath.model_validate(fields) if shape else _through(path, through, at))
            if not exceeds(way, np.linspace(0.0, way.duration, LOOKS), rates=False).any():
                yield how, through[:, :3], at % 1 > 0, way


def _passed(scenario: Scenario, points: np.ndarray) -> np.ndarray:
    """Return at which of `LOOKS` instants a motion is nearest to each of points (k, 6), (k,), in order."""
    poses = scenario.motion(np.linspace(0.0, scenario.duration, LOOKS), None)[0].pose
    passed = [0]
    for point in points[1:-1]:
        passed.append(passed[-1] + int(np.linalg.norm((poses[passed[-1] :] - point)[:, :3], axis=1).argmin()))
    return np.array([*passed, LOOKS - 1])


def _way_round(scenario: Scenario, start: np.ndarray, end: np.ndarray) -> np.ndarray | None:
    """Return the poses (LOOKS, 6) of a way between two past what is in the way; None if none is found."""
    tube, limits = scenario.task.tube, scenario.task.limits
    line = LinePath.model_validate({"kind": "line", "start": start.tolist(), "end": end.tolist()})
    given = {} if isinstance(scenario.task.path, LinePath) else {"initial": None, "final": None}
    tube = tube.model_copy(update={"position": "free", "ends": None})  # the ends of a cycle are not the leg's
    leg = {"path": line, "duration": scenario.duration, "tube": tube} | given
    free = with_task(scenario, **leg)
    if limits.platform_box is None:
        low, high = Space(free).box
        low[2] = max(low[2], min(_floor(scenario), *Space(free).references[0][:, 2]))
        box = Box(min=tuple(low.tolist()), max=tuple(high.tolist()))
        free = with_task(free, limits=limits.model_copy(update={"platform_box": box}))
    found, _ = find_global_path(free, most=CONFIGURATIONS)
    if found is None:
        return None
    axes = [axis for axis in POSITION if scenario.robot.dof_mask[axis]]
    poses, _ = found.space.poses(found.at(np.linspace(0.0, 1.0, LOOKS)))
    for pose in poses[1:-1]:
        pose[axes] = [rounded(value, up=False) for value in pose[axes]]
    return poses


def _clear_points(scenario: Scenario, points: np.ndarray) -> dict[int, np.ndarray]:
    """Return a near position (3,) at which the robot can rest, for each of the points (k, 6) at which it cannot.

    If there is none, as where cables cross a wall through the robot, no path leads from there either.
    """
    space = Space(scenario)
    times = _passed(scenario, points) * scenario.duration / (LOOKS - 1)
    carriers = np.stack([carrier.pose for carrier in scenario.references(times)[1]], axis=1)
    kept = AtRest(scenario, space.size, spare=0.0)
    limits_alone = AtRest(scenario, space.size, balance=False)(points, carriers)
    moved, others = {}, points[:, :3].copy()
    held = kept(points, carriers).slack >= 0
    for k, (slack, worst) in enumerate(zip(limits_alone.slack, limits_alone.worst, strict=True)):
        if held[k] or (slack < 0 and scenario.limits.all[worst].name not in IN_THE_WAY):
            continue
        beside = others[[near for near in (k - 1, k + 1) if 0 <= near < len(points)]]
        if (place := _nearest(kept, points[k], carriers[k], beside)) is not None:
            moved[k] = others[k] = place
    if 0 in moved and platform_ends(scenario.task) == "periodic":
        moved[len(points) - 1] = moved[0]
    return moved


def _nearest(kept: AtRest, pose: np.ndarray, carriers: np.ndarray, beside: np.ndarray) -> np.ndarray | None:
    """Return the position nearest to a pose, along an axis of {G}, at which the robot can rest, or None.

    The nearest from which the lines to positions `beside` it (k, 3) are clear is preferred, unless the planner may
    leave the line by the shift.
    """
    scenario, start = kept.scenario, pose[:3]
    size = float(np.linalg.norm(np.ptp(np.vstack([scenario.robot.home_anchors, start, beside]), axis=0)))
    step = 10.0 ** np.floor(np.log10(size / STEPS))

    def holds(moved: np.ndarray) -> np.ndarray:
        return _slack(kept, pose, carriers, moved) >= 0

    def clear() -> Iterator[np.ndarray]:
        """Yield the nearest clear positions, a step farther than necessary, at a round distance."""
        for shift in shortest_shifts(scenario, size, holds):
            far = np.linalg.norm(shift)
            by = shift * (step * (np.ceil(far / step) + 1) / far)
            if holds(by[None])[0]:
                yield start + by

    places = clear()
    nearest = next(places, None)
    if nearest is None or scenario.task.tube.radius >= float(np.linalg.norm(nearest - start)):
        return nearest
    share = np.linspace(0.0, 1.0, PLACES)[:, None]
    lines = (
        (place, [place - start + share * (other - place) for other in beside]) for place in chain([nearest], places)
    )
    return next((place for place, ways in lines if holds(np.vstack(ways)).all()), nearest)


def _slack(kept: AtRest, pose: np.ndarray, carriers: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Return by how much limits are kept at rest, (n,), by a robot moved by (n, 3) [m] with its flying carriers."""
    platform = np.tile(pose, (len(moved), 1))
    every = np.tile(carriers, (len(moved), 1, 1))
    platform[:, :3] += moved
    every[:, kept.scenario.loose, :3] += moved[:, None]
    found = kept(platform, every)
    return np.where(found.points[..., 2].min(axis=1) < _floor(kept.scenario), -np.inf, found.slack)


def _floor(scenario: Scenario) -> float:
    """Return the height of the floor [m]: z = 0 where no anchor is lower, else there is none."""
    return 0.0 if scenario.robot.home_anchors[:, 2].min() >= 0 else -np.inf


def fewer_regions(scenario: Scenario, audit: Audit | None) -> Change | None:
    """Return the change to the regions that the audited motion keeps clear of, or without an audit to no regions."""
    limits, given = scenario.task.limits, scenario.task.limits.keep_out
    excesses = () if audit is None else audit.excess
    through = {excess.about.partition(" outside ")[2] for excess in excesses if excess.limit == "keep_out"}
    kept = () if audit is None else tuple(region for region in given if region.name not in through)
    through = through or {region.name for region in given}
    if len(kept) == len(given):
        return None

    fewer = with_task(scenario, limits=limits.model_copy(update={"keep_out": kept}))

    def without(share: float) -> Variation:
        varied, left = (scenario, given) if share == 1.0 else (fewer, kept)
        return varied, len(left), f"of {len(given)}, without {', '.join(map(repr, sorted(through)))}"

    return Change("number of keep-out regions", "", without)
