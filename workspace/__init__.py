"""Which poses are reachable: conditions on the places of platform and carriers, asked of 10^4 to 10^9 of them.

`sample` is the whole of it. `pose_problem` is one pose as a tension problem, `hints` a first look.
"""

from .condition import AllOf, AnyOf, Condition, condition_from
from .conditions import StaticEquilibrium
from .places import Places
from .pose import hints, pose_problem
from .region import Region
from .sample import sample, save

__all__ = [
    "AllOf",
    "AnyOf",
    "Condition",
    "Places",
    "Region",
    "StaticEquilibrium",
    "condition_from",
    "hints",
    "pose_problem",
    "sample",
    "save",
]
