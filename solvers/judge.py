"""Judge what a method proposes: by multipliers, else by a certificate, else by the optimum in exact arithmetic."""

from typing import NamedTuple

import numpy as np

from .box_least_squares import project
from .certificate import Certificate, sharpest
from .exact_arithmetic import exact_optimum
from .methods.method import Method, Proposal
from .problem import Array, TensionProblem, accepted_error
from .standard_form import StandardForm
from .status import Status

_EXACT = "at the edge of what the cables can give, or of rounding: solved in exact arithmetic"
_UNPROVEN = "gives the wrench, but multipliers do not prove it optimal"


class Judgement(NamedTuple):
    """Hold what is known of a problem after a proposal, in the fields of a `TensionSolution`."""

    status: Status
    tensions: Array | None = None  # (m,)
    certificate: Certificate | None = None
    detail: str = ""


def judge(
    problem: TensionProblem,
    form: StandardForm,
    method: Method,
    proposal: Proposal,
    tensions: Array | None,
    settle: bool,
) -> Judgement | None:
    """Judge a proposal of a method.

    Parameters
    ----------
    problem, form :
        The problem, and the form of it that the method got.
    method, proposal, tensions :
        The method, its proposal, and that in tensions [N], shape (m,).
    settle :
        False if another form is left to try: then only what is accepted is judged.

    Returns
    -------
    :
        "optimal" if the tensions give w and, of a method of least squares, multipliers prove them optimal; else what
        follows from a certificate or from exact arithmetic. None if that is left to another form.
    """
    useful = tensions is not None and _gives_wrench(problem, tensions)
    if tensions is not None and useful and (not method.least_squares or form.is_optimal(tensions)):
        return Judgement(Status.OPTIMAL, tensions)
    if not settle:
        return None
    projection = project(problem)
    certificate = None if useful else sharpest(problem, projection)
    if certificate is not None and method.always_answers and tensions is not None:
        return Judgement(Status.INACCURATE, tensions, certificate, proposal.detail)
    if certificate is not None:
        return Judgement(Status.SINGULAR if certificate.singular else Status.INFEASIBLE, certificate=certificate)
    if method.exact and not proposal.final:
        exact = exact_optimum(problem, projection)
        if _gives_wrench(problem, exact):
            return Judgement(Status.OPTIMAL, exact, detail=_EXACT)
    if useful:
        return Judgement(Status.INACCURATE, tensions, detail=_UNPROVEN)
    return Judgement(Status.FAILED if tensions is None else Status.INACCURATE, tensions, detail=proposal.detail)


def _gives_wrench(problem: TensionProblem, tensions: Array) -> bool:
    error = problem.scaled_A @ tensions - problem.scaled_w
    return bool(np.sqrt(error @ error) <= accepted_error(problem, tensions))
