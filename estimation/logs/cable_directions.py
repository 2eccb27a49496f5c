"""Recorded directions of cables as unit vectors in {G} from anchor to platform, whatever their frame and sign.

Logs have no common convention: directions may be seen from the world, from a carrier or from the platform, and point
to either end. Those of the robot's file, at the measured poses, decide. Without measured positions, these follow from
the directions themselves, and all cables must lead to the same one.
"""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from ...base.csv_columns import ANGLES
from ...base.errors import InputError
from ...base.text import quantity
from ...models import points
from ...models.dynamics import Dynamics
from ...models.robot import Robot
from .encoders import lengths_of
from .measurements import Measurements, carriers_of, measured_poses
from .recording import Field

FRAMES = {"world": "in {G}", "carrier": "in the frames of the carriers", "platform": "in the frame of the platform"}
ENDS = {1.0: "from the anchors to the platform", -1.0: "from the platform to the anchors"}
CLEARLY = 2.0  # times smaller differences, by another convention
FARTHEST = np.radians(30.0)  # median difference from the file's directions
MOST_COMPARED = 400  # samples


def vectors(fields: Sequence[Field], values: np.ndarray, m: int) -> dict[str, np.ndarray]:
    """Return the unit vectors (N, m, 3) of recorded directions (N, k), by what their angles may mean, usual one first.

    z is nan of an azimuth alone, all of what was not measured. Raises `InputError` for a wrong number of fields.
    """
    k = len(fields)
    angles = fields[0].unit in ANGLES
    if k not in ((m, 2 * m) if angles else (3 * m,)):
        wanted = "1 or 2 angles" if angles else "x, y, z"
        raise InputError(f"directions must have {wanted} for each of the {m} cables, got {k} fields ({fields[0].full})")
    if not angles:
        whole = values.reshape(-1, m, 3)
        size = np.linalg.norm(whole, axis=2, keepdims=True)
        return {"": whole / np.where(size > 0, size, np.nan)}
    azimuth = values.reshape(-1, m, k // m)
    x, y = np.cos(azimuth[..., 0]), np.sin(azimuth[..., 0])
    if k == m:
        return {"": np.stack([x, y, np.full_like(x, np.nan)], axis=2)}
    c, s = np.cos(azimuth[..., 1]), np.sin(azimuth[..., 1])
    return {
        "": np.stack([c * x, c * y, s], axis=2),
        "with elevations that point down": np.stack([c * x, c * y, -s], axis=2),
        "with angles from straight down": np.stack([s * x, s * y, -c], axis=2),
    }


def in_world(
    robot: Robot, measured: Measurements, given: Mapping[str, np.ndarray], stated: str | None = None
) -> tuple[np.ndarray, str | None]:
    """Return unit vectors (N, m, 3) in {G} from anchor to platform, and a note if they were recorded otherwise.

    - `measured`: measurements, with poses of the carriers if these move.
    - `given`: `vectors` of the log.
    - `stated`: frame of the directions, world, carrier or platform; default: the one that fits best.

    Raises `InputError` if no frame fits, or the cables look exchanged.
    """
    position, rotation, known = measured_poses(robot, measured)
    measured_there = bool(known[:, :3][:, robot.dof_mask[:3] > 0].all(axis=1).any())
    usable = np.isfinite(next(iter(given.values()))[..., :2]).all(axis=(1, 2))
    rows = np.flatnonzero(usable & (known[:, :3][:, robot.dof_mask[:3] > 0].all(axis=1) | (not measured_there)))
    if not rows.size:
        return next(iter(given.values())), "no directions of all cables were recorded together with a position"
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_COMPARED)).astype(int))]
    carriers = np.broadcast_to(carriers_of(robot, measured), (len(measured), *robot.carrier_home.shape))
    turns = {
        "world": np.broadcast_to(np.eye(3), (len(measured), 1, 3, 3)),
        "carrier": points.rotations(carriers[..., 3:])[:, robot.carrier_of_cable],
        "platform": rotation[:, None],
    }
    poses = np.hstack([position[rows], points.angles(rotation[rows])])
    tried: list[tuple[float, str, str, float, np.ndarray]] = []
    for (meaning, of), frame, sign in product(given.items(), [stated] if stated else FRAMES, ENDS):
        seen = sign * _turned(turns[frame][rows], of[rows])
        at = poses if measured_there else placed(robot, measured.only(rows), poses, seen)
        apart = _apart(-np.swapaxes(Dynamics(robot).wrench_matrix(at, carriers[rows])[:, :3], 1, 2), seen)
        tried.append((float(np.diag(apart).max()), meaning, frame, sign, apart))
    best = min(tried, key=lambda one: one[0])
    best = best if CLEARLY * best[0] < tried[0][0] else tried[0]
    error, meaning, frame, sign, apart = best
    _check_order(apart, error, measured_there)
    world = sign * _turned(turns[frame], given[meaning])
    if best is tried[0]:
        return world, None
    how = " and ".join(text for text in (meaning, FRAMES[frame], ENDS[sign]) if text)
    angles = quantity(np.degrees(error), "deg", 2), quantity(np.degrees(tried[0][0]), "deg", 2)
    text = f"cable directions look recorded {how}, and are converted: they then differ from the file's by {angles[0]}"
    return world, f"{text} instead of {angles[1]}"


