"""IPOPT for a program: from a guess, from a motion or from its own last solution, and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..errors import SolverError
from .guess import initial_guess
from .program import Program
from .scenario import Deviation

__all__ = ["Outcome", "Progress", "Solver"]

MET = 1e-8  # what constraints of a program may miss, in its units
BETTER = 1e-3  # of the objective: what a solution must be better by for the search to go on
PATIENCE = 30  # iterations without a better one
Progress = Callable[[int, float, float], None]  # iteration, objective, infeasibility


@dataclass(frozen=True)
class Outcome:
    """What the solver came back with."""

    deviation: Deviation
    duration: float  # [s]
    success: bool  # whether all constraints are met; the message tells whether it is an optimum too
    message: str
    iterations: int
    slack: float  # largest missing wrench at a node, in any wind [N], zero in the rigid program


# The guess is near: IPOPT's default 0.1 throws it away, and "adaptive" took 8 times as long.
_FROM_A_GUESS = {"mu_init": 1e-2}


# A motion that was found on another mesh or for another task is nearer: a minimum time of three robots took 96
# iterations from the coarser mesh instead of more than 150.
_FROM_A_MOTION = {"mu_init": 1e-3}


# A solution with its multipliers is nearer still.
_FROM_A_SOLUTION = {
    "mu_init": 1e-6,
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-6,
    "warm_start_bound_frac": 1e-6,
    "warm_start_slack_bound_push": 1e-6,
    "warm_start_slack_bound_frac": 1e-6,
    "warm_start_mult_bound_push": 1e-6,
}


_STARTS: dict[str, dict[str, Any]] = {"guess": _FROM_A_GUESS, "motion": _FROM_A_MOTION, "solution": _FROM_A_SOLUTION}


class Solver:
    """IPOPT for one program, to be run from several guesses, or from its own last solution."""

    def __init__(self, program: Program, max_iterations: int = 400):
        self.program = program
        self._watch = _Watch(program)
        self._max_iterations = max_iterations
        self._solvers: dict[str, ca.Function] = {}
        self._last: dict[str, ca.DM] | None = None

    def prepare(self, guess: Deviation | None) -> ca.Function:
        """IPOPT for a run from `guess`, made when it is first asked for."""
        start = "motion" if guess is not None else "guess" if self._last is None else "solution"
        if start not in self._solvers:
            self._solvers[start] = self._make(_STARTS[start])
        return self._solvers[start]

    def _make(self, start: dict[str, Any]) -> ca.Function:
        quiet = {"print_level": 0, "sb": "yes"}
        accuracy = {"tol": 1e-8, "constr_viol_tol": 1e-9, "max_iter": self._max_iterations}
        options = {"print_time": False, "error_on_fail": False, "iteration_callback": self._watch}
        try:
            return ca.nlpsol("planner", "ipopt", self.program.problem, {"ipopt": quiet | accuracy | start, **options})
        except RuntimeError as error:
            raise _broken(error) from None

    def solve(self, guess: Deviation | None, progress: Progress | None = None) -> Outcome:
        """Solve from `guess`; None: from the last solution and its multipliers, or else from a guess of our own.

        That nothing is found is told, not raised.

        Raises
        ------
        SolverError
            If CasADi or IPOPT break.
        KeyboardInterrupt
            If a person stopped it.
        """
        program, watch = self.program, self._watch
        start: dict[str, Any] = {
            "lbx": program.lower,
            "ubx": program.upper,
            "lbg": program.lower_g,
            "ubg": program.upper_g,
        }
        nlp = self.prepare(guess)
        if guess is not None or self._last is None:
            if guess is None:
                guess = initial_guess(program.scenario, program.shares * program.scenario.duration)
            start["x0"] = program.pack(guess)
        else:
            start |= {"x0": self._last["x"], "lam_x0": self._last["lam_x"], "lam_g0": self._last["lam_g"]}
        watch.begin(progress)
        try:
            result = nlp(**start)
        except RuntimeError as error:
            raise _broken(error) from None
        statistics = nlp.stats()
        message = str(statistics["return_status"])
        if watch.interrupted or (message == "User_Requested_Stop" and not watch.settled):
            raise KeyboardInterrupt
        self._last = result if statistics["success"] else None
        x = result["x"].full().ravel()
        met = program.violation(x, result["g"].full().ravel()) <= MET
        if watch.settled:
            x, met, message = watch.best, True, f"no better by {BETTER:.1%} in {PATIENCE} iterations"
        missing = program.layout.columns(x)[:, program.layout.missing].reshape(-1, 6)
        return Outcome(
            deviation=program.read(x),
            duration=program.duration(x),
            success=(bool(statistics["success"]) or met) and bool(np.isfinite(x).all()),
            message=message,
            iterations=int(statistics["iter_count"]),
            slack=float(np.linalg.norm(missing, axis=1).max(initial=0.0) * program.scenario.robot.force_scale),
        )


def _broken(error: RuntimeError) -> SolverError:
    return SolverError(f"planner: CasADi failed ({str(error).splitlines()[-1]})")


class _Watch(ca.Callback):
    """Looks at each iteration of the solver, tells a progress function, and stops it when there is no use to go on.

    A person may press Ctrl-C. Or the search settled: a minimum time is often found long before IPOPT is sure that there
    is no shorter one, and where much costs nothing it wanders about between solutions that are as good as each other.
    """

    def __init__(self, program: Program):
        super().__init__()
        self._sizes = {"x": program.problem["x"].numel(), "g": program.problem["g"].numel(), "f": 1}
        self._program = program
        self.begin(None)
        self.construct("watch", {})

    def begin(self, progress: Progress | None) -> None:
        """Start to count anew."""
        self._progress = progress
        self._iteration = 0
        self.best = np.zeros(0)  # iterate of those that meet all constraints
        self._objective = np.inf  # its
        self._mark = np.inf  # the objective that a later one has to be better than
        self._since = 0  # the last iteration that was on the way to a better one
        self.interrupted = False

    @property
    def settled(self) -> bool:
        """Whether `best` is as good as it gets."""
        return len(self.best) > 0 and self._iteration - self._since > PATIENCE

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return ca.nlpsol_out(i)

    def get_name_out(self, i: int) -> str:
        return "stop"

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        name = ca.nlpsol_out(i)
        size = self._sizes.get({"lam_x": "x", "lam_g": "g"}.get(name, name), 0)
        return ca.Sparsity.dense(size) if size else ca.Sparsity(0, 0)

    def eval(self, arg: Sequence[ca.DM]) -> list[int]:
        try:
            x, g, objective = arg[0].full().ravel(), arg[2].full().ravel(), float(arg[1])
            self._keep(x, g, objective)
            # What making up for what g misses would change, to first order.
            low, high = self._program.lower_g, self._program.upper_g
            if objective + arg[4].full().ravel() @ (g - np.clip(g, low, high)) < self._better():
                self._since = self._iteration
            if self._progress is not None:
                infeasibility = float(np.maximum(np.maximum(low - g, g - high), 0).max(initial=0.0))
                self._progress(self._iteration, objective, infeasibility)
            self._iteration += 1
        except KeyboardInterrupt:
            self.interrupted = True
        return [int(self.interrupted or self.settled)]

    def _better(self) -> float:
        """Objective that makes it worth to go on."""
        return self._mark - BETTER * abs(self._mark) if np.isfinite(self._mark) else np.inf

    def _keep(self, x: np.ndarray, g: np.ndarray, objective: float) -> None:
        """Keep the best iterate that meets all constraints."""
        if self._program.violation(x, g) > MET or objective >= self._objective:
            return
        if objective < self._better():
            self._mark = objective
        self.best, self._objective = x, objective
