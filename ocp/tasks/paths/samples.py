"""`SamplePath`: a path through samples at given times."""

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import override

from ....models.part import Finite
from .base import Motion, PathBase, PoseOrPosition, check_times


class SamplePath(PathBase):
    """Samples that a quintic spline interpolates; its speeds at the ends follow from the samples near them."""

    kind: Literal["samples"]
    times: tuple[Finite, ...] = Field(min_length=6, description="times, increasing from 0 [s]")
    poses: tuple[PoseOrPosition, ...] = Field(min_length=6, description="a pose or position at each time [m, rad]")

    @model_validator(mode="after")
    def _times_fit(self) -> Self:
        check_times(self.times, len(self.poses))
        return self

    @property
    @override
    def natural_duration(self) -> float | None:
        return self.times[-1]

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        from scipy.interpolate import make_interp_spline

        poses = np.array(self.poses)
        poses[:, 3:] = np.unwrap(poses[:, 3:], axis=0)
        spline = make_interp_spline(np.array(self.times), poses, k=5)
        return Motion(spline(times), spline(times, 1), spline(times, 2))
