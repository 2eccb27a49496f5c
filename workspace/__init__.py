"""Which poses are reachable: conditions on places of platform and carriers, asked of 10^4 to 10^9 of them.

Conditions stand alone or are joined by & and |; `sample` asks them. `pose_problem` is one pose as a tension problem,
`hints` a first look.
"""

from .balance import make_ready
from .boundary import boundary
from .condition import AllOf, AnyOf, Condition, condition_from
from .conditions import (
    Dynamic,
    EquilibriumPosture,
    ExistsPlacement,
    ForceBalance,
    Interference,
    Lengths,
    Margin,
    StaticEquilibrium,
    WrenchClosure,
    WrenchFeasible,
    WrenchWithTolerance,
)
from .places import Places
from .pose import hints, pose_problem
from .region import Region
from .sample import sample, save

__all__ = [
    "AllOf",
    "AnyOf",
    "Condition",
    "Dynamic",
    "EquilibriumPosture",
    "ExistsPlacement",
    "ForceBalance",
    "Interference",
    "Lengths",
    "Margin",
    "Places",
    "Region",
    "StaticEquilibrium",
    "WrenchClosure",
    "WrenchFeasible",
    "WrenchWithTolerance",
    "boundary",
    "condition_from",
    "hints",
    "make_ready",
    "pose_problem",
    "sample",
    "save",
]
