"""The C core as an extension module, where one was built when towline was installed.

`solve_packed` takes problems of at most `ROWS` wrench rows and `CABLES` cables; both are zero without the extension.
"""

from typing import Any

from ..kernels.codes import UNSURE

__all__ = ["CABLES", "ROWS", "solve_packed"]

try:
    from ._core import CABLES, ROWS, solve_packed
except ImportError:
    ROWS = CABLES = 0

    def solve_packed(packed: Any, tensions: Any, direction: Any = None) -> int:
        """Solve a problem given as one array, `TensionProblem.packed`; return its status, a code of `kernels.codes`.

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
