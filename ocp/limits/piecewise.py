"""Expressions that distances are made of: the share of a segment, and the largest of several values."""

from functools import reduce
from typing import Any

import casadi as ca


def within_segment(share: Any) -> Any:
    """Return the share of a segment that is nearest to this one, from 0 to 1."""
    return ca.fmin(ca.fmax(share, 0.0), 1.0)


def largest(values: list[Any]) -> Any:
    """Return the largest of several expressions."""
    return reduce(ca.fmax, values)
