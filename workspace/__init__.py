"""Which poses are reachable: conditions on the places of platform and carriers, alone or joined by & and |.

`pose_problem` is one pose as a tension problem, `hints` a first look.
"""

from .balance import make_ready
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
    "StaticEquilibrium",
    "WrenchClosure",
    "WrenchFeasible",
    "WrenchWithTolerance",
    "condition_from",
    "hints",
    "make_ready",
    "pose_problem",
]
