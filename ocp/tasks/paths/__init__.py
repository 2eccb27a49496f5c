"""Paths as data: a pose and its first two time derivatives at every time, from a few numbers of a task file."""

from typing import Annotated, TypeAlias

from pydantic import Field

from .base import PathBase as PathBase
from .base import PoseOrPosition as PoseOrPosition
from .circle import CirclePath as CirclePath
from .feed import FeedPath as FeedPath
from .line import LinePath as LinePath
from .motion import Motion as Motion
from .rest import RestPath as RestPath
from .returning import ReturnPath as ReturnPath
from .samples import SamplePath as SamplePath
from .sequence import SequencePath as SequencePath
from .sequence import SinglePath as SinglePath
from .stations import Stations as Stations
from .timed import Curve as Curve
from .timed import TimedPath as TimedPath
from .waypoints import WaypointPath as WaypointPath

AnyPath: TypeAlias = Annotated[
    RestPath | LinePath | CirclePath | WaypointPath | SamplePath | FeedPath | TimedPath | SequencePath | ReturnPath,
    Field(discriminator="kind"),
]
