"""`RobustMargin`: how the tensions along a plan differ between the robots of an uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.display import Displayed
from .tensions import TOLERANCE


@dataclass(frozen=True)
class RobustMargin(Displayed):
    """The differences of tensions between the robots of the uncertainty, along a plan, to first order.

    Attributes
    ----------
    share
        Of the robots that must have tensions inside their limits at all times.
    factor
        Standard deviations that this share keeps to (`robust.motion_factor`).
    reach
        By how much the tensions of these robots differ at most, at each audited time, (n, m) [N].
    tightened
        By how much the limits of the program were tightened, (m,) [N].
    violation
        How far tensions less their reach are outside of the limits less the task's margin, (n, m) [N]; 0: inside.
    """

    share: float
    factor: float
    reach: np.ndarray
    tightened: np.ndarray
    violation: np.ndarray

    @property
    def holds(self) -> bool:
        """Return whether the share of the robots keeps all limits, to first order."""
        return bool(self.violation.max() <= TOLERANCE)

    def to_dict(self) -> dict[str, Any]:
        """Return share, factor, and by cable the largest reach and what limits were tightened by, for JSON."""
        return {
            "share": self.share,
            "factor": self.factor,
            "reach": self.reach.max(axis=0).tolist(),
            "tightened": self.tightened.tolist(),
            "worst_violation": float(self.violation.max()),
        }
