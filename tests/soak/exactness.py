"""Check that random problems of every awkward kind get the right status, optimal tensions and true certificates.

    python -m tests.soak exactness [--start 0] [--count 1000000] [--only exact,random,float]

Each problem is named by its seed. `solve`, `solve_batch` by its lanes and by the C core, and the distribution of an
exported control step, which is compiled here, solve it. `exact_judge` judges their answers in integers. Wrong is

- a status that differs from that of `solve`, but for an exported step that is unsure;
- "optimal" with a tension beyond a limit, a wrench error above the tolerance, or a cost above the least;
- "infeasible" or "singular" if the limits permit w, or with a direction that does not, exactly, prove otherwise;
- "infeasible" instead of "singular", or the other way round;
- any other status.

There are exceptions, and all are counted. A problem is `rough` if its scales differ by more than 2^8 or its cables are
parallel to five digits. Only of such a problem "inaccurate" and "failed" are not wrong, and "singular" is right, too,
if no cable pulls along the direction by more than 1e-11 of its column, as documented: it is listed as "singular to
eleven digits". "infeasible" will do for a w off the range if it is off by less than 1000 tolerances, if the problem is
rough, or if the condition of the matrix is above 1e5. The exported step has rounded numbers only. It may be
unsure of a rough problem, if the condition is above 100, on the boundary of what the cables can give, and within 1000
tolerances or 1e-6 of the largest wrench of a cable of it.

The family "exact" is made of integers and powers of two, and the truth is known. The family "random" has random digits
instead; there each answer has to prove itself. In "float" the float form of the step solves problems of 24 bits, and is
judged by its own tolerances: it may always be unsure, but it must not call optimal what is out of reach by any amount.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from towline.base.errors import InputError, SolverError
from towline.solvers import TensionProblem, solve, solve_batch
from towline.solvers.solution import STATUSES

from .exact_judge import DOUBLE, FLOAT, Judge
from .exact_problems import ExactProblem, exact_problem
from .step_distribution import StepDistribution

Array = NDArray[np.float64]

KINDS = (
    "plain",
    "geometric",
    "twins",
    "nearly parallel",
    "rank deficient",
    "fixed",
    "unlimited",
    "huge limits",
    "corner",
    "weighted",
    "wished",
)
BLOCK = 2000
NEAR = 1000.0  # tolerances
FAR = 1e-6  # of the largest wrench of a cable at a limit or at its t_ref
CONDITION, WORST = 1e2, 1e5
BEYOND = 1e15  # of this size limits are infinite in float [N]; a tension of at least that is refused
NEARLY = "singular to eleven digits"
PARTS = ("exact", "random", "float")


def soak(start: int, count: int, parts: Sequence[str]) -> bool:
    """Check the problems of `count` seeds in each of `parts`, print what is wrong, and return whether nothing is."""
    return all([_soak_part(part, range(start, start + count)) for part in parts])


def _soak_part(part: str, seeds: range) -> bool:
    report = Report(Counter(), [], 0.0)
    with tempfile.TemporaryDirectory() as folder:
        step = _step("float" if part == "float" else "double", Path(folder))
        for first in range(0, len(seeds), BLOCK):
            some = seeds[first : first + BLOCK]
            block = check_float(some, step) if part == "float" else check(some, part, step)
            for wrong in block.wrong:
                print(wrong, flush=True)
            report = report.plus(block)
    print(f"{part}: {report.line()}")
    for answer, count in sorted(report.answers.items()):
        print(f"{answer}: {count}")
    return not report.wrong


def _step(precision: str, folder: Path) -> StepDistribution | None:
    try:
        return StepDistribution(precision, folder)
    except InputError as error:
        print(error)
        return None


class Wrong(NamedTuple):
    """A wrong answer to the problem of a seed."""

    seed: int
    solver: str
    reason: str


class Answer(NamedTuple):
    """The status of a solver, with tensions where it is optimal and a direction where it is a proof."""

    status: str
    tensions: Array  # (m,)
    direction: Array  # (n,)


class Report(NamedTuple):
    """Counts of each solver's statuses, the wrong answers, and the largest gap of a cost to the least one."""

    answers: Counter[tuple[str, str]]
    wrong: list[Wrong]
    gap: float

    def plus(self, other: Report) -> Report:
        """Return both together."""
        return Report(self.answers + other.answers, self.wrong + other.wrong, max(self.gap, other.gap))

    @property
    def statuses(self) -> set[str]:
        """Return the statuses that occurred."""
        return {status for _, status in self.answers}

    def line(self) -> str:
        """Return the figures in one line."""
        problems = max(Counter(solver for solver, _ in self.answers.elements()).values(), default=0)
        return f"{problems} problems, {len(self.wrong)} wrong answers, largest gap of an optimal cost {self.gap:.1e}"


