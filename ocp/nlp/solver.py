"""Run IPOPT on a program, from a guess, a motion or the last solution: `Solver`."""

import ctypes
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ...base.errors import InputError, SolverError
from ...base.inputs import shown
from ..tasks.deviation import Deviation
from ..tasks.scenario import Scenario
from .guess import initial_guess
from .near import has_places
from .program import Program
from .rows import MANY
from .waiting import Errands, wait_for

MET = 1e-8  # what constraints of a program may miss, in its units
BETTER = 1e-3  # of the objective: what a solution must be better by for the search to go on
# Iterations without a better one. From the optimum of a coarser mesh a run is soon as good as that.
PATIENCE, FROM_COARSER = 10, 5
ROUND, CLOSE = 24, 1e-4  # iterates in a circle, and what constraints miss there at most
GAIN = 1e-4  # of the objective: what an iterate must be better by not to be in a circle
MOST_ITERATIONS = 400
# Of the objective: how far it may be above the least where a run near an optimum ends at one barrier. Bounds
# that are not active add little: it was above it by 0.07 % and less. Then the least and the largest barrier.
ABOVE, BARRIERS = 5e-3, (1e-9, 1e-5)
# MUMPS refactorises less with a larger pivot tolerance where thrust directions are equations: teams of
# quadrotors then take half of the time. For other robots each iteration takes 10 % longer. Ordered by METIS, an
# iteration of a team past obstacles takes less than half of the time that it takes with MUMPS's own choice. Without a
# permutation that scales it would take another tenth less, but short motions of teams are then not found.
TEAM = {"mumps_pivtol": 1e-4, "mumps_pivot_order": 5}
# What IPOPT adds to constraints where MUMPS calls their Jacobian singular. The motion of a quadrotor with a slung load
# follows from the load's motion. Only accelerations of the nodes remain, times the square of a step: much less than
# IPOPT's default, 1e-8, with which each step is far from Newton's. A minimum time took 300 iterations; it takes 36.
NEARLY_SINGULAR = {"jacobian_regularization_value": 1e-13}
TIME_LIMIT, SETTLED = "time limit", f"no better by {BETTER:.1%} in the last iterations"  # messages of ours
STRAYED = "in a region that is left out"  # likewise
LOOK = 10  # iterations after which, again and again, a run ends where its motion has strayed
CIRCLING = f"{ROUND} iterates that are neither better nor nearer"  # likewise
Progress = Callable[[int, float, float], None]  # iteration, objective, infeasibility
VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")


@dataclass(frozen=True)
class Outcome(Displayed):
    """The result of a run of the solver."""

    deviation: Deviation
    duration: float  # [s]
    success: bool  # whether all constraints are met; the message states whether it is an optimum too
    message: str
    iterations: int
    slack: float  # largest missing wrench at a node, in any wind [N], zero in the rigid program
    objective: float  # of the task; nan in the elastic program, which has another one


KEPT = "x", "g", "lam_x", "lam_g"  # of a solution
PUSHED = "bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push"


def _from_a_solution(push: float) -> dict[str, Any]:
    """Return options for a start with multipliers, at least `push` away from all bounds."""
    return {"mu_init": 1e-6, "warm_start_init_point": "yes"} | {f"warm_start_{name}": push for name in PUSHED}


# A solution with its multipliers is the nearest.
FROM_A_SOLUTION = _from_a_solution(1e-6)
SLIGHT = 1e-5  # in the program's units: a solution that misses moved bounds by less can be started from directly


_STARTS: dict[str, dict[str, Any]] = {
    # A guess or a motion from another mesh or task is near: IPOPT's default 0.1 throws it away, "adaptive" took 8 times
    # as long. From 1e-2 the README's circle took 20 iterations, of which 7 were backtracking, from 1e-3 it takes 9; a
    # minimum time of three robots from a coarser mesh took more than 150, and takes 96.
    "motion": {"mu_init": 1e-3},
    # The same task's optimum on a coarser mesh is nearer still: paper F's circle then takes 5 to 8 iterations from
    # N = 100 to 1600, and 6 to 40 from the barrier above.
    "coarser": {"mu_init": 1e-5},
    "solution": FROM_A_SOLUTION,
    # For a program whose bounds have moved: as near to the old ones it cannot move with them. Each step ended at the
    # bounds of its slacks, so that a forest of six quadrotors took 84 iterations, of which it now takes 28.
    "tightened": _from_a_solution(1e-3),
    # For a program whose parameters have changed a little: with the accuracy of others each would take two iterations
    # more, and the motions differ by less than the audit can tell. What constraints may miss is the same.
    "near": FROM_A_SOLUTION | {"mu_init": 1e-7, "tol": 1e-6},
}


