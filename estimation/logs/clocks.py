"""`clock_of_poses`: the clock of poses in another file than the lengths, by cable speeds."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.errors import InputError
from ...models import points
from ...models.dynamics import Dynamics
from ...models.robot import Robot
from .alignment import Clock, align
from .carrier_poses import carriers_at
from .mapping import Field, LogMap
from .recording import Recording, Samples, check_rising

MOST_ALIGNED = 200_000  # poses
FAR_APART = 0.1  # [s] between clocks in one file; calibration and replay find smaller offsets themselves
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
