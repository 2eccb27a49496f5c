"""Find the fastest time law along a given path that keeps every tension inside its limits: `time_along`.

Along a path only s(t) is left to choose. The available wrench set at each s (`solvers.available_wrench`) and the wrench
that the motion needs (`parametrised_path`) make half-planes in d2s/dt2 and (ds/dt)^2 (`phase_plane`), and toppra finds
the fastest law inside all of them (`piece`, `toppra_law`). It is audited as any plan is; violations between the grid
points are removed by a finer grid and by a little distance from the limits.
"""

import os
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...base.inputs import InputError, whole_number
from ...models import Robot
from ...models.files import AnyRobot, as_robot
from ..audits.audit import Audit, audit
from ..audits.excess import TENSIONS, Excess
from ..limits.cables import WinchForce
from ..limits.carriers import CarrierReach
from ..limits.limits import Limits
from ..limits.places import Inside
from ..limits.platform import ZoneSpeed
from ..plan import Plan
from ..tasks.lay_out import carrier_paths, lay_out
from ..tasks.limit_list import limit_list
from ..tasks.paths import (
    AnyPath,
    CirclePath,
    Curve,
    FeedPath,
    LinePath,
    ReturnPath,
    SamplePath,
    SequencePath,
    TimedPath,
    WaypointPath,
)
from ..tasks.scenario import MOST_SAMPLES, Scenario, least_audit_rate
from ..tasks.task import GivenBase, MotionStatus, Task, read_task
from .fastest_law import FastestLaw
from .parametrised_path import ParametrisedPath, PathLimits
from .phase_plane import RESERVE, Piece, proofs, solved_piece
from .timed_task import ACCELERATIONS, KNOWN_LIMITS, SPEEDS, WITHOUT_POWER, check_task

ATTEMPTS = 12
MOST_INTERVALS = 6400
SPLIT = 0.25, 0.5, 0.75  # of an interval in which much is missing: further points
MOST_SPLITS = 3  # times that such intervals are split
FINER_TRIES = 2  # after a grid on which the search ended without a law
LARGEST_RESERVE = 0.01  # of the weight
LITTLE = 1e-4  # of the weight: if no more than this is missing anywhere, it becomes a reserve everywhere
LARGEST_SHRINK = 0.01
COARSE = 4e-3  # of the weight: if more is missing it takes a finer grid, if less a reserve there
RISE = 2.5  # times 1 / intervals: change of the logarithm of a zone's bound from point to point
NEAR_REST = 0.5 ** np.arange(7.0, 0.0, -1.0)  # of the interval beside a rest, where further points are
CLOSEST = 1e-3  # of a step of a grid: points that are nearer to each other are one
FINEST = 1e-2  # of that, for points that split an interval
COARSE_EXCESS = 1e-4  # of a limit: if it is exceeded by more it takes a finer grid, if by less some distance everywhere
PIECES = (400, 800, 1600)  # of a spline through points of a path, until it is near enough
LOOKS = 20_001
ON_PATH = 2e-6  # of a path's length: how far that spline may be off
SURE = 5 * ON_PATH  # of it: what is beyond a limit by more is so on the path itself


