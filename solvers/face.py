"""What is left to choose where w is on the boundary of the available wrench set: `face`."""

import numpy as np

from ..tolerances import AT_LIMIT
from .methods.numerics.linear_program import optimise
from .problem import Array, TensionProblem
from .standard_form import standard_forms


def face(problem: TensionProblem, tensions: Array) -> TensionProblem:
    """Fix the cables that have the same tension, that of a limit, in all tensions that give w.

    With w on a face of the available wrench set those are the cables that pull along its normal. The others can all be
    off their limits at once, so a method that needs such tensions has them.

    Parameters
    ----------
    problem :
        The problem.
    tensions :
        Some tensions that give w inside the limits [N], shape (m,).
    """
    form = standard_forms(problem)[-1]
    s = (tensions - form.origin)[form.moving] / form.unit  # (k,)
    near = AT_LIMIT * max(1.0, np.abs(s).max(initial=0.0))
    low, high = s - form.lower <= near, form.upper - s <= near
    held = np.flatnonzero(low | high)
    if not held.size:
        return problem
    # Of all changes that leave the wrench as it is and cross no limit, one that moves as many of these as can move.
    changes = form._replace(b=0.0 * form.b, lower=np.where(low, 0.0, -np.inf), upper=np.where(high, 0.0, np.inf))
    moved = np.eye(s.size)[held] * np.where(low, -1.0, 1.0)
    rows = np.hstack([moved, np.eye(held.size)])
    cost = np.r_[np.zeros(s.size), -np.ones(held.size)]
    change = optimise(changes, cost, rows, np.zeros(held.size), nonnegative=True, most=1.0).s
    stays = form.moving[held if change is None else held[np.abs(change[held]) < 0.5]]
    t_min, t_max = problem.t_min.copy(), problem.t_max.copy()
    t_min[stays] = t_max[stays] = tensions[stays]
    return TensionProblem(problem.A, problem.w, t_min, t_max, problem.t_ref, problem.weights, problem.length)
