"""Find layouts of CoGiRo and IPAnema-2 at equal time: towline against a genetic algorithm and CMA-ES, in one run.

    python -m towline.benchmarks.design [--seconds 5] [--runs 5]

Anchors and attachments are free in the boxes of the published ones. The objective is the smallest capacity margin at
7 x 7 x 5 positions, computed by the same core for all. No contender knows the published layout:

- towline: the search of `design` with `start: random`.
- pymoo GA: its genetic algorithm, whose first population are the best 150 of 3000 layouts that are drawn as
  towline's annealing draws them, half of the coordinates at bounds; uniform draws are worse.
- cma: CMA-ES inside the bounds, from their middle; cma, drawn: from the best of these draws. Neither is better for
  both robots.

Each result is judged at 100 000 random positions of the box. The contenders alternate; margins are medians of the runs.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np

from ..layout.annealing import drawn
from ..layout.evaluation import Evaluation, rows_of
from ..layout.requirements import Requirements
from ..layout.search import AUDITED, search
from ..layout.variables import Variables, variables_of
from ..models import load
from .harness import alternating, machine, table as table_of

BOXES = {"cogiro": ((-4.0, -3.0, 0.5), (4.0, 3.0, 3.0)), "ipanema-2": ((-2.0, -1.5, 2.0), (2.0, 1.5, 3.5))}
DRAWS, POPULATION = 3000, 150
_NEGATIVE = 0.05  # of the mean of negative margins in the score, as in towline's annealing


class Task:
    """The free points of a robot, and the time to find them in."""

    def __init__(self, name: str, seconds: float, seed: int):
        robot, (low, high) = load(name), BOXES[name]
        free = [
            {"part": part, "box": {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}}
            for part, points in (("anchor", robot.anchors), ("attachment", robot.attachments))
        ]
        require = [{"box": {"min": low, "max": high}, "grid": (7, 7, 5)}]
        data = {"free": free, "require": require, "start": "random", "time_limit": seconds, "seed": seed}
        self.requirements = Requirements.model_validate(data)
        self.variables: Variables = variables_of(robot, self.requirements)
        self.rng = np.random.default_rng(seed)
        self._evaluation = self._at(self.requirements.require[0].places())
        self.until = time.perf_counter() + seconds

    def _at(self, poses: np.ndarray) -> Evaluation:
        return Evaluation(self.variables, rows_of(self.variables.robot, self.requirements.require, [poses]))

    def score(self, share: np.ndarray) -> float:
        """Return what peers maximise, from shares of the ranges of the variables [N]."""
        margins = self._evaluation.margins(self.layout(share))
        return float(margins.min() + _NEGATIVE * np.minimum(margins, 0.0).mean())

    def layout(self, share: np.ndarray) -> np.ndarray:
        """Return the variables."""
        return self.variables.low + share * (self.variables.high - self.variables.low)

    def draws(self) -> np.ndarray:
        """Return the best layouts of many random ones as shares, best first, (POPULATION, p)."""
        low, high = np.zeros(self.variables.size), np.ones(self.variables.size)
        shares = np.array([drawn(low, high, self.rng) for _ in range(DRAWS)])
        return shares[np.argsort([-self.score(share) for share in shares])[:POPULATION]]

    def judged(self, y: np.ndarray) -> float:
        """Return the smallest margin at random positions and at the grid's [N]."""
        poses = self.requirements.require[0].sampled(AUDITED, np.random.default_rng(0))
        return float(min(self._at(poses).margins(y).min(), self._evaluation.margins(y).min()))


def towline(task: Task) -> np.ndarray:
    """Search as `design` does."""
    return search(task.variables, task.requirements, lambda what, share, best: None).y


def pymoo(task: Task) -> np.ndarray:
    """Search by a genetic algorithm."""
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.core.problem import ElementwiseProblem
    from pymoo.optimize import minimize

    class Layout(ElementwiseProblem):
        def __init__(self) -> None:
            super().__init__(n_var=task.variables.size, n_obj=1, xl=0.0, xu=1.0)

        def _evaluate(self, x: np.ndarray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
            out["F"] = -task.score(x)

    first: Any = task.draws()  # pymoo's annotation permits only its own samplings
    algorithm = GA(pop_size=POPULATION, sampling=first)
    left = max(task.until - time.perf_counter(), 1e-3)
    found = minimize(Layout(), algorithm, ("time", left), seed=int(task.rng.integers(2**31)))
    return task.layout(np.asarray(found.X))


def cma(task: Task, drawn: bool) -> np.ndarray:
    """Search by CMA-ES from the middle of the bounds, or from the best random layouts: from the next when converged."""
    from cma import CMAEvolutionStrategy

    best, value = np.zeros(task.variables.size), -np.inf
    starts, deviation = (task.draws(), 0.2) if drawn else (np.full((1, task.variables.size), 0.5), 0.3)
    for start in cycle(starts):
        options = {"bounds": [0, 1], "seed": int(task.rng.integers(1, 2**31)), "verbose": -9}
        strategy = CMAEvolutionStrategy(start, deviation, options)
        while not strategy.stop() and time.perf_counter() < task.until:
            shares = strategy.ask()
            values = [task.score(share) for share in shares]
            strategy.tell(shares, [-each for each in values])
            if max(values) > value:
                best, value = np.array(shares[int(np.argmax(values))]), max(values)
        if time.perf_counter() > task.until:
            break
    return task.layout(best)


CONTENDERS: dict[str, Callable[[Task], np.ndarray]] = {
    "towline": towline,
    "pymoo GA": pymoo,
    "cma": partial(cma, drawn=False),
    "cma, drawn": partial(cma, drawn=True),
}


def measure(name: str, seconds: float, runs: int) -> dict[str, list[float]]:
    """Return the judged margins of each contender for a robot [N], alternating."""
    found: dict[str, list[float]] = {contender: [] for contender in CONTENDERS}
    for turn, (contender, run) in alternating([*CONTENDERS.items()], runs):
        task = Task(name, seconds, turn)
        found[contender].append(task.judged(run(task)))
    return found


def table(found: dict[str, dict[str, list[float]]]) -> list[str]:
    """Return a line for each robot and contender: median, worst and best margin, and the median as a share of ours."""
    rows = []
    for name, margins in found.items():
        ours = float(np.median(margins["towline"]))
        for contender, each in margins.items():
            median = float(np.median(each))
            rows.append(
                (name, contender, *(f"{x:.1f}" for x in (median, min(each), max(each))), f"{median / ours:.2f}")
            )
    return table_of("robot | contender | median [N] | worst [N] | best [N] | ratio to towline", rows, words=2)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=5.0, help="for each search (default: 5)")
    parser.add_argument("--runs", type=int, default=5, help="of each contender (default: 5)")
    options = parser.parse_args()
    if not 0.0 < options.seconds < 1e6 or options.runs < 1:
        parser.error(f"--seconds must be above 0 and --runs 1 or more, got {options.seconds} and {options.runs}")
    print(machine(("pymoo", "cma", "numpy")))
    print("\n".join(table({name: measure(name, options.seconds, options.runs) for name in BOXES})))


if __name__ == "__main__":
    main()
