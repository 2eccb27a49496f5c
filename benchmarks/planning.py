"""Time paper F's circle with the base free: towline against CasADi by hand, Opti and rockit, in one run.

    python -m towline.benchmarks.planning [--steps 100] [--runs 5] [--figure cost.png]

What each contender does is in `planning_contenders`. Every solution is audited by towline's audit; one that does not
pass ends the benchmark with code 1. "Again" is the same program solved once more, from its own solution. The contenders
take turns; each figure is the median of the runs.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import median

import numpy as np

from .machine import machine
from .planning_contenders import CONTENDERS, Run

STEPS = (50, 100, 200, 400, 800, 1600)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=100, help="intervals (default: 100)")
    parser.add_argument("--runs", type=int, default=5, help="of each contender (default: 5)")
    parser.add_argument("--figure", type=Path, help="PNG of towline's time against the number of intervals")
    options = parser.parse_args()
    if options.steps < 4:
        parser.error(f"--steps must be 4 or more, got {options.steps}")
    if options.runs < 1:
        parser.error(f"--runs must be 1 or more, got {options.runs}")
    print(machine(("casadi", "rockit-meco", "numpy")))
    runs = measure(options.steps, options.runs)
    print("\n".join(table(runs)))
    if options.figure is not None:
        times = [median(CONTENDERS["towline"](steps).first for _ in range(options.runs)) for steps in STEPS]
        for steps, seconds in zip(STEPS, times, strict=True):
            print(f"towline, {steps} steps: {seconds:.3f} s, {1e3 * seconds / steps:.2f} ms a step")
        draw(times, options.figure)
    if not all(audit.passed for each in runs.values() for run in each for audit in run.audits):
        raise SystemExit(1)


def measure(steps: int, count: int) -> dict[str, list[Run]]:
    """Return `count` runs of each contender on `steps` intervals, one contender after the other in each round."""
    runs: dict[str, list[Run]] = {name: [] for name in CONTENDERS}
    for _ in range(count):
        for name, contender in CONTENDERS.items():
            runs[name].append(contender(steps))
    return runs


def table(runs: dict[str, list[Run]]) -> list[str]:
    """Return a line for each contender: medians, their ratios to towline's, and the worst of the audits."""
    ours = _medians(runs["towline"])
    lines = [f"{'':16}{'build and first solve':>24}{'again':>12}{'ratios to towline':>22}   audit"]
    for name, each in runs.items():
        first, again = _medians(each)
        audits = [audit for run in each for audit in run.audits]
        passed = "passed" if all(audit.passed for audit in audits) else "NOT PASSED"
        worst = max(float(audit.violation.max()) for audit in audits)
        ratios = f"{first / ours[0]:.2f}, {again / ours[1]:.2f}"
        lines.append(f"{name:16}{first:22.3f} s{again:10.3f} s{ratios:>22}   {passed}, short by {worst:.1e} N at most")
    return lines


def _medians(runs: list[Run]) -> tuple[float, float]:
    return median(run.first for run in runs), median(run.again for run in runs)


def draw(times: list[float], path: Path) -> None:
    """Draw towline's time against the number of steps, with a line of constant cost a step and 20 % above it."""
    from ..figures import style

    canvas = style.figure()
    ax = style.axes(canvas, "intervals N", "build and solve [s]")
    steps = np.array(STEPS, dtype=float)
    ax.loglog(steps, times, "o-", color=style.colour(0), label="towline")
    linear = times[0] * steps / steps[0]
    ax.loglog(steps, linear, **style.LIMIT, label="linear from N = 50")
    ax.legend(fontsize="small")
    style.save(canvas, path)


if __name__ == "__main__":
    main()
