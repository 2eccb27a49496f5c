"""Clocks of poses in another file than the lengths, by cable speeds, and of carriers in files of their own."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.errors import InputError
from ...models import points
from ...models.dynamics import Dynamics
from ...models.robot import Robot
from .alignment import Clock, ClockJumpError, Records, align, check_jumps
from .cable_directions import vectors
from .carrier_poses import angles_at, carriers_at, from_ned, ned_frame, platform_from_ned
from .encoders import locked
from .mapping import LogMap, carrier_fields
from .measurements import Measurements, measured_poses, tracked
from .pose_track import PoseTrack, unit_quaternions
from .recording import Field, Recording, Samples, check_rising
from .streams import Reader, at_times

MOST_ALIGNED = 200_000  # poses
FAR_APART = 0.1  # [s] between clocks in one file; calibration and replay find smaller offsets themselves
STEP, FEWEST, MOST_COMPARED = 0.05, 0.5, 300  # [s] of a search, share of samples that must overlap, and their number
LONGEST = 1e4  # [s] before and after the middle of a log
MOST_TRIED, LONGEST_STEP = 8000, 0.2  # offsets, and [s] of a search in a long log
# Another clock is better if the spread of lengths falls below this fraction; second: if orientations are not recorded.
CLEARLY, VERY_CLEARLY = 0.8, 0.5
EXACT = 3  # samples of a parabola that meets them: poses were smoothed when they were read
SURELY, LIKE = 10.0, 0.8  # standard deviations of such an offset, and the correlation of speeds


def clock_of_poses(
    lengths: Samples,
    pose: Samples,
    source: Field,
    first: Field,
    robot: Robot | None,
    given: LogMap | None,
    from_: Sequence[Recording],
) -> Clock | None:
    """Return the clock of poses by cable speeds, or None if poses and lengths have one; arguments as in `aligned`."""
    times, pose_times = lengths.times, pose.times
    assert times is not None
    assert pose_times is not None
    for one in (times, pose_times):
        check_rising(one)
    shared = min(times[-1], pose_times[-1]) - max(times[0], pose_times[0])
    if source.recording is first.recording and shared >= 0.5 * min(np.ptp(times), np.ptp(pose_times)):
        if robot is None:
            return None
        try:
            clock = aligned(lengths, pose, robot, given, from_)
        except ClockJumpError:
            raise
        except InputError:
            return None
        # That of another computer, which stamped the poses, is clearly far from the lengths'.
        ahead = clock.offset + (clock.rate - 1) * 0.5 * float(times[0] + times[-1])
        return clock if abs(ahead) > max(FAR_APART, SURELY * clock.sigma) and clock.likeness > LIKE else None
    if locked(lengths.values):
        if shared > 0:
            return None  # constant readings are the same at all times
        raise InputError("lengths must change to align the clocks, got readings of locked winches")
    if robot is None:
        raise InputError("robot must be given to align the clocks of lengths and poses, got None")
    return aligned(lengths, pose, robot, given, [one for one in from_ if one is source.recording])


def aligned(
    lengths: Samples, pose: Samples, robot: Robot, given: LogMap | None, of_poses: Sequence[Recording]
) -> Clock:
    """Return the clock of poses in other recordings, which have poses of moving carriers too.

    `pose` is of positions (N, 3) [m], followed by quaternions (N, 4) where orientations were recorded.
    """
    rows = np.flatnonzero(np.isfinite(pose.values).all(axis=1))
    if len(rows) < 4 or lengths.times is None or pose.times is None:
        raise InputError("poses with positions must be measured to align the clocks, got none")
    rows = rows[:: max(1, len(rows) // MOST_ALIGNED)]
    complete = np.isfinite(lengths.values).all(axis=1)
    if complete.sum() < 4:
        raise InputError(f"lengths must have four complete samples or more to align the clocks, got {complete.sum()}")
    if lengths.values.shape[1] != robot.m:
        raise InputError(f"lengths must have a column for each of the {robot.m} cables, got {lengths.values.shape[1]}")
    poses = np.tile(robot.home, (len(rows), 1))
    poses[:, :3] = pose.values[rows, :3]
    carriers, effects = None, [poses[:, :3]]
    if any(carrier.moves for carrier in robot.carriers):
        seen = pose.times[rows]
        carriers = carriers_at(robot, of_poses, given, seen, len(rows), [])[0]
        kept = np.isfinite(carriers).all(axis=(1, 2))
        if not kept.any():
            raise InputError(f"poses must include the poses of the carriers of {robot.name} to align clocks, got none")
        rows, poses, carriers = rows[kept], poses[kept], carriers[kept]
        effects = [poses[:, :3], *np.swapaxes(carriers[..., :3], 0, 1)]
    if pose.values.shape[1] > 3:
        rotation = Rotation.from_quat(pose.values[rows, 3:])
        poses[:, 3:] = points.angles(rotation.as_matrix())
        effects.append((rotation * rotation[0].inv()).as_rotvec())
    effects = np.hstack(effects)
    effects = effects[:, np.ptp(effects, axis=0) > 1e-6]
    along = np.asarray(Dynamics(robot).cable_lengths(poses, carriers))
    records = Records(lengths.times[complete], lengths.values[complete], pose.times[rows], along, effects)
    if of_poses:
        check_jumps(records)
    return align(records)


def realigned(
    robot: Robot, measurements: Measurements, rows: np.ndarray | slice = slice(None)
) -> tuple[Measurements, Clock | None]:
    """Return samples of measurements at the times of poses by the clock that all cable speeds show, and this clock.

    Cable speeds of poses in a wrong frame hardly show the rate of a clock. Nothing changes, and the clock is None,
    without times, with moving carriers, or if lengths and poses have too little in common.
    """
    times, poses, known = measurements.times, measurements.poses, tracked(robot, measurements)
    if times is None or poses is None or measurements.carrier_poses is not None or known.sum() < 4:
        return measurements, None
    turns = unit_quaternions(poses[:, 3:]) if np.isfinite(poses[:, 3:]).any() else poses[:, :0]
    seen = Samples(times, np.hstack([poses[:, :3], turns]))
    try:
        clock = aligned(Samples(times, measurements.lengths), seen, robot, None, [])
    except InputError:
        return measurements, None
    position, rotation, _ = measured_poses(robot, measurements)
    track = PoseTrack((times - clock.offset) / clock.rate, position, rotation, known, EXACT).at_times(times[rows])
    position, rotation = track.at(0.0)[:2]
    angles = points.angles(rotation)
    if np.nanmax(np.abs(poses[:, 3:]), initial=0.0) > np.pi:  # such as degrees, which are read as they were logged
        at = clock.offset + clock.rate * times[rows]
        angles = np.stack([np.interp(at, times[known], column) for column in poses[known, 3:].T], axis=1)
    moved = np.where(np.isfinite(poses[rows]), np.hstack([position, angles]), np.nan)
    return measurements.only(rows).changed(poses=moved).only(track.inside(0.0)), clock


class Seen(NamedTuple):
    """Times (N,) [s] and poses (N, 6) of the platform, with the cable lengths up to offsets, (N, m) [m]."""

    times: np.ndarray
    poses: np.ndarray
    lengths: np.ndarray


class _Track(NamedTuple):
    """The recording of a carrier in a file of its own: times (K,) [s] and poses (K, 6) [m, rad]."""

    source: Recording
    times: np.ndarray
    poses: np.ndarray


def set_clocks_of_carriers(
    robot: Robot, of_poses: Sequence[Recording], all_: Sequence[Recording], given: LogMap | None, seen: Seen | None
) -> tuple[list[str], bool]:
    """Set the clocks of carriers that were recorded in files of their own.

    The right offset is the one at which the distance from anchor to attachment changes as the length does: hardly, if
    the lengths are constant. Clocks of one rate are assumed. Without poses of the platform, the directions of the
    cables of the first such carrier show where the platform is. Returns notes, and whether there are such carriers.
    """
    tracks, whose = _tracks(robot, all_, given), "the poses"
    first = next(iter(tracks), 0)
    if seen is None:
        of_poses, whose = [one.source for one in tracks.values()][:1], robot.carriers[first].name
    of_others = {id(one.source) for one in tracks.values()} - {id(one) for one in of_poses}
    others = [index for index, one in tracks.items() if id(one.source) in of_others]
    if not others:
        return [], False
    if seen is None:
        ways = _seen_from(robot, first, tracks[first], all_, given)
        if not ways:
            names = ", ".join(robot.carriers[index].name for index in others)
            hint = f"relative to {whose}: neither poses of the load nor directions of its cable show them"
            return [f"the clocks of {names} are not known {hint}"], True
    else:
        known = seen.poses[np.isfinite(seen.poses[:, :3]).all(axis=1)]
        middle = robot.carrier_home[None].copy()  # (1, c, 6)
        for index, track in tracks.items():
            middle[0, index, :3] = np.median(track.poses[:, :3], axis=0)
        # Bodies turn about other axes in a frame of north, east, down, which moves the ends of their cables.
        axis = ned_frame(robot, np.median(known, axis=0, keepdims=True), middle) if len(known) else None
        if axis is not None:
            seen = seen._replace(poses=np.asarray(platform_from_ned(robot, seen.poses, axis)))
            tracks = {index: one._replace(poses=from_ned(one.poses, axis)) for index, one in tracks.items()}
        ways = [seen]
    tried: list[dict[int, tuple[float, float]]] = []
    for number, way in enumerate(ways):
        tried.append({})
        for index in others:
            own = [] if seen is not None else _seen_from(robot, index, tracks[index], all_, given)
            ends = None
            if len(own) == len(ways):
                arms = [robot.home_attachments[list(robot.carrier_of_cable).index(i)] for i in (index, first)]
                shift = np.pad(arms[0] - arms[1], (0, 3))  # from poses, by the attitude at home, to the ends of cables
                ends = own[number]._replace(poses=own[number].poses + shift)
            tried[-1][index] = _offset(robot, index, tracks[index], way, ends)
    notes: list[str] = []
    for index, (offset, _) in min(tried, key=lambda one: sum(left for _, left in one.values())).items():
        tracks[index].source.ahead = offset
        if offset:
            where = f"{abs(offset):.4f} s {'ahead of' if offset > 0 else 'behind'} that of {whose}"
            notes.append(f"the clock of {robot.carriers[index].name} is {where}")
    return notes, True


def _tracks(robot: Robot, all_: Sequence[Recording], given: LogMap | None) -> dict[int, _Track]:
    """Return the recorded motions of moving carriers by their indices."""
    tracks: dict[int, _Track] = {}
    for index, carrier in enumerate(robot.carriers):
        found = carrier_fields(all_, given, carrier.name)
        if not found.position or not carrier.moves:
            continue
        reader = Reader(found)
        own, position = reader.stream(found.position)
        if own is None:
            continue
        angles = angles_at(own, reader, found) if found.orientation else np.full_like(position, np.nan)
        poses = np.hstack([position, np.where(np.isfinite(angles), angles, carrier.home[3:])])
        kept = np.isfinite(position).all(axis=1) & _lasting(own)
        if kept.sum() >= 4:
            tracks[index] = _Track(found.position[0].recording, own[kept], poses[kept])
    return tracks


def _seen_from(robot: Robot, index: int, track: _Track, all_: Sequence[Recording], given: LogMap | None) -> list[Seen]:
    """Return where a carrier's first cable of constant length leads, for each way to read its recorded directions."""
    found = carrier_fields(all_, given, robot.carriers[index].name)
    if robot.fixed_lengths is None or not found.directions:
        return []
    cables = np.flatnonzero(np.asarray(robot.carrier_of_cable) == index)
    samples = Reader(found).stream(found.directions)
    R, lengths = points.rotations(track.poses[:, 3:]), np.tile(robot.fixed_lengths, (len(track.times), 1))
    start, arm = track.poses[:, :3] + R @ robot.anchors[cables[0]], robot.home_attachments[cables[0]] - robot.home[:3]
    ways: list[Seen] = []
    for of in vectors(found.directions, samples.values, len(cables)).values():
        own = at_times(track.times, Samples(samples.times, of[:, 0]), found.directions[0]).values
        for d in (own, (R @ own[..., None])[..., 0]):
            for sign in (1.0, -1.0):
                at = start + sign * lengths[:, cables[:1]] * d - arm
                ways.append(Seen(track.times, np.hstack([at, np.full_like(at, np.nan)]), lengths))
    return [way for way in ways if np.isfinite(way.poses[:, :3]).all(axis=1).any()]


