"""Clocks of poses in another file than the lengths, by cable speeds, and of carriers in files of their own."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.errors import InputError
from ...models import points
from ...models.dynamics import Dynamics
from ...models.robot import Robot
from .alignment import Clock, align
from .carrier_poses import angles_at, carriers_at
from .mapping import Field, LogMap, carrier_fields
from .north_east_down import from_ned, ned_frame, platform_from_ned
from .recording import Recording, Samples, check_rising
from .streams import Reader

MOST_ALIGNED = 200_000  # poses
FAR_APART = 0.1  # [s] between clocks in one file; calibration and replay find smaller offsets themselves
STEP, FEWEST, MOST_COMPARED = (
    0.05,
    0.5,
    300,
)  # [s] of a search, share of the samples that must overlap, and their number
LONGEST = 1e4  # [s] before and after the middle of a log
CLEARLY = 0.8  # of the spread of a cable's length, below which another clock is better
SURELY, LIKE = 10.0, 0.8  # standard deviations of such an offset, and the correlation of speeds


def clock_of_poses(
    lengths: Samples,
    position: Samples,
    quaternions: np.ndarray | None,
    source: Field,
    first: Field,
    robot: Robot | None,
    given: LogMap | None,
    from_: Sequence[Recording],
) -> Clock | None:
    """Return the clock of poses by cable speeds, or None if poses and lengths have one."""
    times, pose_times = lengths.times, position.times
    assert times is not None
    assert pose_times is not None
    for one in (times, pose_times):
        check_rising(one)
    shared = min(times[-1], pose_times[-1]) - max(times[0], pose_times[0])
    if source.recording is first.recording and shared >= 0.5 * min(np.ptp(times), np.ptp(pose_times)):
        return None if robot is None else _far_apart(lengths, position, quaternions, robot, given, from_)
    if robot is None:
        raise InputError("robot must be given to align the clocks of lengths and poses, got None")
    return _aligned(lengths, position, quaternions, robot, given, [one for one in from_ if one is source.recording])


def _far_apart(
    lengths: Samples,
    position: Samples,
    quaternions: np.ndarray | None,
    robot: Robot,
    given: LogMap | None,
    from_: Sequence[Recording],
) -> Clock | None:
    """Return the clock of poses that another computer stamped, None unless it is clearly far from the lengths'."""
    try:
        clock = _aligned(lengths, position, quaternions, robot, given, from_)
    except InputError:
        return None
    assert lengths.times is not None
    middle = 0.5 * float(lengths.times[0] + lengths.times[-1])
    ahead = clock.offset + (clock.rate - 1) * middle
    return clock if abs(ahead) > max(FAR_APART, SURELY * clock.sigma) and clock.likeness > LIKE else None


