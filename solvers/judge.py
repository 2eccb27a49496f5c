"""Judge what a method proposes: by multipliers, else by a certificate, else on the boundary of what cables can give."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .box_least_squares import project
from .certificate import Certificate, sharpest
from .exact_arithmetic import exact_optimum
from .face import face
from .methods.method import Method, Proposal
from .problem import Array, TensionProblem, accepted_error
from .standard_form import StandardForm, standard_forms
from .status import Status

_EXACT = "at the edge of what the cables can give, or of rounding: solved in exact arithmetic"
_ON_FACE = "at the edge of what the cables can give: a choice among the tensions that give the wrench there"
_UNPROVEN = "gives the wrench, but multipliers do not prove it optimal"
_NEAREST = "gives the wrench as near to t_ref as can be, which is not what the method looks for"


class Judgement(NamedTuple):
    """Hold what is known of a problem after a proposal, in the fields of a `TensionSolution`."""

    status: Status
    tensions: Array | None = None  # (m,)
    iterations: int | None = None
    detail: str = ""
    certificate: Certificate | None = None


def judge(problem: TensionProblem, method: Method, propose: Callable[[StandardForm], Proposal]) -> Judgement:
    """Take the proposals of a method, for one form of the problem after the other, and judge them.

    "optimal" are tensions that give w and, of a method of least squares, that multipliers prove optimal. Else the
    status follows from a certificate. If there is none, a method that is `exact` has lost its answer by rounding, on
    the boundary of the available wrench set or near it: the least squares are then computed in exact arithmetic, and a
    method with another aim proposes once more, for the cables that have a choice there.
    """
    proposal, tensions, useful = Proposal(None), None, False
    for form in standard_forms(problem):
        proposal = propose(form)
        tensions = None if proposal.s is None else form.tensions(problem, proposal.s)
        useful = tensions is not None and _gives_wrench(problem, tensions)
        if tensions is not None and useful and (not method.least_squares or form.is_optimal(tensions)):
            return Judgement(Status.OPTIMAL, tensions, proposal.iterations)
    iterations, detail = proposal.iterations, proposal.detail
    projection = project(problem)
    certificate = None if useful else sharpest(problem, projection)
    if certificate is not None:
        if method.always_answers and tensions is not None:
            return Judgement(Status.INACCURATE, tensions, iterations, detail, certificate)
        status = Status.SINGULAR if certificate.singular else Status.INFEASIBLE
        return Judgement(status, None, iterations, certificate=certificate)
    if method.exact and not proposal.final:
        exact = exact_optimum(problem, projection)
        if _gives_wrench(problem, exact):
            if method.least_squares:
                return Judgement(Status.OPTIMAL, exact, iterations, _EXACT)
            return _on_face(problem, propose, exact)
    if useful:
        return Judgement(Status.INACCURATE, tensions, iterations, _UNPROVEN)
    return Judgement(Status.FAILED if tensions is None else Status.INACCURATE, tensions, iterations, detail)


def _on_face(problem: TensionProblem, propose: Callable[[StandardForm], Proposal], exact: Array) -> Judgement:
    """Take the proposals for the cables that have a choice on the boundary; `exact` (m,) [N] are the least squares."""
    proposal = Proposal(None)
    for form in standard_forms(face(problem, exact)):
        if not form.N.size:
            return Judgement(Status.OPTIMAL, exact, detail=_EXACT)  # no others give w
        proposal = propose(form)
        tensions = None if proposal.s is None else form.tensions(problem, proposal.s)
        if tensions is not None and _gives_wrench(problem, tensions):
            return Judgement(Status.OPTIMAL, tensions, proposal.iterations, _ON_FACE)
    if proposal.final:
        return Judgement(Status.FAILED, None, proposal.iterations, proposal.detail)
    return Judgement(Status.INACCURATE, exact, proposal.iterations, f"{_NEAREST}: {proposal.detail}".removesuffix(": "))


def _gives_wrench(problem: TensionProblem, tensions: Array) -> bool:
    error = problem.scaled_A @ tensions - problem.scaled_w
    return bool(np.sqrt(error @ error) <= accepted_error(problem, tensions))
