"""`RobustMargin`: the spread of tensions along a plan due to geometric uncertainty."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.display import Displayed
from ...base.text import quantity
from .excess import Excess


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


def closest_to_limit(
    time: float, tensions: np.ndarray, reach: np.ndarray, low: np.ndarray, high: np.ndarray, share: float, why: str = ""
) -> Excess:
    """Return the excess of the tension that is closest to a limit, or farthest beyond it, at an instant.

    `reach` is how far the tensions of a share of the robots differ from `tensions`; all are (m,) [N].
    """
    from_low, from_high = tensions - reach - low, high - tensions - reach
    cable = int(np.minimum(from_low, from_high).argmin())
    below = bool(from_low[cable] < from_high[cable])
    side, bound = ("at least", low + reach) if below else ("at most", high - reach)
    text = f"{quantity(100 * share, '%')} of the robots differ by up to {quantity(reach[cable], 'N')}"
    if reach[cable] > high[cable]:
        text += ", since the cables hardly resist some direction"
    about, value = f"cable {cable + 1}", float(tensions[cable])
    return Excess("tension", about, float(time), value, float(bound[cable]), "N", side, text + why)
