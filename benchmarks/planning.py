"""Time paper F's circle with the base free: towline against CasADi by hand and rockit, in one run.

    python -m towline.benchmarks.planning [--steps 100] [--runs 5]

What each contender does is in `planning_contenders`. Every solution is audited by towline's audit; one that does not
pass ends the benchmark with code 1. "Again" is the same program solved once more, from its own solution. The contenders
alternate; times are medians of the runs, and ratios, to towline, medians of those in one turn.
"""

import argparse

import numpy as np

from .harness import alternating, machine, ratio
from .harness import table as table_of
from .planning_contenders import CONTENDERS, Run


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=100, help="intervals (default: 100)")
    parser.add_argument("--runs", type=int, default=5, help="of each contender (default: 5)")
    options = parser.parse_args()
    if options.steps < 4 or options.runs < 1:
        parser.error(f"--steps must be 4 or more and --runs 1 or more, got {options.steps} and {options.runs}")
    print(machine(("casadi", "rockit-meco", "numpy")))
    runs = measure(options.steps, options.runs)
    print("\n".join(table(runs)))
    if not all(audit.passed for each in runs.values() for run in each for audit in run.audits):
        raise SystemExit(1)


def measure(steps: int, count: int) -> dict[str, list[Run]]:
    """Return `count` runs of each contender on `steps` intervals, alternating."""
    runs: dict[str, list[Run]] = {name: [] for name in CONTENDERS}
    for _, (name, contender) in alternating([*CONTENDERS.items()], count):
        runs[name].append(contender(steps))
    return runs


def table(runs: dict[str, list[Run]]) -> list[str]:
    """Return a line for each contender: medians, their ratios to towline's, and the worst of the audits."""
    rows = []
    for name, each in runs.items():
        cells = [name]
        for kind in ("first", "again"):
            times, ours = ({turn: getattr(run, kind) for turn, run in enumerate(of)} for of in (each, runs["towline"]))
            cells += [f"{np.median([*times.values()]):.3f} s", f"{ratio(times, ours):.2f}"]
        audits = [audit for run in each for audit in run.audits]
        passed = "passed" if all(audit.passed for audit in audits) else "NOT PASSED"
        worst = max(float(audit.violation.max()) for audit in audits)
        rows.append((*cells, f"{passed}, short by {worst:.1e} N at most"))
    return table_of("contender | build and first solve | ratio | again | ratio | audit", rows)


if __name__ == "__main__":
    main()
