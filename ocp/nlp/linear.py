"""`LinearDistances`: a program with distances from regions that are linear in its unknowns, about one motion at a time.

A distance from a convex region falls at most as its linear expression does: while it is kept, so is the distance of
points that move without turning. IPOPT needs some twenty iterations with such rows, where true distances, whose
curvature bends the Lagrangian the wrong way, take a hundred. A motion that keeps them is where the next ones are taken,
and what a few of these passes lead to is near a local optimum of the true program, which starts from it.
"""

from dataclasses import replace

import casadi as ca
import numpy as np

from ..tasks.deviation import Deviation
from .derivatives import Block
from .program import Program
from .solver import Outcome, Progress, Solver

MOST_ITERATIONS = 150  # of a pass: those that end well take 10 to 90


class LinearDistances:
    """The program, its solver, and the expressions that it needs about a motion.

    - `program`: the true program.
    - `shares`: where its points are.
    """

    def __init__(self, program: Program):
        self._program, self.shares = program, program.shares
        x, blocks = program.problem["x"], program.blocks
        local, others = blocks[: program.local], blocks[program.local :]
        mapped = [block.mapped for block in local if block.mapped is not None]
        values = ca.vertcat(ca.MX(0, 1), *(ca.vec(block.values) for block in local))
        self._count = values.numel()
        slopes = ca.vertcat(ca.MX(0, x.numel()), *(each.slopes(x.numel()) for each in mapped))
        self._expressions = ca.Function("distances", [x], [values, slopes.nz[:]])
        p = ca.MX.sym("p", slopes.nnz() + self._count)
        slopes = ca.MX(slopes.sparsity(), p[: slopes.nnz()])
        linear = slopes @ x + p[slopes.nnz() :]
        rows = [row for block in local for row in block.rows * block.values.shape[1]]
        first = Block(linear, rows, np.zeros(1, int), slopes=slopes)
        problem = program.problem | {"g": ca.vertcat(linear, program.problem["g"][self._count :]), "p": p}
        self._sparsity = slopes.sparsity()
        self._solver = Solver(replace(program, problem=problem, blocks=[first, *others], local=0), MOST_ITERATIONS)

    def solve(self, motion: Deviation, progress: Progress | None, seconds: float) -> Outcome:
        """Solve with distances about a motion at the program's points."""
        x = ca.DM(self._program.pack(motion))
        values, slopes = self._expressions(x)
        offsets = values - ca.DM(self._sparsity, slopes) @ x
        return self._solver.solve(motion, progress, False, seconds, ca.vertcat(slopes, offsets))

    def missed(self, motion: Deviation) -> float:
        """Return by how much a motion at the program's points exceeds its true distances, in units of their scales."""
        values = self._expressions(ca.DM(self._program.pack(motion)))[0].full().ravel()
        low, high = (bound[: self._count] for bound in (self._program.lower_g, self._program.upper_g))
        return float(np.maximum(low - values, values - high).max(initial=0.0))