def _turned(turns: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Return vectors (N, m, 3) turned by rotations (N, m or 1, 3, 3); azimuths alone stay such."""
    flat = np.isnan(of[..., 2]) & np.isfinite(of[..., 0])
    whole = np.where(flat[..., None] & np.array([False, False, True]), 0.0, of)
    result = (turns @ whole[..., None])[..., 0]
    result[flat, 2] = np.nan
    return result


def placed(robot: Robot, measured: Measurements, poses: np.ndarray, seen: np.ndarray | None = None) -> np.ndarray:
    """Return poses (N, 6) at the mean of the positions to which the directions of all cables lead, where known.

    `seen` are unit vectors (N, m, 3) in {G} from anchor to platform; default: those of the measurements.
    """
    seen = measured.directions if seen is None else seen
    if seen is None:
        return poses
    carriers = np.broadcast_to(carriers_of(robot, measured), (len(seen), *robot.carrier_home.shape))
    along = lengths_of(robot, measured.lengths)[..., None] * seen - points.attachments(robot, poses)
    position = poses[:, :3] + (points.anchors(robot, carriers) + along).mean(axis=1)
    moves = (robot.dof_mask[:3] > 0) & np.isfinite(position)
    return np.hstack([np.where(moves, position, poses[:, :3]), poses[:, 3:]])


def _apart(expected: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return the median angles between expected directions i and recorded ones j, both (N, m, 3): (m, m) [rad]."""
    flat = np.isnan(seen[:, None, :, 2, None]) & np.array([False, False, True])
    one, other = (np.where(flat, 0.0, part) for part in (expected[:, :, None], seen[:, None]))  # (N, m, m, 3)
    cross = np.linalg.norm(np.cross(one, other), axis=3)
    return np.median(np.arctan2(cross, (one * other).sum(axis=3)), axis=0)


def _check_order(apart: np.ndarray, error: float, sure: bool) -> None:
    """Raise InputError if cables look exchanged, or directions are far from those of the file."""
    from scipy.optimize import linear_sum_assignment

    columns = linear_sum_assignment(apart**2)[1]
    if sure and CLEARLY * apart[np.arange(len(apart)), columns].max() < error:
        order = ", ".join(str(column + 1) for column in columns)
        raise InputError(f"directions must be in the order of the cables, got them in an order that looks like {order}")
    if error > FARTHEST:
        raise InputError(
            "directions must be in {G}, or in the frame of a carrier or the platform, and agree with the file's, got "
            f"differences of {quantity(np.degrees(error), 'deg', 2)}"
        )
