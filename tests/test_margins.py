"""Capacity margins of many wrenches by the Gale dual: against projections, facets and differences."""

import subprocess
from itertools import product
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from towline import core
from towline.solvers import TensionProblem, capacity_margin
from towline.solvers.margin import all_reserves, margins, reserves

from .c_programs import program_of, sources_of, watched_objects
from .problems import geometric_matrix


def one_by_one(A, w, t_min, t_max):
    """Margins of `capacity_margin`, which finds normals by singular values and projects."""
    return np.array([capacity_margin(TensionProblem(each, w, t_min, t_max)).value for each in A])


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 6), st.integers(0, 4), st.integers(0, 2**32 - 1))
def test_margins_inside_are_those_of_single_problems(n, more, seed):
    rng = np.random.default_rng(seed)
    m = min(n + more, 10)
    A, t_min, t_max = rng.normal(size=(5, n, m)), rng.uniform(0, 5, m), rng.uniform(20, 90, m)
    w = np.einsum("knm,m->kn", A, rng.uniform(t_min, t_max)).mean(axis=0)
    found, expected = margins(A, w, t_min, t_max), one_by_one(A, w, t_min, t_max)
    inside = expected > 0
    np.testing.assert_allclose(found[inside], expected[inside], atol=1e-10)
    assert (found[~inside] < 1e-10).all()
    assert (found[~inside] >= expected[~inside] - 1e-10).all()


def test_awkward_matrices_are_left_to_the_facets():
    """Parallel, equal and missing columns, matrices at and near rank 5, a flat set, a cable with one tension."""
    rng = np.random.default_rng(3)
    A = np.repeat(geometric_matrix(rng, 8)[None], 8, axis=0)
    A[1, :, 7] = A[1, :, 6]
    A[2, :, 7] = -2 * A[2, :, 6]
    A[3, :, 7] = 0.0
    A[4, 5] = 0.0
    A[5, 5] = A[5, 4] + 1e-6 * rng.normal(size=8)
    A[6, :, 7] = A[6, :, 6] * (1 + 1e-9) + 1e-7 * A[6, :, 0]
    A[7, :, 4:] = A[7, :, :4]
    t_min, t_max = np.full(8, 1.0), np.full(8, 50.0)
    for low, high in ((t_min, t_max), (t_min, np.r_[1.0, t_max[1:]])):
        for k in range(8):
            w = A[k] @ np.linspace(low, high, 9)[3]
            expected = one_by_one(A[k : k + 1], w, low, high)
            np.testing.assert_allclose(margins(A[k : k + 1], w, low, high), expected, rtol=1e-6, atol=1e-9)
            least = all_reserves(A[k : k + 1], w, low, high).min()
            assert least == pytest.approx(expected[0], rel=1e-6, abs=1e-9)
    A[0, 0, 0] = np.nan
    assert margins(A, np.zeros(6), t_min, t_max)[0] == -np.inf
    assert margins(A[:0], np.zeros(6), t_min, t_max).shape == (0,)


@pytest.mark.parametrize(("n", "m"), [(2, 4), (3, 4), (6, 6), (6, 7), (6, 8), (6, 9)])
def test_derivatives_are_those_of_differences(n, m):
    rng = np.random.default_rng(n + m)
    A, t_min, t_max = rng.normal(size=(40, n, m)), rng.uniform(0, 5, m), rng.uniform(20, 90, m)
    w = A @ rng.uniform(t_min, t_max)
    every = all_reserves(A, w, t_min, t_max)
    np.testing.assert_array_equal(every.min(axis=1), margins(A, w, t_min, t_max))
    found = reserves(A, w, t_min, t_max, every.argmin(axis=1))
    np.testing.assert_allclose(found.value, every.min(axis=1), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found.direction, axis=1), 1.0)
    # The tensions are those of the nearest point of the boundary.
    there = np.einsum("knm,km->kn", A, found.tensions)
    np.testing.assert_allclose(there - w, found.value[:, None] * found.direction, atol=1e-8)
    step = 1e-6
    second = np.partition(every, 1, axis=1)[:, 1] - every.min(axis=1) > 1e-3  # away from kinks
    largest = np.abs(found.tensions).max(axis=1)

    def changes(dA=0.0, dw=0.0, low=0.0, high=0.0):
        ahead, behind = (margins(A + s * dA, w + s * dw, t_min + s * low, t_max + s * high) for s in (step, -step))
        return (ahead - behind) / (2 * step)

    for _ in range(5):
        dA = rng.normal(size=A.shape)
        slope = np.einsum("kn,km,knm->k", found.direction, found.tensions, dA)
        size = largest * np.linalg.norm(found.direction, axis=1)
        assert (np.abs(changes(dA=dA) - slope) < 3e-8 * np.maximum(size, 100))[second].all()
    dw, dt = rng.normal(size=w.shape), rng.normal(size=m)
    assert np.abs(changes(dw=dw) + (found.direction * dw).sum(axis=1))[second].max() < 1e-7
    assert np.abs(changes(high=dt) - np.maximum(found.pull, 0) @ dt)[second].max() < 1e-7
    assert np.abs(changes(low=dt) - np.minimum(found.pull, 0) @ dt)[second].max() < 1e-7


def test_arrays_that_do_not_fit_are_refused():
    A, w, low, high, found, every = (
        np.ones((2, 6, 8)),
        np.ones(6),
        np.zeros(8),
        np.ones(8),
        np.ones(2),
        np.ones((2, 56)),
    )
    core.margins(A, w, low, high, found, every)
    assert np.isnan(found).all()
    for position, change in product(range(6), (-1, 1)):
        wrong = [A, w, low, high, found, every]
        wrong[position] = np.ones(wrong[position].size + change)
        with pytest.raises(ValueError, match="wrench matrices"):
            core.margins(*wrong)
    with pytest.raises(ValueError, match="wrench matrices"):
        core.margins(np.ones((2, 6, 11)), w, np.zeros(11), np.ones(11), found, None)


@pytest.mark.parametrize("lanes", [True, False])
def test_sanitizers_are_silent_and_bits_are_the_same(tmp_path_factory, lanes):
    """With none, infinite, huge and tiny numbers, and of as many rows as there are lanes, more, and one."""
    parts = watched_objects(tmp_path_factory, sources_of("available_wrench"), lanes=lanes)
    program = program_of(tmp_path_factory, "core_margins.c", parts)
    rng = np.random.default_rng(9)
    for (n, m), rows in product([(1, 1), (2, 5), (6, 6), (6, 8), (6, 10)], (1, 19)):
        arrays = [rng.normal(size=(rows, n, m)), rng.normal(size=(rows, n)), np.ones(m), rng.uniform(10, 20, m)]
        for array in arrays[:2]:
            array.flat[rng.integers(array.size, size=3)] = rng.choice([np.nan, np.inf, -np.inf, 1e308, 1e-308, 0.0], 3)
        expected = [np.empty(rows), np.empty((rows, comb(m, n - 1)))]
        core.margins(*arrays, *expected)
        for processor in range(core.PROCESSOR + 1 if lanes else 1):
            sent = b"".join(array.tobytes() for array in arrays)
            command = [program, *map(str, (n, m, rows, processor))]
            done = subprocess.run(command, input=sent, capture_output=True, check=False)
            assert done.returncode == 0, done.stderr.decode()
            np.testing.assert_array_equal(
                np.frombuffer(done.stdout), np.concatenate([each.ravel() for each in expected])
            )
