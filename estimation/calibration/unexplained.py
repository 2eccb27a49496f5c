"""`Unexplained`: differences of lengths at measured poses from readings that are no noise, and what explains them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.display import Displayed
from ...models import points
from ...models.robot import Robot
from ..logs.clocks import LIKE, SURELY, realigned
from ..logs.encoders import locked, stretched
from ..logs.measurements import Measurements, measured_poses
from .differences import PLAUSIBLE, LogPart
from .explanations import Way

EXPLAINED = 0.1  # of the change of the readings, which differences are below if lengths and poses belong together
FAR = 3.0  # times the noise, of differences that are not explained yet
MOST_STRETCHED = 1.05  # of a length: no cable is stretched more
STILL = 2e-3  # of a length, by which the reading of a locked winch with noise may change


def part_of(robot: Robot, part: Measurements, table: np.ndarray) -> LogPart:
    """Return measurements as a part of a log."""
    position, rotation, known = measured_poses(robot, part)
    angles = points.angles(rotation) if part.poses is None else np.where(known[:, 3:], part.poses[:, 3:], 0.0)
    # An unknown tension stretches no cable here, and one in another unit, or of no cable, hardly any.
    stretch = np.clip(np.nan_to_num(stretched(robot, part.tensions), nan=1.0), 1.0, MOST_STRETCHED)
    y = part.lengths * table[:, 7] * stretch
    return LogPart(robot, table, position, rotation, angles, y, part.sigma.lengths, part.carrier_poses)


def aligned(robot: Robot, given: Measurements, rows: np.ndarray, table: np.ndarray) -> LogPart | None:
    """Return samples with the poses by the clock that cable speeds show, None if it is as good as theirs.

    A clock of the poses that is ahead is explained by no other frame or convention.
    """
    moved, clock = realigned(robot, given, rows)
    sure = clock is not None and clock.likeness > LIKE and abs(clock.offset) > SURELY * clock.sigma
    return part_of(robot, moved, table) if sure else None


@dataclass(frozen=True, eq=False)
class Unexplained(Displayed):
    """A log whose differences are no noise.

    Attributes:
        robot, given: The robot and all measurements.
        table: Parameters of the cables in the file, (m, 15).
        rows: Samples that are compared, (N,).
        log: These samples, by the clock that cable speeds show.
        noise: Largest differences by noise [m].
        ways: Explanations without other frames.
        as_given: Size of the differences of the log as it is [m].
    """

    robot: Robot
    given: Measurements
    table: np.ndarray
    rows: np.ndarray
    log: LogPart
    noise: float
    ways: list[Way]
    as_given: float

    @cached_property
    def whole(self) -> LogPart:
        """Return all samples."""
        return part_of(self.robot, self.given, self.table)

    @cached_property
    def still(self) -> bool:
        """Return whether winches are locked: units, signs and order of such readings do not show."""
        return locked(self.given.lengths, STILL)

    @cached_property
    def best(self) -> Way:
        """Return the best explanation."""
        return min((way for way in self.ways if way.text), key=lambda way: way[:2])

    @cached_property
    def most(self) -> float:
        """Return the size that differences must be below if lengths and poses belong together [m]."""
        log = self.log
        if not self.still:
            return EXPLAINED * float(np.median(np.abs(log.y - np.median(log.y, axis=0))))
        # Wrong anchors turn the cables, so they change lengths by a share of the motion.
        moved = float(np.median(np.linalg.norm(log.position - np.median(log.position, axis=0), axis=1)))
        return max(EXPLAINED * self.as_given, PLAUSIBLE * moved, self.noise)

    @property
    def named(self) -> bool:
        """Return whether an error without other frames is named."""
        return not self.still and self.best.weighted < self.as_given and self.best.size < self.most

    @property
    def left(self) -> float:
        """Return the size of the differences with the best explanation [m]."""
        return self.best.size * self.best.way.factor

    @property
    def far(self) -> bool:
        """Return whether differences are left that other frames may explain."""
        return self.left > FAR * self.noise if self.named else self.as_given > self.most
