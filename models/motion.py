"""`Motion`: where platform and carriers are and how they move, as one argument."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from ..base.display import record
from .arrays import Array


class Motion(NamedTuple):
    """Coordinates (x, y, z, roll, pitch, yaw) of platform and carriers and their first two time derivatives.

    Carriers whose coordinates are None are at home and at rest.
    """

    pose: Array  # of the platform frame, (..., 6) [m, rad]
    velocity: Array = None
    acceleration: Array = None
    carrier_pose: Array = None  # of the carriers, (..., c, 6), or (..., 6) of a single one
    carrier_velocity: Array = None
    carrier_acceleration: Array = None

    __repr__ = record

    @classmethod
    def symbols(cls, *carriers: int) -> Motion:
        """Return CasADi symbols of columns (6, 1), and of matrices of the shape `carriers` for the carriers."""
        return cls(*(ca.SX.sym(name, *(carriers if "carrier" in name else (6,))) for name in cls._fields))

    def arguments(self, home: np.ndarray) -> dict[str, Array]:
        """Return the parts by their names, of carriers at `home` and at rest where they are None."""
        carriers = {"carrier_pose": home, "carrier_velocity": np.zeros_like(home)}
        carriers["carrier_acceleration"] = carriers["carrier_velocity"]
        return carriers | {name: value for name, value in self._asdict().items() if value is not None}
