"""`Curve`: a path of any kind but `timed`."""

from typing import Annotated, TypeAlias

from pydantic import Field

from .circle import CirclePath
from .line import LinePath
from .rest import RestPath
from .samples import SamplePath
from .waypoints import WaypointPath

Curve: TypeAlias = Annotated[RestPath | LinePath | CirclePath | WaypointPath | SamplePath, Field(discriminator="kind")]
