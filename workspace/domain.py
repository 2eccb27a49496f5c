"""`Domain`: a region for one robot, and the map from points of the unit cube to configurations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.display import Displayed
from ..base.inputs import InputError, shown
from ..base.text import quantity_row
from ..models import Robot
from ..models.part import COORDINATES, Box
from ..models.points import anchors, attachments
from .condition import Places
from .region import AngleBox, Region, reach_boxes, room, surrounding_box

THINNEST = 1e-9  # [m or rad]; thinner than this is no extent


def three_cable_pose(robot: Robot, attitude: np.ndarray, carriers: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return positions of a platform on three cables of given lengths at given attitudes.

    |A_i - P - R b_i| = l_i: P lies on spheres about A_i - R b_i with the radii l_i. Of the two points that three
    spheres share it is the lower, along gravity.

    - `robot`: robot with three cables whose anchors are points.
    - `attitude`: (roll, pitch, yaw) of the platform, (n, 3) [rad].
    - `carriers`: poses in {G}, (n, c, 6) [m, rad].
    - `lengths`: (3,) for all configurations or (n, 3) [m].

    Returns positions in {G}, (n, 3) [m]; nan where the cables do not meet.
    """
    turned = np.concatenate([np.zeros_like(attitude), attitude], axis=1)
    centres = anchors(robot, carriers) - attachments(robot, turned)  # (n, 3, 3)
    to_second, to_third = centres[:, 1] - centres[:, 0], centres[:, 2] - centres[:, 0]
    squares = np.broadcast_to(lengths, (len(attitude), 3)) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = np.cross(to_second, to_third)
        area = _square(normal)
        # In the plane of the centres: 2 a . p = l_1^2 - l_2^2 + |a|^2, and so for b.
        along_second = squares[:, :1] - squares[:, 1:2] + _square(to_second)
        along_third = squares[:, :1] - squares[:, 2:] + _square(to_third)
        foot = np.cross(normal, along_third * to_second - along_second * to_third) / (2.0 * area)
        drop = normal * np.sqrt((squares[:, :1] - _square(foot)) / area)
        drop *= np.where(drop @ np.array(robot.gravity) < 0, -1.0, 1.0)[:, None]
        return centres[:, 0] + foot + drop


def _square(vectors: np.ndarray) -> np.ndarray:
    """Return squared lengths, (n, 1)."""
    return np.einsum("ni,ni->n", vectors, vectors)[:, None]


