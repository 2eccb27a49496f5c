r"""Method "min-norm": pseudo-inverse plus null space, Eq. 16 and 17 of Wang, Zhao, Li, Ji (m robots towing one object).

The paper prints $T = J^T (J J^T)^{-1} w + N \lambda$ with any scalar $\lambda \in (0, 1)$. That inverse does not exist
for fewer than six cables, and one scalar multiplies one null-space vector, so here the pseudo-inverse comes from the
singular value decomposition and $\lambda \in R^{m - rank}$. Without the option `lambda_` it is the shortest one that
brings the tensions inside their limits: T' and N lambda are orthogonal, so the result is the least norm of all. With
`lambda_`, a number where m - rank = 1 as the paper has it, the tensions are T' + N lambda, if the limits permit these.
"""

from typing import Any, ClassVar

import numpy as np

from ...base.inputs import InputError, real_array, shown
from ...base.tolerances import DOUBTFUL
from ..problem import TensionProblem
from .method import Method, Proposal, StandardForm
from .numerics.least_norm import least_norm_in_null_space

_SLACK = 1e-12  # How far s, of order one, may pass a limit; `solve` moves it back.
_LARGEST = 1e50  # of an entry of lambda [N], as of all numbers of a problem


class MinNorm(Method):
    """Pseudo-inverse solution, moved along the null space as little as the limits require, or by a given lambda."""

    name = "min-norm"
    guarantee = "the unique optimum"
    source = "Wang, Zhao, Li, Ji, cable-driven multi-robot towing system, Eq. 16-17, corrected"
    exact = True
    continuous = True
    least_squares = True
    seeks_reference = True
    options: ClassVar[dict[str, str] | None] = {
        "lambda_": "null-space coordinates [N], a number or (m - rank,): tensions A^+ w + N lambda_ with N = "
        "problem.null_space, failed where these leave the limits; the shortest inside the limits if not given"
    }

    def for_options(self, problem: TensionProblem, options: dict[str, Any]) -> Method:
        """Return the method that takes lambda as it is, if there is one among the options."""
        given = options.get("lambda_")
        return self if given is None else GivenLambda(problem, given)

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Take s' = Q^T b, and s' + N^T lambda if that is outside the limits."""
        s = form.b @ form.Q  # (k,)
        low, high = form.lower - s, form.upper - s
        if low.max(initial=-np.inf) <= _SLACK and high.min(initial=np.inf) >= -_SLACK:
            return Proposal(s)
        if not len(form.N):
            return Proposal(None, detail="the only tensions that give w are outside the limits")
        return least_norm_in_null_space(form)


class GivenLambda(Method):
    """Pseudo-inverse solution plus N lambda, whatever t_ref and weights: no optimum, so it is not judged as one."""

    name = MinNorm.name
    guarantee = "A^+ w + N lambda_; fails if these tensions leave the limits, even if other tensions do not"
    source = MinNorm.source
    exact = False
    options = MinNorm.options

    def __init__(self, problem: TensionProblem, given: Any) -> None:
        null = problem.null_space
        size = null.shape[1]
        shift = np.atleast_1d(real_array("lambda_", given).astype(float))
        if shift.shape != (size,) or not (np.abs(shift) < _LARGEST).all():
            numbers = (
                f"{size} finite numbers, one for each column of the null space" if size != 1 else "a finite number"
            )
            accepted = numbers if size else "empty, as A has no null space"
            raise InputError(
                f"lambda_ must be {accepted} (m = {problem.m}, rank {problem.m - size}), got {shown(given)}"
            )
        t = np.linalg.pinv(problem.scaled_A, rcond=DOUBTFUL) @ problem.scaled_w + null @ shift
        beyond = np.maximum(problem.t_min - t, t - problem.t_max)
        worst = int(np.argmax(beyond))
        self.tensions, self.detail = t, ""
        if beyond[worst] > _SLACK * np.abs(t).max():
            self.detail = f"A^+ w + N lambda_ leaves the limits of cable {worst} by {beyond[worst]:.3g} N"

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Propose these tensions if they are inside the limits."""
        s = (self.tensions - form.origin)[form.moving] / form.unit
        return Proposal(None, detail=self.detail) if self.detail else Proposal(s)
