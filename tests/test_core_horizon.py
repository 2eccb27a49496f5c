"""Predictive control in C: sanitizers and compilers are silent, and all processors have the same bits."""

import subprocess
from copy import deepcopy

import numpy as np
import pytest

from towline.core import PROCESSOR, horizon_places, horizon_size, horizon_solve
from towline.solvers import Horizon, horizon

from .c_programs import program_of, require, sources_of, watched_objects
from .test_solvers_horizon import random_problem, written


@pytest.mark.parametrize("vectors", [True, False])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_sanitizers_and_compilers_are_silent(compiler, vectors, tmp_path_factory):
    """Random horizons, and nonsense in each of their arrays, in memory that is exactly as large as it must be."""
    require(compiler)
    parts = watched_objects(tmp_path_factory, sources_of("horizon"), lanes=vectors, compiler=compiler)
    program = program_of(tmp_path_factory, "core_horizon.c", parts, f"-DPROCESSOR={PROCESSOR}", compiler=compiler)
    finished = subprocess.run([program], capture_output=True, text=True)
    assert finished.returncode == 0, finished.stdout + finished.stderr


@pytest.mark.parametrize(("n", "m", "p"), [(1, 1, 0), (18, 9, 2), (12, 8, 0), (24, 9, 0), (7, 5, 3)])
def test_every_form_has_the_same_bits(monkeypatch, n, m, p):
    """The form for processors with AVX2, where there is one, adds in the order of the one for all."""
    problem = random_problem(n, N=8, n=n, m=m, p=p, radius=0.9)
    solutions = []
    for processor in (PROCESSOR, 0):
        monkeypatch.setattr(horizon, "PROCESSOR", processor)
        solver = written(problem.arrays)
        assert solver.solve()
        solutions.append(solver)
    one, other = solutions
    for a, b in zip(
        (one.states, one.controls, *one.multipliers), (other.states, other.controls, *other.multipliers), strict=True
    ):
        np.testing.assert_array_equal(a, b)


def test_a_copy_of_the_memory_has_the_same_solution():
    solver = written(random_problem(3, p=1).arrays)
    assert solver.solve()
    copy = deepcopy(solver)
    assert isinstance(copy, Horizon)
    assert copy.solve(warm=True)
    assert solver.solve(warm=True)
    np.testing.assert_array_equal(copy.controls, solver.controls)


@pytest.mark.parametrize("sizes", [(0, 1, 1, 0), (1, 1, 1001, 0), (1, 1, 1, -1), (10**12, 1, 1, 0)])
def test_sizes_out_of_range_are_refused(sizes):
    with pytest.raises(ValueError, match="whole numbers"):
        horizon_size(*sizes)


def test_memory_of_another_size_is_refused():
    size = horizon_size(2, 3, 1, 0)
    with pytest.raises(ValueError, match=f"{size} numbers, got {size - 1}"):
        horizon_places(2, 3, 1, 0, np.zeros(size - 1))
    with pytest.raises(ValueError, match=f"{size} numbers, got {size + 1}"):
        horizon_solve(2, 3, 1, 0, 0, 0, 50, 1e-8, np.zeros(size + 1), np.zeros(4))
    with pytest.raises(ValueError, match="four numbers"):
        horizon_solve(2, 3, 1, 0, 0, 0, 50, 1e-8, np.zeros(size), np.zeros(3))