def _aligned(
    lengths: Samples,
    position: Samples,
    quaternions: np.ndarray | None,
    robot: Robot,
    given: LogMap | None,
    of_poses: Sequence[Recording],
) -> Clock:
    """Return the clock of poses in other recordings, which have those of moving carriers too."""
    known = np.isfinite(position.values).all(axis=1)
    if quaternions is not None:
        known &= np.isfinite(quaternions).all(axis=1)
    rows = np.flatnonzero(known)
    if len(rows) < 4 or lengths.times is None or position.times is None:
        raise InputError("poses with positions must be measured to align the clocks, got none")
    rows = rows[:: max(1, len(rows) // MOST_ALIGNED)]
    if lengths.values.shape[1] != robot.m:
        raise InputError(f"lengths must have a column for each of the {robot.m} cables, got {lengths.values.shape[1]}")
    poses = np.tile(robot.home, (len(rows), 1))
    poses[:, :3] = position.values[rows]
    carriers, effects = None, [poses[:, :3]]
    if any(carrier.moves for carrier in robot.carriers):
        seen = position.times[rows]
        carriers = carriers_at(robot, of_poses, given, seen, len(rows), [])[0]
        kept = np.isfinite(carriers).all(axis=(1, 2))
        if not kept.any():
            raise InputError(f"poses must have those of the carriers of {robot.name}, to align clocks, got none")
        rows, poses, carriers = rows[kept], poses[kept], carriers[kept]
        effects = [poses[:, :3], *np.swapaxes(carriers[..., :3], 0, 1)]
    if quaternions is not None:
        rotation = Rotation.from_quat(quaternions[rows])
        poses[:, 3:] = points.angles(rotation.as_matrix())
        effects.append((rotation * rotation[0].inv()).as_rotvec())
    effects = np.hstack(effects)
    effects = effects[:, np.ptp(effects, axis=0) > 1e-6]
    along = np.asarray(Dynamics(robot).cable_lengths(poses, carriers))
    return align(lengths.times, lengths.values, position.times[rows], along, effects)


class Seen(NamedTuple):
    """Times (N,) [s] and poses (N, 6) of the platform, with the cable lengths up to offsets, (N, m) [m]."""

    times: np.ndarray
    poses: np.ndarray
    lengths: np.ndarray


def set_clocks_of_carriers(
    robot: Robot, of_poses: Sequence[Recording], all_: Sequence[Recording], given: LogMap | None, seen: Seen
) -> list[str]:
    """Set the clocks of carriers that were recorded in files of their own, and return a note on each.

    The right offset is the one at which the distance from anchor to attachment changes as the length does: hardly, if
    the lengths are constant. Clocks of one rate are assumed.
    """
    tracks: dict[int, tuple[Recording, np.ndarray, np.ndarray]] = {}
    middle = robot.carrier_home[None].copy()  # (1, c, 6)
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
            tracks[index] = found.position[0].recording, own[kept], poses[kept]
            middle[0, index, :3] = np.median(position[kept], axis=0)
    known = seen.poses[np.isfinite(seen.poses[:, :3]).all(axis=1)]
    # Bodies turn about other axes in a frame of north, east, down, which moves the ends of their cables.
    axis = ned_frame(robot, np.median(known, axis=0, keepdims=True), middle) if len(known) else None
    if axis is not None:
        seen = seen._replace(poses=np.asarray(platform_from_ned(robot, seen.poses, axis)))
    notes: list[str] = []
    for index, (source, own, poses) in tracks.items():
        if source in of_poses:
            continue
        carrier = robot.carriers[index]
        offset = _offset(robot, index, own, poses if axis is None else from_ned(poses, axis), seen)
        if offset:
            source.ahead = offset
            where = "ahead of" if offset > 0 else "behind"
            notes.append(f"the clock of {carrier.name} is {abs(offset):.4f} s {where} that of the poses")
    return notes


def _lasting(times: np.ndarray) -> np.ndarray:
    """Return which times (N,) are near most others: not before a clock was set, as from boot to epoch, nor nan."""
    return np.asarray(np.abs(times - np.median(np.nan_to_num(times))) <= LONGEST)


def _offset(robot: Robot, index: int, times: np.ndarray, poses: np.ndarray, seen: Seen) -> float:
    """Return by how much the clock of a carrier's poses (K, 6) is ahead [s], 0 if that is not clear."""
    from scipy.optimize import minimize_scalar

    cables = np.flatnonzero(np.asarray(robot.carrier_of_cable) == index)
    rows = np.flatnonzero(np.isfinite(seen.poses[:, :3]).all(axis=1) & _lasting(seen.times))
    if not len(rows) or not len(cables):
        return 0.0
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, MOST_COMPARED).astype(int))]
    angles = np.where(np.isfinite(seen.poses[rows, 3:]), seen.poses[rows, 3:], robot.home[3:])
    ends = seen.poses[rows, None, :3] + robot.attachments[cables] @ np.swapaxes(points.rotations(angles), 1, 2)
    starts = poses[:, None, :3] + robot.anchors[cables] @ np.swapaxes(points.rotations(poses[:, 3:]), 1, 2)  # (K, c, 3)
    flat = starts.reshape(len(starts), -1).T

    def spread(offset: float) -> float:
        at = seen.times[rows] + offset
        inside = (at >= times[0]) & (at <= times[-1])
        if inside.mean() < FEWEST:
            return np.inf
        moved = np.stack([np.interp(at[inside], times, column) for column in flat], axis=1)
        apart = np.linalg.norm(moved.reshape(-1, len(cables), 3) - ends[inside], axis=2)
        return float((apart - seen.lengths[rows][inside][:, cables]).std(axis=0).mean())

    tried = np.arange(times[0] - seen.times[rows[-1]], times[-1] - seen.times[rows[0]] + STEP, STEP)
    best = tried[int(np.argmin([spread(offset) for offset in tried]))]
    found: Any = minimize_scalar(spread, bounds=(best - STEP, best + STEP), method="bounded", options={"xatol": 1e-5})
    return float(found.x) if found.fun < CLEARLY * spread(0.0) else 0.0
