"""`WaypointSpline`: a curve of degree 5 through points, from rest to rest."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from .motion import Motion

NEAREST = 1e-6  # of the length of all steps together: nearer points make a spline turn wildly
STILL = np.zeros(6)


class WaypointSpline:
    """A spline through points, with its knots by the square root of their distances, which keeps it near to them.

    Velocity and acceleration are zero at its ends. Angles change by less than half a turn from point to point.

    - `points`: (n, 6) poses.
    - `times`: (n,), the times of the points [s]; default: any duration.
    """

    def __init__(self, points: Sequence[Sequence[float]], times: Sequence[float] | None):
        self._points, self._times = np.array(points), None if times is None else np.array(times)
        self._points[:, 3:] = np.unwrap(self._points[:, 3:], axis=0)
        self._steps = np.linalg.norm(np.diff(self._points, axis=0), axis=1)  # a radian counts as a metre

    def check(self) -> None:
        """Refuse points without times that are too near to each other.

        Raises `ValueError` naming the second of them.
        """
        near = np.flatnonzero(self._steps <= NEAREST * self._steps.sum())
        if self._times is None and near.size:
            index = int(near[0])
            raise ValueError(
                f"points[{index + 1}] must be at least {NEAREST:g} of the path's length away from points[{index}] in "
                f"a spline without times, got {self._steps[index]:.3g} m of {self._steps.sum():.3g} m"
            )

    def knots(self, duration: float) -> np.ndarray:
        """Return the times of the points, (n,) [s]."""
        return duration * self._shares if self._times is None else self._times

    @cached_property
    def _shares(self) -> np.ndarray:
        parts = np.sqrt(self._steps) if self._times is None else np.diff(self._times)
        return np.append(0.0, np.cumsum(parts)) / parts.sum()

    @cached_property
    def _curve(self) -> Any:
        """Return the spline over the share of the time."""
        from scipy.interpolate import make_interp_spline

        rest = [(derivative, STILL) for derivative in (1, 2)]
        return make_interp_spline(self._shares, self._points, k=5, bc_type=(rest, rest))

    def at(self, times: np.ndarray, duration: float) -> Motion:
        """Return the motion of a task that lasts `duration` [s] at `times` [s]."""
        last = duration if self._times is None else self._times[-1]
        s = np.clip(times / last, 0.0, 1.0)
        moving = ((s > 0) & (s < 1))[:, None]
        return Motion(self._curve(s), *(moving * self._curve(s, k) / last**k for k in (1, 2)))
