"""`RestPath`: a pose that is held."""

from typing import Literal

import numpy as np
from pydantic import Field
from typing_extensions import override

from .base import PathBase, PoseOrPosition
from .motion import Motion


class RestPath(PathBase):
    """A pose that is held."""

    kind: Literal["rest"]
    pose: PoseOrPosition = Field(description="pose, (x, y, z) or (x, y, z, roll, pitch, yaw) [m, rad]")

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        return Motion.still(np.tile(np.array(self.pose), (len(times), 1)))
