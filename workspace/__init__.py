"""Workspaces: conditions, evaluated at 10^3 to 10^9 configurations of platform and carriers.

Conditions can be joined by & and |. `sample` evaluates them, `boundary` computes a mesh of the region where they hold.
"""

from . import conditions
from .boundary_mesh import boundary
from .condition import AllOf, AnyOf, Condition, Places, TensionCondition, condition_from
from .conditions import *  # noqa: F403  the only list of them is there
from .dataset import draw, save
from .metrics import METRICS, metric_values
from .region import Region
from .run import sample

__all__ = [
    "METRICS",
    "AllOf",
    "AnyOf",
    "Condition",
    "Places",
    "Region",
    "TensionCondition",
    "boundary",
    "condition_from",
    "draw",
    "metric_values",
    "sample",
    "save",
]
__all__ += conditions.__all__
