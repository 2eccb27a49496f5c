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
        if watch.interrupted or statistics["return_status"] == "User_Requested_Stop":
            raise KeyboardInterrupt
        self._last = result if statistics["success"] else None
        x = result["x"].full().ravel()
        # A minimum time is often found long before IPOPT is sure that there is no shorter one.
        met = program.violation(x, result["g"].full().ravel()) <= MET
        missing = program.layout.columns(x)[:, program.layout.missing].reshape(-1, 6)
        return Outcome(
            deviation=program.read(x),
            duration=program.duration(x),
            success=(bool(statistics["success"]) or met) and bool(np.isfinite(x).all()),
            message=str(statistics["return_status"]),
            iterations=int(statistics["iter_count"]),
            slack=float(np.linalg.norm(missing, axis=1).max(initial=0.0) * program.scenario.robot.force_scale),
        )


def _broken(error: RuntimeError) -> SolverError:
    return SolverError(f"planner: CasADi failed ({str(error).splitlines()[-1]})")


class _Watch(ca.Callback):
    """Tells a progress function about each iteration of the solver, and stops it when a person presses Ctrl-C."""

    def __init__(self, program: Program):
        super().__init__()
        self._sizes = {"x": program.problem["x"].numel(), "g": program.problem["g"].numel(), "f": 1}
        self._bounds = (program.lower_g, program.upper_g)
        self.begin(None)
        self.construct("watch", {})

    def begin(self, progress: Progress | None) -> None:
        """Start to count anew."""
        self._progress = progress
        self._iteration = 0
        self.interrupted = False

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
            if self._progress is not None:
                g = arg[2].full().ravel()
                low, high = self._bounds
                infeasibility = float(np.maximum(np.maximum(low - g, g - high), 0).max(initial=0.0))
                self._progress(self._iteration, float(arg[1]), infeasibility)
            self._iteration += 1
        except KeyboardInterrupt:
            self.interrupted = True
        return [int(self.interrupted)]