class Solver:
    """IPOPT for one program, to be run from several guesses, or from its own last solution."""

    def __init__(self, program: Program, max_iterations: int = MOST_ITERATIONS):
        self._watch = _Watch(program)
        self._max_iterations = max_iterations
        self._solvers: dict[str, ca.Function] = {}
        self._last: dict[str, np.ndarray] | None = None  # solution, with its constraints and multipliers
        self.interrupted: Outcome | None = None  # the best of a run that was interrupted

    @property
    def program(self) -> Program:
        """Return the program; one that replaces it has the same functions, with other bounds or parameters."""
        return self._watch.program

    @program.setter
    def program(self, program: Program) -> None:
        self._watch.program = program

    @property
    def has_solution(self) -> bool:
        """Return whether a run without a guess starts from the solution of the last one."""
        return self._last is not None

    @property
    def _own(self) -> str:
        """Return the start that suits the last solution: its bounds may have moved since."""
        missed = 0.0 if self._last is None else self.program.violation(self._last["x"], self._last["g"])
        return "solution" if missed <= SLIGHT else "tightened"

    def prepare(self, guess: Deviation | None, coarser: bool = False, near: bool = False) -> ca.Function:
        """Return the solver for a run from `guess`, made at the first call."""
        own = "motion" if self._last is None else "near" if near else self._own
        start = own if near or guess is None else "coarser" if coarser else "motion"
        if start not in self._solvers:
            self._solvers[start] = self._make(_STARTS[start] | self._one_barrier(start, guess))
        return self._solvers[start]

    def _one_barrier(self, start: str, guess: Deviation | None) -> dict[str, Any]:
        """Return options for a start near the optimum of a coarser mesh, or with other bounds again: one barrier.

        At its solution the objective of a convex program is above the least by at most the barrier times the number of
        bounds. Teams and tasks past regions have it, since their iterations take longest.
        """
        program, last = self.program, self._last
        long = program.scenario.count > MANY or has_places(program.scenario)
        near = start == "coarser" or (start in ("tightened", "solution") and "coarser" in self._solvers)
        if not (long and near):
            return {}
        x = program.pack(guess) if guess is not None else last["x"] if last else 0.0
        objective = ca.Function("objective", [program.problem[name] for name in "xp"], [program.problem["f"]])
        above = ABOVE * abs(float(objective(x, program.parameters)))
        bounds = (program.lower, program.upper), (program.lower_g, program.upper_g)
        count = sum(np.isfinite(each[low < high]).sum() for low, high in bounds for each in (low, high))
        barrier = float(np.clip(above / max(count, 1), *BARRIERS))
        return {"mu_init": barrier, "mu_target": barrier, "compl_inf_tol": barrier, "tol": 1e-5}

    def take(self, scenario: Scenario) -> None:
        """Go on with another scenario, of which the program with parameters is one too (`Program.of`)."""
        self.program = self.program.of(scenario)

    def _make(self, start: dict[str, Any]) -> ca.Function:
        scenario = self.program.scenario
        thrusts = any(scenario.robot.carriers[index].efforts for index, _ in scenario.carrier_free)
        accuracy = {"tol": 1e-8, "constr_viol_tol": 1e-9, "max_iter": self._max_iterations} | NEARLY_SINGULAR
        accuracy |= TEAM if thrusts and scenario.count > MANY else {}
        # What its check of the inputs warns of, more equations than unknowns, is an answer here: no solution.
        options = {"print_time": False, "error_on_fail": False, "inputs_check": False, "calc_lam_p": False}
        options |= {"ipopt": {"print_level": 0, "sb": "yes"} | accuracy | start, "iteration_callback": self._watch}
        options |= self.program.derivatives
        made = wait_for(lambda: _checked(ca.nlpsol, "planner", "ipopt", self.program.problem, options))
        run_in_one_thread()
        return made

    def solve(
        self,
        guess: Deviation | None,
        progress: Progress | None = None,
        coarser: bool = False,
        seconds: float = np.inf,
        parameters: ca.DM | None = None,
        near: bool = False,
        stray: bool = True,
    ) -> Outcome:
        """Solve from `guess`; default: from the last solution and its multipliers, or else from a guess of our own.

        A guess is `coarser` if it is the same task's optimum on a coarser mesh. After so many `seconds` IPOPT
        stops with the best that it has. A run without a solution is a result, not an error. `parameters` belong
        to the program, if it has any; default: its own. A guess that is `near` the last solution starts
        with its multipliers. A run that may not `stray` ends early in a region of which the program has no rows.
        Raises `SolverError` if CasADi or IPOPT break; `KeyboardInterrupt` if an interrupt arrives; the solver's
        thread ends at its next iteration.
        """
        program, watch = self.program, self._watch
        start: dict[str, Any] = {"p": program.parameters if parameters is None else parameters}
        start |= {"lbx": program.lower, "ubx": program.upper, "lbg": program.lower_g, "ubg": program.upper_g}
        own = self._last if near or guess is None else None
        nlp = self.prepare(guess, coarser, near)
        if own is not None:
            start |= {"x0": own["x"], "lam_x0": own["lam_x"], "lam_g0": own["lam_g"]}
        elif guess is None:
            guess = initial_guess(program.scenario, program.shares * program.scenario.duration)
        if guess is not None:
            start["x0"] = program.pack(guess)
        watch.begin(progress, seconds, stray, FROM_COARSER if coarser else PATIENCE)
        self.interrupted = None
        try:
            result = wait_for(lambda: watch.follow(nlp, start), watch.errands)
        except BaseException:
            if watch.best:
                self.interrupted = self._outcome(watch.best["x"], watch.objective, True, "interrupted", watch.iteration)
            self._abandon()
            raise
        statistics = nlp.stats()
        last = {name: result[name].full().ravel() for name in KEPT}
        x, iterations = last["x"], max(watch.iteration - 1, 0)  # the first call of the watch is before any
        objective = float(result["f"])
        message = statistics["return_status"]
        # With more equations than unknowns IPOPT does not start, and returns zeros.
        met = watch.iteration > 0 and program.violation(x, last["g"]) <= MET
        if watch.settled or watch.late:
            message = TIME_LIMIT if watch.late else SETTLED
            if watch.best:
                x, objective, met, last = watch.best["x"], watch.objective, True, watch.best
        elif watch.strayed:
            message, met = STRAYED, False
        elif watch.circling:
            (x, objective), message = watch.nearest, CIRCLING
        self._last = last if statistics["success"] or (met and watch.settled) else None
        return self._outcome(x, objective, bool(statistics["success"]) or met, str(message), iterations)

    def _outcome(self, x: np.ndarray, objective: float, success: bool, message: str, iterations: int) -> Outcome:
        """Return a run that ended at the unknowns x."""
        deviation, success = self.program.read(x), success and bool(np.isfinite(x).all())
        slack, seconds = self.program.missing(x), float(deviation.nodes[-1])
        of_task = np.nan if self.program.mesh.elastic else objective
        return Outcome(deviation, seconds, success, message, iterations, slack, of_task)

    def _abandon(self) -> None:
        """Stop the run for which nobody waits; objects that its thread still uses are not used again."""
        self._watch.abandoned = True
        self._watch = _Watch(self.program)
        self._solvers = {}


