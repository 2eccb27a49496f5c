"""`Domain`: a region for one robot: which quantities vary between which ends, and the places that numbers stand for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import InputError
from ..models import Robot
from ..models.robot import COORDINATES, Box
from .places import Places
from .region import AngleBox, Region, reach_boxes, surrounding_box
from .three_cable_pose import three_cable_pose

THINNEST = 1e-9  # [m or rad]; thinner than this is no extent


@dataclass(frozen=True)
class Domain:
    """What varies, and between which ends.

    Attributes
    ----------
    low, high
        Ends of position, attitude, carriers' positions and cable lengths, in this order, (k,) [m, rad]. With `hangs`
        those of the position are of the box that holds every place the lengths allow.
    hangs
        Whether the position follows from three cable lengths.
    """

    robot: Robot
    low: np.ndarray
    high: np.ndarray
    hangs: bool

    @classmethod
    def of(cls, robot: Robot, region: Region) -> Domain:
        """The domain of a region for a robot.

        Raises
        ------
        InputError
            If the robot cannot be where the region says, or nothing in it varies.
        """
        boxes = _carrier_boxes(robot, region)
        home = robot.carrier_home[:, :3]
        carriers = [
            boxes.get(carrier.name, Box(min=tuple(at), max=tuple(at)))
            for carrier, at in zip(robot.carriers, home, strict=True)
        ]
        attitude = _attitude(robot, region)
        if region.position is not None:
            position = np.array(region.position.min), np.array(region.position.max)
            _check_locked(robot, "position", position, 0)
        elif region.lengths is None:
            position = surrounding_box(robot, boxes)
        else:
            position = _hanging_box(robot, region, carriers)
        if region.lengths is None and not (position[1] - position[0] > THINNEST).any():
            raise InputError(
                f"region.position: the box from {_told(position[0])} to {_told(position[1])} is empty; accepted: min "
                "below max along an axis at least"
            )
        lengths = ([], []) if region.lengths is None else ([region.lengths.min] * 3, [region.lengths.max] * 3)
        parts = [
            position,
            attitude,
            (np.ravel([box.min for box in carriers]), np.ravel([box.max for box in carriers])),
            lengths,
        ]
        low, high = (np.concatenate([np.asarray(part[end], dtype=float) for part in parts]) for end in (0, 1))
        domain = cls(robot, low, high, region.lengths is not None)
        if not domain.varying.size:
            raise InputError("region: nothing in it varies; accepted: min below max in one quantity at least")
        return domain

    @cached_property
    def varying(self) -> np.ndarray:
        """Indices of the quantities that vary."""
        thick = self.high - self.low > THINNEST
        thick[:3] &= not self.hangs
        return np.flatnonzero(thick)

    @property
    def extent(self) -> np.ndarray:
        """How far each of them varies, (d,) [m, rad]."""
        return (self.high - self.low)[self.varying]

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner of the box of positions, (3,) [m]."""
        return self.low[:3], self.high[:3]

    @cached_property
    def attitude_varies(self) -> bool:
        """Whether the attitude varies."""
        return bool((self.high - self.low)[3:6].max() > THINNEST)

    @cached_property
    def carriers_vary(self) -> bool:
        """Whether carriers move."""
        return bool((self.high - self.low)[6 : 6 + 3 * len(self.robot.carriers)].max() > THINNEST)

    @property
    def measure(self) -> float:
        """Volume of the box [m^3], or its area [m^2] or length [m] where it has no thickness along an axis."""
        thick = self.high[:3] - self.low[:3]
        return float(np.prod(thick[thick > THINNEST]))

    @property
    def measure_unit(self) -> str:
        """The unit of `measure`."""
        return {1: "m", 2: "m^2", 3: "m^3"}.get(int((self.high[:3] - self.low[:3] > THINNEST).sum()), "1")

    def places(self, units: np.ndarray) -> tuple[Places, np.ndarray]:
        """The places that points of the unit cube stand for, and whether there is such a place.

        Parameters
        ----------
        units
            (n, d), between 0 and 1.

        Returns
        -------
        Places, and (n,) of bool, false where three cables of those lengths do not meet; the pose is that of home there.
        """
        count, carriers = len(units), len(self.robot.carriers)
        values = np.empty((count, len(self.low)))
        values[:] = self.low
        values[:, self.varying] += units * self.extent
        pose = values[:, :6].copy()
        where = np.broadcast_to(self.robot.carrier_home, (count, carriers, 6))
        if self.carriers_vary:
            where = where.copy()
            where[:, :, :3] = values[:, 6 : 6 + 3 * carriers].reshape(count, carriers, 3)
        if not self.hangs:
            return Places(pose, where), np.ones(count, dtype=bool)
        pose[:, :3] = three_cable_pose(self.robot, pose[:, 3:], where, values[:, -3:])
        exists = np.isfinite(pose[:, 0])
        pose[~exists, :3] = self.robot.home[:3]
        return Places(pose, where), exists


