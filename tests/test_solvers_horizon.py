"""The QP of stages: its answers fulfil conditions that are assembled here a second time, densely, and others agree."""

import signal
import threading
from types import SimpleNamespace

import clarabel
import daqp
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import example, given, settings, strategies as st
from scipy.linalg import block_diag

from towline.base.errors import InputError
from towline.solvers import Horizon

TOLERANCE = 1e-8


def written(given):
    """Return a horizon with these arrays, of which None is zero, and numbers repeat."""
    N, n, m = given["B"].shape
    horizon = Horizon(N, n, m, given["d"].shape[1])
    for name, value in given.items():
        getattr(horizon, name)[...] = 0.0 if value is None else value
    return horizon


def solved(problem, start=None, tolerance=TOLERANCE, iterations=50):
    """Return a horizon that has solved the problem, cold or from another one's solution."""
    horizon = written(problem.arrays)
    horizon.tolerance, horizon.iterations_max = tolerance, iterations
    if start is not None:
        horizon.states[:], horizon.controls[:] = start.states, start.controls
        for own, other in zip(horizon.multipliers, start.multipliers, strict=True):
            own[:] = other
    horizon.solve(warm=start is not None)
    return horizon


def cost_of(problem, states, controls):
    """Return the cost, penalties of broken rows included."""
    x, u, p = states[:-1], controls, problem
    total = 0.5 * np.einsum("ki,kij,kj->", states, p.Q, states) + (p.q * states).sum()
    total += 0.5 * np.einsum("ki,kij,kj->", u, p.R, u) + (p.r * u).sum() + np.einsum("ki,kij,kj->", u, p.S, x)
    excess = np.einsum("kpj,kj->kp", p.C, x) + np.einsum("kpj,kj->kp", p.D, u) - p.d
    excess = np.maximum(excess, 0.0)
    return total + (p.penalty * excess + 0.5 * p.square * excess**2).sum()


def random_problem(seed, N=6, n=4, m=3, p=0, radius=1.0, width=1.0, scaled=False, **other):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(N, n, n))
    A *= radius / np.maximum(np.abs(np.linalg.eigvals(A)).max(axis=1), 1e-3)[:, None, None]
    J = rng.normal(size=(N + 1, n + m, n + m)) / np.sqrt(n + m)
    cost = J @ J.transpose(0, 2, 1) + 1e-3 * np.eye(n + m)
    given = {
        "A": A,
        "B": rng.normal(size=(N, n, m)),
        "start": 2 * rng.normal(size=n),
        "Q": cost[:, m:, m:],
        "R": cost[:N, :m, :m],
        "S": cost[:N, :m, m:],
        "c": 0.1 * rng.normal(size=(N, n)),
        "q": rng.normal(size=(N + 1, n)),
        "r": rng.normal(size=(N, m)),
        "u_min": -width * rng.uniform(size=(N, m)),
        "u_max": width * rng.uniform(size=(N, m)),
        "C": rng.normal(size=(N, p, n)),
        "D": rng.normal(size=(N, p, m)),
        "d": rng.normal(size=(N, p)),
        "penalty": 10 ** rng.uniform(-1, 2, size=(N, p)),
        "square": rng.choice([0.0, 1.0], size=(N, p)),
    }
    if scaled:
        x, u, cost = 10 ** rng.uniform(-3, 3, n), 10 ** rng.uniform(-3, 3, m), 10 ** rng.uniform(-6, 6)
        given |= {"A": x[:, None] * given["A"] / x, "B": x[:, None] * given["B"] / u, "C": given["C"] / x}
        given |= {"Q": cost * given["Q"] / x / x[:, None], "R": cost * given["R"] / u / u[:, None]}
        given |= {"S": cost * given["S"] / x / u[:, None], "q": cost * given["q"] / x, "r": cost * given["r"] / u}
        given |= {name: given[name] * x for name in ("c", "start")} | {"D": given["D"] / u}
        given |= {name: given[name] * u for name in ("u_min", "u_max")}
        given |= {name: cost * given[name] for name in ("penalty", "square")}
    horizon = written(given | other)
    arrays = {name: getattr(horizon, name).copy() for name in given}
    return SimpleNamespace(N=N, n=n, m=m, p=p, arrays=arrays, **arrays)