@dataclass(frozen=True)
class Domain(Displayed):
    """Ranges of the quantities that describe a configuration."""

    robot: Robot
    # limits of position, attitude, carriers' positions and cable lengths, in this order, (k,) [m, rad]. With
    # `position_from_lengths` the position's limits are a box that contains every position the lengths allow.
    low: np.ndarray
    high: np.ndarray
    position_from_lengths: bool  # True if three cable lengths determine the position

    @classmethod
    def of(cls, robot: Robot, region: Region) -> Domain:
        """Return the domain of a region for a robot.

        Raises `InputError` if the robot cannot be in the region, or nothing in it varies.
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
            position = _default_box(robot, boxes)
        else:
            position = _box_of_lengths(robot, region, carriers)
        if region.lengths is None and not (position[1] - position[0] > THINNEST).any():
            raise InputError(
                "region.position must have min below max along at least one axis, got a box from "
                f"({quantity_row(position[0])}) to ({quantity_row(position[1])})"
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
            raise InputError("region must have min below max in at least one quantity, got one in which nothing varies")
        return domain

    @cached_property
    def varying(self) -> np.ndarray:
        """Return the indices of the quantities that vary, (d,)."""
        thick = self.high - self.low > THINNEST
        thick[:3] &= not self.position_from_lengths
        return np.flatnonzero(thick)

    @property
    def extent(self) -> np.ndarray:
        """Return the range of each quantity that varies, (d,) [m, rad]."""
        return (self.high - self.low)[self.varying]

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest and the highest corner of the box of positions, (3,) [m]."""
        return self.low[:3], self.high[:3]

    @cached_property
    def attitude_varies(self) -> bool:
        """Return whether the attitude varies."""
        return bool((self.high - self.low)[3:6].max() > THINNEST)

    @cached_property
    def carriers_vary(self) -> bool:
        """Return whether the positions of carriers vary."""
        return bool((self.high - self.low)[6 : 6 + 3 * len(self.robot.carriers)].max() > THINNEST)

    @property
    def measure(self) -> float:
        """Return the volume of the box [m^3], or its area [m^2] or length [m] if it has no thickness along an axis."""
        thick = self.high[:3] - self.low[:3]
        return float(np.prod(thick[thick > THINNEST]))

    @property
    def measure_unit(self) -> str:
        """Return the unit of `measure`."""
        return {1: "m", 2: "m^2", 3: "m^3"}.get(int((self.high[:3] - self.low[:3] > THINNEST).sum()), "1")

    @property
    def numbers_kept(self) -> int:
        """Return the number of columns of `numbers`."""
        return 3 + 3 * self.attitude_varies + 3 * len(self.robot.carriers) * self.carriers_vary

    def numbers(self, places: Places) -> np.ndarray:
        """Return position, and attitude and carriers' positions if they vary, for each configuration, (n, k)."""
        parts = [places.pose if self.attitude_varies else places.pose[:, :3]]
        if self.carriers_vary:
            parts.append(places.carriers[:, :, :3].reshape(len(places), 3 * places.carriers.shape[1]))
        return np.hstack(parts) if len(parts) > 1 else parts[0]

    def places(self, units: np.ndarray) -> tuple[Places, np.ndarray]:
        """Map points of the unit cube to configurations.

        `units`: (n, d), between 0 and 1.

        Returns the configurations, and (n,) of bool: False where three cables of these lengths do not meet; the
        pose there is home.
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
        if not self.position_from_lengths:
            return Places(pose, where), np.ones(count, dtype=bool)
        pose[:, :3] = three_cable_pose(self.robot, pose[:, 3:], where, values[:, -3:])
        exists = np.isfinite(pose[:, 0])
        pose[~exists, :3] = self.robot.home[:3]
        return Places(pose, where), exists


def _carrier_boxes(robot: Robot, region: Region) -> dict[str, Box]:
    """Return the boxes of the moving carriers, by name."""
    if region.carriers == "home":
        return {}
    if region.carriers == "reach":
        boxes = reach_boxes(robot)
        if not boxes:
            raise InputError(
                f"region.carriers must be home for robot {robot.name!r} without mobile carriers, got reach"
            )
        return boxes
    names = [carrier.name for carrier in robot.carriers]
    for name in region.carriers:
        if name not in names:
            raise InputError(f"region.carriers must have the names {', '.join(names)}, got {shown(name)}")
    return dict(region.carriers)


def _default_box(robot: Robot, carriers: dict[str, Box]) -> tuple[np.ndarray, np.ndarray]:
    """Return a box about home and anchors, (3,) and (3,) [m], down to the floor and inside the room of the robot."""
    low, high = surrounding_box(robot, carriers)
    lowest, highest = room(robot)
    moving = robot.dof_mask[:3] > 0
    low = np.where(moving, np.clip(low, lowest, robot.home[:3]), low)
    return low, np.where(moving, np.clip(high, robot.home[:3], highest), high)


def _attitude(robot: Robot, region: Region) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of roll, pitch and yaw [rad]."""
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
                f"region.{field} must have equal min and max of {name}, which robot {robot.name!r} cannot change, got "
                f"{low:g} to {high:g}"
            )


def _box_of_lengths(robot: Robot, region: Region, carriers: list[Box]) -> tuple[np.ndarray, np.ndarray]:
    """Return a box that contains every position that three cables of at most the largest length allow."""
    assert region.lengths is not None
    if robot.m != 3 or (robot.dof_mask[:3] == 0).any():
        raise InputError(
            "region.lengths requires a robot with three cables and the coordinates x, y and z, "
            f"got {robot.m} cables and {', '.join(robot.platform.dof)}"
        )
    if robot.pulley_radii.any():
        raise InputError(f"region.lengths requires a robot whose anchors are points, got {robot.name!r} with pulleys")
    lows, highs = [], []
    for cable, owner in enumerate(robot.carrier_of_cable):
        own = robot.home_anchors[cable] - robot.carrier_home[owner, :3]
        away = region.lengths.max + np.linalg.norm(robot.attachments[cable])
        lows.append(own + carriers[owner].min - away)
        highs.append(own + carriers[owner].max + away)
    low, high = np.max(lows, axis=0), np.min(highs, axis=0)
    if (low >= high).any():
        raise InputError(
            f"region.lengths must be long enough for the three cables to meet, got at most {region.lengths.max:g} m"
        )
    return low, high
