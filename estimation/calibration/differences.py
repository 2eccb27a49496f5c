"""`LogPart`: samples of a log, and the differences between cable lengths and readings that offsets do not explain.

The ends of cables may be displaced from those in the file. What a displacement explains is not counted as a difference,
but a penalty on displacements is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import points
from ...models.robot import Robot
from .geometry import runs
from .interpretations import Interpretation

FEWEST = 12, 24  # samples with which displaced anchors, and displaced attachments, are taken into account
PLAUSIBLE = 0.03  # of a cable's length, by which its ends may be displaced
STRIDE = 5  # between the samples that the roughness is computed from
WRONG, MOST_WRONG = 6.0, 0.2  # median sizes, beyond which samples are left out, and how many may be
MOST_ROUNDS = 4  # of leaving out samples
MOST_NOISE = 0.02  # [rad], of measured angles
SLIPPED = 3.0  # times smaller differences without a slip
AS_GIVEN = Interpretation("")


class LogPart(NamedTuple):
    """Samples with measured poses: the parameters' table, positions, rotations, angles as logged, and readings.

    `carriers` are the poses of moving ones, (N, c, 6), which are read in the same way, or None. `counted` is True if
    readings may be multiples of lengths, with another factor for each cable.
    """

    robot: Robot
    table: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    angles: np.ndarray
    y: np.ndarray
    sigma: float
    carriers: np.ndarray | None = None
    counted: bool = False

    def without(self, samples: np.ndarray) -> LogPart:
        """Return the log without some samples (N,) of bool."""
        parts = {name: getattr(self, name)[~samples] for name in ("position", "rotation", "angles", "y")}
        return self._replace(**parts, carriers=None if self.carriers is None else self.carriers[~samples])

    def steady(self) -> LogPart:
        """Return the log with one orientation if those measured hardly change, and it leaves smaller differences.

        They are noise then, which other conventions of angles or frames would make smaller.
        """
        if float(np.sqrt(self.angles.var(axis=0).sum())) > MOST_NOISE or len(self.y) < 2:
            return self
        rotation = np.broadcast_to(Rotation.from_matrix(self.rotation).mean().as_matrix(), self.rotation.shape)
        other = self._replace(rotation=rotation, angles=np.broadcast_to(self.angles.mean(axis=0), self.angles.shape))
        return min(self, other, key=lambda one: float(medians(one.sound(0)[1], len(one.y)).sum()))

    def at(self, way: Interpretation) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return positions, rotations and poses of carriers as another interpretation reads them."""
        turned = self.rotation if way.turned is None else way.turned(self.rotation, self.angles)
        carriers = None if self.carriers is None else self.carriers.copy()
        for one in () if carriers is None else np.swapaxes(carriers, 0, 1):
            one[:, :3] = way.placed(one[:, :3])
            if way.turned is not None:
                one[:, 3:] = points.angles(way.turned(points.rotations(one[:, 3:]), one[:, 3:]))
        return way.placed(self.position), turned, carriers

    def read_in(self, way: Interpretation) -> LogPart:
        """Return the log with poses as another interpretation reads them."""
        position, rotation, carriers = self.at(way)
        return self._replace(position=position, rotation=rotation, carriers=carriers)

    def parts(self, way: Interpretation) -> tuple[np.ndarray, np.ndarray]:
        """Return the parts of lengths (m, N + c) and readings (m, m, N + c) that cables do not explain [m].

        Cable i explains part of its own lengths and of the reading of each cable j, by an offset and, with enough
        samples, by displaced anchors and attachments. The last c columns are the penalties for these.
        """
        run = runs(self.robot, self.table, *self.at(way))
        ends = 3 * sum(len(self.y) >= fewest for fewest in FEWEST)  # of their coordinates
        D = np.concatenate([np.ones((*run.lengths.shape, 1)), run.by_geometry[..., :ends]], axis=2)  # (m, N, c)
        count, c = D.shape[1:]
        # A displacement by PLAUSIBLE costs as much as differences of the stated size.
        length = float(np.nanmedian(run.lengths))
        prior = np.sqrt(count) * self.sigma / (PLAUSIBLE * length) * np.eye(c)[1:]
        Q = np.linalg.qr(np.concatenate([D, np.tile(prior, (len(D), 1, 1))], axis=1))[0]
        both = np.concatenate([run.lengths[:, None], np.tile(self.y.T, (len(D), 1, 1))], axis=1)  # (m, 1 + m, N)
        both = np.concatenate([both, np.zeros((*both.shape[:2], c - 1))], axis=2)
        left = both - np.matmul(np.matmul(both, Q), np.swapaxes(Q, 1, 2))
        left[..., :count] *= np.sqrt(count / (count - c))
        left[..., count:] /= np.sqrt(count)
        return left[:, 0], left[:, 1:]

    def sound(self, rounds: int = MOST_ROUNDS) -> tuple[LogPart, np.ndarray]:
        """Return the log and its differences as given, (m, N + c), without samples in which these are far too large.

        Cables may be slack at first, and displaced ends of cables would make up for this. Winches may slip.
        """
        lengths, y = self.parts(AS_GIVEN)
        order = np.arange(len(lengths))
        left = lengths - y[order, order]
        e = np.abs(left[:, : len(self.y)])
        wrong = np.asarray((e > WRONG * np.median(e, axis=1, keepdims=True)).any(axis=0))
        if rounds and wrong.any() and wrong.mean() <= MOST_WRONG:
            return self.without(wrong).sound(rounds - 1)
        return self._without_slips(left) if rounds else (self, left)

    def _without_slips(self, left: np.ndarray) -> tuple[LogPart, np.ndarray]:
        """Return the log with differences `left`, (m, N + c), without the step that a slip of a winch explains."""
        count, cables = len(self.y), np.arange(len(left))
        if count < FEWEST[1]:
            return self, left
        at = np.abs(np.diff(left[:, :count], axis=1)).argmax(axis=1)
        after = np.where(np.arange(count)[:, None] > at, 1.0, 0.0)
        steps = self._replace(y=after).parts(AS_GIVEN)[1][cables, cables]
        y = self.y + after * (left * steps).sum(axis=1) / (steps**2).sum(axis=1)
        lengths, readings = self._replace(y=y).parts(AS_GIVEN)
        slipped = medians(lengths - readings[cables, cables], count) < medians(left, count) / SLIPPED
        return self._replace(y=np.where(slipped, y, self.y)).sound(0) if slipped.any() else (self, left)

    def roughness(self, ways: list[Interpretation]) -> np.ndarray:
        """Return the median difference that offsets do not explain in each of some ways (w,), by a few samples [m]."""
        few = self.without(np.arange(len(self.y)) % STRIDE > 0)
        position, rotation, carriers = zip(*map(few.at, ways), strict=True)
        moved = None if few.carriers is None else np.concatenate(carriers)
        lengths = runs(few.robot, few.table, np.concatenate(position), np.concatenate(rotation), moved).lengths
        y = np.stack([way.factor * few.y.T for way in ways], axis=1)  # (m, w, N)
        apart = lengths.reshape(y.shape) - y
        return np.asarray(np.median(np.abs(apart - np.median(apart, axis=2, keepdims=True)), axis=(0, 2)))


def medians(left: np.ndarray, count: int) -> np.ndarray:
    """Return sizes of unexplained parts (..., N + c): medians over N samples, and penalties for displacements."""
    return np.hypot(np.median(np.abs(left[..., :count]), axis=-1), np.linalg.norm(left[..., count:], axis=-1))