def check_progress(progress: Any) -> None:
    """Check that a user's `progress` is a function or None.

    Raises `InputError` if it is something else.
    """
    if progress is not None and not callable(progress):
        accepted = "a function of (iteration, objective, infeasibility)"
        raise InputError(f"progress must be {accepted}, got {shown(progress)}")


def _checked(call: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Call CasADi, and turn its exceptions into a SolverError of one line."""
    try:
        return call(*arguments, **named)
    except RuntimeError as error:
        raise SolverError(f"planner: CasADi failed ({str(error).splitlines()[-1]})") from None


class _Watch(ca.Callback):
    """Follow the iterations of the solver, report each, and stop it when going on is of no use.

    That is when its run is abandoned, when the time is up, or when the search has settled: a minimum time is often
    reached long before IPOPT is sure that there is no shorter one, and where much costs nothing it moves on and on
    between solutions that are as good as each other. Or when it goes in a circle: distances bend within centimetres of
    a corner, or have corners themselves, where a step of Newton's method leads from one side to the other and back.
    """

    def __init__(self, program: Program):
        super().__init__()
        self._sizes = {name: part.numel() for name, part in program.problem.items()}
        self.program = program  # of which bounds and parameters may change between runs
        self.begin(None)
        self.construct("watch", {})

    def begin(
        self, progress: Progress | None, seconds: float = np.inf, stray: bool = True, patience: int = PATIENCE
    ) -> None:
        """Start to count again from zero."""
        self._progress = progress
        self.errands: Errands = SimpleQueue()  # calls of `progress`, for the thread that waits
        self._deadline = time.perf_counter() + seconds
        self._patience = patience
        self.late = False  # whether the time is up
        self._looks = not (stray or self.program.near.is_everywhere)
        self.strayed = False  # whether the motion is deep in a region of which the program has no rows
        self.iteration = 0
        self.best: dict[str, np.ndarray] = {}  # iterate of those that meet all constraints, with its multipliers
        self.objective = np.inf  # its
        self._mark = np.inf  # the objective that a later one has to be better than
        self._since = 0  # the last iteration that was on the way to a better one
        self.nearest = np.zeros(0), np.inf  # unknowns and objective of the iterate that misses the constraints by least
        self._missed, self._least = np.inf, np.inf  # by how much it does; and the least objective close to them
        self._round = 0  # close ones since one of them came nearer, or had a better objective
        self.abandoned = False  # whether nobody waits for the run any more

    def follow(self, nlp: ca.Function, start: dict[str, Any]) -> dict[str, ca.DM]:
        """Run `nlp`, whose callback this is: CasADi does not keep it alive, and the run may be abandoned."""
        return _checked(nlp, **start)

    @property
    def settled(self) -> bool:
        """Return whether `best` no longer improves."""
        return bool(self.best) and self.iteration - self._since > self._patience

    @property
    def circling(self) -> bool:
        """Return whether the iterates near the constraints are no longer better nor nearer, because of distances."""
        return self.program.has_corners and not self.best and self._round >= ROUND

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
        size = self._sizes.get(name.removeprefix("lam_"), 0)
        return ca.Sparsity.dense(size) if size else ca.Sparsity(0, 0)

    def has_eval_buffer(self) -> bool:
        return True  # without copies: as DM each argument takes longer than all that is done here

    def eval_buffer(self, arg: Sequence[memoryview], res: Sequence[memoryview]) -> int:
        x, f, g, lam_x, lam_g = (np.frombuffer(arg[i]) for i in range(5))
        objective = float(f[0])
        # Change that would make up for what g misses, to first order.
        missed = g - np.minimum(np.maximum(g, self.program.lower_g), self.program.upper_g)
        infeasibility = float(np.abs(missed).max(initial=0.0))
        if infeasibility <= MET:
            self._keep({"x": x, "g": g, "lam_x": lam_x, "lam_g": lam_g}, objective)
        # A product of such long vectors by `@` would start a thread of BLAS, which then waits at full load.
        made_up = objective + (lam_g * missed).sum()
        if made_up < self._better():
            self._since = self.iteration
        self._follow(x, objective, made_up, infeasibility)
        if self._progress is not None:
            self.errands.put(partial(self._progress, self.iteration, objective, infeasibility))
        self.iteration += 1
        self.late = time.perf_counter() > self._deadline
        self.strayed = self._looks and self.iteration % LOOK == 0 and self.program.strays(x)
        np.frombuffer(res[0])[:] = self.abandoned or self.settled or self.circling or self.late or self.strayed
        return 0

    def _follow(self, x: np.ndarray, objective: float, made_up: float, infeasibility: float) -> None:
        """Note whether an iterate is better or nearer than all before it that are close to the constraints.

        `made_up` is the objective with what making up for the infeasibility would change.
        """
        if infeasibility > CLOSE:
            return
        self._round += 1
        if not np.isfinite(self._least) or made_up < self._least - GAIN * abs(self._least):
            self._round, self._least = 0, made_up
        if infeasibility < self._missed / 2:
            self._round = 0
        if infeasibility < self._missed:
            self.nearest, self._missed = (x.copy(), objective), infeasibility

    def _better(self) -> float:
        """Return the objective below which it is worth going on."""
        return self._mark - BETTER * abs(self._mark) if np.isfinite(self._mark) else np.inf

    def _keep(self, iterate: dict[str, np.ndarray], objective: float) -> None:
        """Keep the best iterate that meets all constraints."""
        if self.program.violation(iterate["x"], iterate["g"]) > MET or objective >= self.objective:
            return
        if objective < self._better():
            self._mark = objective
        self.best, self.objective = {name: values.copy() for name, values in iterate.items()}, objective


@cache
def run_in_one_thread() -> None:
    """Set the OpenBLAS that CasADi brings along to one thread; to be called after CasADi has loaded IPOPT.

    The dense blocks of a program's factorisation are so small that more threads only wait for each other: on two cores
    a team of six was planned 1.6 times as fast with one, in a third of the processor time. Other users of BLAS are not
    affected, and neither is a number of threads that the environment gives.
    """
    if any(name in os.environ for name in VARIABLES) or not hasattr(os, "RTLD_NOLOAD"):
        return
    for file in Path(ca.__file__).parent.glob("libcasadi-tp-openblas*"):
        try:
            # By its bare name, and only if it is loaded: a wheel has several copies, which would not share the setting.
            library = ctypes.CDLL(file.name, mode=os.RTLD_NOLOAD)
            library.openblas_set_num_threads(1)
        except (OSError, AttributeError):
            continue
