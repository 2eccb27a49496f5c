"""Solve batches of one shape again and again, in arrays of its own and with tensions in every case: `InPlace`."""

from math import prod
from typing import Any

import numpy as np

from ..core import CABLES, ROWS, solve_rows
from .batch import solve_batch
from .problem import Array, TensionProblem
from .solution import INFEASIBLE, INVALID, OPTIMAL, SINGULAR, UNSURE
from .solve import solve

RHO = 1e8  # weight of the squared wrench error in a soft solution, relative to the squared tensions
# The same where carriers give what cables cannot. With more, cables that hardly turn the platform pull as hard as they
# can for moments that noise requires. With this, the wrench along a cable is off by 0.1 % of its tension's change.
SPARING = 1e3

# With up to so many more cables than equations lanes are as quick for one row and several times as quick for many. With
# more, one row takes 1.5 times as long. A row has the same bits alone and among others: the shape alone decides.
IN_LANES = 2


class InPlace:
    """Problems of one shape, to be written into its arrays, solved, and written again.

    A controller solves such a problem thousands of times a second: no array is made, and where no tensions give w, the
    tensions are those of the method "soft-wrench", with the least wrench error that the limits permit.

    - `rows`, `n`, `m`: how many problems, of how many wrench rows and cables.
    - `length`: characteristic length [m] of all problems.
    - `is_sparing`: whether other forces complete the wrench, so that cables which hardly change it need not.
    - `is_exact`: whether tensions that give w are taken if they exist; with fewer cables than equations by chance only.
    - `A`, `w`: wrench matrices, shape (rows, n, m), and required wrenches, shape (rows, n), [N] and [N m].
    - `bounds`, `t_ref`: lowest and highest tensions, shape (2, rows, m), and tensions to stay near, shape (rows, m)
      [N].
    - `tensions`: the tensions [N], shape (rows, m); nan where the numbers of a row do not define a problem.
    - `code`: status of each row, shape (rows,): `STATUSES[int(code)]`.
    - `solves`: how it does so: one after another (1), in lanes (2), or not at all (0).
    - `direction`, `shortfall`: where no tensions give w: a verified direction, shape (rows, n), along which they miss
      it, and by how much [N].
    """

    def __init__(self, rows: int, n: int, m: int, length: float, is_sparing: bool = False):
        self._shape, self.length, self.is_sparing = (rows, n, m), float(length), is_sparing
        # all of these arrays in one, as `core.control_step` writes and solves them;
        self.memory = np.zeros(rows * (n * m + 2 * n + 4 * m + 4))
        self._spare, self._has_core = (np.zeros((rows, n)), np.zeros((rows, 2))), n <= ROWS and m <= CABLES
        self._arrange()

    def _arrange(self) -> None:
        """Set the arrays, parts of the memory, and the arguments of the core, which are these."""
        rows, n, m = self._shape
        shapes = (rows, n, m), (rows, n), (2, rows, m), (rows, m), (rows, m), (rows, n), (rows, 2), (rows,), (rows,)
        ends = np.cumsum([prod(shape) for shape in shapes])
        parts = [part.reshape(shape) for part, shape in zip(np.split(self.memory, ends[:-1]), shapes, strict=True)]
        self.A, self.w, self.bounds, self.t_ref, self.tensions, self.direction, self._info, residual, self.code = parts
        per = np.array([n * m, n, m, m, m, 0, 0], dtype=float)  # one length and equal weights for all rows
        given = (self.A, self.w, *self.bounds, self.t_ref, np.empty(0), np.array([self.length]), per)
        in_lanes, self.is_exact = m - n <= IN_LANES, not self.is_sparing or m < n
        self.solves = 0 if not self._has_core else 2 if in_lanes else 1
        self._exact = (n, m, 0.0, in_lanes, *given, self.tensions, self.direction, self._info, residual, self.code)
        rho = SPARING if self.is_sparing else RHO
        self._soft = (n, m, rho, False, *given, self.tensions, *self._spare, residual, self.code)

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies and pickles hold: the memory without its parts."""
        names = "_shape", "length", "is_sparing", "memory", "_spare", "_has_core"
        return {name: self.__dict__[name] for name in names}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the memory, and the arrays as its parts."""
        self.__dict__.update(state)
        self._arrange()

    @property
    def shortfall(self) -> Array:
        """Return by how much the limits miss w along `direction` [N], shape (rows,)."""
        return self._info[:, 1]

    def solve(self) -> bool:
        """Solve all rows, and return whether tensions that give w result for each."""
        self.code.fill(UNSURE)
        if self._has_core and solve_rows(*self._exact) == len(self.code) and self.is_exact:
            return True
        self.solve_others()
        return not self.code.any()

    def solve_others(self) -> None:
        """Answer the rows whose tensions the core did not prove optimal."""
        self._prove_without_core()
        exact = self.code.copy()
        self.code[(exact != INVALID) & ((exact != OPTIMAL) | (not self.is_exact))] = UNSURE
        if self._has_core:
            solve_rows(*self._soft)
        for row in np.flatnonzero(self.code == UNSURE):
            given = (self.A[row], self.w[row], *self.bounds[:, row])
            problem = TensionProblem(*given, t_ref=self.t_ref[row], length=self.length)
            solution = solve(problem, "soft-wrench", rho=self._soft[2])
            self.tensions[row] = np.nan if solution.tensions is None else solution.tensions
        self.code[:] = exact
        self.tensions[exact == INVALID] = np.nan
        unproven = (exact != INFEASIBLE) & (exact != SINGULAR)
        self.direction[unproven], self._info[unproven] = np.nan, np.nan

    def _prove_without_core(self) -> None:
        """Decide the rows of which the core is not sure, or all of a size that it does not take."""
        rows = np.flatnonzero(self.code == UNSURE)
        if not rows.size:
            return
        batch = solve_batch(
            self.A[rows], self.w[rows], *self.bounds[:, rows], t_ref=self.t_ref[rows], length=self.length
        )
        self.code[rows], self.tensions[rows], self.direction[rows] = batch.code, batch.tensions, batch.direction
        self._info[rows] = np.stack([batch.support, batch.shortfall], axis=1)
