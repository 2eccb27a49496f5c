"""Judge what a method proposes: by multipliers, else by a certificate, else on the boundary of what cables can give."""

from typing import NamedTuple

import numpy as np

from ..base.tolerances import AT_LIMIT, RANK
from .box_least_squares import project
from .certificate import Certificate, sharpest
from .exact_arithmetic import exact_optimum
from .methods.method import Method, Proposal
from .methods.numerics.linear_program import optimise
from .problem import Array, TensionProblem, accepted_error
from .solution import Status
from .standard_form import StandardForm

_EXACT = "at the edge of what the cables can give, or of rounding: solved in exact arithmetic"
_ON_FACE = "at the edge of what the cables can give: a choice among the tensions that give the wrench there"
_UNPROVEN = "gives the wrench, but multipliers do not prove it optimal"
_MISSES = "does not give the wrench to within the tolerance"
_NEAREST = "gives the wrench as near to t_ref as can be, which is not what the method looks for"


class Verdict(NamedTuple):
    """Hold what is known of a problem after a proposal, in the fields of a `TensionSolution`.

    `left` is the problem of the tensions that remain free on the boundary of the available wrench set, for another
    proposal; `tensions` are then the least squares there. None if the verdict is final.
    """

    status: Status
    tensions: Array | None = None  # (m,)
    detail: str = ""
    certificate: Certificate | None = None
    left: TensionProblem | None = None


def verify(
    problem: TensionProblem,
    form: StandardForm,
    method: Method,
    proposal: Proposal,
    tensions: Array | None,
    exact: Array | None,
    last: bool,
) -> Verdict | None:
    """Judge a proposal of a method.

    The status is "optimal" if the tensions give w and, for a method of least squares, if multipliers prove them
    optimal. Otherwise a certificate decides it. If none exists, rounding has cost an `exact` method its answer: w is on
    the boundary of the available wrench set, or near it. The least squares are then computed in exact arithmetic and
    are "optimal" too; a method with another aim proposes once more, for the cables that can still vary.

    - `problem`, `form`: the problem, and the form of it that the method got.
    - `method`, `proposal`, `tensions`: the method, its proposal, and that in tensions [N], (m,).
    - `exact`: the least squares [N], (m,), if all tensions of the form remain free on the boundary; else None.
    - `last`: False if another form is left to try: then only what is accepted is judged, and None is returned
      otherwise.
    """
    useful = tensions is not None and _gives_wrench(problem, tensions)
    if tensions is not None and useful and (not method.least_squares or form.is_optimal(tensions)):
        return Verdict(Status.OPTIMAL, tensions, "" if exact is None else _ON_FACE)
    if not last:
        return None
    if exact is not None:
        if proposal.final:
            return Verdict(Status.FAILED, None, proposal.detail)
        return Verdict(Status.INACCURATE, exact, f"{_NEAREST}: {proposal.detail}".removesuffix(": "))
    nearest, exactly = project(problem), method.exact and not proposal.final
    while True:
        certificate = None if useful else sharpest(problem, nearest)
        if certificate is not None or not exactly:
            break
        nearest, exactly = exact_optimum(problem, nearest.closest), False
        if _gives_wrench(problem, nearest.closest):
            left = None if method.least_squares else _face(problem, form, nearest.closest)
            return Verdict(Status.OPTIMAL, nearest.closest, _EXACT, left=left)
    if certificate is not None:
        if method.always_answers and tensions is not None:
            return Verdict(Status.INACCURATE, tensions, proposal.detail, certificate)
        return Verdict(Status.SINGULAR if certificate.singular else Status.INFEASIBLE, certificate=certificate)
    if useful:
        return Verdict(Status.INACCURATE, tensions, _UNPROVEN)
    if tensions is None:
        return Verdict(Status.FAILED, None, proposal.detail)
    return Verdict(Status.INACCURATE, tensions, proposal.detail or _MISSES)


def _face(problem: TensionProblem, form: StandardForm, exact: Array) -> TensionProblem | None:
    """Fix each cable that is at the same limit in every solution of A t = w; return None if none is left to choose.

    If w is on a face of the available wrench set, these are the cables whose wrench has a component along its normal.
    The others can all be strictly inside their limits at once, as some methods require. `exact` are some tensions that
    give w [N], (m,).
    """
    s = (exact - form.origin)[form.moving] / form.unit  # (k,)
    near = AT_LIMIT * max(1.0, np.abs(s).max(initial=0.0))
    low, high = s - form.lower <= near, form.upper - s <= near
    held = np.flatnonzero(low | high)
    stays = held
    if held.size:
        # A change that leaves the wrench as it is, crosses no limit, and moves as many of these as can move.
        changes = form._replace(b=0.0 * form.b, lower=np.where(low, 0.0, -np.inf), upper=np.where(high, 0.0, np.inf))
        moved = np.eye(s.size)[held] * np.where(low, -1.0, 1.0)
        rows = np.hstack([moved, np.eye(held.size)])
        cost = np.r_[np.zeros(s.size), -np.ones(held.size)]
        change = optimise(changes, cost, rows, np.zeros(held.size), nonnegative=True, most=1.0).s
        stays = held if change is None else held[np.abs(change[held]) < 0.5]
    if len(form.N) == (np.linalg.matrix_rank(form.N[:, stays], RANK) if stays.size else 0):
        return None
    t_min, t_max = problem.t_min.copy(), problem.t_max.copy()
    fixed = form.moving[stays]
    t_min[fixed] = t_max[fixed] = exact[fixed]
    return TensionProblem(problem.A, problem.w, t_min, t_max, problem.t_ref, problem.weights, problem.length)


def _gives_wrench(problem: TensionProblem, tensions: Array) -> bool:
    error = problem.scaled_A @ tensions - problem.scaled_w
    return bool(np.sqrt(error @ error) <= accepted_error(problem, tensions))