def dense(problem):
    """Return H, h, G, g, E, d of 1/2 z'Hz + h'z, G z = g and E z <= d for z = (u_0, x_1, u_1, ..., x_N)."""
    N, n, m, p = problem.N, problem.n, problem.m, problem.p
    size = N * (m + n)
    H, h = np.zeros((size, size)), np.zeros(size)
    G, g, E, d = np.zeros((N * n, size)), np.zeros(N * n), np.zeros((N * p, size)), np.zeros(N * p)

    def u(k):
        return slice(k * (m + n), k * (m + n) + m)

    def x(k):
        return slice(k * (m + n) - n, k * (m + n))

    for k in range(N):
        H[u(k), u(k)], h[u(k)] = problem.R[k], problem.r[k]
        row, soft = slice(k * n, k * n + n), slice(k * p, k * p + p)
        G[row, u(k)], G[row, x(k + 1)], g[row] = problem.B[k], -np.eye(n), -problem.c[k]
        E[soft, u(k)], d[soft] = problem.D[k], problem.d[k]
        if k == 0:
            h[u(k)] += problem.S[k] @ problem.start
            g[row] -= problem.A[k] @ problem.start
            d[soft] -= problem.C[k] @ problem.start
        else:
            H[u(k), x(k)], H[x(k), u(k)] = problem.S[k], problem.S[k].T
            G[row, x(k)], E[soft, x(k)] = problem.A[k], problem.C[k]
        H[x(k + 1), x(k + 1)], h[x(k + 1)] = problem.Q[k + 1], problem.q[k + 1]
    return H, h, G, g, E, d


def stacked(states, controls):
    return np.concatenate([controls, states[1:]], axis=1).ravel()


def check_optimality(problem, solution, tolerance=1e-7):
    """Check the conditions of optimality by `dense`, each relative to the largest of its terms."""
    H, h, G, g, E, d = dense(problem)
    z = stacked(solution.states, solution.controls)
    y, lower, upper, force = (part.ravel() for part in solution.multipliers)
    bounds = np.zeros((problem.N, problem.m + problem.n))
    bounds[:, : problem.m] = solution.multipliers.upper - solution.multipliers.lower
    # Multipliers of the dynamics that end in a state are a term of their own: those that begin there may cancel them.
    own = np.zeros_like(bounds)
    own[:, problem.m :] = -solution.multipliers.dynamics.reshape(problem.N, -1)
    terms = np.array([H @ z, h, own.ravel(), G.T @ y - own.ravel(), E.T @ force, bounds.ravel()])
    # A state or control has one unit at all stages.
    each = np.abs(terms).max(axis=0).reshape(problem.N, -1).max(axis=0)
    left = np.abs(terms.sum(axis=0)).reshape(problem.N, -1).max(axis=0)
    assert (left <= tolerance * each + 1e-15).all()
    assert np.abs(G @ z - g).max() <= 1e-12 * max(1.0, np.abs(G).max() * np.abs(z).max())
    u, low, high = solution.controls, problem.u_min, problem.u_max
    assert ((low <= u) & (u <= high)).all()
    assert lower.min() >= 0 <= upper.min()
    weight = each[: problem.m] + 1e-15
    size = np.abs(u).max(axis=0) + np.where(np.isfinite(high - low), high - low, 1.0).max(axis=0)
    for multiplier, slack in ((solution.multipliers.lower, u - low), (solution.multipliers.upper, high - u)):
        assert (multiplier[np.isinf(slack)] == 0).all()
        assert (multiplier * np.where(np.isfinite(slack), slack, 0.0) <= 10 * tolerance * weight * size).all()
    excess = (E @ z - d).reshape(problem.N, problem.p)
    force, most = solution.multipliers.rows, problem.penalty + problem.square * np.maximum(excess, 0.0)
    assert ((force >= 0) & (force <= most * (1 + 1e-6) + 1e-9)).all()
    off = np.where(excess < 0, -force * excess, (most - force) * excess)
    reach = np.abs(E @ z).max(initial=0) + np.abs(d).max(initial=0)
    assert (np.abs(off) <= 100 * tolerance * reach * max(most.max(initial=0), 1e-15)).all()


