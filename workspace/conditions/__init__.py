"""Conditions on configurations, one per file; each is evaluated at many configurations at once."""

from .dynamic import Dynamic
from .equilibrium_posture import EquilibriumPosture
from .exists_placement import ExistsPlacement
from .force_balance import ForceBalance
from .interference import Interference
from .lengths import Lengths
from .margin import Margin
from .metric import MetricInRange
from .static_equilibrium import StaticEquilibrium
from .wrench_closure import WrenchClosure
from .wrench_feasible import WrenchFeasible
from .wrench_with_tolerance import WrenchWithTolerance

__all__ = [
    "Dynamic",
    "EquilibriumPosture",
    "ExistsPlacement",
    "ForceBalance",
    "Interference",
    "Lengths",
    "Margin",
    "MetricInRange",
    "StaticEquilibrium",
    "WrenchClosure",
    "WrenchFeasible",
    "WrenchWithTolerance",
]
