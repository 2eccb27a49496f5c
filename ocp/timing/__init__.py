"""Timing along a given path: how fast it may be followed, by toppra inside limits of our own."""

from .fastest_law import time_along
from .timing import Timing

__all__ = ["Timing", "time_along"]
