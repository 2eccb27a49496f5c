"""Tension distribution: compute tensions inside their limits that give a wrench, or prove that none exist.

This package works on plain NumPy arrays and is independent of robots. Build a `TensionProblem` and call `solve`, or
pass arrays to `solve_batch`. An infeasible problem has a `Certificate`. `Horizon` solves the quadratic programs of
predictive controllers.
"""

from .batch import BatchSolution, solve_batch
from .casadi_form import casadi_function
from .certificate import Certificate, certify
from .derivatives import sensitivity
from .horizon import Horizon, Multipliers, Residuals
from .margin import Margin, capacity_margin
from .methods.method import Method, Proposal
from .problem import TensionProblem, limit_rate
from .solution import Status, TensionSolution
from .solve import methods, solve
from .standard_form import StandardForm

__all__ = [
    "BatchSolution",
    "Certificate",
    "Horizon",
    "Margin",
    "Method",
    "Multipliers",
    "Proposal",
    "Residuals",
    "StandardForm",
    "Status",
    "TensionProblem",
    "TensionSolution",
    "capacity_margin",
    "casadi_function",
    "certify",
    "limit_rate",
    "methods",
    "sensitivity",
    "solve",
    "solve_batch",
]
