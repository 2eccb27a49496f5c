"""Limits of a motion, one class each: what stays between which bounds. `Limit` is the base of them all."""

from .distance import Distance, Pair
from .limit import Angle, Hull, Limit, Magnitude, Rate
from .state import Body, State

__all__ = ["Angle", "Body", "Distance", "Hull", "Limit", "Magnitude", "Pair", "Rate", "State"]