def by_clarabel(problem):
    """Return states and controls of the optimum."""
    H, h, G, g, E, d = dense(problem)
    size, p = len(h), len(d)
    free = problem.u_min.ravel(), problem.u_max.ravel()
    pick = np.zeros((problem.N * problem.m, size))
    for row in range(len(pick)):
        k, i = divmod(row, problem.m)
        pick[row, k * (problem.m + problem.n) + i] = 1.0
    P = sp.csc_matrix(block_diag(H, np.diag(problem.square.ravel())))
    low, high = np.isfinite(free[0]), np.isfinite(free[1])
    A = np.block(
        [
            [G, np.zeros((len(g), p))],
            [-pick[low], np.zeros((low.sum(), p))],
            [pick[high], np.zeros((high.sum(), p))],
            [E, -np.eye(p)],
            [np.zeros((p, size)), -np.eye(p)],
        ]
    )
    b = np.concatenate([g, -free[0][low], free[1][high], d, np.zeros(p)])
    cones = [clarabel.ZeroConeT(len(g)), clarabel.NonnegativeConeT(len(b) - len(g))]
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = 1e-11
    cost = np.concatenate([h, problem.penalty.ravel()])
    found = clarabel.DefaultSolver(sp.triu(P, format="csc"), cost, sp.csc_matrix(A), b, cones, options).solve()
    z = np.array(found.x)[:size].reshape(problem.N, -1)
    return np.vstack([problem.start, z[:, problem.m :]]), z[:, : problem.m]


@pytest.mark.parametrize("seed", range(12))
def test_conditions_hold_and_clarabel_agrees(seed):
    problem = random_problem(seed, p=seed % 3, N=3 + seed)
    solution = solved(problem)
    assert solution.converged
    assert max(solution.residuals) <= TOLERANCE
    check_optimality(problem, solution)
    states, controls = by_clarabel(problem)
    ours, theirs = cost_of(problem, solution.states, solution.controls), cost_of(problem, states, controls)
    assert abs(ours - theirs) <= 1e-6 * (1 + abs(theirs))
    # Where a multiplier and a distance to a bound are both nearly 0, controls depend on the tolerance's square root.
    exact = solved(problem, tolerance=1e-11)
    np.testing.assert_allclose(exact.controls, controls, atol=2e-5)


def test_daqp_agrees_on_the_condensed_problem():
    problem = random_problem(5, N=8, n=5, m=2)
    H, h, G, g, _, _ = dense(problem)
    # z = F v + f for the controls v alone.
    states = np.zeros(H.shape[0], dtype=bool)
    states.reshape(8, -1)[:, 2:] = True
    F = np.zeros((H.shape[0], 16))
    F[~states] = np.eye(16)
    F[states] = -np.linalg.solve(G[:, states], G[:, ~states])
    f = np.zeros(H.shape[0])
    f[states] = np.linalg.solve(G[:, states], g)
    cost, slope = F.T @ H @ F, F.T @ (H @ f + h)
    v, _, flag, _ = daqp.solve(
        0.5 * (cost + cost.T),
        slope,
        np.zeros((0, 16)),
        problem.u_max.ravel(),
        problem.u_min.ravel(),
        np.zeros(16, dtype=np.int32),
    )
    assert flag == 1
    np.testing.assert_allclose(solved(problem).controls.ravel(), v, atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 10**6),
    st.integers(1, 12),
    st.integers(1, 12),
    st.integers(1, 9),
    st.integers(0, 3),
    st.floats(0.3, 1.4),
    st.booleans(),
)
@example(seed=10, N=10, n=3, m=1, p=0, radius=1.38671875, scaled=False)
def test_conditions_hold_for_all_sizes(seed, N, n, m, p, radius, scaled):
    problem = random_problem(seed, N, n, m, p, radius, scaled=scaled)
    solution = solved(problem)
    assert ((problem.u_min <= solution.controls) & (solution.controls <= problem.u_max)).all()
    assert solution.converged == (max(solution.residuals) <= TOLERANCE)
    if not scaled:
        assert solution.converged
        check_optimality(problem, solution)


def test_units_change_nothing():
    """The same problem in other units of states, controls and cost has the same residuals and iterations."""
    one, other = random_problem(3, p=1), random_problem(3, p=1, scaled=True)
    a, b = solved(one), solved(other)
    assert a.converged
    assert b.converged
    assert a.iterations == b.iterations
    scale = other.u_max / one.u_max
    np.testing.assert_allclose(b.controls / scale, a.controls, atol=1e-6)