def _carrier_boxes(robot: Robot, region: Region) -> dict[str, Box]:
    """Boxes of the carriers that may move, by name."""
    if region.carriers == "home":
        return {}
    if region.carriers == "reach":
        boxes = reach_boxes(robot)
        if not boxes:
            raise InputError(f"region.carriers: reach: robot {robot.name!r} has no mobile carriers; accepted: home")
        return boxes
    names = [carrier.name for carrier in robot.carriers]
    for name in region.carriers:
        if name not in names:
            raise InputError(f"region.carriers: {name!r} is unknown; accepted: {', '.join(names)}")
    return dict(region.carriers)


def _attitude(robot: Robot, region: Region) -> tuple[np.ndarray, np.ndarray]:
    """Ends of roll, pitch and yaw [rad]."""
    if region.attitude is None:
        return robot.home[3:], robot.home[3:]
    if isinstance(region.attitude, AngleBox):
        ends = np.array(region.attitude.min), np.array(region.attitude.max)
    else:
        ends = np.array(region.attitude), np.array(region.attitude)
    _check_locked(robot, "attitude", ends, 3)
    return ends


def _check_locked(robot: Robot, field: str, ends: tuple[np.ndarray, np.ndarray], first: int) -> None:
    for i, (low, high) in enumerate(zip(*ends, strict=True)):
        name = COORDINATES[first + i]
        if name not in robot.platform.dof and high - low > THINNEST:
            raise InputError(
                f"region.{field}: {name} from {low:g} to {high:g}, but robot {robot.name!r} cannot move so; accepted: "
                "equal min and max"
            )


def _hanging_box(robot: Robot, region: Region, carriers: list[Box]) -> tuple[np.ndarray, np.ndarray]:
    """The box that holds every place three cables of at most the largest length allow."""
    assert region.lengths is not None
    if robot.m != 3 or (robot.dof_mask[:3] == 0).any():
        raise InputError(
            f"region.lengths: robot {robot.name!r} has {robot.m} cables; accepted: robots with three, moving in space"
        )
    if robot.pulley_radii.any():
        raise InputError(f"region.lengths: robot {robot.name!r} has pulleys; accepted: robots whose anchors are points")
    lows, highs = [], []
    for cable, owner in enumerate(robot.carrier_of_cable):
        own = robot.home_anchors[cable] - robot.carrier_home[owner, :3]
        away = region.lengths.max + np.linalg.norm(robot.attachments[cable])
        lows.append(own + carriers[owner].min - away)
        highs.append(own + carriers[owner].max + away)
    low, high = np.max(lows, axis=0), np.min(highs, axis=0)
    if (low >= high).any():
        raise InputError(
            f"region.lengths: at most {region.lengths.max:g} m; the three cables never meet; accepted: longer ones"
        )
    return low, high


def _told(vector: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:g}" for value in vector) + ")"
