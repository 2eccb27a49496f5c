"""Method "qp": the bounded quadratic program by any solver that the qpsolvers package finds installed."""

import warnings
from typing import Any, ClassVar

import numpy as np

from ...base.errors import InputError
from .method import Method, Proposal, StandardForm
from .numerics.least_norm import least_norm

# As tight as each can go: their defaults leave wrench errors of newtons, and the standard form has condition one. Every
# one is bounded in iterations or time, since some loop for ever on infeasible problems.
_SETTINGS: dict[str, dict[str, Any]] = {
    "clarabel": {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-12, "tol_feas": 1e-12, "time_limit": 5.0},
    "osqp": {
        "eps_abs": 3e-12,
        "eps_rel": 0.0,
        "eps_prim_inf": 1e-9,
        "polishing": True,
        "rho": 100.0,
        "max_iter": 20_000,
        "time_limit": 5.0,
    },
    "daqp": {"primal_tol": 1e-12},
    "piqp": {"eps_abs": 1e-11, "eps_rel": 0.0, "max_iter": 500},
    "proxqp": {"eps_abs": 1e-11, "max_iter": 1000},
    "scs": {"eps_abs": 1e-10, "eps_rel": 0.0, "max_iters": 100_000, "time_limit_secs": 5.0},
    "highs": {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10, "time_limit": 5.0},
}
# OSQP crawls where the feasible tensions have next to no interior; how slowly depends on its step size. Of 5000
# problems with most tensions at their limits, 21 are left after the first attempt and 1 after all of these.
_SECOND_THOUGHTS: dict[str, list[dict[str, Any]]] = {
    "osqp": [{"rho": 1000.0}, {"adaptive_rho": False}, {"rho": 10.0, "max_iter": 100_000}]
}
# A limit this many units away is left out at first: s is of order one, and residuals of interior-point methods are
# relative to the largest number that they see.
_FAR = 1e3


class QuadraticProgram(Method):
    """Weighted least squares to t_ref inside the limits, by a general QP solver."""

    name = "qp"
    guarantee = (
        "the unique optimum to the back end's accuracy; 'infeasible' is confirmed by a certificate of towline's own"
    )
    source = "qpsolvers: S. Caron et al.; OSQP: Stellato et al. 2020; Clarabel: Goulart and Chen 2024"
    exact = False
    continuous = True
    least_squares = True
    seeks_reference = True
    options: ClassVar[dict[str, str] | None] = None

    def backends(self) -> list[str]:
        """Return the names of the installed back ends, the default first."""
        import qpsolvers

        return sorted(qpsolvers.available_solvers, key=lambda name: (name != "clarabel", name))

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise |s|^2 / 2 with Q s = b as equality rows and the finite limits as inequality rows."""
        name = backend or self.backends()[0]
        proposal = _call(name, form, _FAR, options)
        s = proposal.s
        if s is not None and ((s < np.minimum(form.lower, -_FAR)) | (s > np.maximum(form.upper, _FAR))).any():
            proposal = _call(name, form, np.finfo(float).max, options)
        return proposal


def _call(name: str, form: StandardForm, far: float, options: dict[str, Any]) -> Proposal:
    """Run one back end with the limits up to `far`, again with other settings if it gets nowhere."""
    first, proposal = _SETTINGS.get(name, {}), Proposal(None)
    for change in ({}, *_SECOND_THOUGHTS.get(name, [])):
        proposal = _call_once(name, form, far, first | change, options)
        if proposal.s is not None or "infeasible" in proposal.detail:
            break
    return proposal


def _call_once(
    name: str, form: StandardForm, far: float, settings: dict[str, Any], options: dict[str, Any]
) -> Proposal:
    """Run one back end once; whatever it raises or warns stays here."""
    import qpsolvers
    from scipy.sparse import csc_matrix

    identity = np.eye(form.lower.size)
    use_lower, use_upper = form.lower >= -far, form.upper <= far
    G = np.vstack([identity[use_upper], -identity[use_lower]])
    h = np.concatenate([form.upper[use_upper], -form.lower[use_lower]])
    convert = np.ascontiguousarray if name in qpsolvers.dense_solvers else csc_matrix
    limits: dict[str, Any] = {"G": convert(G), "h": h} if h.size else {}
    equations: dict[str, Any] = {"A": convert(form.Q), "b": form.b} if form.b.size else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            program = qpsolvers.Problem(convert(identity), np.zeros(len(identity)), **limits, **equations)
            answer = qpsolvers.solve_problem(program, solver=name, **(settings | options))
        except Exception as error:
            if options and isinstance(error, TypeError | AttributeError | ValueError):
                raise InputError(
                    f"options must be settings of {name}, got {', '.join(options)}: {' '.join(str(error).split())}"
                ) from None
            return Proposal(None, detail=f"{name}: {type(error).__name__}: {error}")
    if not answer.found or answer.x is None or not np.isfinite(answer.x).all():
        reason = answer.extras.get("status") or getattr(answer.extras.get("info"), "status", "no solution")
        return Proposal(None, detail=f"{name}: {reason}")
    return Proposal(np.asarray(answer.x, dtype=np.float64))


class Daqp(Method):
    """Weighted least squares to t_ref inside the limits, by a dual active-set method."""

    name = "daqp"
    guarantee = "the unique optimum, exact up to rounding, continuous in w"
    source = "DAQP: D. Arnström, A. Bemporad, D. Axehill, IEEE Trans. Autom. Control 67(8), 2022"
    exact = True
    continuous = True
    least_squares = True
    seeks_reference = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise |s|^2 with Q s = b as equality rows and the limits as simple bounds."""
        return least_norm(form)


class ActiveSet(Daqp):
    """Weighted least squares to t_ref inside the limits, by a dual active-set method in the null space.

    `solve` runs the C core, `towline.core`. If its result is uncertain, or the problem is too large for it,
    the daqp package proposes and `solve` judges, as with the other methods: some 0.2 ms a call.
    """

    name = "active-set"
    source = (
        "null space: Golub and Van Loan, Matrix Computations, 5.4; D. Goldfarb, A. Idnani, Math. Program. 27, 1983; "
        "R. Seidel, Discrete Comput. Geom. 6, 1991"
    )
