"""The QP of a predictive controller: `StageProblem`, checked on construction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.display import Displayed
from ..base.errors import InputError
from ..base.inputs import finite_array, real_array

__all__ = ["Array", "StageProblem"]

Array = NDArray[np.float64]

_LARGEST = 1e50  # products of inputs stay inside the range of float64
_CONVEX = 1e-9  # relative to the largest eigenvalue: how negative one may be by rounding


@dataclass(frozen=True, eq=False)
class StageProblem(Displayed):
    r"""Controls of N stages with bounds, and the states that they lead to, at the least quadratic cost.

    $$
    \min \; \sum_{k=0}^{N-1} \tfrac12 \begin{bmatrix} x_k \\ u_k \end{bmatrix}^\top
    \begin{bmatrix} Q_k & S_k^\top \\ S_k & R_k \end{bmatrix} \begin{bmatrix} x_k \\ u_k \end{bmatrix}
    + q_k^\top x_k + r_k^\top u_k + \rho_k^\top s_k + \tfrac12 s_k^\top \mathrm{diag}(\sigma_k) s_k
    \; + \tfrac12 x_N^\top Q_N x_N + q_N^\top x_N
    $$

    subject to $x_{k+1} = A_k x_k + B_k u_k + c_k$ from a given $x_0$, $u_{\min,k} \le u_k \le u_{\max,k}$ and
    $C_k x_k + D_k u_k \le d_k + s_k$, $s_k \ge 0$. It is feasible for any data. Arrays are copied.

    Parameters
    ----------
    A, B :
        Dynamics, shapes (N, n, n) and (N, n, m).
    start :
        The state x of stage 0, shape (n,).
    Q, R :
        Symmetric matrices of the cost, shapes (N + 1, n, n) and (N, m, m); with S, convex. R may be zero.
    c :
        Offsets of the dynamics, shape (N, n). default: 0.
    S :
        Products of controls and states in the cost, shape (N, m, n). default: 0.
    q, r :
        Linear cost, shapes (N + 1, n) and (N, m). default: 0.
    u_min, u_max :
        Bounds of controls, shape (N, m) or one that repeats to it; they may be infinite, or equal. default: none.
    C, D, d :
        Soft rows, shapes (N, p, n), (N, p, m) and (N, p). default: p = 0; without C or D it is 0.
    penalty, square :
        Linear and quadratic cost of breaking each soft row, not negative, shape (N, p) or one that repeats to it. A
        linear one that is larger than the multiplier which the row has as a constraint keeps it exactly. default: 1 and
        0.

    Raises
    ------
    InputError
        If an array has a wrong type or shape, numbers that are not finite, or the cost is not convex.
    """

    A: Array  # (N, n, n)
    B: Array  # (N, n, m)
    start: Array  # (n,)
    Q: Array  # (N + 1, n, n)
    R: Array  # (N, m, m)
    c: Array  # (N, n)
    S: Array  # (N, m, n)
    q: Array  # (N + 1, n)
    r: Array  # (N, m)
    u_min: Array  # (N, m)
    u_max: Array  # (N, m)
    C: Array  # (N, p, n)
    D: Array  # (N, p, m)
    d: Array  # (N, p)
    penalty: Array  # (N, p)
    square: Array  # (N, p)

    def __init__(
        self,
        A: ArrayLike,
        B: ArrayLike,
        start: ArrayLike,
        Q: ArrayLike,
        R: ArrayLike,
        c: ArrayLike | None = None,
        S: ArrayLike | None = None,
        q: ArrayLike | None = None,
        r: ArrayLike | None = None,
        u_min: ArrayLike = -np.inf,
        u_max: ArrayLike = np.inf,
        C: ArrayLike | None = None,
        D: ArrayLike | None = None,
        d: ArrayLike | None = None,
        penalty: ArrayLike = 1.0,
        square: ArrayLike = 0.0,
    ) -> None:
        shape = real_array("A", A).shape
        if len(shape) != 3 or 0 in shape or shape[1] != shape[2]:
            raise InputError(f"A must be an array of shape (N, n, n) with N, n >= 1, got shape {shape}")
        N, n, _ = shape
        shape = real_array("B", B).shape
        if len(shape) != 3 or shape[:2] != (N, n) or shape[2] < 1:
            raise InputError(f"B must be an array of shape ({N}, {n}, m) with m >= 1, got shape {shape}")
        m = shape[2]
        p = 0
        if d is not None:
            rows = real_array("d", d).shape
            if len(rows) != 2 or rows[0] != N:
                raise InputError(f"d must be of shape ({N}, p), p rows for each stage, got shape {rows}")
            p = rows[1]
        elif C is not None or D is not None:
            raise InputError("d must be given where C or D is, got None")
        given: dict[str, tuple[Any, tuple[int, ...]]] = {
            "A": (A, (N, n, n)),
            "B": (B, (N, n, m)),
            "start": (start, (n,)),
            "Q": (Q, (N + 1, n, n)),
            "R": (R, (N, m, m)),
            "c": (c, (N, n)),
            "S": (S, (N, m, n)),
            "q": (q, (N + 1, n)),
            "r": (r, (N, m)),
            "C": (C, (N, p, n)),
            "D": (D, (N, p, m)),
            "d": (d, (N, p)),
        }
        for name, (value, wanted) in given.items():
            array = np.zeros(wanted) if value is None else finite_array(name, value, wanted)
            object.__setattr__(self, name, _limited(name, array))
        object.__setattr__(self, "u_min", _bounds("u_min", u_min, (N, m), np.inf))
        object.__setattr__(self, "u_max", _bounds("u_max", u_max, (N, m), -np.inf))
        crossed = self.u_min > self.u_max
        if crossed.any():
            k, i = np.argwhere(crossed)[0]
            low, high = self.u_min[k, i], self.u_max[k, i]
            raise InputError(f"u_min must be at most u_max, got {low:g} above {high:g} at stage {k}, control {i}")
        for name, value in (("penalty", penalty), ("square", square)):
            array = _limited(name, finite_array(name, _repeated(name, value, (N, p)), (N, p)))
            if (array < 0).any():
                raise InputError(f"{name} must be numbers >= 0, got {array.min():g}")
            object.__setattr__(self, name, array)
        for name in ("Q", "R"):
            object.__setattr__(self, name, _symmetric(name, getattr(self, name)))
        self._check_convexity()

    def _check_convexity(self) -> None:
        across = np.concatenate([self.S, np.zeros((1, self.m, self.n))])
        corner = np.concatenate([self.R, np.zeros((1, self.m, self.m))])
        cost = np.block([[corner, across], [across.transpose(0, 2, 1), self.Q]])
        # In units in which the diagonal is 1, so that no small part hides behind a large one.
        size = np.sqrt(np.maximum(np.einsum("kii->ki", cost), 0.0))
        unit = np.where(size > 0, size, 1.0)
        values = np.linalg.eigvalsh(cost / unit[:, :, None] / unit[:, None, :])
        least = values[:, 0] / np.maximum(np.abs(values).max(axis=1), 1e-300)
        if (least < -_CONVEX).any():
            k = int(np.argmin(least))
            raise InputError(f"Q, R and S must be such that the cost is convex, got a negative curvature at stage {k}")

    @property
    def N(self) -> int:
        """Return the number of stages with controls."""
        return self.B.shape[0]

    @property
    def n(self) -> int:
        """Return the number of states."""
        return self.B.shape[1]

    @property
    def m(self) -> int:
        """Return the number of controls."""
        return self.B.shape[2]

    @property
    def p(self) -> int:
        """Return the number of soft rows of a stage."""
        return self.d.shape[1]

    def cost(self, states: Array, controls: Array) -> float:
        """Return the cost of states (N + 1, n) and controls (N, m), penalties included.

        Raises
        ------
        InputError
            If an array has another shape, or numbers that are not finite.
        """
        states = finite_array("states", states, (self.N + 1, self.n))
        controls = finite_array("controls", controls, (self.N, self.m))
        x, u = states[:-1], controls
        total = 0.5 * np.einsum("ki,kij,kj->", states, self.Q, states) + (self.q * states).sum()
        total += 0.5 * np.einsum("ki,kij,kj->", u, self.R, u) + (self.r * u).sum()
        total += np.einsum("ki,kij,kj->", u, self.S, x)
        excess = np.einsum("kpj,kj->kp", self.C, x) + np.einsum("kpj,kj->kp", self.D, u) - self.d
        excess = np.maximum(excess, 0.0)
        return float(total + (self.penalty * excess + 0.5 * self.square * excess**2).sum())


def _limited(name: str, array: Array) -> Array:
    """Return an array whose numbers are below the largest that is accepted."""
    if array.size and np.abs(array).max() > _LARGEST:
        raise InputError(f"{name} must be numbers below {_LARGEST:g}, got {np.abs(array).max():g}")
    return array


def _repeated(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return an array of this shape, repeating one that fits it."""
    given = real_array(name, value)
    try:
        return np.array(np.broadcast_to(given, shape), dtype=np.float64)
    except ValueError:
        raise InputError(f"{name} must be of shape {shape} or repeat to it, got shape {given.shape}") from None


def _bounds(name: str, value: ArrayLike, shape: tuple[int, ...], never: float) -> Array:
    array = _repeated(name, value, shape)
    if np.isnan(array).any() or (array == never).any():
        raise InputError(f"{name} must be numbers, or infinite for no bound, got nan or {never:g}")
    array[np.abs(array) > _LARGEST] = -never
    return array


def _symmetric(name: str, matrices: Array) -> Array:
    other = matrices.transpose(0, 2, 1)
    size = np.abs(matrices).max(axis=(1, 2), keepdims=True)
    if (np.abs(matrices - other) > _CONVEX * size).any():
        raise InputError(f"{name} must be symmetric matrices, got one whose halves are not equal")
    return 0.5 * (matrices + other)
