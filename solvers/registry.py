"""One call for every method: `methods` lists them, `solve` runs one and judges what it proposes."""

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..inputs import required, shown
from ..tolerances import DOUBTFUL
from . import compiled
from .active_set import ActiveSet
from .analytic_centre import AnalyticCentre
from .centroid import Centroid
from .certificate import Certificate, certify
from .closed_form import ClosedForm
from .direct_daqp import Daqp
from .dykstra import Dykstra
from .exact_arithmetic import exact_optimum
from .improved_closed_form import ImprovedClosedForm
from .linear_programs import LargestMargin, LeastSum, MinMax
from .log_barrier import LogBarrier
from .method import Method, Proposal
from .min_norm import MinNorm
from .optimality import is_optimal
from .p_norm import PNorm
from .polygon_norms import OneNorm, TwoNorm
from .problem import TensionProblem
from .qp import QuadraticProgram
from .soft_wrench import SoftWrench
from .solution import Status, TensionSolution
from .standard_form import StandardForm, standard_form

__all__ = ["methods", "solve"]

_EXACT = "at the edge of what the cables can give, or of rounding: solved in exact arithmetic"

_ACTIVE_SET = ActiveSet()
_METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        _ACTIVE_SET,
        Daqp(),
        QuadraticProgram(),
        MinNorm(),
        ClosedForm(),
        ImprovedClosedForm(),
        Centroid(),
        OneNorm(),
        TwoNorm(),
        Dykstra(),
        LeastSum(),
        LargestMargin(),
        MinMax(),
        LogBarrier(),
        AnalyticCentre(),
        PNorm(),
        SoftWrench(),
    )
}


def methods() -> dict[str, Method]:
    """Return every method by name; each has `guarantee`, `source`, `options` and `backends()`."""
    return dict(_METHODS)


def solve(
    problem: TensionProblem, method: str | Method = "active-set", backend: str | None = None, **options: Any
) -> TensionSolution:
    """Distribute the tensions of one problem.

    An infeasible problem is an answer, not an exception: the status reports it and a certificate proves it. The status
    "optimal" of a method of least squares rests on multipliers that were verified, "infeasible" and "singular" on a
    certificate that was verified, never on a solver's word.

    Parameters
    ----------
    problem :
        The problem.
    method :
        One of `methods()`, or a method of your own (docs/adding-a-method.md).
    backend :
        For "qp", the name of an installed QP solver; default: "clarabel".
    **options :
        Options of the method, see `methods()[name].options`.

    Raises
    ------
    InputError
        If there is no such method, back end or option; the message lists those that exist.
    """
    start = time.perf_counter()
    if (
        isinstance(method, str)
        and method == "active-set"
        and backend is None
        and not options
        and type(problem) is TensionProblem
    ):
        form_of_kernels = compiled.current().backend
        answer = _ACTIVE_SET.attempt(problem)
        if answer is not None:
            spent = time.perf_counter() - start
            proof = _ACTIVE_SET.direction
            return TensionSolution(problem, answer[1], answer[0], "active-set", form_of_kernels, spent, direction=proof)
    chosen, used_backend = _lookup(method, backend, options)
    if chosen is _ACTIVE_SET:
        used_backend = "daqp"  # the solver of the robust path
    required("problem", problem, TensionProblem)
    form = standard_form(problem)
    proposal, judgement = None, None
    if form.sigma.size and form.sigma[-1] <= DOUBTFUL * form.sigma[0]:
        coarse = standard_form(problem, DOUBTFUL)
        proposal = _propose(chosen, coarse, used_backend, options)
        judgement = _accept(problem, coarse, chosen, proposal)
    if proposal is None or judgement is None:
        proposal = _propose(chosen, form, used_backend, options)
        judgement = _accept(problem, form, chosen, proposal) or _explain(problem, form, chosen, proposal)
    return TensionSolution(
        problem,
        judgement.tensions,
        judgement.status,
        chosen.name,
        used_backend,
        time.perf_counter() - start,
        judgement.certificate,
        proposal.iterations,
        judgement.detail,
    )


class _Judgement(NamedTuple):
    status: Status
    tensions: NDArray[np.float64] | None = None
    certificate: Certificate | None = None
    detail: str = ""


def _propose(method: Method, form: StandardForm, backend: str | None, options: dict[str, Any]) -> Proposal:
    """Return the proposal of the method, or t_ref at once where that is its answer."""
    at_reference = not form.b.any() and (form.lower <= 0.0).all() and (form.upper >= 0.0).all()
    if at_reference and method.seeks_reference:
        return Proposal(np.zeros(form.moving.size))
    return method.propose(form, backend, **options)


def _accept(problem: TensionProblem, form: StandardForm, method: Method, proposal: Proposal) -> _Judgement | None:
    """Return the judgement on tensions that give w and, of a method that solves the least squares, are optimal."""
    tensions = None if proposal.s is None else form.tensions(problem, proposal.s)
    if tensions is None or not _gives_wrench(problem, tensions):
        return None
    return _Judgement(Status.OPTIMAL, tensions) if not method.least_squares or is_optimal(form, tensions) else None


def _explain(problem: TensionProblem, form: StandardForm, method: Method, proposal: Proposal) -> _Judgement:
    """Judge a proposal that was not accepted: by a certificate, else by verified tensions from elsewhere, else less."""
    tensions = None if proposal.s is None else form.tensions(problem, proposal.s)
    useful = tensions if tensions is not None and _gives_wrench(problem, tensions) else None
    certificate = None if useful is not None else certify(problem)
    if certificate is not None and method.always_answers and tensions is not None:
        return _Judgement(Status.INACCURATE, tensions, certificate, proposal.detail)
    if certificate is not None:
        return _Judgement(Status.SINGULAR if certificate.singular else Status.INFEASIBLE, certificate=certificate)
    if method.exact and not proposal.final:
        exact = exact_optimum(problem)
        if _gives_wrench(problem, exact):
            return _Judgement(Status.OPTIMAL, exact, detail=_EXACT)
    if useful is not None:
        return _Judgement(Status.INACCURATE, useful, detail="gives the wrench, but multipliers do not prove it optimal")
    return _Judgement(Status.FAILED if tensions is None else Status.INACCURATE, tensions, detail=proposal.detail)


def _gives_wrench(problem: TensionProblem, tensions: NDArray[np.float64]) -> bool:
    error = problem.scaled_A @ tensions - problem.scaled_w
    return bool(np.sqrt(error @ error) <= problem.tolerance(tensions))


def _lookup(name: str | Method, backend: str | None, options: dict[str, Any]) -> tuple[Method, str | None]:
    """Return the method and the back end it will use, or raise InputError listing what there is."""
    if isinstance(name, Method):
        method = name
    elif isinstance(name, str) and name in _METHODS:
        method = _METHODS[name]
    else:
        raise InputError(f"method must be one of {', '.join(_METHODS)}, got {shown(name)}")
    available = method.backends()
    if backend is None:
        backend = next(iter(available), None)
    elif not isinstance(backend, str) or backend not in available:
        accepted = f"one of {', '.join(available)}" if available else f"None, as method {method.name} has no back ends"
        raise InputError(f"backend must be {accepted}, got {shown(backend)}")
    if method.options is not None:
        unknown = [key for key in options if key not in method.options]
        if unknown:
            accepted = f"among {', '.join(method.options)}" if method.options else f"empty for method {method.name}"
            raise InputError(f"options must be {accepted}, got {shown(unknown[0])}")
    return method, backend
