"""Measure solvers at the programs of a predictive controller, alternating, against the best solution that is known."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .control_contenders import REFERENCE, TOWLINE, Contender, Program, condense, exact
from .harness import alternating, ratio

Array = NDArray[np.float64]

FAILED = 1e-3  # controls this far off are a failure, in units of their range
BLOCK = 25  # programs of a turn


@dataclass(frozen=True)
class Row:
    """A solver at the programs of a task; errors are in units of the range of a control.

    `residual` is the largest step of a control of any stage along its gradient, over its curvature, inside its bounds.
    """

    task: str
    contender: str
    tolerance: str  # the accuracy required
    median_us: float  # of a program [us]
    p99_us: float
    ratio: float  # to condensing and `daqp.solve`, median over the turns
    ratio_to_horizon: float  # to `Horizon` as it was simulated, likewise
    max_error: float | None  # of the first stage's controls
    residual: float | None
    failures: int  # programs, of `programs`, without a result or with an error above `FAILED`
    programs: int  # how many it was given


def measure(task: str, programs: Sequence[Program], contenders: Sequence[Contender]) -> list[Row]:
    """Measure contenders at the programs of one run, alternating every few; `TOWLINE` and `REFERENCE` among them."""
    solvers = {each.name: each.prepare(programs[0]) for each in contenders}
    for solver in solvers.values():  # imports belong to no program
        solver.solve(solver.arrange(programs[0]))
    count = len(programs)
    spent: dict[str, dict[int, list[float]]] = {name: {} for name in solvers}  # [us] by turn
    errors, residuals = ({name: np.full(count, np.nan) for name in solvers} for _ in range(2))
    of_turn, known = -1, list[tuple[Array, Array, Array]]()
    for turn, (name, solver) in alternating([*solvers.items()], -(-count // BLOCK)):
        block = range(turn * BLOCK, min((turn + 1) * BLOCK, count))
        if turn != of_turn:
            of_turn, known = turn, [_known(programs[k]) for k in block]
        spent[name][turn] = []
        for k, (best, cost, slope) in zip(block, known, strict=True):
            given = solver.arrange(programs[k])
            start = time.perf_counter_ns()
            controls = solver.solve(given)
            spent[name][turn].append((time.perf_counter_ns() - start) / 1e3)
            if controls is not None:
                errors[name][k] = (np.abs(controls[0] - best[0]) / _range(programs[k])[0]).max()
                residuals[name][k] = _residual(programs[k], controls, cost, slope)
    rows = []
    for each in contenders:
        off, answered = errors[each.name], np.isfinite(errors[each.name])
        times = np.concatenate([*spent[each.name].values()])
        rows.append(
            Row(
                task=task,
                contender=each.name,
                tolerance=each.tolerance,
                median_us=float(np.median(times)),
                p99_us=float(np.percentile(times, 99)),
                ratio=ratio(spent[each.name], spent[REFERENCE]),
                ratio_to_horizon=ratio(spent[each.name], spent[TOWLINE]),
                max_error=float(off[answered].max()) if answered.any() else None,
                residual=float(residuals[each.name][answered].max()) if answered.any() else None,
                failures=int((~(off <= FAILED)).sum()),
                programs=count,
            )
        )
    return rows


def _known(program: Program) -> tuple[Array, Array, Array]:
    """Return the best solution that is known, (N, m), by its residual, and the condensed cost."""
    cost, slope = condense(program)
    return min(exact(program), key=lambda u: _residual(program, u, cost, slope)), cost, slope


def _range(program: Program) -> Array:
    """Return the range of each control, (N, m); 1 for a control that is fixed or has no limits."""
    width = program.u_max - program.u_min
    return np.where((width > 0) & np.isfinite(width), width, 1.0)


def _residual(program: Program, controls: Array, cost: Array, slope: Array) -> float:
    """Return how far each control alone would move to lower the cost inside its bounds, by the condensed cost."""
    u = controls.ravel()
    moved = np.clip(u - (cost @ u + slope) / np.diag(cost), program.u_min.ravel(), program.u_max.ravel())
    return float((np.abs(moved - u) / _range(program).ravel()).max())
