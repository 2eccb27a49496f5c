"""`within_segment`: an expression that distances from segments are made of."""

from typing import Any

import casadi as ca


def within_segment(share: Any) -> Any:
    """Return the share of a segment that is nearest to this one, from 0 to 1."""
    return ca.fmin(ca.fmax(share, 0.0), 1.0)