def time_along(robot: AnyRobot, task: Task | dict[str, Any] | str | os.PathLike[str], *, grid: int = 200) -> Plan:
    """Find the fastest motion along a task's path, from standstill to standstill, with every tension inside its limits.

    Only the geometry of the path matters, not its own time law. Straight legs round their corners by up to `blend`. The
    motion stops at reversals, at dwells and, with `blend: 0`, at corners; the dwell times are part of the duration.
    A circle ends at the point that it reaches at its own rate in the task's duration or, without a duration, after one
    turn; for all other paths the task's duration is ignored. Carriers rest or follow given paths with the same
    parameter s.

    The task's limits on speeds and accelerations of platform, cables and carriers, and on the power of winches, apply,
    and the robot file's limits of winches and of mobile carriers that move. A law that keeps `winch_power` is a local
    optimum. If winches have inertia, `force_max` limits the sum of the tension and the
    force that accelerates the winch. The tension limits, reduced by the task's margin, enter as the facets of the
    available wrench set. TOPP-RA computes the time law (H. Pham, Q.-C. Pham, "A new approach to time-optimal path
    parameterization based on reachability analysis", IEEE T-RO 34(3), 2018): d2s/dt2 is constant between grid points,
    so tensions jump there. The extra `timing` installs it.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        task: A `Task`, a mapping with its keys, or the path of a YAML file, as for `plan`.
        grid: Initial number of intervals, from 10 to 6400; after an audit that fails there are more.

    Returns:
        Plan: Audited like every plan. Its task contains the time law, so `plan` audits the same motion again; `law`
            contains the active limit on each part of the path (`bottlenecks`). Status `infeasible`: no tensions inside
            their limits give the required wrench at `law.at`, whatever the speed and acceleration (at the ends: at
            rest), or the path goes below the floor, or leaves the workspace box or the reach of a carrier
            (`audit.excess`). The motion then only shows the path, in 10 s. Status `not-found`: every grid point allows
            some speed, but no time law connects them, or none passes the audit.

    Raises:
        InputError: If an argument is invalid, the task does not fit the robot or has keys that a time law along a path
            does not support, or nothing limits the speed.
        SolverError: If toppra is not installed; the message contains the command that installs it.
    """
    robot, task = as_robot(robot), read_task(task)
    grid = whole_number("grid", grid, 10, MOST_INTERVALS)
    check_task(robot, task)
    paths = carrier_paths(robot, task)
    moving = {index: geometry(its, alone=False) for index, its in paths.items()}
    until = task.duration if isinstance(task.path, CirclePath) and isinstance(task.duration, float) else None
    still_air = None if task.wind is None else np.zeros(3)
    parametrised = ParametrisedPath(robot, geometry(task.path, alone=not moving), moving, until, still_air)
    return _search(task, parametrised, _limits(robot, task, parametrised.moving), grid)


def _limits(robot: Robot, task: Task, moving: list[int]) -> PathLimits:
    """Return the limits of the task, and those of the carriers that move."""
    names = {robot.carriers[index].name for index in moving}
    kept = [
        limit
        for limit in limit_list(robot, task)
        if limit.name in KNOWN_LIMITS and (not limit.name.startswith("carrier") or limit.labels[0] in names)
    ]
    parts = (tuple(limit for limit in kept if limit.name in names) for names in (SPEEDS, ACCELERATIONS))
    speeds, accelerations = (Limits(robot, part) for part in parts)
    return PathLimits(speeds, accelerations, task.limits.winch_power or np.inf)


