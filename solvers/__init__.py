"""Tension distribution: which tensions, inside their limits, give a wrench, or proof that none do.

Plain NumPy arrays in and out; this room knows no robot. State a `TensionProblem`, call `solve`, read the
`TensionSolution`, or give arrays to `solve_batch`; an infeasible problem comes with a `Certificate`.
"""

from .batch import BatchSolution, solve_batch
from .certificate import Certificate, certify
from .problem import TensionProblem
from .registry import methods, solve
from .solution import Status, TensionSolution

__all__ = [
    "BatchSolution",
    "Certificate",
    "Status",
    "TensionProblem",
    "TensionSolution",
    "certify",
    "methods",
    "solve",
    "solve_batch",
]
