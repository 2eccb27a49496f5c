"""Tension-rate limits for every method."""

import numpy as np
from numpy.typing import ArrayLike

from ..base.inputs import InputError, repeated, required, shown
from .problem import TensionProblem


def limit_rate(problem: TensionProblem, previous: ArrayLike, rate_max: ArrayLike) -> TensionProblem:
    """Reduce a problem's limits to the tensions that can be reached from the last ones.

    The result is a problem like any other, for every method: `solve(limit_rate(problem, last.tensions, 5.0))`. If it is
    infeasible, its certificate refers to the reduced limits. A cable whose last tension is so far outside its limits
    that they cannot be reached moves towards them as far as the rate allows.

    Args:
        problem: The problem with its original limits.
        previous: The last tensions [N], shape (m,).
        rate_max: Largest change of a tension from one call to the next [N], >= 0, shape (m,) or one number; a rate in
            N/s times the time step.

    Returns:
        TensionProblem: The same problem; its limits are clipped to the range from previous - rate_max to
            previous + rate_max.

    Raises:
        InputError: If an argument has a wrong type, shape or value.
    """
    required("problem", problem, TensionProblem)
    at, step = repeated("previous", previous, problem.m), repeated("rate_max", rate_max, problem.m)
    if not np.isfinite(at).all():
        raise InputError(f"previous must be finite tensions [N], got {shown(at.tolist())}")
    if not (step >= 0.0).all():
        raise InputError(f"rate_max must be numbers >= 0 [N per call], got {step.min():g}")
    lower, upper = (np.clip(limit, at - step, at + step) for limit in (problem.t_min, problem.t_max))
    return TensionProblem(problem.A, problem.w, lower, upper, problem.t_ref, problem.weights, problem.length)
