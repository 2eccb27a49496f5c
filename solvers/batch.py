"""Many problems in one call: `solve_batch`."""

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import processors
from ..base.display import Displayed, Fact
from ..base.inputs import InputError, leading, number, real_array, shown, whole_number
from ..base.text import quantity
from ..core import CABLES, ROWS, solve_rows
from .problem import Array, TensionProblem
from .solution import INVALID, STATUSES, UNSURE, Status, TensionSolution
from .solve import solve

ROWS_WORTH_A_THREAD = 2000  # about a millisecond
BACKENDS = LANES, ONE_BY_ONE = "lanes", "c"
NONE = np.empty(0)  # stands for equal weights
BEYOND_THE_CORE = "python"  # the back end that is reported for sizes that it does not take


@dataclass(frozen=True, eq=False)
class BatchSolution(Displayed):
    """The solutions of a batch of problems with leading dimensions `...`.

    Attributes:
        tensions: Tensions [N], shape (..., m), inside the limits to the last bit; nan where none exist.
        code: Status of each row as a small integer, shape (...); `statuses[code]` is the `Status`.
        residual: Wrench error |S (A t - w)| [N], shape (...); nan without tensions.
        direction: Verified wrench direction that proves infeasibility, shape (..., n), scaled as in `Certificate`; nan
            for feasible rows. Along it the shortfall exceeds the tolerance. Along the direction of
            `solution(index).certificate`, the shortfall is as large as possible.
        shortfall, support: d . w - h(d) [N] and h(d) [N] along that direction, shape (...); nan elsewhere.
        time: Wall time of the call [s].
        problem: A, w, t_min, t_max, t_ref, weights and length, broadcast. Float64 arrays are views of the arguments: do
            not change them as long as `solution` may be called.
        rho: As given.
        backend: "lanes" or "c", see `solve_batch`; "python" for sizes that the C core does not support.
    """

    tensions: Array  # (..., m)
    code: NDArray[np.int8]  # (...)
    residual: Array  # (...)
    direction: Array  # (..., n)
    shortfall: Array  # (...)
    support: Array  # (...)
    time: float
    problem: dict[str, Array]
    rho: float | None = None
    backend: str = ""

    statuses = STATUSES

    def _headline(self) -> str:
        return f"{quantity(self.code.size)} problems: " + ", ".join(
            f"{quantity(n)} {s}" for s, n in self.count().items()
        )

    def _facts(self) -> Iterable[Fact]:
        return [
            ("shape", " x ".join(map(str, self.tensions.shape))),
            ("time", quantity(1e3 * self.time, "ms", digits=3)),
            ("backend", self.backend),
        ]

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Return where the tensions are usable, shape (...)."""
        return self.code == 0

    @cached_property
    def status(self) -> NDArray[np.str_]:
        """Return the status of each row as text, shape (...): "optimal", "infeasible", ..."""
        return np.array([status.value for status in STATUSES])[self.code]

    def count(self) -> dict[Status, int]:
        """Return the number of rows with each status that occurs."""
        numbers = np.bincount(self.code.ravel(), minlength=len(STATUSES))
        return {status: int(number) for status, number in zip(STATUSES, numbers, strict=True) if number}

    def solution(self, index: int | tuple[int, ...]) -> TensionSolution:
        """Solve one row again as a single problem, for its full `TensionSolution`.

        The method is "active-set", or "soft-wrench" if `rho` was given; `index` is a number or a tuple.

        Raises:
            InputError: If the row is invalid; the message gives the reason.
        """
        accepted = f"index must pick one row of a batch of shape {self.code.shape}"
        try:
            picked = self.code[index]
        except (IndexError, TypeError, ValueError):
            raise InputError(f"{accepted}, got {shown(index)}") from None
        if np.ndim(picked):
            raise InputError(f"{accepted}, got {shown(index)}, which picks {np.size(picked)} rows")
        return _alone(_row(self.problem, index), self.rho)


def solve_batch(
    A: ArrayLike,
    w: ArrayLike,
    t_min: ArrayLike,
    t_max: ArrayLike,
    t_ref: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    length: ArrayLike | None = None,
    *,
    rho: float | None = None,
    threads: int | None = None,
    backend: str | None = None,
) -> BatchSolution:
    """Compute the tensions of many problems, each like `solve` with the method "active-set".

    Leading dimensions broadcast as in NumPy. The ranks may differ inside a batch. An invalid row (NaN, t_min > t_max, a
    weight that is not positive) has the status "invalid", and the others are solved.

    The C core solves several rows at a time in the lanes of vector registers. Rows with an uncertain result, near the
    boundary of the available wrench set or of the rank tolerance, are solved again by `solve`. Statuses are equal to
    the statuses of `solve`, and tensions are equal up to rounding. The result of a row does not depend on the other
    rows or on the number of threads, to the last bit.

    The core supports up to 6 wrench rows and 32 cables. `solve` solves all rows of larger problems, at about 0.2 ms
    each.

    Args:
        A: Wrench matrices, shape (..., n, m).
        w: Required wrenches, shape (..., n), [N] and [N m].
        t_min, t_max: Tension limits [N], shape (..., m) or one number.
        t_ref: Preferred tensions [N], shape (..., m) or one number; None = 0.
        weights: Weights of the cables, shape (..., m) or one number; None = 1.
        length: Characteristic length [m], shape (...); None = 1 m.
        rho: Weight of the squared wrench error relative to the squared tensions, as in the method "soft-wrench", 1e-12
            to 1e12: every valid row gets tensions, and rows with a wrench error are "inaccurate". None = exact wrench.
        threads: Number of threads that share the rows; None = one for each 2000 rows, at most the number of processors.
            The result does not depend on it.
        backend: "lanes" as described above, or "c" for rows one by one, with results equal to `solve` in every bit.
            None = "lanes".

    Raises:
        InputError: If an argument has a wrong type or shape.
    """
    start = time.perf_counter()
    if threads is not None:
        threads = whole_number("threads", threads, 1, 1024)
    if rho is not None:
        rho = number("rho", rho, 1e-12, 1e12, also=", or None")
    matrix = _real("A", A)
    if matrix.ndim < 2 or 0 in matrix.shape[-2:]:
        raise InputError(
            f"A must be of shape (..., n, m) with n >= 1 wrench rows and m >= 1 cables, got shape {matrix.shape}"
        )
    n, m = matrix.shape[-2:]
    given = {
        "A": matrix,
        "w": _ends("w", w, n),
        "t_min": _ends("t_min", t_min, m, repeat=True),
        "t_max": _ends("t_max", t_max, m, repeat=True),
        "t_ref": _ends("t_ref", 0.0 if t_ref is None else t_ref, m, repeat=True),
        "weights": _ends("weights", 1.0 if weights is None else weights, m, repeat=True),
        "length": _real("length", 1.0 if length is None else length),
    }
    core = {name: {"A": 2, "length": 0}.get(name, 1) for name in given}
    lead = leading({name: value.shape[: value.ndim - core[name]] for name, value in given.items()})
    problem = {name: _broadcast(value, core[name], lead) for name, value in given.items()}
    count, backend = math.prod(lead), _backend(backend, n, m)
    unsure = np.full(count, float(UNSURE))
    rows = _Rows(np.empty((count, m)), np.empty((count, n)), np.empty((count, 2)), np.empty(count), unsure)
    if backend != BEYOND_THE_CORE and count:
        columns = [
            (NONE, 0) if name == "weights" and weights is None else _column(value, problem[name], core[name], count)
            for name, value in given.items()
        ]
        _solve_by_core(rows, columns, backend == LANES, rho or 0.0, threads)
    code = rows.status.astype(np.int8).reshape(lead)
    _solve_others(rows, code, problem, rho)
    return BatchSolution(
        rows.tensions.reshape(*lead, m),
        code,
        rows.residual.reshape(lead),
        rows.direction.reshape(*lead, n),
        rows.info[:, 1].reshape(lead),
        rows.info[:, 0].reshape(lead),
        time.perf_counter() - start,
        problem,
        rho,
        backend,
    )


class _Rows(NamedTuple):
    """Results of the core for each row, as in `core/batch/batch.h`."""

    tensions: Array  # (rows, m)
    direction: Array  # (rows, n)
    info: Array  # (rows, 2)
    residual: Array  # (rows,)
    status: Array  # (rows,)


def _broadcast(value: Array, core: int, lead: tuple[int, ...]) -> Array:
    """Return an array whose last `core` dimensions are its own as (*lead, ...)."""
    shape = lead + value.shape[value.ndim - core :]
    return value if value.shape == shape else np.broadcast_to(value, shape)


def _column(value: Array, of_all: Array, core: int, rows: int) -> tuple[Array, int]:
    """Return the numbers of all rows as (rows, ...), or those that serve all as (1, ...), and how many a row has."""
    size = math.prod(value.shape[value.ndim - core :])
    if value.size == size:
        return np.ascontiguousarray(value).reshape(1, size), 0
    return np.ascontiguousarray(of_all).reshape(rows, size), size


def _solve_by_core(
    rows: _Rows, columns: list[tuple[Array, int]], in_lanes: bool, rho: float, threads: int | None
) -> None:
    """Solve all rows by the core, shared among threads; rows with an uncertain result stay uncertain."""
    count, m = rows.tensions.shape
    share = threads or min(processors.available(), max(1, count // ROWS_WORTH_A_THREAD))
    per = np.array([size for _, size in columns], dtype=np.float64)

    def work(begin: int, end: int) -> None:
        part = slice(begin, end)
        own = (array[part] if size else array for array, size in columns)
        solve_rows(rows.direction.shape[1], m, rho, in_lanes, *own, per, *(array[part] for array in rows))

    processors.in_threads(work, count, min(share, count))


def _solve_others(rows: _Rows, code: NDArray[np.int8], problem: dict[str, Array], rho: float | None) -> None:
    """Solve the rows that are unsure by `solve`, and write their codes."""
    for row in np.flatnonzero(code == UNSURE):
        for array in rows[:-1]:
            array[row] = np.nan
        index = tuple(int(i) for i in np.unravel_index(row, code.shape))
        try:
            solution = _alone(_row(problem, index), rho)
        except InputError:
            code[index] = INVALID
            continue
        code[index] = STATUSES.index(solution.status)
        if solution.tensions is not None:
            rows.tensions[row], rows.residual[row] = solution.tensions, solution.residual
        if (certificate := solution.certificate) is not None:
            rows.direction[row], rows.info[row] = certificate.direction, (certificate.support, certificate.shortfall)


def _backend(given: str | None, n: int, m: int) -> str:
    """Return the back end for problems of this size, or raise InputError."""
    fits = n <= ROWS and m <= CABLES
    if given is None:
        return LANES if fits else BEYOND_THE_CORE
    if not isinstance(given, str) or given not in BACKENDS or not fits:
        accepted = "c, lanes or None"
        if not fits:
            accepted = f"None for {n} wrench rows and {m} cables, which the C core does not take"
        raise InputError(f"backend must be {accepted}, got {shown(given)}")
    return given


def _alone(problem: TensionProblem, rho: float | None) -> TensionSolution:
    """Solve one row by the method of the batch."""
    return solve(problem) if rho is None else solve(problem, method="soft-wrench", rho=rho)


def _row(problem: dict[str, Array], index: int | tuple[int, ...]) -> TensionProblem:
    """State one row of a batch as a problem."""
    taken = {name: value[index] for name, value in problem.items()}
    return TensionProblem(**{**taken, "length": float(taken["length"])})


def _real(name: str, value: ArrayLike) -> Array:
    """Return `value` as float64, or raise InputError if it is not an array of real numbers."""
    return np.asarray(real_array(name, value), dtype=np.float64)


def _ends(name: str, value: ArrayLike, size: int, repeat: bool = False) -> Array:
    """Return `value` as (..., size); a single number may stand for all of them."""
    array = _real(name, value)
    if repeat and array.ndim == 0:
        return np.full(size, array)
    if array.ndim == 0 or array.shape[-1] != size:
        also = " or a single number" if repeat else ""
        raise InputError(f"{name} must be of shape (..., {size}) for this A{also}, got shape {array.shape}")
    return array