def _search(task: Task, parametrised: ParametrisedPath, limits: PathLimits, intervals: int) -> Plan:
    """Solve and audit; after a violation again, on a finer grid or with more distance from the limits."""
    margin, weight = task.margin, parametrised.robot.force_scale
    short, shrink, attempts, failures, splits = list[_Stretches](), 0.0, 0, 0, 0
    further = np.zeros(0)
    zones = [limit for limit in limits.speeds if isinstance(limit, ZoneSpeed)]
    corners = np.concatenate([[], *(parametrised.crossings(zone) for zone in zones)])
    while True:
        attempts += 1
        rises = np.concatenate([[], *(parametrised.rises(zone, RISE / intervals) for zone in zones)])
        grids = [_through(s, corners, np.append(rises, _rests(s)), further) for s in parametrised.pieces(intervals)]
        pieces = [solved_piece(parametrised, limits, s, margin, _reserve(s, short, weight), shrink) for s in grids]
        s = np.concatenate([pieces[0].s[:1], *(piece.s[1:] for piece in pieces)])
        law = FastestLaw(parametrised, limits, margin, s, np.full(len(s), np.nan))
        if failures == 0 and (proven := _proven(law, pieces)) is not None:
            return _shown(task, proven)
        if any(piece.law.unlimited for piece in pieces):
            raise InputError(
                f"limits must have one of {', '.join(WITHOUT_POWER)} that bounds the speed, because the tension limits "
                "and winch_power alone do not bound it along this path, got none"
            )
        stuck = next((piece for piece in pieces if piece.law.x is None), None)
        if stuck is not None:
            failures += 1
            if failures > FINER_TRIES or attempts == ATTEMPTS:
                return _shown(task, replace(law, at=float(stuck.s[stuck.law.stuck or 0])))
            intervals = min(2 * intervals, MOST_INTERVALS)
            continue
        x = [piece.law.x for piece in pieces]
        law = replace(law, sd=np.sqrt(np.concatenate([x[0][:1], *(each[1:] for each in x)])))
        _check_duration(task, law)
        scenario = lay_out(parametrised.robot, _timed(task, law))
        audited = audit(scenario, None)
        if audited.passed:
            return Plan(scenario, MotionStatus.FEASIBLE, None, audited, 0.0, 0.0, law=law)
        if beyond := _off_limits(scenario, audited):
            law = replace(law, at=float(law.path.law(np.array([beyond[0].time]))[0][0]))
            audited = replace(audited, excess=beyond, certificate=None)
            return Plan(scenario, MotionStatus.INFEASIBLE, None, audited, 0.0, 0.0, law=law)
        missing = _missing(law, audited)
        # A reserve makes up for what motors lack, as for missing wrenches.
        known = (each for each in audited.excess if each.limit in KNOWN_LIMITS and each.limit != WinchForce.name)
        excess = max([0.0, *(each.value / each.bound - 1.0 for each in known)])
        if attempts == ATTEMPTS:
            law = replace(law, at=float(law.path.law(audited.times[[audited.worst]])[0][0]))
            reason = f"no time law passed the audit in {ATTEMPTS} attempts"
            return Plan(scenario, MotionStatus.NOT_FOUND, None, audited, 0.0, 0.0, reason, law=law)
        # A grid too coarse for a bend misses it by so much that as large a reserve would leave no tension at all.
        if splits < MOST_SPLITS and missing.newtons.max() > COARSE * weight:
            further, splits = np.append(further, _between(law.s, missing, COARSE * weight)), splits + 1
            intervals = min(2 * intervals, MOST_INTERVALS)
        elif intervals < MOST_INTERVALS and excess > COARSE_EXCESS:
            intervals = min(2 * intervals, MOST_INTERVALS)
        else:
            short.append(missing)
            shrink = min(shrink + 2 * excess, LARGEST_SHRINK)


def _check_duration(task: Task, law: FastestLaw) -> None:
    """Refuse limits that permit only motions that are too long to be audited; name the one that acts for longest."""
    longest, seconds = MOST_SAMPLES / least_audit_rate(task), law.path.natural_duration or 0.0
    if seconds > longest:
        most = max(law.bottlenecks, key=lambda each: each.seconds)
        raise InputError(
            f"task {task.name!r}: limits must permit a motion of at most {longest:g} s, the longest that is audited, "
            f"got one of {seconds:g} s, limited for {most.seconds:g} s by {most.limit}"
        )


def _rests(s: np.ndarray) -> np.ndarray:
    """Return points beside both ends of a grid, where its motion rests: there the speed can rise at once.

    Its square is linear from a rest to the first point, which takes twice as long as at the speed there.
    """
    return np.append(s[0] + NEAR_REST * (s[1] - s[0]), s[-1] - NEAR_REST * (s[-1] - s[-2]))


def _through(s: np.ndarray, corners: np.ndarray, rises: np.ndarray, further: np.ndarray) -> np.ndarray:
    """Return a grid with points at corners of the bound of the speed, where that rises, and `further` ones.

    A time law that is slow enough at the first point in a zone would be too fast between its edge and that point.
    """
    least = CLOSEST * (s[-1] - s[0]) / len(s)
    points = s[[0, -1]]
    others = (corners, least, least), (s[1:-1], 0.0, least), (rises, least, least), (further, 0.0, FINEST * least)
    for these, from_each_other, from_those_before in others:
        inside = np.sort(these[(these > s[0]) & (these < s[-1])])
        inside = inside[np.diff(inside, prepend=-np.inf) > from_each_other]
        after = np.searchsorted(points, inside)
        apart = np.minimum(inside - points[after - 1], points[after] - inside) > from_those_before
        points = np.sort(np.append(points, inside[apart]))
    return points


