"""The tension-distribution problem: `TensionProblem`, checked on construction; `limit_rate` reduces its limits."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.display import Displayed
from ..base.inputs import InputError, real_array, repeated, required, shown
from ..base.tolerances import CANCELLED, DOUBTFUL, FEASIBILITY, ROUNDING, WEIGHTS_APART

Array = NDArray[np.float64]

# Inside this range no square, and no quotient of two inputs, leaves the range of float64.
_LARGEST, _SMALLEST = 1e50, 1e-50
_HEAVIEST, _LIGHTEST = 1e20, 1e-20

_NO_ENTRY = 1e-6  # Entries of a null-space vector below this have no sign of their own.


@dataclass(frozen=True, eq=False)
class TensionProblem(Displayed):
    r"""The problem: tensions inside their limits that give a wrench, as close as possible to reference tensions.

    $$
    \min\limits_t \; \sum_i \omega_i (t_i - t_{\text{ref},i})^2
    \quad \text{s.t.} \quad A t = w, \; t_{\min} \le t \le t_{\max}
    $$

    The arrays are copied, converted to float64 and set read-only. Entries smaller than 1e-50 are set to 0, and limits
    beyond 1e50 are infinite.

    Args:
        A: Wrench matrix, shape (n, m), any n and m from 1 up. Usually n = 6: rows 0 to 2 are forces [N per N of
            tension], rows 3 to 5 moments [N m per N].
        w: Required wrench, shape (n,), [N] and [N m]. The entries of w and of A must be below 1e50.
        t_min, t_max: Tension limits [N], shape (m,) or one number for all cables. Equal limits fix a tension; t_min may
            be -inf and t_max +inf.
        t_ref: Preferred tensions [N], shape (m,) or one number, inside or outside the limits. Default: 0, for the least
            norm.
        weights: Weights omega of the cables in the cost, from 1e-20 to 1e20, with ratios up to 1e14, shape (m,) or one
            number. None = 1.
        length: Characteristic length [m], from 1e-20 to 1e20, by which moment rows (3 to 5, when n = 6) are divided
            wherever newtons and newton metres are compared: in residuals, tolerances and certificates. It never changes
            which tensions are optimal. Default: 1 m.

    Raises:
        InputError: If an argument has a wrong type, shape or value. The message is one line.
    """

    A: Array  # (n, m)
    w: Array  # (n,)
    t_min: Array  # (m,)
    t_max: Array  # (m,)
    t_ref: Array  # (m,)
    weights: Array  # (m,)
    length: float
    n: int
    """The number of wrench rows."""
    m: int
    """The number of cables."""
    packed: Array = field(repr=False)
    """The whole problem in one array, in the order of the arguments; the others are views of it."""

    def __init__(
        self,
        A: ArrayLike,
        w: ArrayLike,
        t_min: ArrayLike,
        t_max: ArrayLike,
        t_ref: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        length: float | None = None,
    ) -> None:
        matrix = _real_array("A", A)
        if matrix.ndim != 2 or 0 in matrix.shape:
            raise InputError(
                f"A must be of shape (n, m) with n >= 1 wrench rows and m >= 1 cables, got shape {matrix.shape}"
            )
        n, m = matrix.shape
        wrench = _real_array("w", w)
        if wrench.shape != (n,):
            raise InputError(f"w must be of shape ({n},), one entry per row of A, got shape {wrench.shape}")
        _require_finite("A", matrix)
        _require_finite("w", wrench)

        lower = _per_cable("t_min", t_min, m)
        upper = _per_cable("t_max", t_max, m)
        _reject_at("t_min", lower, lower > _LARGEST, f"numbers up to {_LARGEST:g}, or -inf")
        _reject_at("t_max", upper, upper < -_LARGEST, f"numbers from {-_LARGEST:g}, or inf")
        lower[lower < -_LARGEST], upper[upper > _LARGEST] = -np.inf, np.inf
        crossed = lower > upper
        if crossed.any():
            i = int(np.argmax(crossed))
            raise InputError(f"t_min must be at most t_max, got {lower[i]:g} above {upper[i]:g} at cable {i}")

        wish = np.zeros(m) if t_ref is None else _per_cable("t_ref", t_ref, m)
        _require_finite("t_ref", wish)
        omega = np.ones(m) if weights is None else _per_cable("weights", weights, m)
        out_of_range = (omega < _LIGHTEST) | (omega > _HEAVIEST)
        _reject_at("weights", omega, out_of_range, f"numbers > 0, from {_LIGHTEST:g} to {_HEAVIEST:g}")
        if omega.max() > WEIGHTS_APART * omega.min():
            raise InputError(
                f"weights must be such that the largest is at most {WEIGHTS_APART:g} times the smallest, "
                f"got {omega.min():g} to {omega.max():g}"
            )

        parts = (matrix.ravel(), wrench, lower, upper, wish, omega)
        packed = np.concatenate((*parts, [_positive_length(length)]))
        packed.flags.writeable = False
        start = 0
        for name, part in zip(("A", "w", "t_min", "t_max", "t_ref", "weights"), parts, strict=True):
            view = packed[start : start + part.size]
            object.__setattr__(self, name, view.reshape(n, m) if name == "A" else view)
            start += part.size
        for name, value in (("length", float(packed[-1])), ("n", n), ("m", m), ("packed", packed)):
            object.__setattr__(self, name, value)

    @cached_property
    def row_scale(self) -> Array:
        """Return the diagonal of S, shape (n,): 1 for force rows, 1 / length for moment rows; S w is in newtons."""
        scale = np.ones(self.n)
        if self.n == 6:
            scale[3:] = 1.0 / self.length
        return scale

    @cached_property
    def scaled_A(self) -> Array:
        """Return S A, shape (n, m) [N per N]."""
        return self.A if self.length == 1.0 else self.row_scale[:, None] * self.A

    @cached_property
    def scaled_w(self) -> Array:
        """Return S w, shape (n,) [N]."""
        return self.w if self.length == 1.0 else self.row_scale * self.w

    @cached_property
    def column_norms(self) -> Array:
        """Return the norm of each column of S A, shape (m,): the wrench that 1 N in a cable makes [N per N]."""
        return np.sqrt(np.einsum("ij,ij->j", self.scaled_A, self.scaled_A))

    @cached_property
    def wrench_scale(self) -> float:
        """Return the wrench size to which errors are relative: |S w| plus sum |S a_i| times the least |t_i| [N]."""
        nearest_to_zero = np.minimum(np.maximum(self.t_min, 0.0), self.t_max)
        return float(np.sqrt(self.scaled_w @ self.scaled_w) + self.column_norms @ np.abs(nearest_to_zero))

    @cached_property
    def null_space(self) -> Array:
        """Return N, shape (m, m - rank): orthonormal columns that span the null space of A.

        All tensions that give w, inside the limits or not, are A^+ w + N lambda; `TensionSolution.lambda_` is the
        lambda of a solution. N is in echelon form: the first nonzero entry of each column is positive, and later
        columns are zero in its row. So N is unique, and the same on every computer. Singular values of S A below 1e-10
        of the largest are treated as zero.
        """
        _, sigma, rows = np.linalg.svd(self.scaled_A)
        null = rows[int(np.count_nonzero(sigma > DOUBTFUL * sigma[0])) :].T  # in any basis
        basis = np.zeros((0, null.shape[1]))
        for row in null:
            for _ in range(2):  # Gram and Schmidt, twice against rounding
                row = row - basis.T @ (basis @ row)
            size = np.linalg.norm(row)
            if size > _NO_ENTRY:
                basis = np.vstack([basis, row / size])
        return null @ basis.T

    def tolerance(self, tensions: Array) -> float:
        r"""Return the largest wrench error [N] at which `tensions` are accepted as giving w.

        $$
        10^{-9} \Big( |S w| + \sum_i |S a_i| \, |\hat t_i| \Big)
        + 10^{-13} \sum_i |S a_i| \, (|t_i| + |t_{\text{ref},i}|)
        $$

        with $\hat t_i$ the tension inside the limits that is nearest to 0. The first part is relative to what the
        problem requires, so a huge limit does not raise it. The second is the rounding error of A t. In it, the sum
        over |t_i| counts at most as 1e10 times the large brackets plus the sum over |t_ref,i|, because with larger
        tensions that cancel, rounding alone could give any wrench.

        Args:
            tensions: The tensions to check [N], shape (m,).
        """
        if not isinstance(tensions, np.ndarray) or tensions.shape != self.t_min.shape or tensions.dtype != np.float64:
            tensions = _per_cable("tensions", tensions, self.m)
            _require_finite("tensions", tensions)
        return accepted_error(self, tensions)


def accepted_error(problem: TensionProblem, tensions: Array) -> float:
    """Return `TensionProblem.tolerance` [N] of tensions (m,) of float64 that are known to be numbers."""
    norms, required = problem.column_norms, problem.wrench_scale
    reference = norms @ np.abs(problem.t_ref)
    terms = norms @ np.abs(tensions)
    if required > 0.0:  # otherwise no tensions give the wrench too, and what others leave is rounding
        terms = min(terms, CANCELLED * required + reference)
    return float(FEASIBILITY * required + ROUNDING * (terms + reference))


def _real_array(name: str, value: ArrayLike) -> Array:
    """Return a float64 copy of `value`, or raise InputError if it is not an array of real numbers."""
    return _flushed(np.array(real_array(name, value), dtype=np.float64, order="C"))


def _flushed(array: Array) -> Array:
    array[np.abs(array) < _SMALLEST] = 0.0
    return array


def _per_cable(name: str, value: ArrayLike, m: int) -> Array:
    """Return `value` as a new (m,) array without NaN, repeating a single number."""
    array = _flushed(repeated(name, value, m))
    _reject_at(name, array, np.isnan(array), "numbers")
    return array


def _require_finite(name: str, array: Array) -> None:
    fits = np.abs(array) < _LARGEST
    if not fits.all():
        _reject_at(name, array, ~fits, f"finite numbers below {_LARGEST:g}")


def _reject_at(name: str, array: Array, bad: NDArray[np.bool_], accepted: str) -> None:
    """Raise InputError for the first entry that `bad` marks."""
    if bad.any():
        index = np.unravel_index(int(np.argmax(bad)), array.shape)
        where = ", ".join(str(int(i)) for i in index)
        raise InputError(f"{name} must be {accepted}, got {array[index]:g} at index {where}")


def _positive_length(length: float | None) -> float:
    if length is None:
        return 1.0
    value = _real_array("length", length)
    if value.ndim != 0 or not _LIGHTEST <= value <= _HEAVIEST:
        given = f"shape {value.shape}" if value.ndim else f"{value:g}"
        raise InputError(
            f"length must be one number > 0 [m], from {_LIGHTEST:g} to {_HEAVIEST:g}, or None for 1 m, got {given}"
        )
    return float(value)


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
