"""Solve one problem by any method: convert it to standard form, compute a proposal, verify it."""

from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy import empty

from ..base.inputs import InputError, shown
from ..core import solve_packed
from .box_least_squares import project
from .certificate import Certificate, certificate_along, sharpest
from .methods import METHODS
from .methods.method import Method, Proposal
from .methods.qp import ActiveSet
from .problem import Array, TensionProblem
from .solution import INFEASIBLE, OPTIMAL, SINGULAR, STATUSES, TensionSolution
from .standard_form import StandardForm, standard_forms
from .verify import verify

_OPTIMAL = STATUSES[OPTIMAL]
_new = object.__new__


def methods() -> dict[str, Method]:
    """Return every method by name; each has `guarantee`, `source`, `options` and `backends()`.

    Guarantees are for problems with feasible tensions. If none exist, the result is a certificate without tensions,
    unless the guarantee says otherwise.
    """
    return dict(METHODS)


def solve(
    problem: TensionProblem, method: str | Method = "active-set", backend: str | None = None, **options: Any
) -> TensionSolution:
    """Compute the tensions of one problem.

    An infeasible problem is a result, not an exception: the status reports it and a certificate proves it. For methods
    of least squares the status "optimal" is based on verified multipliers; "infeasible" and "singular" are based on a
    verified certificate. The status of a solver is never trusted.

    Args:
        problem: The problem.
        method: One of `methods()`, or a method of your own (docs/adding-a-method.md).
        backend: For "qp", the name of an installed QP solver; default: "clarabel".
        **options: Options of the method, see `methods()[name].options`.

    Raises:
        InputError: If the method, back end or option does not exist; the message lists the existing ones.
    """
    start = perf_counter()
    # These few lines decide the time of a step: a constructor would add a tenth.
    plain = isinstance(problem, TensionProblem) and type(method) is str and backend is None and not options
    if plain and method == "active-set":
        tensions = empty(problem.m)
        code = solve_packed(problem.packed, tensions)
        if code == OPTIMAL:
            solution = _new(TensionSolution)
            solution.problem = problem
            solution.tensions = tensions
            solution.status = _OPTIMAL
            solution.method = "active-set"
            solution.backend = "c"
            solution.iterations = solution.proof = None
            solution.detail = ""
            solution.time = perf_counter() - start
            return solution
        if code <= SINGULAR:
            spent = perf_counter() - start
            return TensionSolution(problem, None, STATUSES[code], "active-set", "c", spent, None, "", _PROOFS[code])
    if not isinstance(problem, TensionProblem):
        raise InputError(f"problem must be a TensionProblem, got {shown(problem)} of type {type(problem).__name__}")
    chosen, backend = _look_up(method, backend, options)
    chosen = chosen.for_options(problem, options)
    used = "daqp" if isinstance(chosen, ActiveSet) else backend  # the core does not take this size, or was not sure

    left, exact, forms = problem, None, list[StandardForm]()
    while True:
        forms = forms or standard_forms(left)
        form = forms.pop(0)
        if chosen.seeks_reference and form.holds_reference:
            proposal = Proposal(np.zeros(form.moving.size))
        else:
            proposal = chosen.propose(form, backend, **options)
        tensions = None if proposal.s is None else form.tensions(problem, proposal.s)
        verdict = verify(problem, form, chosen, proposal, tensions, exact, last=not forms)
        if verdict is None:
            continue
        status, tensions, detail, certificate, left = verdict
        if left is None:
            break
        exact = tensions  # the method chooses from what is left
    spent = perf_counter() - start
    return TensionSolution(
        problem, tensions, status, chosen.name, used, spent, proposal.iterations, detail, certificate
    )


def _prove(problem: TensionProblem, singular: bool) -> Certificate | None:
    """Return the sharpest certificate of what was proven, or else the one along the direction that proved it."""
    projection = project(problem)
    certificate = sharpest(problem, projection)
    if certificate is None or certificate.singular is not singular:
        # If the projection cancels huge tensions, its own rounding hides a shortfall that other tensions show.
        others = projection._replace(closest=np.minimum(np.maximum(problem.t_min, 0.0), problem.t_max))
        direction = _direction_of_core(problem)
        if direction is not None:
            along = (certificate_along(problem, direction, nearest) for nearest in (projection, others))
            return next(filter(None, along), certificate)
    return certificate


_PROOFS = {code: partial(_prove, singular=code == SINGULAR) for code in (INFEASIBLE, SINGULAR)}


def _direction_of_core(problem: TensionProblem) -> Array | None:
    """Return the direction, (n,) [1 and 1/m], on which "infeasible" or "singular" of the core rests."""
    n, m = problem.A.shape
    direction = np.full(n, np.nan)
    return direction if solve_packed(problem.packed, np.empty(m), direction) in (INFEASIBLE, SINGULAR) else None


def _look_up(name: str | Method, backend: str | None, options: dict[str, Any]) -> tuple[Method, str | None]:
    """Return the method and its back end, or raise InputError with a list of the existing ones."""
    if isinstance(name, Method):
        method = name
    elif isinstance(name, str) and name in METHODS:
        method = METHODS[name]
    else:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {shown(name)}")
    available = method.backends()
    if backend is None:
        backend = next(iter(available), None)
    elif not isinstance(backend, str) or backend not in available:
        accepted = f"be one of {', '.join(available)}" if available else f"be left out: {method.name} has no back ends"
        raise InputError(f"backend must {accepted}, got {shown(backend)}")
    if "solver" in options and "solver" not in (method.options or ()):
        raise InputError(
            "solver must be left out, as a QP solver is chosen by method='qp' with backend=..., "
            f"got solver={shown(options['solver'])}"
        )
    if method.options is not None:
        unknown = [key for key in options if key not in method.options]
        if unknown:
            accepted = f"among {', '.join(method.options)}" if method.options else f"empty for method {method.name}"
            raise InputError(f"options must be {accepted}, got {shown(unknown[0])}")
    return method, backend
