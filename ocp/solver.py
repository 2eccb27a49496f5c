"""IPOPT or fatrop for a program: from a guess, a motion or its own last solution, and what came of it."""

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
    slack: float  # largest missing wrench at a node [N], zero in the rigid program


# The guess is near: IPOPT's default 0.1 throws it away, and "adaptive" took 8 times as long.
_FROM_A_GUESS = {"mu_init": 1e-2}


# A motion that was found on another mesh or for another task is nearer: a minimum time of three robots took 96
# iterations from the coarser mesh instead of more than 150.
_FROM_A_MOTION = {"mu_init": 1e-3}


# The same task's optimum on a coarser mesh is nearer still: paper F's circle then takes 5 to 8 iterations from N = 100
# to 1600, and 6 to 40 from the barrier above.
_FROM_COARSER = {"mu_init": 1e-5}


# A solution with its multipliers is the nearest.
_FROM_A_SOLUTION = {
    "mu_init": 1e-6,
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-6,
    "warm_start_bound_frac": 1e-6,
    "warm_start_slack_bound_push": 1e-6,
    "warm_start_slack_bound_frac": 1e-6,
    "warm_start_mult_bound_push": 1e-6,
}


_STARTS: dict[str, dict[str, Any]] = {
    "guess": _FROM_A_GUESS,
    "motion": _FROM_A_MOTION,
    "coarser": _FROM_COARSER,
    "solution": _FROM_A_SOLUTION,
}


FATROP_STATUS = {0: "Solve_Succeeded", 1: "Maximum_Iterations_Exceeded"}  # fatrop's numbers in IPOPT's words


class Solver:
    """IPOPT or fatrop for one program, to be run from several guesses, or from its own last solution."""

    def __init__(self, program: Program, max_iterations: int = 400):
        self.program = program
        self._watch = _Watch(program)
        self._max_iterations = max_iterations
        self._solvers: dict[str, ca.Function] = {}
        self._last: dict[str, ca.DM] | None = None

    def prepare(self, guess: Deviation | None, coarser: bool = False) -> ca.Function:
        """The solver for a run from `guess`, made when it is first asked for."""
        own = "guess" if self._last is None else "solution"
        start = own if guess is None else "coarser" if coarser else "motion"
        if start not in self._solvers:
            self._solvers[start] = self._make(_STARTS[start])
        return self._solvers[start]

    def _make(self, start: dict[str, Any]) -> ca.Function:
        name, common = self.program.scenario.task.solver, {"print_time": False, "error_on_fail": False}
        options = self._fatrop(start) if name == "fatrop" else self._ipopt(start)
        try:
            return ca.nlpsol("planner", name, self.program.problem, common | options)
        except RuntimeError as error:
            raise _broken(error) from None

    def _ipopt(self, start: dict[str, Any]) -> dict[str, Any]:
        quiet = {"print_level": 0, "sb": "yes"}
        accuracy = {"tol": 1e-8, "constr_viol_tol": 1e-9, "max_iter": self._max_iterations}
        return {"ipopt": quiet | accuracy | start, "iteration_callback": self._watch}

    def _fatrop(self, start: dict[str, Any]) -> dict[str, Any]:
        program = self.program
        if program.stages is None:
            raise SolverError("planner: fatrop needs a program in stages")
        stages = program.stages
        # Of what `start` says it knows this much, by names of its own.
        words = {"mu_init": "mu_init", "warm_start_bound_push": "bound_push", "warm_start_bound_frac": "bound_frac"}
        asked = {words[key]: value for key, value in start.items() if key in words}
        return {
            "structure_detection": "manual",
            "N": len(stages.rows) - 1,
            "nx": stages.states,
            "nu": stages.controls,
            "ng": stages.rows,
            "equality": (program.lower_g == program.upper_g).tolist(),
            "fatrop": {"print_level": 0, "tol": 1e-8, "max_iter": self._max_iterations} | asked,
        }

    def solve(self, guess: Deviation | None, progress: Progress | None = None, coarser: bool = False) -> Outcome:
        """Solve from `guess`; None: from the last solution and its multipliers, or else from a guess of our own.

        A guess is `coarser` if it is the same task's optimum on a coarser mesh. That nothing is found is told, not
        raised.

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
        nlp = self.prepare(guess, coarser)
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
        x, iterations = result["x"].full().ravel(), int(statistics["iter_count"])
        message = statistics["return_status"]
        if isinstance(message, int):
            message = FATROP_STATUS.get(message, f"fatrop's status {message}")
            # It calls nobody while it solves.
            watch.tell(iterations, float(result["f"]), result["g"].full().ravel())
        # A minimum time is often found long before IPOPT is sure that there is no shorter one.
        met = program.violation(x, result["g"].full().ravel()) <= MET
        return Outcome(
            deviation=program.read(x),
            duration=program.duration(x),
            success=(bool(statistics["success"]) or met) and bool(np.isfinite(x).all()),
            message=str(message),
            iterations=iterations,
            slack=program.missing(x),
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

    def tell(self, iteration: int, objective: float, g: np.ndarray) -> None:
        """Tell whoever asked."""
        if self._progress is not None:
            low, high = self._bounds
            infeasibility = float(np.maximum(np.maximum(low - g, g - high), 0).max(initial=0.0))
            self._progress(iteration, objective, infeasibility)

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
            self.tell(self._iteration, float(arg[1]), arg[2].full().ravel())
            self._iteration += 1
        except KeyboardInterrupt:
            self.interrupted = True
        return [int(self.interrupted)]
