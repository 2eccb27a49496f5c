"""Method "active-set": the bounded quadratic program by our own null-space kernel."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from . import compiled
from .direct_daqp import Daqp
from .problem import TensionProblem
from .solution import Status

__all__ = ["ActiveSet"]

_ANSWERS = (Status.OPTIMAL, Status.INFEASIBLE, Status.SINGULAR)


class ActiveSet(Daqp):
    """Weighted least squares to t_ref inside the limits, by a dual active-set method in the null space.

    What the kernel is not sure of goes to the daqp package and is judged as the other methods are. So do the first
    calls of a process: the kernel takes half a second to load from the disk (25 to compile, once on a machine) and
    saves 60 us a call, so that it is loaded by call number `compiled.CALLS_WORTH_LOADING`, or by
    `solve_batch`, or by `compiled.load()` if a control loop must not wait. Both give the same tensions to 1e-9.
    """

    name: ClassVar[str] = "active-set"
    source: ClassVar[str] = (
        "null space: Golub and Van Loan, Matrix Computations, 5.4; D. Goldfarb, A. Idnani, Math. Program. 27, 1983; "
        "R. Seidel, Discrete Comput. Geom. 6, 1991"
    )

    def attempt(self, problem: TensionProblem) -> tuple[Status, NDArray[np.float64] | None] | None:
        """Run the kernel if it is there; None if it is not, or is not sure."""
        solve_packed = compiled.solve_packed or compiled.count_a_call()
        if solve_packed is None:
            return None
        n, m = problem.A.shape
        tensions = np.empty(m)
        code = solve_packed(problem.packed, n, m, tensions)
        if code == 0:
            return Status.OPTIMAL, tensions
        return None if code > 2 else (_ANSWERS[code], None)

    def direction(self, problem: TensionProblem) -> NDArray[np.float64] | None:
        """Return the kernel's own direction."""
        compiled.load()
        from .kernels.single import solve_one, work_size

        n, m = problem.A.shape
        data = (problem.A.ravel(), problem.w, problem.t_min, problem.t_max, problem.t_ref, problem.weights)
        direction = np.full(n, np.nan)
        outputs = np.empty(m), direction, np.empty(3), np.empty(work_size(n, m))
        code = solve_one(*data, problem.length, n, m, *outputs)
        return direction if code in (1, 2) else None