def _timed(task: Task, law: FastestLaw) -> Task:
    """Return the task whose platform and carriers move by a time law."""
    names = [carrier.name for carrier in law.parametrised.robot.carriers]
    carriers = {names[index]: path for index, path in law.carrier_paths.items()}
    base = GivenBase(kind="given", paths=carriers) if carriers else task.base
    return task.model_copy(update={"path": law.path, "base": base, "duration": None})


def _shown(task: Task, law: FastestLaw) -> Plan:
    """Return the plan of a path without a time law: a motion that shows the path, and what is known of it."""
    scenario = lay_out(law.parametrised.robot, _timed(task, law))
    audited = audit(scenario, None, to_show=True)
    audited = replace(audited, excess=_off_limits(scenario, audited), certificate=None)
    if law.certificate is not None:
        at = float(law.path.time_at(np.array([law.at]))[0])
        audited = replace(audited, certificate=replace(law.certificate, time=at))
    elif not audited.excess:
        reason = f"no time law connects the points of the path; the search ended at s = {law.at:.4g}"
        return Plan(scenario, MotionStatus.NOT_FOUND, None, audited, 0.0, 0.0, reason, law=law)
    return Plan(scenario, MotionStatus.INFEASIBLE, None, audited, 0.0, 0.0, law=law)


def _off_limits(scenario: Scenario, audited: Audit) -> list[Excess]:
    """Return where the path itself exceeds limits, at any speed, by more than a spline may be off its points."""
    names = {limit.name for limit in scenario.limits if isinstance(limit, Inside | CarrierReach)}
    steps = np.diff(audited.motion.pose, axis=0)
    moved = np.linalg.norm(steps[:, :3], axis=1) + scenario.robot.length * np.linalg.norm(steps[:, 3:], axis=1)
    least = SURE * moved.sum()
    return [each for each in audited.excess if each.limit in names and abs(each.value - each.bound) > least]


class _Stretches(NamedTuple):
    """Stretches of s, from points of a grid to others, and the largest wrench that misses in each, (k,) [N]."""

    start: np.ndarray
    end: np.ndarray
    newtons: np.ndarray


def _missing(law: FastestLaw, audited: Audit) -> _Stretches:
    """Return where an audit found no tensions, and all of s for tensions of too few cables and for little wrenches."""
    beyond = [abs(each.value - each.bound) for each in audited.excess if each.limit in (TENSIONS, WinchForce.name)]
    rows = np.flatnonzero(audited.violation > audited.tolerance)
    at = law.path.law(audited.times)[0]
    first, last = np.searchsorted(law.s, [at[rows], at[np.minimum(rows + 1, len(at) - 1)]])
    start, end = law.s[(first - 2).clip(0)], law.s[(last + 1).clip(max=len(law.s) - 1)]
    if (most := audited.violation.max()) <= LITTLE * law.parametrised.robot.force_scale:
        beyond.append(most)  # in the next law others would miss as little elsewhere
    whole = _Stretches(np.zeros(1), np.ones(1), np.array([max([0.0, *beyond])]))
    return _Stretches(*map(np.append, (start, end, audited.violation[rows]), whole))


def _between(s: np.ndarray, missing: _Stretches, newtons: float) -> np.ndarray:
    """Return points that split the intervals of a grid in which more than so many `newtons` are missing."""
    coarse = np.zeros(len(s) - 1, bool)
    for start, end, its in zip(*missing, strict=True):
        if its > newtons:
            coarse[np.searchsorted(s, start) : np.searchsorted(s, end)] = True
    start, end = s[:-1][coarse], s[1:][coarse]
    return np.concatenate([start + part * (end - start) for part in SPLIT])


