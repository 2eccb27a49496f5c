"""Count which solvers detect that a QP has no solution; qpbenchmark itself scores solvable QPs only.

    python infeasible.py [--settings high_accuracy]

Runs every solver of the test set on `data/cdpr_infeasible.parquet` and writes `results/cdpr_infeasible.md`. A solver is
right if it returns without a solution, for whatever reason: an iteration limit counts as well as a proof.
"""

import argparse
import logging
import warnings
from pathlib import Path
from statistics import median

import qpbenchmark
from cdpr_qpbenchmark import HERE, CdprQpbenchmark
from qpbenchmark.utils import get_cpu_info_summary, time_solve_problem

DATA = HERE / "data" / "cdpr_infeasible.parquet"


class CdprInfeasible(CdprQpbenchmark):
    """The QPs without a solution, with the settings of the test set."""

    data = DATA


def measure(test_set: qpbenchmark.TestSet, settings: str) -> list[tuple[str, int, int, float, float]]:
    """Return for each solver: how many it got right, of how many, median and longest time [us]."""
    problems = list(test_set)
    rows = []
    for solver in sorted(test_set.solvers):
        options = test_set.solver_settings[settings][solver]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answers = [time_solve_problem(problem, solver, **options) for problem in problems]
        right = sum(not solution.found for solution, _ in answers)
        times = [1e6 * runtime for _, runtime in answers]
        rows.append((solver, right, len(problems), median(times), max(times)))
    return rows


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--settings", default="high_accuracy")
    parser.add_argument("--out", type=Path, default=HERE / "results" / "cdpr_infeasible.md")
    options = parser.parse_args()
    logging.disable(logging.WARNING)  # exceptions of solvers are logged, and are answers here
    rows = measure(CdprInfeasible(), options.settings)
    lines = ["# Infeasible QPs", "", f"{get_cpu_info_summary()}; settings {options.settings}; cold calls.", ""]
    lines += ["| solver | right | of | median us | longest us |", "|---|---:|---:|---:|---:|"]
    lines += [f"| {name} | {right} | {of} | {middle:.0f} | {most:.0f} |" for name, right, of, middle, most in rows]
    options.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(options.out.read_text(encoding="utf-8"), end="")


if __name__ == "__main__":
    main()
