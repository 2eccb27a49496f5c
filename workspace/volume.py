"""How large a workspace is, with an interval for what chance may have done.

Of n independent samples, uniform in a box of volume V, k lie in the workspace: k is binomial with p = v / V, and the
interval of p is that of Clopper and Pearson, which covers at least as often as its level says.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError

__all__ = ["LEVEL", "Volume", "share_interval", "volume"]

LEVEL = 0.95


@dataclass(frozen=True)
class Volume:
    """A volume and its confidence interval, in the unit of the box: [m^3], or [m^2] of a plane.

    Attributes
    ----------
    value
        Estimate, share of the samples times the box.
    low, high
        Ends of the interval.
    level
        How often at least such an interval covers the true volume.
    accepted, samples
        What it was computed from.
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

    Samples of a low-discrepancy sequence or a grid are more even than chance: for them the interval is wider than need
    be, though not by a proof.

    Parameters
    ----------
    accepted, samples
        How many of how many lie in the workspace.
    box
        Volume of the box.
    level
        Of confidence, between 0 and 1.

    Raises
    ------
    InputError
        If the numbers do not fit each other.
    """
    if samples < 1:
        raise InputError(f"samples: is {samples}; accepted: 1 and more")
    if not 0 <= accepted <= samples:
        raise InputError(f"accepted: is {accepted}; accepted: 0 to {samples}, the number of samples")
    if not box > 0:
        raise InputError(f"box: is {box}; accepted: a volume > 0")
    if not 0 < level < 1:
        raise InputError(f"level: is {level}; accepted: a number between 0 and 1")
    low, high = share_interval(accepted, samples, level)
    return Volume(accepted / samples * box, low * box, high * box, level, int(accepted), int(samples))


def share_interval(accepted: int, samples: int, level: float = LEVEL) -> tuple[float, float]:
    """Interval of Clopper and Pearson of a share, of which `accepted` of `samples` independent samples were seen."""
    from scipy.special import betaincinv

    tail = (1.0 - level) / 2.0
    low = float(betaincinv(accepted, samples - accepted + 1, tail)) if accepted else 0.0
    high = float(betaincinv(accepted + 1, samples - accepted, 1.0 - tail)) if accepted < samples else 1.0
    return low, high
