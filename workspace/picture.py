"""`draw`: a workspace as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..base.inputs import InputError, required, shown
from ..models.files import AnyRobot, as_robot
from .metrics import METRICS

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def draw(result: xr.Dataset, robot: AnyRobot | None = None) -> Figure:
    """Draw the metrics of a workspace as contours, or, if it has none, where samples were accepted.

    Args:
        result: A result of `sample`.
        robot: The robot whose anchors are drawn as triangles (default: none).

    Raises:
        InputError: If an argument has a wrong type, or the result is not one of `sample`.
    """
    import xarray as xr

    from ..figures.workspace import metric_map, reached

    required("result", result, xr.Dataset)
    if "reached" not in result:
        raise InputError(f"result must be a result of sample, got a dataset with {shown(list(result.data_vars))}")
    anchors = None if robot is None else as_robot(robot).home_anchors
    metrics = [str(name) for name in result.data_vars if name in METRICS]
    return metric_map(result, metrics, anchors) if metrics else reached(result, anchors)