def _lasting(times: np.ndarray) -> np.ndarray:
    """Return which times (N,) are near most others: not before a clock was set, as from boot to epoch, nor nan."""
    return np.asarray(np.abs(times - np.median(np.nan_to_num(times))) <= LONGEST)


def _offset(robot: Robot, index: int, track: _Track, seen: Seen, own: Seen | None = None) -> tuple[float, float]:
    """Return by how much the clock of a carrier is ahead [s], 0 if that is not clear, and the spread of lengths [m].

    If directions of its cable show the platform too, `own`, the distance between the ends of both cables is constant.
    """
    from scipy.optimize import minimize_scalar

    cables = np.flatnonzero(np.asarray(robot.carrier_of_cable) == index)
    rows = np.flatnonzero(np.isfinite(seen.poses[:, :3]).all(axis=1) & _lasting(seen.times))
    if not len(rows) or not len(cables):
        return 0.0, 0.0
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, MOST_COMPARED).astype(int))]
    turned = np.isfinite(seen.poses[rows, 3:])
    if own is None:
        times, poses, lengths = track.times, track.poses, seen.lengths[:, cables]
        angles = np.where(turned, seen.poses[rows, 3:], robot.home[3:])
        clearly = CLEARLY if turned.all() or not robot.dof_mask[3:].any() else VERY_CLEARLY
        ends = seen.poses[rows, None, :3] + robot.attachments[cables] @ np.swapaxes(points.rotations(angles), 1, 2)
        starts = poses[:, None, :3] + robot.anchors[cables] @ np.swapaxes(points.rotations(poses[:, 3:]), 1, 2)
    else:  # both show the ends of cables, up to constant vectors
        known = np.isfinite(own.poses[:, :3]).all(axis=1)
        times, lengths, clearly, cables = own.times[known], np.zeros((len(seen.times), 1)), CLEARLY, cables[:1]
        starts, ends = own.poses[known, None, :3], seen.poses[rows, None, :3]
    flat = starts.reshape(len(starts), -1).T

    def spread(offset: float) -> float:
        at = seen.times[rows] + offset
        inside = (at >= times[0]) & (at <= times[-1])
        if inside.mean() < FEWEST:
            return np.inf
        moved = np.stack([np.interp(at[inside], times, column) for column in flat], axis=1)
        apart = np.linalg.norm(moved.reshape(-1, len(cables), 3) - ends[inside], axis=2)
        return float((apart - lengths[rows][inside]).std(axis=0).mean())

    low, high = times[0] - seen.times[rows[-1]], times[-1] - seen.times[rows[0]]
    step = float(np.clip((high - low) / MOST_TRIED, STEP, LONGEST_STEP))
    tried = np.arange(low, high + step, step)
    best = tried[int(np.argmin([spread(offset) for offset in tried]))]
    found: Any = minimize_scalar(spread, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-5})
    as_given = spread(0.0)
    return (float(found.x), float(found.fun)) if found.fun < clearly * as_given else (0.0, as_given)
