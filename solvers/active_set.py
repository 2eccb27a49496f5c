"""Method "active-set": the bounded quadratic program by our own null-space kernel."""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from . import compiled
from .direct_daqp import Daqp
from .kernels.memory import floats
from .kernels.single import solve_one, work_size
from .problem import TensionProblem
from .solution import Status

__all__ = ["ActiveSet"]

_ANSWERS = (Status.OPTIMAL, Status.INFEASIBLE, Status.SINGULAR)


class ActiveSet(Daqp):
    """Weighted least squares to t_ref inside the limits, by a dual active-set method in the null space.

    What the kernel is not sure of goes to the daqp package and is judged as the other methods are. The kernel runs as
    plain Python, some 0.4 ms a call, until a process has lost more time to that than loading its machine code takes; a
    control loop calls `compiled.load()` first. Both give the same bits.
    """

    name: ClassVar[str] = "active-set"
    source: ClassVar[str] = (
        "null space: Golub and Van Loan, Matrix Computations, 5.4; D. Goldfarb, A. Idnani, Math. Program. 27, 1983; "
        "R. Seidel, Discrete Comput. Geom. 6, 1991"
    )

    def attempt(self, problem: TensionProblem) -> tuple[Status, NDArray[np.float64] | None] | None:
        """Run the kernel; None if it is not sure."""
        n, m = problem.A.shape
        tensions = np.empty(m)
        code = compiled.solve_packed(problem.packed, n, m, tensions)
        if code == 0:
            return Status.OPTIMAL, tensions
        return None if code > 2 else (_ANSWERS[code], None)

    def direction(self, problem: TensionProblem) -> NDArray[np.float64] | None:
        """Return the direction that the kernel itself verified."""
        n, m = problem.A.shape
        data: tuple[Any, ...] = (
            problem.A.ravel(),
            problem.w,
            problem.t_min,
            problem.t_max,
            problem.t_ref,
            problem.weights,
        )
        direction = np.full(n, np.nan)
        outputs: tuple[Any, ...] = np.empty(m), direction, np.empty(3)
        views = [memoryview(array) for array in (*data, *outputs)]
        code = solve_one(*views[:6], problem.length, n, m, *views[6:], floats(work_size(n, m)))
        return direction if code in (1, 2) else None
