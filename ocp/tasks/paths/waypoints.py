"""`WaypointPath`: a path through given poses."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import override

from ....models.part import Finite
from .base import PathBase, PoseOrPosition, check_times
from .motion import Motion

__all__ = ["WaypointPath"]


class WaypointPath(PathBase):
    """A spline through given poses.

    Angles are taken as they are: from 3.1 to -3.1 rad is a turn of 6.2 rad, not of 0.08.
    """

    kind: Literal["waypoints"]
    points: tuple[PoseOrPosition, ...] = Field(min_length=2, description="two poses or positions or more [m, rad]")
    times: tuple[Finite, ...] | None = Field(
        default=None,
        description="time of each point, from 0 on, increasing [s]; default: by distance over the duration",
    )
    timing: Literal["smooth", "uniform"] = Field(
        default="smooth",
        description="smooth: of degree 7, from rest to rest, acceleration and jerk zero there; uniform: the natural "
        "cubic, which rests nowhere",
    )

    @model_validator(mode="after")
    def _times_fit(self) -> Self:
        if self.times is not None:
            check_times(self.times, len(self.points))
        for index, (before, after) in enumerate(pairwise(self.points)):
            if before == after and self.times is None:
                raise ValueError(f"points[{index + 1}] must differ from points[{index}] unless there are times")
        return self

    @property
    @override
    def natural_duration(self) -> float | None:
        return None if self.times is None else self.times[-1]

    @property
    @override
    def stretches(self) -> bool:
        return self.times is None

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        from scipy.interpolate import CubicSpline, make_interp_spline

        points, knots = np.array(self.points), self.knots(duration)
        if self.timing == "uniform":
            natural = CubicSpline(knots, points, bc_type="natural")
            return Motion(natural(times), natural(times, 1), natural(times, 2))
        at_rest = [(derivative, np.zeros(6)) for derivative in (1, 2, 3)]
        spline = make_interp_spline(knots, points, k=7, bc_type=(at_rest, at_rest))
        return Motion(spline(times), spline(times, 1), spline(times, 2))

    def knots(self, duration: float) -> np.ndarray:
        """Return the times at which the path is at its points [s]."""
        if self.times is not None:
            return np.array(self.times)
        steps = np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)  # a radian counts as a metre
        return np.concatenate([[0], np.cumsum(steps)]) / steps.sum() * duration
