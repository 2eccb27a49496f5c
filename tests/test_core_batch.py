"""Batches in C: no warning, nothing for sanitizers to find, and the same bits from every compiler and form."""

import subprocess
from itertools import product

import numpy as np
import pytest

from towline import core
from towline.solvers.solution import UNSURE

from .c_programs import FLAGS, WITHOUT_LANES, program_of, require, sources_of, watched_objects
from .soak.exactness import awkward_problem

SOURCES = sources_of("batch", "available_wrench", "distribution", "numbers")
SHAPES = [(1, 3), (3, 3), (3, 7), (6, 3), (6, 6), (6, 7), (6, 8), (6, 12), (6, 32)]


@pytest.fixture(scope="module", params=["gcc", "clang"])
def compiler(request):
    """Return a compiler that has vectors."""
    require(request.param)
    return request.param


@pytest.fixture(scope="module")
def solve(compiler, tmp_path_factory):
    """Return a function that solves batches in a program of their own, which sanitizers watch."""
    parts = watched_objects(tmp_path_factory, SOURCES, compiler=compiler)
    program = program_of(tmp_path_factory, "core_batch.c", parts, compiler=compiler)

    def run(arrays, rho, form):
        rows, n, m = arrays[0].shape
        given = b"".join(np.ascontiguousarray(array, float).tobytes() for array in arrays)
        command = [program, *map(str, (n, m, rows, rho)), form]
        done = subprocess.run(command, input=given, capture_output=True, check=False)
        assert done.returncode == 0, done.stderr.decode()
        return done.stdout

    return run


def of_the_extension(arrays, rho, in_lanes):
    """Solve the same rows by the extension: the bytes of tensions, direction, info, residual and status."""
    rows, n, m = arrays[0].shape
    per = np.array([array[0].size for array in arrays], float)
    results = [np.full(rows * size, float(UNSURE)) for size in (m, n, 2, 1, 1)]
    core.solve_rows(n, m, rho, in_lanes, *map(np.ascontiguousarray, arrays), per, *results)
    return b"".join(array.tobytes() for array in results)


def awkward(n, m, count):
    """Return awkward problems, a third of them with a number that is none, infinite, huge, tiny or negative."""
    rows = [awkward_problem(seed, m, n) for seed in range(count)]
    arrays = [*(np.array(column) for column in zip(*rows, strict=True)), np.ones(count)]
    rng = np.random.default_rng(n + 10 * m)
    for row in range(0, count, 3):
        array = arrays[rng.integers(len(arrays))].reshape(count, -1)
        place = rng.integers(array.shape[1])
        array[row, place] = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-308, 0.0, -1.0])
    return arrays


@pytest.mark.parametrize("lanes", [[], [WITHOUT_LANES]])
def test_no_compiler_has_a_warning(compiler, lanes):
    subprocess.run([compiler, *FLAGS, *lanes, "-fsyntax-only", *SOURCES], check=True)


@pytest.mark.parametrize(("n", "m"), SHAPES)
@pytest.mark.parametrize("rho", [0.0, 1e3])
def test_sanitizers_are_silent_and_bits_are_the_same(solve, n, m, rho):
    """Of as few lanes as there are, of as many, of one row at a time, and of the extension."""
    arrays = awkward(n, m, 61)
    assert solve(arrays, rho, "one") == of_the_extension(arrays, rho, False)
    assert solve(arrays, rho, "plain") == solve(arrays, rho, "best") == of_the_extension(arrays, rho, True)
    assert solve([array[:0] for array in arrays], rho, "best") == b""


@pytest.mark.parametrize(("n", "m"), [(1, 1), (3, 4), (6, 6), (6, 8), (6, 32)])
def test_facets_of_no_matrices_are_refused(n, m):
    number = {1: 1, 4: 6, 6: 6, 8: 56, 32: 201376}[m]
    A, low, high = np.ones((2, n, m)), np.zeros(m), np.ones(m)
    results = [np.empty((2, number, n)), np.empty((2, number)), np.empty((2, number))]
    if m < 32:
        core.facets(A, low, high, *results)
    for position, size in product(range(6), (0, 1)):
        wrong = [A, low, high, *results]
        wrong[position] = np.empty(wrong[position].size - 1 if size else 0)
        with pytest.raises(ValueError, match="wrench matrices"):
            core.facets(*wrong)
    for rows, full in ((n, np.empty(5)), (7, np.empty(2)), (0, np.empty(2)), (n, np.empty(0))):
        with pytest.raises(ValueError, match="wrench matrices"):
            core.full_rank(rows, 1e-9, A, full)
