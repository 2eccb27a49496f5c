"""Tension distribution of cable-driven parallel robots: a test set for qpbenchmark.

    python cdpr_qpbenchmark.py run --author NAME

Needs qpbenchmark alone; where the package towline is installed, its solver takes part.
"""

import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import qpbenchmark
from qpbenchmark.benchmark import main

HERE = Path(__file__).resolve().parent
DATA = HERE / "data" / "cdpr.parquet"

# [s]. These QPs take microseconds: 10 ms is no result to a 1 kHz controller, and with the default of 10 s a single
# failure would outweigh a million good answers in the mean.
RUNTIME = 0.01

if find_spec("towline") is not None:
    from towline.benchmarks.qp_solver import register

    register()  # before the class is built, which reads the list of qpsolvers


class CdprQpbenchmark(qpbenchmark.ParquetTestSet):
    """Every QP of `data/cdpr.parquet`, in the order of the names."""

    data = DATA

    @property
    def title(self) -> str:
        """Return the title of the report."""
        return "Cable-driven parallel robots test set"

    @property
    def description(self) -> str:
        """Return the description in the report."""
        return (
            "Tension distribution of cable-driven parallel robots: least-norm tensions inside their limits that give "
            "a wrench. In units of the largest tension limit."
        )

    @property
    def sparse_only(self) -> bool:
        """Return False: the matrices are dense."""
        return False

    def __init__(self) -> None:
        super().__init__(self.data)

    def __iter__(self) -> Iterator[qpbenchmark.Problem]:
        """Yield the problems in the order of their names, which no file system changes."""
        yield from sorted(super().__iter__(), key=lambda problem: problem.name)

    def define_tolerances(self, runtime: float = RUNTIME) -> None:
        """Keep qpbenchmark's accuracies, with a time limit fit for tiny problems."""
        super().define_tolerances(runtime=runtime)

    def define_solver_settings(self) -> None:
        """Give towline, if it takes part, the same tolerances as the other solvers."""
        super().define_solver_settings()
        if "towline" in self.solvers:
            for accuracy in ("low_accuracy", "mid_accuracy", "high_accuracy"):
                self.solver_settings[accuracy].set_param("towline", "eps_abs", self.tolerances[accuracy].primal)


if __name__ == "__main__":
    results = HERE / "results" / "qpbenchmark_results.csv"
    main(test_set_path=os.path.abspath(__file__), results_path=str(results))
