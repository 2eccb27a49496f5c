"""Which poses are reachable: conditions on places of platform and carriers, asked of 10^4 to 10^9 of them.

Conditions stand alone or are joined by & and |; `sample` asks them; `hints` is a first look.
"""

from .balance import make_ready
from .boundary_mesh import boundary
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
from .first_look import hints
from .places import Places
from .region import Region
from .run import sample, save

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
    "sample",
    "save",
]
