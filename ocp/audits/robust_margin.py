"""`RobustMargin`: the spread of tensions along a plan due to geometric uncertainty."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.display import Displayed


@dataclass(frozen=True)
class RobustMargin(Displayed):
    """The first-order spread of tensions along a plan due to geometric uncertainty."""

    share: float  # fraction of the robots that must have tensions inside their limits at all times
    factor: float  # number of standard deviations for this fraction (`robust.motion_factor`)
    reach: np.ndarray  # largest deviation of the tensions of these robots at each audited time, (n, m) [N]
    tightened: np.ndarray  # reduction of the limits in the program, (m,) [N]
    violation: np.ndarray  # of the limits by tensions and their spread, (n, m) [N]; 0: inside by the margin or more
    tolerance: float  # the largest violation that passes [N]

    @property
    def holds(self) -> bool:
        """Return whether the fraction of the robots keeps all limits, to first order."""
        return bool(self.violation.max() <= self.tolerance)

    def to_dict(self) -> dict[str, Any]:
        """Return share, factor, and for each cable the largest spread and the reduction of its limits, for JSON."""
        return {
            "share": self.share,
            "factor": self.factor,
            "reach": self.reach.max(axis=0).tolist(),
            "tightened": self.tightened.tolist(),
            "worst_violation": float(self.violation.max()),
        }
