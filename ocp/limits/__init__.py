"""Limits of a motion, one class each: values and their bounds. `Limit` is their base class."""

from .distance import Distance, Pair
from .limit import Angle, Hull, Limit, Magnitude, Rate
from .state import Body, State

__all__ = ["Angle", "Body", "Distance", "Hull", "Limit", "Magnitude", "Pair", "Rate", "State"]
