"""Tension distribution inside a CasADi expression: `casadi_function`.

CasADi is imported here and nowhere else in this package.
"""

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.inputs import InputError, shown, whole_number
from .derivatives import derivatives
from .problem import Array, TensionProblem
from .solve import solve

if TYPE_CHECKING:
    import casadi

_Matrix = tuple[str, tuple[int, int]]  # name and shape
_Options = Mapping[str, Any]

_MOST = 1000  # cables or wrench rows

_INPUTS = ("A", "w", "t_min", "t_max")


def casadi_function(
    m: int,
    n: int = 6,
    t_ref: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    length: float | None = None,
    name: str = "tensions",
) -> "casadi.Function":
    """Return the bounded quadratic program as a CasADi Function (A, w, t_min, t_max) -> t, with its derivative.

    The method is "soft-wrench" without rho: the tensions are the optimum of "active-set" if w is available, otherwise
    the tensions of the closest available wrench, so that an iterate of a nonlinear program always gets numbers. They
    give w only if `A @ t` is `w`: make that a constraint if it matters. Derivatives with respect to all four inputs are
    exact; at kinks they are one-sided, see `sensitivity`. There are no second derivatives: give IPOPT
    `{"ipopt.hessian_approximation": "limited-memory"}`.

    It is a Python callback: each evaluation costs a `solve`, and it cannot be exported as C code. Keep it in a variable
    as long as anything calls it.

    Args:
        m, n: Numbers of cables and of wrench rows.
        t_ref, weights, length: As in `TensionProblem`.
        name: Name of the Function.

    Returns:
        Function with inputs A (n, m), w (n), t_min (m), t_max (m) and output t (m) [N]. Crossed limits or entries that
            are not finite numbers give nan.

    Raises:
        InputError: If an argument is not what `TensionProblem` accepts.
    """
    m, n = whole_number("m", m, 1, _MOST), whole_number("n", n, 1, _MOST)
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z]([A-Za-z0-9]|_(?!_))*", name):
        raise InputError(f"name must be a letter, then letters, digits and single underscores, got {shown(name)}")
    constants = {"t_ref": t_ref, "weights": weights, "length": length}
    TensionProblem(np.zeros((n, m)), np.zeros(n), 0.0, 1.0, **constants)
    return _callback(name, m, n, constants)


def _callback(name: str, m: int, n: int, constants: dict[str, Any]) -> "casadi.Function":
    """Make the callback; its classes live here so that CasADi is imported on use only."""
    import casadi as ca

    shapes = [(n, m), (n, 1), (m, 1), (m, 1)]
    blocks = [(m, rows * columns) for rows, columns in shapes]
    jacobians: list[ca.Callback] = []  # CasADi does not keep them

    def problem_of(arguments: Sequence[Any]) -> TensionProblem | None:
        A, w, low, high = (argument.full() for argument in arguments[:4])
        try:
            return TensionProblem(A.reshape(n, m), w.ravel(), low.ravel(), high.ravel(), **constants)
        except InputError:
            return None

    def tensions_of(problem: TensionProblem | None) -> Array:
        tensions = None if problem is None else solve(problem, "soft-wrench").tensions
        return np.full(m, np.nan) if tensions is None else tensions

    class Dense(ca.Callback):
        """A callback of dense matrices, each with its name and shape."""

        def __init__(self, name: str, inputs: Sequence[_Matrix], outputs: Sequence[_Matrix], options: _Options):
            ca.Callback.__init__(self)
            self._inputs, self._outputs = inputs, outputs
            self.construct(name, dict(options))

        def get_n_in(self) -> int:
            return len(self._inputs)

        def get_n_out(self) -> int:
            return len(self._outputs)

        def get_name_in(self, i: int) -> str:
            return self._inputs[i][0]

        def get_name_out(self, i: int) -> str:
            return self._outputs[i][0]

        def get_sparsity_in(self, i: int) -> ca.Sparsity:
            return ca.Sparsity.dense(*self._inputs[i][1])

        def get_sparsity_out(self, i: int) -> ca.Sparsity:
            return ca.Sparsity.dense(*self._outputs[i][1])

    class Jacobian(Dense):
        """Return the blocks dt / d(A, w, t_min, t_max), each (m, entries)."""

        def eval(self, arguments: Sequence[Any]) -> list[Array]:
            problem = problem_of(arguments)
            tensions = tensions_of(problem)
            if problem is None or np.isnan(tensions).any():
                return [np.full(block, np.nan) for block in blocks]
            by = derivatives(problem, tensions)
            # CasADi counts the entries of A down its columns.
            return [by.A.transpose(0, 2, 1).reshape(m, n * m), by.w, by.t_min, by.t_max]

    class Tensions(Dense):
        """Return the distribution."""

        def eval(self, arguments: Sequence[Any]) -> list[Array]:
            return [tensions_of(problem_of(arguments))]

        def has_jacobian(self, *_: Any) -> bool:
            return True

        def get_jacobian(self, name: str, inames: Sequence[str], onames: Sequence[str], opts: _Options) -> ca.Function:
            # The fifth input is the nominal output, which is computed again: it may be a stand-in without entries.
            inputs = zip(inames, [*shapes, (m, 1)], strict=True)
            jacobian = Jacobian(name, list(inputs), list(zip(onames, blocks, strict=True)), opts)
            jacobians.append(jacobian)
            return jacobian

    return Tensions(name, list(zip(_INPUTS, shapes, strict=True)), [("t", (m, 1))], {})