@pytest.mark.parametrize(("N", "n", "m"), [(1, 1, 1), (1, 5, 3), (40, 2, 1), (2, 28, 12)])
def test_smallest_and_largest(N, n, m):
    problem = random_problem(1, N, n, m)
    solution = solved(problem)
    assert solution.converged
    check_optimality(problem, solution)


def test_equal_bounds_fix_controls_exactly():
    problem = random_problem(2)
    low, high = problem.u_min.copy(), problem.u_max.copy()
    low[::2, 0] = high[::2, 0] = 0.1 + 0.2
    low[1, 1], high[1, 1] = 0.3, np.nextafter(0.3, 1)
    problem = random_problem(2, u_min=low, u_max=high)
    solution = solved(problem)
    assert (solution.controls[::2, 0] == 0.1 + 0.2).all()
    assert 0.3 <= solution.controls[1, 1] <= np.nextafter(0.3, 1)
    check_optimality(problem, solution)


def test_without_bounds_it_is_the_linear_quadratic_regulator():
    problem = random_problem(4, u_min=-np.inf, u_max=np.inf)
    solution = solved(problem)
    H, h, G, g, _, _ = dense(problem)
    matrix = np.block([[H, G.T], [G, np.zeros((len(g), len(g)))]])
    expected = np.linalg.solve(matrix, np.concatenate([-h, g]))
    np.testing.assert_allclose(stacked(solution.states, solution.controls), expected[: len(h)], atol=1e-9)
    np.testing.assert_allclose(solution.multipliers.dynamics.ravel(), expected[len(h) :], atol=1e-9)
    assert solution.iterations <= 1


def test_one_sided_bounds():
    problem = random_problem(6, u_min=0.0, u_max=np.inf)
    solution = solved(problem)
    assert solution.converged
    check_optimality(problem, solution)


def test_cost_of_states_alone():
    problem = random_problem(7, m=2, R=np.zeros((6, 2, 2)), S=None, r=None, Q=np.tile(np.eye(4), (7, 1, 1)))
    solution = solved(problem)
    assert solution.converged
    check_optimality(problem, solution)


def test_a_large_penalty_is_a_constraint_and_a_small_one_is_paid():
    tight = {"C": np.zeros((6, 1, 4)), "D": np.ones((6, 1, 3)), "d": np.full((6, 1), -0.2), "square": 0.0}
    strict = solved(random_problem(8, p=1, **tight, penalty=1e4))
    assert strict.converged
    assert strict.controls.sum(axis=1).max() <= -0.2 + 1e-7
    loose = solved(random_problem(8, p=1, **tight, penalty=1e-3))
    assert loose.controls.sum(axis=1).max() > -0.2
    broken = loose.controls.sum(axis=1) > -0.2 + 1e-6
    np.testing.assert_allclose(loose.multipliers.rows[broken], 1e-3, rtol=1e-4)


def test_states_are_the_trajectory_of_the_controls():
    problem = random_problem(9, N=30, radius=1.3)
    solution = solved(problem)
    x = problem.start
    for k in range(problem.N):
        following = problem.A[k] @ x + problem.B[k] @ solution.controls[k] + problem.c[k]
        np.testing.assert_allclose(solution.states[k + 1], following, rtol=1e-12, atol=1e-13)
        x = solution.states[k + 1]


def test_a_warm_start_gives_the_same_in_fewer_iterations():
    fewer = 0
    for seed in range(10):
        problem = random_problem(seed, N=10, p=seed % 2)
        cold = solved(problem)
        moved = random_problem(seed, N=10, p=seed % 2, start=problem.start * 1.01)
        again, warm = solved(moved, tolerance=1e-11), solved(moved, cold, tolerance=1e-11)
        assert warm.converged
        np.testing.assert_allclose(warm.controls, again.controls, atol=2e-5)
        fewer += again.iterations - warm.iterations
    assert fewer > 10


