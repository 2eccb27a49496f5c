"""The C core as an extension module, where one was built when towline was installed.

`solve_packed` and `solve_rows` take problems of at most `ROWS` wrench rows and `CABLES` cables; both numbers are zero
without the extension.
"""

from typing import Any

__all__ = [
    "CABLES",
    "MOST_CABLES",
    "MOST_CARRIERS",
    "ROWS",
    "columns_by_geometry",
    "ends",
    "finite",
    "lines",
    "required_wrench",
    "solve_packed",
    "solve_rows",
    "wrench_by_axes",
    "wrench_by_pose",
]

try:
    from ._core import CABLES, MOST_CABLES, MOST_CARRIERS, ROWS, solve_packed, solve_rows
    from ._core import columns_by_geometry, ends, finite, lines, required_wrench, wrench_by_axes, wrench_by_pose
except ImportError:
    ROWS = CABLES = 0
    UNSURE = 6  # of `codes`: the core has found neither tensions nor a proof

    def solve_packed(packed: Any, tensions: Any, direction: Any = None) -> int:
        """Solve a problem given as one array, `TensionProblem.packed`; return its status, a status of `towline_status`.

        Parameters
        ----------
        packed :
            The problem.
        tensions :
            Gets the tensions if they are optimal, shape (m,).
        direction :
            Gets the direction that proves the problem infeasible or singular, shape (n,), if it is.
        """
        return UNSURE

    def solve_rows(n: int, m: int, rho: float, *arrays: Any) -> int:
        """Solve the rows of a batch whose status is `UNSURE`, and return how many of all rows are optimal.

        Those that stay unsure need another method.

        Parameters
        ----------
        n, m :
            Wrench rows and cables.
        rho :
            As in `solve_batch`; 0 if the wrench must be met.
        *arrays :
            A, w, lower, upper, ref, weights, length, per, t, d, info, residual and status of `kernels.rows.solve_rows`,
            but `per` of float64.
        """
        return 0