def _reserve(s: np.ndarray, short: list[_Stretches], weight: float) -> np.ndarray:
    """Return how far wrenches stay inside the available ones, (n,) [N]: twice what audits found missing there."""
    reserve = np.full(len(s), RESERVE * weight)
    for start, end, newtons in short:
        for row in range(len(start)):
            reserve[(s >= start[row]) & (s <= end[row])] += 2 * newtons[row]
    return np.minimum(reserve, LARGEST_RESERVE * weight)


def _proven(law: FastestLaw, pieces: list[Piece]) -> FastestLaw | None:
    """Return where no speed and acceleration are possible, with the proof of the worst point; None if nowhere."""
    weight = law.parametrised.robot.force_scale
    proven = [
        proof
        for piece in pieces
        if piece.law.x is None or not piece.plane.rests_at_ends(weight)
        for proof in proofs(law.parametrised, law.limits, piece.inside, law.margin)
    ]
    if not proven:
        return None
    worst = max(proven, key=lambda each: each.certificate.shortfall)
    blocked = np.array([each.s for each in proven])
    return replace(law, at=worst.s, certificate=worst.certificate, problem=worst.problem, blocked=blocked)


def geometry(path: AnyPath, *, alone: bool) -> Curve:
    """Return the curve of a path; `alone` if no other path is followed with the same s.

    Raises `InputError` if a spline or samples turn so sharply that they must rest, or move nowhere, or for a
    sequence, a return or a feed.
    """
    if isinstance(path, SequencePath):
        raise InputError("path.kind must not be sequence to time a path; time its parts one by one")
    if isinstance(path, FeedPath):
        raise InputError("path.kind must not be feed to time a path, since it has its own speed; plan it instead")
    if isinstance(path, ReturnPath):
        raise InputError("path.kind must not be return to time a path; time the whole path instead")
    if isinstance(path, TimedPath):
        return path.along
    if isinstance(path, LinePath):
        return path.model_copy(update={"timing": "uniform"})
    if isinstance(path, WaypointPath) and path.shape == "spline" and (alone or path.times is None):
        return _by_length(path)
    return _by_length(path) if isinstance(path, SamplePath) and alone else path


def _by_length(path: WaypointPath | SamplePath) -> SamplePath:
    """Return a spline by length through many points of a path, densest at its ends."""
    shares = np.linspace(0.0, 1.0, LOOKS)
    looks = path.by_fraction(shares).pose
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(looks, axis=0), axis=1)))
    smooth = f"path of kind {path.kind} must rest nowhere between its ends to be timed, and not turn at once"
    if not length[-1] > 0:
        raise InputError(f"{smooth}, got one that moves nowhere")
    worst = np.zeros(6)
    for pieces in PIECES:
        targets = length[-1] * (1 - np.cos(np.pi * np.arange(pieces + 1) / pieces)) / 2
        at = np.interp(targets, length, shares)
        at[[0, -1]] = 0.0, 1.0
        poses = tuple((x, y, z, roll, pitch, yaw) for x, y, z, roll, pitch, yaw in path.by_fraction(at).pose.tolist())
        times = tuple((targets / length[-1]).tolist())
        spline = SamplePath(kind="samples", frame=path.frame, times=times, poses=poses)
        # Between the points only the deviation across the path matters: the time law decides where along it.
        between = (targets[1:] + targets[:-1]) / 2
        target, along, _ = path.by_fraction(np.interp(between, length, shares))
        along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
        off = spline.by_fraction(between / length[-1]).pose - target
        across = np.linalg.norm(off - np.sum(off * along, axis=1, keepdims=True) * along, axis=1)
        if across.max() <= ON_PATH * length[-1]:
            return spline
        worst = target[int(across.argmax())]
    raise InputError(f"{smooth}, got one that does near ({', '.join(f'{value:.3g}' for value in worst[:3])}) m")