def check(seeds: range, family: str = "exact", step: StepDistribution | None = None) -> Report:
    """Solve the problems of these seeds by all solvers, in batches of one shape, and judge."""
    report = Report(Counter(), [], 0.0)
    for members, problems, arrays in _shapes(seeds, FAMILIES[family]):
        batches = {name: solve_batch(*arrays, threads=1, backend=name) for name in ("lanes", "c")}
        stepped = step.solve(*arrays) if step else None
        for row, (seed, problem) in enumerate(zip(members, problems, strict=True)):
            given = {"solve": _alone(problem)}
            for name, batch in batches.items():
                given[name] = Answer(str(batch.status[row]), batch.tensions[row], batch.direction[row])
            if stepped:
                status = STATUSES[stepped.status[row]].value
                given["step"] = Answer(status, stepped.tensions[row], stepped.direction[row])
            report = report.plus(_judged(seed, problem, given))
    return report


def check_float(seeds: range, step: StepDistribution | None) -> Report:
    """Solve the problems of these seeds by the step in float, and judge by its tolerances."""
    if step is None:
        raise InputError("the float form of the step needs a C compiler, command cc")
    report = Report(Counter(), [], 0.0)
    for members, problems, arrays in _shapes(seeds, lambda seed: exact_problem(seed, "float")):
        stepped = step.solve(*arrays)
        for row, (seed, problem) in enumerate(zip(members, problems, strict=True)):
            status = STATUSES[stepped.status[row]].value
            answer = Answer(status, stepped.tensions[row], stepped.direction[row])
            judge = Judge(problem, FLOAT)
            reason, gap = _reason(judge, "float", answer)
            if status == "optimal" and not reason:
                # In float "optimal" is a promise that exact tensions are near.
                reason = "w is out of reach" if problem.outside else judge.distance_to_optimum(answer.tensions)
            wrong = [Wrong(seed, "float", f"{status}: {reason}")] if reason else []
            report = report.plus(Report(Counter({("float", status): 1}), wrong, gap))
    return report


def _shapes(
    seeds: range, problem_of: Callable[[int], ExactProblem]
) -> Iterator[tuple[list[int], list[ExactProblem], list[Array]]]:
    """Yield the seeds and problems of each shape, and the problems as arrays with the rows in front."""
    shapes: dict[tuple[int, ...], list[int]] = {}
    problems = {seed: problem_of(seed) for seed in seeds}
    for seed, problem in problems.items():
        shapes.setdefault(problem.A.shape, []).append(seed)
    for members in shapes.values():
        own = [problems[seed] for seed in members]
        yield members, own, [np.array(column) for column in zip(*(problem[:7] for problem in own), strict=True)]


def _alone(p: ExactProblem) -> Answer:
    """Return the answer of `solve`, whose certificate has to verify and to agree with the status."""
    problem = TensionProblem(*p[:6], length=p.length)
    none = np.full(problem.m, np.nan), np.full(problem.n, np.nan)
    try:
        solution = solve(problem)
        certificate = solution.certificate
    except SolverError as error:
        return Answer(str(error), *none)
    status = solution.status.value
    if certificate is not None and not certificate.verify(problem):
        status = f"{status}, whose certificate does not verify"
    elif certificate is not None and certificate.singular is not (status == "singular"):
        status = f"{status}, whose certificate contradicts it"
    tensions = none[0] if solution.tensions is None else solution.tensions
    return Answer(status, tensions, none[1] if certificate is None else certificate.direction)


def _judged(seed: int, problem: ExactProblem, given: dict[str, Answer]) -> Report:
    """Judge the answers to one problem; those that are the same to the last bit are judged once."""
    judge, wrong, largest = Judge(problem, DOUBLE), list[Wrong](), 0.0
    counts: Counter[tuple[str, str]] = Counter()
    known: dict[tuple[str, bytes, bytes], tuple[str, float]] = {}
    for solver, answer in given.items():
        unsure = answer.status == "inaccurate" and solver == "step"
        key = (answer.status, answer.tensions.tobytes(), answer.direction.tobytes())
        if unsure or key not in known:
            known[key] = _reason(judge, solver, answer)
        reason, gap = known[key]
        if not reason and not unsure and answer.status != given["solve"].status:
            reason = f"the status of solve is {given['solve'].status}"
        counts[solver, NEARLY if reason == NEARLY else answer.status] += 1
        if reason not in ("", NEARLY):
            wrong.append(Wrong(seed, solver, f"{answer.status}: {reason}"))
        largest = max(largest, gap)
    return Report(counts, wrong, largest)


