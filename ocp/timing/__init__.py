"""Timing along a given path: how fast it may be followed, by toppra inside limits of our own."""

from .timing import Timing, time_along

__all__ = ["Timing", "time_along"]
