"""The volume of a workspace with its confidence interval.

Of n independent samples, uniform in a box of volume V, k lie in the workspace: k is binomial with p = v / V, and the
interval of p is that of Clopper and Pearson, which covers at least as often as its level states.
"""

from dataclasses import dataclass

import numpy as np

from ..base.display import Displayed
from ..base.inputs import number, whole_number

LEVEL = 0.95
LEAST_LEVEL = 1e-9  # and 1 minus it the highest
MOST_SAMPLES = 10**15


@dataclass(frozen=True)
class Volume(Displayed):
    """A volume and its confidence interval, in the unit of the box: [m^3], or [m^2] for a plane.

    Attributes:
        value: Estimate: accepted fraction of the samples times the volume of the box.
        low, high: Ends of the interval.
        level: Lower bound of the probability that such an interval covers the true volume.
        accepted, samples: Numbers of samples it was computed from.
    """

    value: float
    low: float
    high: float
    level: float
    accepted: int
    samples: int

    def __str__(self) -> str:
        return f"{self.value:.4g} ({self.low:.4g} to {self.high:.4g} at {100 * self.level:g} %)"


def volume(accepted: int, samples: int, box: float, level: float = LEVEL) -> Volume:
    """Estimate a volume from independent samples that were uniform in a box.

    Samples of a low-discrepancy sequence or a grid are more even than random ones: for them the interval is usually
    wider than necessary.

    Args:
        accepted, samples: Number of samples in the workspace, and number of all samples.
        box: Volume of the box.
        level: Confidence level, between 0 and 1.

    Raises `InputError` if a number is out of its range.
    """
    samples = whole_number("samples", samples, 1, MOST_SAMPLES)
    accepted = whole_number("accepted", accepted, 0, samples)
    box = number("box", box, np.finfo(float).tiny, np.finfo(float).max)
    level = number("level", level, LEAST_LEVEL, 1.0 - LEAST_LEVEL)
    low, high = share_interval(accepted, samples, level)
    return Volume(accepted / samples * box, low * box, high * box, level, accepted, samples)


def share_interval(accepted: int, samples: int, level: float = LEVEL) -> tuple[float, float]:
    """Return the interval of Clopper and Pearson of a share, from `accepted` of `samples` independent samples."""
    from scipy.special import betaincinv

    tail = (1.0 - level) / 2.0
    low = float(betaincinv(accepted, samples - accepted + 1, tail)) if accepted else 0.0
    high = float(betaincinv(accepted + 1, samples - accepted, 1.0 - tail)) if accepted < samples else 1.0
    return low, high