def test_a_shifted_start_in_a_loop():
    """A constant plant: the shifted solution needs fewer iterations than none, and gives the same."""
    one = random_problem(10, N=1, n=6, m=3)
    names = ("A", "B", "R", "S", "r", "u_min", "u_max")
    same = {name: np.repeat(getattr(one, name), 15, axis=0) for name in names}
    same |= {"Q": np.repeat(one.Q[:1], 16, axis=0), "q": np.repeat(one.q[:1], 16, axis=0), "c": None}
    problem = random_problem(10, N=15, n=6, m=3, **same)
    horizon, other = written(problem.arrays), written(problem.arrays)
    horizon.tolerance = other.tolerance = 1e-11
    assert horizon.solve()
    shifted = cold = 0
    for _ in range(10):
        horizon.start[:] = other.start[:] = horizon.states[1]
        assert horizon.solve(shifted=True)
        assert other.solve()
        np.testing.assert_allclose(horizon.controls, other.controls, atol=2e-5)
        shifted, cold = shifted + horizon.iterations, cold + other.iterations
    assert shifted < cold


@pytest.mark.parametrize("seed", range(4))
def test_differences_from_a_reference_have_the_solution_less_the_reference(seed):
    """The cost (z - z_ref)' H (z - z_ref) / 2 written out, and the same in differences, without linear cost."""
    rng = np.random.default_rng(seed)
    one = random_problem(seed, N=7, p=seed % 3, q=None, r=None, S=None)
    states, controls = rng.normal(size=(8, 4)), rng.normal(size=(7, 3))
    q, r = -np.einsum("kij,kj->ki", one.Q, states), -np.einsum("kij,kj->ki", one.R, controls)
    expected = solved(random_problem(seed, N=7, p=seed % 3, q=q, r=r, S=None), tolerance=1e-11)
    horizon = written(one.arrays)
    horizon.tolerance = 1e-11
    horizon.relative_to(states, controls)
    assert horizon.solve()
    np.testing.assert_allclose(horizon.controls + controls, expected.controls, atol=1e-6)
    np.testing.assert_allclose(horizon.states + states, expected.states, atol=1e-6)
    for own, other in zip(horizon.multipliers, expected.multipliers, strict=True):
        np.testing.assert_allclose(own, other, atol=1e-5)
    with pytest.raises(InputError, match="controls must have shape"):
        horizon.relative_to(states, controls[1:])


@pytest.mark.parametrize("name", ["A", "B", "start", "Q", "R", "c", "q", "r", "C", "d", "penalty", "u_min"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_nonsense_is_answered_inside_bounds_and_forgotten(name, value):
    problem = random_problem(11, p=2)
    horizon = written(problem.arrays)
    expected = solved(problem)
    getattr(horizon, name).flat[-1] = value
    for way in ({}, {"warm": True}, {"shifted": True}):
        horizon.solve(**way)
        u = horizon.controls
        assert np.isfinite(u).all()
        assert not ((u < problem.u_min) & (u < horizon.u_min)).any()
        assert (u <= horizon.u_max).all()
    if name not in ("u_min", "C", "d", "penalty"):
        assert not horizon.converged
    getattr(horizon, name)[...] = getattr(problem, name)
    for way in ({"warm": True}, {}):
        assert horizon.solve(**way)
        np.testing.assert_allclose(horizon.controls, expected.controls, atol=2e-5)


def test_few_iterations_are_reported_and_usable():
    problem = random_problem(12, N=20)
    solution = solved(problem, iterations=2)
    assert not solution.converged
    assert solution.iterations == 2
    assert ((problem.u_min <= solution.controls) & (solution.controls <= problem.u_max)).all()


def solve_again_and_again(horizon):
    for _ in range(100_000):
        horizon.solve()


def test_an_interrupt_leaves_nothing_that_breaks_the_next_solve():
    problem = random_problem(13, N=40, n=12, m=6)
    horizon = written(problem.arrays)
    assert horizon.solve()
    expected = horizon.controls.copy()
    timer = threading.Timer(0.05, signal.raise_signal, [signal.SIGINT])
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores interrupts
    try:
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            solve_again_and_again(horizon)
        timer.join()
    finally:
        signal.signal(signal.SIGINT, before)
    assert horizon.solve()
    np.testing.assert_array_equal(horizon.controls, expected)


def test_nothing_is_allocated():
    import tracemalloc

    horizon = written(random_problem(14, N=20, n=8, m=4).arrays)
    horizon.solve()
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(20):
        horizon.solve(shifted=True)
    grown = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    assert grown < 2000


def test_wrong_calls_are_refused():
    with pytest.raises(InputError, match="N must be"):
        Horizon(0, 1, 1)
    with pytest.raises(InputError, match="warm must be True or False"):
        Horizon(1, 1, 1).solve(warm=3)
