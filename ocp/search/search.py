"""Solve the programs of a scenario, audit the solutions, and record them: `Search`."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from operator import itemgetter
from types import SimpleNamespace

import numpy as np

from ...base.text import counted, quantity
from ..audits.audit import Audit, audit
from ..audits.excess import TENSIONS
from ..audits.violation import relative_violation
from ..nlp.grid import Grid
from ..nlp.guess import initial_guess, usual_guess
from ..nlp.linear import LinearDistances
from ..nlp.near import Near, has_places, jumps
from ..nlp.program import Program, build
from ..nlp.rows import Mesh
from ..nlp.solver import CIRCLING, MOST_ITERATIONS, SETTLED, STRAYED, TIME_LIMIT, Outcome, Progress, Solver
from ..nlp.stages import Stages
from ..nlp.waiting import raise_if_swallowed, wait_for
from ..plan import Plan
from ..result import PlannerStep
from ..tasks.deviation import Deviation
from ..tasks.scenario import Scenario
from ..tasks.scheme import SchemeName
from ..tasks.task import MotionStatus
from .time_law import PathTiming

NEAR = 0.08  # of a motion's extent: where a place is, of which a program has rows the first time
FEW = 8  # regions
ROUNDS = 8  # of rows that are added where a solution exceeds what the program leaves out; then it has all
PASSES, MOST_PASSES = 3, 7  # with linear distances; more than the first where true distances are still missed
MOST_COARSE = 150  # iterations of a program that only leads to another: those that end well take 20 to 90
# Effort of an iteration for each unknown and row, times the root of how many there are at a node, and of an audit for
# each of its tensions [us], on a usual processor. Measured times would make offers depend on how busy the machine is.
OF_PROGRAM, OF_AUDIT = 0.4, 0.9
PEAKS = 50  # of missing wrenches, that are known of an audit
TO_BUILD = 20  # iterations take as long as building their program
LEAST_ITERATIONS = 15  # fewer find nothing
MOST_AGAIN = 60  # iterations from a solution that is near: more do not lead to one
APPROACHED = 1e-3  # of a distance's scale: what true distances may miss at the end
USABLE = 1e-2  # of it: what the true program makes up for
FOR_AUDIT, MOST_FOR_AUDIT = 0.1, 2.0  # of the time limit, and [s]: what is kept for the audit of the best motion
GAIN = 0.02  # of the objective: less of it is not worth another pass
ENDS = {  # of a run of the solver, by its message; others are quoted
    "Solve_Succeeded": "solved",
    "Solved_To_Acceptable_Level": "solved with less accuracy",
    "Infeasible_Problem_Detected": "no solution found",
    "Maximum_Iterations_Exceeded": "iteration limit reached",
    TIME_LIMIT: "time limit reached",
    STRAYED: "stopped in a region",
    SETTLED: "stopped improving",
    CIRCLING: "went in a circle",
}


class Search:
    """Solve one scenario's programs, and record the time and the message of each stage.

    New `solvers` are added to those that exist already, by mesh. `progress` is called with (iteration, objective,
    infeasibility). All that the search does takes `seconds`, from now on; default: the task's time limit, less what the
    last audit takes. `timing` is what is known of the scenario's path.
    """

    def __init__(
        self,
        scenario: Scenario,
        solvers: dict[Mesh, Solver],
        progress: Progress | None,
        seconds: float | None = None,
        timing: PathTiming | None = None,
    ):
        self.scenario, self.progress, self._solvers = scenario, progress, solvers
        self.timing = timing or PathTiming(scenario)
        limit = scenario.task.time_limit
        own = limit - min(FOR_AUDIT * limit, MOST_FOR_AUDIT)
        self._deadline = time.perf_counter() + (own if seconds is None else seconds)
        self.build_s, self.solve_s = 0.0, 0.0
        self.stages: list[PlannerStep] = []
        self.known: Audit | None = None  # of a motion that the task fixes
        self.mesh: Mesh | None = None  # of the program that was solved last
        self.between: tuple[str, ...] = ()  # of the meshes (`Mesh.between`)
        self.built: list[Stages] = []  # of programs
        self._iterates: list[tuple[int, float, float]] = []
        self._audited: list[tuple[float, Outcome, Audit]] = []
        self._interrupted: Outcome | None = None
        self._circled = 0  # steps of the program that went in a circle last
        self.effort, self.most_effort = 0.0, np.inf  # of programs and audits, in microseconds of a usual processor
        self.cut_short = False  # whether the search for offers had to stop
        self.failed = set[float]()  # shares of the duration at which audits of fixed motions found missing wrenches

    def take(self, scenario: Scenario) -> None:
        """Go on with another scenario, without what is known of the one before."""
        self.scenario = scenario
        self._solvers.clear()
        self._audited.clear()

    def take_scheme(self, name: SchemeName) -> Scenario:
        """Continue with another scheme of transcription; return the scenario that has it."""
        task = self.scenario.task.model_copy(update={"scheme": name})
        self.scenario = replace(self.scenario, task=task)
        self._solvers.clear()
        return self.scenario

    @contextmanager
    def stage(self, name: str) -> Iterator[SimpleNamespace]:
        """Record what happens inside as a stage, which sets its `message`."""
        raise_if_swallowed()
        start, running = time.perf_counter(), SimpleNamespace(message="")
        yield running
        self.stages.append(PlannerStep(name, running.message, time.perf_counter() - start))

    def _iteration(self, iteration: int, objective: float, infeasibility: float) -> None:
        """Record an iteration, and report it."""
        self._iterates.append((iteration, objective, infeasibility))
        if self.progress is not None:
            self.progress(iteration, objective, infeasibility)

    @property
    def iterations(self) -> int:
        """Return how many iterations all runs of solvers have taken."""
        return len(self._iterates)

    @property
    def seconds_left(self) -> float:
        """Return how much is left of the time for the search [s]: nothing after its largest effort."""
        return max(self._deadline - time.perf_counter(), 0.0) if self.effort < self.most_effort else 0.0

    def knows(self, mesh: Mesh) -> bool:
        """Return whether the program of `mesh` exists: it may have a solution to start from."""
        return mesh in self._solvers

    def has_solution(self, mesh: Mesh) -> bool:
        """Return whether the program of `mesh` has an optimum to start from."""
        return mesh in self._solvers and self._solvers[mesh].has_solution

    def solve(
        self, name: str, mesh: Mesh, guess: Deviation | None, coarser: bool = False, clear: bool = False
    ) -> Outcome:
        """Solve the program of `mesh` from `guess`; default: from its last solution, or else from a guess of its own.

        A guess is `coarser` if it is the same task's optimum on a coarser mesh, and `clear` if it is past all regions
        that are in the way, as such an optimum is. If the program goes in a circle, the distances are linear instead:
        at once where it did so before with as many steps.
        """
        again = mesh.steps == self._circled and not mesh.elastic and guess is not None
        if again and (found := self.approach(mesh, guess)) is not None:
            self.mesh = mesh
            return found
        outcome = self._solve(name, mesh, guess, coarser, clear)
        if outcome.message != CIRCLING or mesh.steps < self.scenario.task.steps or mesh.elastic:
            return outcome
        self._circled = mesh.steps
        return self.approach(mesh, outcome.deviation) or outcome

    def _solve(self, name: str, mesh: Mesh, guess: Deviation | None, coarser: bool, clear: bool) -> Outcome:
        """Solve the program of `mesh`, with rows of further regions where the solution may exceed them."""
        with self.stage(f"{name}, {mesh.steps} steps") as stage:
            if self.seconds_left <= 0:
                stage.message = f"{ENDS[TIME_LIMIT]} before it began"
                return self._unsolved(mesh, guess)
            # With few regions, rows that are not needed cost less than another round.
            crowded = len(self.scenario.task.limits.keep_out) > FEW
            reach = NEAR if coarser or (clear and crowded) else 2 * NEAR
            outcome = self._run(mesh, guess, coarser, reach)
            for added in range(ROUNDS + 1):
                program, strayed = self._solvers[mesh].program, outcome.message == STRAYED
                unsolved = not (outcome.success or strayed)
                if unsolved or self.seconds_left <= 0 or program.suffices(outcome.deviation):
                    break
                more = program.near.widened(self.scenario, program.shares, outcome.deviation, NEAR)
                # From the guess again, if the solution is deep in a region: it would come out of it on any side.
                grazes = not (strayed or jumps(self.scenario, outcome.deviation))
                near = guess if strayed or not (grazes or guess is None) else outcome.deviation
                more = more if added < ROUNDS else None
                outcome = self._run(mesh, near, coarser and not grazes, np.inf, more)
            how = ended(outcome.message)
            stage.message = f"{how} {'in' if how == 'solved' else 'after'} {counted(outcome.iterations, 'iteration')}"
            if mesh.elastic:
                stage.message += f", short by {quantity(outcome.slack, 'N')}"
        return outcome

    def tighten(self, mesh: Mesh) -> None:
        """Give the program that was solved last the limits of `mesh`: it has the same rows with other bounds.

        Its next run starts from the last solution and its multipliers.
        """
        if self.mesh is not None and self.mesh in self._solvers:
            solver = self._solvers[mesh] = self._solvers.pop(self.mesh)
            solver.program = solver.program.tightened(mesh)

    def solve_again(self, mesh: Mesh, guess: Deviation) -> Outcome:
        """Solve the program with parameters of `mesh` from a guess near its last solution, of another scenario."""
        with self.stage(f"nonlinear program, {mesh.steps} steps") as stage:
            start, self.mesh = time.perf_counter(), mesh
            if mesh in self._solvers:
                solver = self._solvers[mesh]
                solver.take(self.scenario)
            else:
                solver = self._solvers[mesh] = wait_for(
                    lambda: Solver(build(self.scenario, mesh, movable=True), MOST_AGAIN)
                )
            built = time.perf_counter()
            outcome = solver.solve(guess, self._iteration, False, self.seconds_left, near=True)
            self.solve_s += time.perf_counter() - built
            solver.prepare(None, near=True)  # for the next one
            self.build_s += built - start
            stage.message = f"{ended(outcome.message)} in {counted(outcome.iterations, 'iteration')}"
        return outcome

    def approach(self, mesh: Mesh, guess: Deviation | None, scenario: Scenario | None = None) -> Outcome | None:
        """Return the outcome of passes with linear distances: a motion past the regions that are in the way, or None.

        Each pass is about the motion of the one before. The program of `mesh` soon ends from the last motion. It is one
        of `scenario`; default: of the search's own.
        """
        slower = "" if scenario is None else f", motion of {quantity(scenario.duration, 's')}"
        scenario = scenario or self.scenario
        if not has_places(scenario) or self.seconds_left <= 0:
            return None
        with self.stage(f"program with linear distances, {mesh.steps} steps{slower}") as stage:
            start = time.perf_counter()
            shares = Grid.of(scenario, mesh.steps).shares
            motion = initial_guess(scenario, shares * scenario.duration) if guess is None else guess
            motion = motion.at(shares * motion.nodes[-1])
            near, linear = Near.along(scenario, shares, motion, 2 * NEAR), None
            best, objective, iterations, missed = None, np.inf, 0, np.inf
            for passed in range(MOST_PASSES):
                if linear is None:
                    linear = wait_for(lambda near=near: LinearDistances(self._build(scenario, mesh, near)))
                self.build_s += time.perf_counter() - start
                start = time.perf_counter()
                outcome = linear.solve(motion, self._iteration, self.seconds_left)
                self.solve_s += time.perf_counter() - start
                iterations += outcome.iterations
                stage.message = (
                    f"{ended(outcome.message)} after {counted(iterations, 'iteration')} in pass {passed + 1}"
                )
                if not outcome.success:
                    break
                start = time.perf_counter()
                if not near.suffices(scenario, shares, outcome.deviation):
                    near = near.widened(scenario, shares, outcome.deviation, NEAR)
                    linear, missed = None, np.inf
                    continue
                best, motion, missed = outcome, outcome.deviation, linear.missed(outcome.deviation)
                settled = missed <= APPROACHED and outcome.objective > objective - GAIN * abs(objective)
                if settled or (passed + 1 >= PASSES and missed <= APPROACHED):
                    break
                objective = outcome.objective
        return best if missed <= USABLE else None

    def _unsolved(self, mesh: Mesh, guess: Deviation | None) -> Outcome:
        """Return the motion from which the program of `mesh` would start, as the outcome of no iteration."""
        scenario = self.scenario
        motion = guess or usual_guess(scenario, Grid.of(scenario, mesh.steps).shares * scenario.duration)
        slack = np.inf if mesh.elastic else 0.0
        return Outcome(motion, float(motion.nodes[-1]), False, TIME_LIMIT, 0, slack, np.nan)

    def _run(
        self, mesh: Mesh, guess: Deviation | None, coarser: bool, reach: float, near: Near | None = None
    ) -> Outcome:
        """Run the solver of `mesh`; one that does not exist yet has the regions within `reach`.

        With `near` it is made again, with those rows.
        """
        start, self.mesh = time.perf_counter(), mesh
        known = self._solvers.get(mesh)
        again = known is not None and guess is None and known.has_solution  # continues from there, with its own rows
        if near is not None:
            self._solvers[mesh] = wait_for(lambda: self._solver(self._build(self.scenario, mesh, near)))
        elif known is None or not (again or np.isfinite(reach) or known.program.near.is_everywhere):
            self._solvers[mesh] = wait_for(lambda: self._solver(self._built(mesh, guess, reach)))
        solver = self._solvers[mesh]
        at = None if guess is None else guess.at(solver.program.shares * guess.nodes[-1])
        solver.prepare(at, coarser)
        built = time.perf_counter()
        try:
            outcome = solver.solve(at, self._iteration, coarser, self.seconds_left, stray=mesh.elastic)
        except BaseException:
            self._interrupted = None if mesh.elastic else solver.interrupted
            raise
        self.build_s += built - start
        self.solve_s += time.perf_counter() - built
        self.effort += (outcome.iterations + (solver is not known) * TO_BUILD) * effort_of(solver.program)
        return outcome

    def _solver(self, program: Program) -> Solver:
        """Return the solver of a new program, with as many iterations as the remaining effort permits."""
        most = MOST_COARSE if program.mesh.steps < self.scenario.task.steps else MOST_ITERATIONS
        left = (self.most_effort - self.effort) / effort_of(program) - TO_BUILD
        return Solver(program, int(max(min(most, left), LEAST_ITERATIONS)))

    def _built(self, mesh: Mesh, guess: Deviation | None, reach: float) -> Program:
        """Return the program of `mesh`, without the rows of regions that are farther than `reach` from the guess."""
        scenario = self.scenario
        if not has_places(scenario) or not np.isfinite(reach):
            return self._build(scenario, mesh, None)
        shares = Grid.of(scenario, mesh.steps).shares
        motion = initial_guess(scenario, shares * scenario.duration) if guess is None else guess
        return self._build(scenario, mesh, Near.along(scenario, shares, motion, reach))

    def _build(self, scenario: Scenario, mesh: Mesh, near: Near | None) -> Program:
        """Build a program from the stages of earlier ones, as far as they are the same."""
        for stages in self.built:
            if stages.scenario is scenario and stages.mesh.rows == mesh.rows:
                return build(scenario, mesh, near, stages=stages)
        self.built.append(Stages.of(scenario, mesh, known=self.built))
        return build(scenario, mesh, near, stages=self.built[-1])

    def audit(self, outcome: Outcome) -> Audit:
        """Audit the motion of a program's solution, which `best` then chooses from."""
        scenario = self.scenario.lasting(outcome.duration)
        audited = self.audit_motion(scenario, outcome.deviation)
        self._audited.append((relative_violation(scenario, audited), outcome, audited))
        return audited

    def audit_direct(self) -> Plan | None:
        """Audit the motions from which programs start, and return the first plan of one that passes, or None."""
        scenario, span = self.scenario, self.scenario.duration_range
        for seconds in (scenario.duration, *([] if span is None else [span.max])):
            lasting = scenario.lasting(seconds)
            guess = usual_guess(lasting, Grid.of(lasting, scenario.task.steps).shares * seconds)
            audited = self.audit_motion(lasting, guess, f"audit of the direct motion of {quantity(seconds, 's')}")
            if audited.passed:
                return Plan(lasting, MotionStatus.FEASIBLE, guess, audited, self.build_s, self.solve_s)
        return None

    def best_of_interrupted(self) -> Plan | None:
        """Return the best plan of a search that was interrupted, audited now if it has to be; None if there is none."""
        if self._interrupted is not None:
            outcome, self._interrupted = self._interrupted, None
            self.audit(outcome)
        return self.best("the search was interrupted") if self._audited else None

    def best(self, reason: str = "") -> Plan:
        """Return the plan of the audited solution that violates its limits by least; the latest of equal ones.

        `reason` is why the search ended, if it was not because of the time limit.
        """
        _, outcome, audited = min(reversed(self._audited), key=itemgetter(0))
        if self.seconds_left <= 0:
            reason = f"the time limit of {quantity(self.scenario.task.time_limit, 's')} is reached"
        return Plan(
            scenario=self.scenario.lasting(outcome.duration),
            status=MotionStatus.FEASIBLE if audited.passed else MotionStatus.NOT_FOUND,
            deviation=outcome.deviation,
            audit=audited,
            build_s=self.build_s,
            solve_s=self.solve_s,
            reason="" if audited.passed else reason,
            iterations=outcome.iterations,
            message=outcome.message,
            iterates=tuple(self._iterates),
            objective=None if np.isnan(outcome.objective) else outcome.objective,  # of the elastic program
        )

    def audit_motion(
        self, scenario: Scenario, deviation: Deviation | None, name: str = "audit", known: Audit | None = None
    ) -> Audit:
        """Audit any motion whose audit is not `known`."""
        with self.stage(name) as stage:
            audited = known or audit(scenario, deviation)
            self.effort += OF_AUDIT * audited.tensions.size
            if not scenario.count:
                missed = np.where(audited.violation > audited.tolerance, audited.violation, 0.0)
                peaks = 1 + np.flatnonzero((missed[1:-1] > missed[:-2]) & (missed[1:-1] >= missed[2:]))
                about = (peaks[np.argsort(-missed[peaks])[:PEAKS]] + np.array([[-1], [0], [1]])).ravel()
                self.failed |= {*(audited.times[about] / audited.times[-1]).tolist()}  # on both sides of a jump
            stage.message = "passed" if audited.passed else describe(audited)
        return audited


def effort_of(program: Program) -> float:
    """Return the effort of an iteration, from unknowns and rows: near regions have some at each node, teams many."""
    size = program.lower.size + program.lower_g.size
    return float(OF_PROGRAM * size * np.sqrt(size / program.mesh.steps))


def ended(message: str) -> str:
    """Return how a run of the solver ended, from its message."""
    return ENDS.get(message, f"stopped ({message})")


def describe(audited: Audit) -> str:
    """Return the violations of an audit in short."""
    lines = []
    if audited.violation.max() > audited.tolerance:
        short = quantity(audited.violation.max(), "N")
        lines.append(f"short by up to {short} at t = {audited.times[audited.worst]:.3f} s")
    if count := sum(not lines or each.limit != TENSIONS for each in audited.excess):
        lines.append(f"{counted(count, 'other limit' if lines else 'limit')} exceeded")
    return ", ".join(lines)
