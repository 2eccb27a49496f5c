"""Tension distribution: which tensions, inside their limits, give a wrench, or proof that none do.

Plain NumPy arrays in and out; this package knows no robot. State a `TensionProblem`, call `solve`, read the
`TensionSolution`, or give arrays to `solve_batch`; an infeasible problem comes with a `Certificate`. `Horizon`
solves the quadratic programs of predictive controllers, stage by stage.
"""

from .batch import BatchSolution, solve_batch
from .casadi_form import casadi_function
from .certificate import Certificate, certify
from .derivatives import sensitivity
from .horizon import Horizon, Multipliers, Residuals
from .margin import Margin, capacity_margin
from .methods.method import Method, Proposal
from .problem import TensionProblem
from .rate import limit_rate
from .solution import TensionSolution
from .solve import methods, solve
from .standard_form import StandardForm
from .status import Status

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
