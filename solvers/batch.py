"""Many problems in one call: `solve_batch`."""

import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import processors
from ..base.display import Displayed, Fact
from ..base.errors import InputError
from ..base.inputs import leading, number, real_array, shown, whole_number
from ..base.text import quantity
from ..core import CABLES, ROWS, solve_rows
from . import compiled
from .kernels.codes import INACCURATE, INVALID, OPTIMAL, UNSURE
from .problem import TensionProblem
from .solution import TensionSolution
from .solve import solve
from .status import STATUSES, Status

__all__ = ["BatchSolution", "solve_batch"]

Array = NDArray[np.float64]

ROWS_WORTH_A_THREAD = 2000  # about a millisecond
# The C core takes half a microsecond to two for a row, the lanes ten times as much in NumPy, and a third of it in
# machine code, which takes seconds to load. That pays for larger batches only, among them the blocks of workspaces.
MOST_ROWS_OF_CORE = 8000


@dataclass(frozen=True, eq=False)
class BatchSolution(Displayed):
    """The answers to a batch of problems, `...` being its leading dimensions.

    Attributes
    ----------
    tensions :
        Tensions [N], shape (..., m), inside the limits to the last bit; nan where there are none.
    code :
        Status of each row as a small integer, shape (...); `statuses[code]` is the `Status`.
    residual :
        Wrench error |S (A t - w)| [N], shape (...); nan without tensions.
    direction :
        Wrench direction that proves w out of reach, where it is, shape (..., n), scaled as that of a `Certificate`;
        nan elsewhere. Every one was verified. It is a direction along which the shortfall is more than the tolerance,
        not always the one along which it is largest: that is `solution(index).certificate`.
    shortfall, support :
        d . w - h(d) [N] and h(d) [N] along that direction, shape (...); nan elsewhere.
    time :
        Wall time of the call [s].
    problem :
        A, w, t_min, t_max, t_ref, weights and length, broadcast. Views of what was given, where that was an array of
        float64: not to be changed as long as `solution` may be called.
    rho :
        As it was given.
    backend :
        "c" if the C core solved all rows, else the form in which the lanes ran, "compiled" or "interpreted", on which
        the numbers do not depend.
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
        """Return where the tensions can be used as they are, shape (...)."""
        return self.code == 0

    @cached_property
    def status(self) -> NDArray[np.str_]:
        """Return the status of each row as text, shape (...): "optimal", "infeasible", ..."""
        return np.array([status.value for status in STATUSES])[self.code]

    def count(self) -> dict[Status, int]:
        """Return how many rows have each status, for those that occur."""
        numbers = np.bincount(self.code.ravel(), minlength=len(STATUSES))
        return {status: int(number) for status, number in zip(STATUSES, numbers, strict=True) if number}

    def solution(self, index: int | tuple[int, ...]) -> TensionSolution:
        """Solve one row again by itself, for its certificate and all else that a `TensionSolution` has.

        With the method "active-set", or "soft-wrench" if `rho` was given; `index` picks it, a number or a tuple.

        Raises
        ------
        InputError
            If the row is invalid; the message gives the reason.
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
    """Distribute the tensions of many problems, each as `solve` does with the method "active-set".

    Leading dimensions broadcast as in NumPy. The ranks may differ inside a batch. A row whose numbers are no problem
    (NaN, t_min > t_max, a weight that is not positive) has the status "invalid" and the others are solved.

    Batches of at most 8000 rows are solved by the C core, row by row, where towline was installed with it. Larger ones
    go through lanes, which solve many rows together: their statuses are the same, and their tensions but for rounding.
    The core solves the rows of which the lanes are not sure, and `solve` those of which the core is not sure either:
    they lie near the boundary of the available wrench set or of the rank cut. Without the C core `solve` takes both.

    The lanes run as NumPy operations, some 0.1 s for 10,000 rows, until a process has spent as much time on them as
    loading their machine code takes (1 s; compiling it, once on a machine, 15 s). Neither form, nor the number of
    threads, nor what was solved before, changes a bit of the result. A program that is going to solve millions of rows
    saves time by calling `towline.solvers.compiled.load()` first.

    Parameters
    ----------
    A :
        Wrench matrices, shape (..., n, m).
    w :
        Required wrenches, shape (..., n), [N] and [N m].
    t_min, t_max :
        Tension limits [N], shape (..., m) or one number.
    t_ref :
        Tensions to stay near [N], shape (..., m) or one number; None = 0.
    weights :
        Weights of the cables, shape (..., m) or one number; None = 1.
    length :
        Characteristic length [m], shape (...); None = 1 m.
    rho :
        Weight of the squared wrench error beside the squared tensions, as in the method "soft-wrench", 1e-12 to 1e12:
        every row that is a problem gets tensions, and those whose wrench is not the required one are "inaccurate".
        None = the wrench must be met.
    threads :
        How many threads share the rows; None = one for each 2000 rows, at most as many as there are processors. The
        result does not depend on it.
    backend :
        "c" or "lanes" for all rows; None = as stated above. Machine code solves a batch of 1000 to 8000 rows in half of
        the time of the C core: a program that has loaded it and solves thousands of such batches states "lanes".

    Raises
    ------
    InputError
        If an argument has a wrong type or its shape does not fit the others.
    """
    start = time.perf_counter()
    if threads is not None:
        threads = whole_number("threads", threads, 1, 1024)
    soft = 0.0 if rho is None else 1.0 / number("rho", rho, 1e-12, 1e12, also=", or None")
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
    rows = int(np.prod(lead, dtype=np.int64))

    flat, per = [], np.zeros(7, np.int64)
    for position, (name, value) in enumerate(given.items()):
        if weights is None and name == "weights":
            flat.append(np.empty(0))
            continue
        own, tail = value.shape[: value.ndim - core[name]], value.shape[value.ndim - core[name] :]
        if np.prod(own, dtype=np.int64) != 1:
            value = np.broadcast_to(value, lead + tail)
            per[position] = np.prod(tail, dtype=np.int64)
        flat.append(np.ascontiguousarray(value).reshape(-1))

    tensions, direction, info, residual = (np.empty(rows * size) for size in (m, n, 2, 1))
    status = np.full(rows, float(UNSURE))
    kernels = compiled.current()
    core_alone = _is_for_core(backend, rows, n, m)
    share, together = 1, 1 if core_alone else kernels.rows_at_once
    if together is None:  # NumPy takes all rows together
        together = max(rows, 1)
    else:
        share = threads or min(processors.available(), max(1, rows // ROWS_WORTH_A_THREAD))
    block = max(together, -(-rows // (together * share)) * together)

    def work(first: int) -> None:
        stop = min(first + block, rows)
        if not core_alone:
            kernels.many(*flat, per, soft, n, m, first, stop, tensions, direction, info, residual, status)
        part = slice(first, stop)
        if n <= ROWS and m <= CABLES and (status[part] == UNSURE).any():
            given = (array[first * int(size) :] for array, size in zip(flat, per, strict=True))
            got = (tensions[first * m : stop * m], direction[first * n : stop * n], info[2 * first : 2 * stop])
            solve_rows(n, m, rho or 0.0, *given, per.astype(np.float64), *got, residual[part], status[part])

    if share == 1:
        work(0)
    else:
        with ThreadPoolExecutor(share) as pool:
            list(pool.map(work, range(0, rows, block)))

    code = status.astype(np.int8)
    t, d, proof = tensions.reshape(rows, m), direction.reshape(rows, n), info.reshape(rows, 2)
    problem = {
        name: np.broadcast_to(value, lead + value.shape[value.ndim - core[name] :]) for name, value in given.items()
    }
    if code.any():
        without = (code != OPTIMAL) & (code != INACCURATE)
        t[without], residual[without] = np.nan, np.nan
        unproven = (code == OPTIMAL) | (code == INVALID) | np.isnan(proof[:, 1])
        d[unproven], proof[unproven] = np.nan, np.nan
        for row in np.flatnonzero(code == UNSURE):
            index = tuple(int(i) for i in np.unravel_index(row, lead))
            t[row], residual[row] = np.nan, np.nan
            d[row], proof[row] = np.nan, np.nan
            try:
                solution = _alone(_row(problem, index), rho)
            except InputError:
                code[row] = INVALID
                continue
            code[row] = STATUSES.index(solution.status)
            if solution.tensions is not None:
                t[row], residual[row] = solution.tensions, solution.residual
            if (certificate := solution.certificate) is not None:
                d[row], proof[row] = certificate.direction, (certificate.support, certificate.shortfall)
    else:
        d[:], proof[:] = np.nan, np.nan
    return BatchSolution(
        t.reshape(*lead, m),
        code.reshape(lead),
        residual.reshape(lead),
        d.reshape(*lead, n),
        proof[:, 1].reshape(lead),
        proof[:, 0].reshape(lead),
        time.perf_counter() - start,
        problem,
        rho,
        "c" if core_alone else kernels.backend,
    )


def _is_for_core(backend: str | None, rows: int, n: int, m: int) -> bool:
    """Return whether the C core is to solve all rows, or raise InputError."""
    fits = n <= ROWS and m <= CABLES
    if backend is None:
        return fits and rows <= MOST_ROWS_OF_CORE
    if not isinstance(backend, str) or backend not in (("c", "lanes") if fits else ("lanes",)):
        accepted = "c, lanes or None"
        if not fits:
            accepted = f"lanes or None for {n} wrench rows and {m} cables, which the C core does not take"
        raise InputError(f"backend must be {accepted}, got {shown(backend)}")
    return backend == "c"


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
