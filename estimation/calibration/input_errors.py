"""`Mistake`: a probable input error of a log, in one line, and the log without it."""

from typing import NamedTuple

import numpy as np

from ...base.display import record
from ...base.text import quantity
from ...models import points
from ..logs.measurements import Measurements

Placed = tuple[np.ndarray, np.ndarray, np.ndarray | None]  # positions, rotations, and poses of carriers


class Mistake(NamedTuple):
    """A probable input error of a log.

    Attributes:
        text: The error, in one line.
        corrected: Measurements without it, or None if several errors are equally probable.
        severe: True if a calibration would be wrong, False if it would only mean a frame other than the file's.
        factors: Factors of the readings in `corrected`, (m,) or one for all cables.
        columns: Column of the log for each cable, (m,); None if the columns are in the order of the cables.
    """

    text: str
    corrected: Measurements | None
    severe: bool = True
    factors: np.ndarray | float = 1.0
    columns: np.ndarray | None = None

    __repr__ = record

    @property
    def doubt(self) -> str | None:
        """Return the error and how to correct it, in one line, None if it only means another frame."""
        hint = "; --fix corrects it" if self.corrected else ""
        return f"the log probably has an input error: {self.text}{hint}" if self.severe else None


def better_by(text: str, before: float, after: float) -> str:
    """Return an error with how much smaller the differences are without it."""
    times = quantity(before / max(after, 1e-12), digits=2)
    return f"{text}: correcting this makes the differences between lengths and poses {times} times smaller"


def corrected_to(
    given: Measurements, placed: Placed, columns: np.ndarray, factors: np.ndarray | float, framed: tuple[str, ...] = ()
) -> Measurements:
    """Return measurements at other poses, with columns of readings in the order of the cables, times factors."""
    position, rotation, carriers = placed
    poses = given.poses
    if poses is not None:
        poses = np.where(np.isfinite(poses), np.hstack([position, points.angles(rotation)]), np.nan)
    tensions = None if given.tensions is None else given.tensions[:, columns]
    lengths = given.lengths[:, columns] * factors
    result = given.changed(lengths=lengths, poses=poses, tensions=tensions, carrier_poses=carriers)
    result.framed = framed or given.framed
    return result
