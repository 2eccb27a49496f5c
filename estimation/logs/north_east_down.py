"""Poses in a frame of north, east, down, as drones record them, and their conversion to {G}, where z is up."""

import numpy as np

from ...models import points
from ...models.robot import Robot

# Rotations from north, east, down to {G}, by the axis of x of {G}; and from forward, right, down to x, y, z of a body.
FROM_NED = {"east": np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]), "north": np.diag([1.0, -1, -1])}
FROM_FRD = np.diag([1.0, -1, -1])
HANGS = 0.5  # of the height of carriers above the load at home: less is a load on the ground beside its carriers


def ned_frame(robot: Robot, poses: np.ndarray | None, carriers: np.ndarray) -> str | None:
    """Return where x of {G} points if the poses of a team are in a frame of north, east, down; otherwise None.

    Cables cannot push, so a load cannot be above all carriers that move, unless their frames are below it at home too,
    as with vehicles with masts. Without a position of the load, carriers below the origin that are above it at home
    are in such a frame. Which axis it is follows from the home poses.

    - `poses`: of the platform, (N, 6) [m, rad], nan where not measured.
    - `carriers`: of the carriers, (N, c, 6).
    """
    moving = [i for i in sorted(set(robot.carrier_of_cable)) if robot.carriers[i].moves]
    if not moving or len(moving) < len(set(robot.carrier_of_cable)) or np.any(robot.gravity[:2]):
        return None
    loaded = poses is not None and bool(np.isfinite(poses[:, :3]).any())
    at_home = robot.carrier_home[moving, :3] - (robot.home[:3] if loaded else 0.0)
    if not (at_home[:, 2] > 0).all() or not robot.gravity[2] < 0:
        return None
    away = carriers[:, moving, :3] - (poses[:, None, :3] if loaded and poses is not None else 0.0)
    away = away[(np.abs(away[..., 2]) > HANGS * at_home[:, 2]).all(axis=1) & np.isfinite(away).all(axis=(1, 2))]
    if not len(away) or (np.median(away[..., 2], axis=0) >= 0).any():
        return None
    middle = np.median(away, axis=0)
    if not loaded and len(moving) > 1:  # how the carriers lie to each other
        middle, at_home = middle - middle.mean(axis=0), at_home - at_home.mean(axis=0)
    return min(FROM_NED, key=lambda axis: float(np.linalg.norm(middle @ FROM_NED[axis].T - at_home)))


def from_ned(poses: np.ndarray, axis: str) -> np.ndarray:
    """Return poses (..., 6) [m, rad] in {G}, of poses in a frame of north, east, down; nan where not measured."""
    result, turn = poses.copy(), FROM_NED[axis]
    result[..., :3] = poses[..., :3] @ turn.T
    known = np.isfinite(poses[..., 3:]).all(axis=-1)
    result[known, 3:] = points.angles(turn @ points.rotations(poses[known, 3:]) @ FROM_FRD)
    return result


def carriers_from_ned(robot: Robot, poses: np.ndarray, axis: str) -> np.ndarray:
    """Return poses of carriers (N, c, 6) in {G}, as `from_ned`; carriers and attitudes at home are in {G} already."""
    result, home = poses.copy(), robot.carrier_home
    for i, carrier in enumerate(robot.carriers):
        if carrier.moves:
            result[:, i] = from_ned(poses[:, i], axis)
        if (poses[:, i, 3:] == home[i, 3:]).all():
            result[:, i, 3:] = home[i, 3:]
    return result


def platform_from_ned(robot: Robot, poses: np.ndarray | None, axis: str) -> np.ndarray | None:
    """Return poses of the platform (N, 6) in {G}, as `from_ned`; locked coordinates stay at home."""
    if poses is None:
        return None
    return np.where((robot.dof_mask > 0) | ~(poses == robot.home), from_ned(poses, axis), poses)


def note_of(axis: str, poses: np.ndarray | None) -> str:
    """Return the remark on converted poses, where those of the platform were `poses`, (N, 6) or None."""
    loaded = poses is not None and bool(np.isfinite(poses[:, :3]).any())
    why = "the load would be above its carriers" if loaded else "the carriers would be below the origin"
    return (
        f"{why}, so the poses are read as north, east, down, and forward, right, down of the bodies, with x of {{G}} "
        f"to the {axis}"
    )