def _reason(judge: Judge, solver: str, answer: Answer) -> tuple[str, float]:
    """Return why an answer is wrong, or nothing, and the gap of its cost if it is optimal."""
    problem, tolerance = judge.problem, judge.tolerance(np.zeros(len(judge.columns)))
    if answer.status == "optimal":
        error, gap = judge.error(answer.tensions), judge.smallest_gap(answer.tensions)
        if not error <= judge.tolerance(answer.tensions):
            return f"the wrench error is {error:g} N", gap
        return ("" if gap <= judge.tolerances.gap else f"the cost is {gap:.1e} too high"), gap
    if answer.status in ("infeasible", "singular"):
        off, loose = judge.off_range(), problem.rough or solver == "float"
        nearly = loose and answer.status == "singular" and judge.is_nearly_orthogonal(answer.direction)
        if problem.outside == 0.0 or not judge.excludes(answer.direction):
            permits = "the limits permit w" if problem.outside == 0.0 else "the direction does not exclude w"
            return (NEARLY if nearly and solver != "float" else permits), 0.0
        if answer.status == "singular":
            return ("" if off > 0.0 or nearly else "w is in the range"), 0.0
        either = loose or off <= NEAR * tolerance or judge.condition() > WORST
        return ("" if either else "w is off the range"), 0.0
    if answer.status in ("inaccurate", "failed") and (problem.rough or solver == "float"):
        return "", 0.0
    beyond = problem.t_min.max() > BEYOND or problem.t_max.min() < -BEYOND
    if answer.status == "invalid" and solver == "float" and beyond:
        return "", 0.0
    if answer.status == "inaccurate" and solver == "step":
        near = 0.0 < problem.outside <= max(NEAR * tolerance, FAR * judge.largest()) or tolerance == 0.0
        near = near or 0.0 < judge.off_range() <= NEAR * tolerance or judge.condition() > CONDITION
        near = near or problem.place in ("face", "corner")
        return ("" if near else "nothing is near that rounding could decide"), 0.0
    return "no status of such a problem", 0.0


def awkward_problem(seed: int, m: int | None = None, n: int | None = None) -> tuple[Array, ...]:
    """Return A, w, t_min, t_max, t_ref, weights of a random problem, m 1 to 12 cables and a rank from 1 to 6.

    Two kinds of trouble at a time, w inside, at a corner of, or outside the available wrench set, any units.
    """
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, 13)) if m is None else m
    n = int(rng.integers(1, 7)) if n is None else n
    kinds = set(rng.choice(KINDS, 2))
    A = rng.normal(size=(n, m))
    if "geometric" in kinds and n == 6:
        A[:3] /= np.linalg.norm(A[:3], axis=0)
        A[3:] = np.cross(rng.uniform(-1, 1, (3, m)), A[:3], axis=0)
    if "twins" in kinds:
        A[:, rng.integers(m)] = A[:, 0] * rng.choice([-1.0, 1.0, 0.5])
    if "nearly parallel" in kinds:
        A[:, rng.integers(m)] = A[:, 0] + 10.0 ** rng.uniform(-6, -2) * rng.normal(size=n)
    if "rank deficient" in kinds:
        rank = int(rng.integers(1, n + 1))
        A[rank:] = rng.integers(-2, 3, size=(n - rank, rank)) @ A[:rank]
    low = rng.uniform(-1.0, 1.0, m)
    high = low + rng.uniform(0.1, 2.0, m)
    if "fixed" in kinds:
        some = rng.random(m) < 0.3
        high[some] = low[some]
    span = high - low
    if "unlimited" in kinds:
        high[rng.random(m) < 0.3] = np.inf
        low[rng.random(m) < 0.2] = -np.inf
    if "huge limits" in kinds:
        high[rng.random(m) < 0.3] = 10.0 ** rng.uniform(3, 9)
    t = np.where(np.isfinite(low), low, high - span)
    t = np.where(np.isfinite(t), t, 0.0) + span * np.clip(rng.uniform(-0.3, 1.3, m), 0.0, 1.0)
    t = np.minimum(np.maximum(t, low), high)
    if "corner" in kinds:
        d = rng.normal(size=n) @ A
        at = np.where(d > 0, high, low)
        t = np.where(np.isfinite(at), at, t)
    w = A @ t
    where = rng.random()
    if where < 0.25:
        w = w + 10.0 ** rng.uniform(-3, 1) * np.abs(t).max() * (A @ rng.normal(size=m))
    elif where < 0.35:
        w = w + rng.normal(size=n)
    unit, load = 10.0 ** rng.uniform(-6, 6, 2)
    wish = load * rng.normal(size=m) * 3.0 if "wished" in kinds else np.zeros(m)
    weights = 10.0 ** rng.uniform(-4, 4, m) if "weighted" in kinds else np.ones(m)
    return A * unit, w * unit * load, low * load, high * load, wish, weights


def _random_problem(seed: int) -> ExactProblem:
    """Return an awkward problem of which nothing is known."""
    A, w, low, high, wish, weights = awkward_problem(seed)
    return ExactProblem(A, w, low, high, wish, weights, 1.0, None, np.nan, "somewhere", True)


FAMILIES: dict[str, Callable[[int], ExactProblem]] = {"exact": exact_problem, "random": _random_problem}
