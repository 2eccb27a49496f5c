"""Paths as data: a pose and its first two time derivatives at every time, from a few numbers of a task file."""

from typing import Annotated, TypeAlias

from pydantic import Field

from .base import PathBase, PoseOrPosition
from .circle import CirclePath
from .feed import FeedPath
from .line import LinePath
from .motion import Motion
from .rest import RestPath
from .returning import ReturnPath
from .samples import SamplePath
from .sequence import SequencePath, SinglePath
from .stations import Stations
from .timed import Curve, TimedPath
from .waypoints import WaypointPath

__all__ = [
    "AnyPath",
    "CirclePath",
    "Curve",
    "FeedPath",
    "LinePath",
    "Motion",
    "PathBase",
    "PoseOrPosition",
    "RestPath",
    "ReturnPath",
    "SamplePath",
    "SequencePath",
    "SinglePath",
    "Stations",
    "TimedPath",
    "WaypointPath",
]

AnyPath: TypeAlias = Annotated[
    RestPath | LinePath | CirclePath | WaypointPath | SamplePath | FeedPath | TimedPath | SequencePath | ReturnPath,
    Field(discriminator="kind"),
]
