"""`Region`: ranges to sample, as data; and the search for the feasible pose closest to an infeasible one."""

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from ..models import Robot
from ..models.part import Box, Name, Part, PositiveRange, Vector3, optional
from ..models.points import rotations
from ..models.shapes import skeleton
from .condition import Condition, Places

SCATTERED = 4000  # poses of the first round, at distances of all magnitudes
ROUNDS, AROUND, BETWEEN = 10, 400, 40  # then about the best pose so far, and on the line to it
SHRINK = 0.6  # of the surroundings, each round
NEAREST = 1e-4  # of the size, in the first round


class AngleBox(Box):
    """A box of attitudes (roll, pitch, yaw) [rad]."""

    sides: ClassVar[tuple[str, ...]] = ("for roll", "for pitch", "for yaw")
    unit: ClassVar[str] = "rad"

    min: Vector3
    max: Vector3


class Region(Part):
    """Describe the region to sample. A quantity with equal ends is constant: a slice is a box without thickness.

    Samples are uniform and independent in each varying quantity.
    """

    position: Box | None = optional(
        "box of positions of the platform frame in {G} [m]; default: a box about home and anchors, down to the floor "
        "and inside the workspace_box of the robot file"
    )
    attitude: Vector3 | AngleBox | None = optional(
        "(roll, pitch, yaw) or a box of them [rad]; default: the attitude at home"
    )
    carriers: Literal["home", "reach"] | dict[Name, Box] = optional(
        "home; reach: mobile carriers anywhere in their reach boxes; or boxes in {G} [m] by name", "home"
    )
    lengths: PositiveRange | None = optional(
        "range of the lengths of each of three cables [m]; the position then follows from carriers, "
        "attitude and lengths: the lower of the two points where the cables meet"
    )

    @model_validator(mode="after")
    def _one_source_of_positions(self) -> Self:
        if self.position is not None and self.lengths is not None:
            raise ValueError(
                "position and lengths must not both be given, because the position follows from the lengths, got both"
            )
        return self


def surrounding_box(robot: Robot, carriers: dict[str, Box]) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of a box about home, anchors and the floor below, (3,) and (3,) [m].

    Locked coordinates stay at home. A platform that hangs from anchors near one another can be far below them.
    Carriers are in the boxes of `carriers`, by name, or else at home.
    """
    corners = [robot.home_anchors, robot.home[None, :3]]
    if robot.floor is not None:
        corners.append(np.array([[*robot.home[:2], robot.floor]]))
    for index, carrier in enumerate(robot.carriers):
        if carrier.name in carriers:
            own = robot.home_anchors[robot.carrier_of_cable == index] - carrier.home[:3]
            corners += [own + carriers[carrier.name].min, own + carriers[carrier.name].max]
    every = np.vstack(corners)
    low, high = every.min(axis=0), every.max(axis=0)
    # There is space above and below the anchors too. Across gravity, cables that all pull to one side balance nothing.
    reach = np.linalg.norm(robot.attachments, axis=1) + 2 * robot.pulley_radii  # from anchors
    beside = np.where(robot.gravity, np.inf, 2 * reach.max())
    spread = np.maximum(high - low, np.minimum(0.5 * (high - low).max(), high - low + beside))
    low = np.minimum(low, (low + high - spread) / 2)
    moving = robot.dof_mask[:3] > 0
    return np.where(moving, low, robot.home[:3]), np.where(moving, low + spread, robot.home[:3])


def room(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return where the platform may be in its home attitude above the floor and in the room, (3,) and (3,) [m]."""
    body = robot.platform.body
    points = np.vstack([robot.platform.com, robot.attachments]) if body is None else skeleton(body).corners
    around = points @ rotations(robot.home[3:]).T
    radius = 0.0 if body is None else body.rounding
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    if robot.floor is not None:
        low[2] = robot.floor
    if (room := robot.workspace_box) is not None:
        low, high = np.maximum(low, room.min), np.minimum(high, room.max)
    return low - around.min(axis=0) + radius, high - around.max(axis=0) - radius


def reach_boxes(robot: Robot) -> dict[str, Box]:
    """Return the reach boxes of the carriers that have one, by name."""
    boxes = {carrier.name: carrier.motion_limits.reach for carrier in robot.carriers}
    return {name: box for name, box in boxes.items() if box is not None}


def nearest_feasible(
    robot: Robot, condition: Condition, pose: np.ndarray, carriers: np.ndarray, size: float
) -> np.ndarray | None:
    """Return the pose closest to `pose` at which a condition holds, to a few per cent of the distance, or None.

    The search samples poses and may miss a feasible set that is thin or has several parts. Distances are in metres,
    with radians multiplied by `Robot.length`.

    - `pose`, `carriers`: (6,) and (c, 6) in {G} [m, rad]. Carriers are fixed.
    - `size`: search radius [m].
    """
    rng, free = np.random.default_rng(0), robot.dof_mask.astype(bool)
    unit = robot.wrench_scale * free

    def holding(poses: np.ndarray) -> np.ndarray:
        """Return the poses at which the condition holds, the closest first."""
        places = Places(poses, np.broadcast_to(carriers, (len(poses), *carriers.shape)))
        there = poses[condition.evaluate(robot, places)]
        return there[np.argsort(distances(there))]

    def distances(poses: np.ndarray) -> np.ndarray:
        return np.linalg.norm((poses - pose)[:, free] / unit[free], axis=1)

    directions = rng.normal(size=(SCATTERED, 6)) * unit
    # Half of them keep the attitude: far away, random turns are large, and few platforms permit these.
    directions[::2, 3:] = 0.0
    directions /= np.linalg.norm(directions[:, free] / unit[free], axis=1, keepdims=True)
    reach = size * np.geomspace(NEAREST, 1.0, SCATTERED)[:, None]
    best = holding(np.vstack([pose, robot.home, pose + reach * directions]))[:1]
    if not len(best):
        return None
    spread = float(distances(best)[0])
    for _ in range(ROUNDS):
        near = best + spread * rng.normal(size=(AROUND, 6)) / np.sqrt(free.sum()) * unit
        near[::2, 3:] = best[:, 3:]
        best = holding(np.vstack([best, near]))[:1]
        # The end of the line is `best` but for rounding, which may be too much for a thin feasible set.
        best = holding(np.vstack([best, pose + np.linspace(0.0, 1.0, BETWEEN)[:, None] * (best - pose)]))[:1]
        spread *= SHRINK
    return best[0]
