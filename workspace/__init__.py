"""Which poses are reachable: conditions, evaluated at 10^3 to 10^9 places of platform and carriers.

Conditions stand alone or are joined by & and |. `sample` evaluates them, `boundary` makes a mesh of where they
hold, `hints` takes a first look.
"""

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
from .feasibility import load_kernels
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
    "load_kernels",
    "sample",
    "save",
]
