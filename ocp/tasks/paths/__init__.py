"""Paths as data: a pose and its first two time derivatives at every time, from a few numbers of a task file."""

from typing import Annotated, TypeAlias

from pydantic import Field

from .base import Motion as Motion, PathBase as PathBase, PoseOrPosition as PoseOrPosition, Stations as Stations
from .circle import CirclePath as CirclePath
from .feed import FeedPath as FeedPath
from .line import LinePath as LinePath, RestPath as RestPath
from .samples import SamplePath as SamplePath
from .sequence import ReturnPath as ReturnPath, SequencePath as SequencePath, SinglePath as SinglePath
from .timed import Curve as Curve, TimedPath as TimedPath
from .waypoints import WaypointPath as WaypointPath

AnyPath: TypeAlias = Annotated[
    RestPath | LinePath | CirclePath | WaypointPath | SamplePath | FeedPath | TimedPath | SequencePath | ReturnPath,
    Field(discriminator="kind"),
]
