"""A zoo of tension problems, each named for what makes it awkward, and random ones whose status is known beforehand."""

from typing import NamedTuple

import numpy as np

from towline.solvers import TensionProblem

T_MIN, T_MAX = 0.5, 60.0


class Case(NamedTuple):
    problem: TensionProblem
    status: str


def geometric_matrix(rng, m):
    """Return the wrench matrix (6, m) of unit cable directions at attachments within a metre."""
    u = rng.normal(size=(3, m))
    u /= np.linalg.norm(u, axis=0)
    r = rng.uniform(-1.0, 1.0, size=(3, m))
    return np.vstack([u, np.cross(r, u, axis=0)])


def random_tensions(rng, m):
    """Return tensions inside the limits; in every second draw many of them at a limit."""
    t = rng.uniform(T_MIN, T_MAX, m)
    if rng.random() < 0.5:
        t[rng.random(m) < 0.4] = T_MIN
        t[rng.random(m) < 0.3] = T_MAX
    return t


def random_feasible(rng, m):
    A = geometric_matrix(rng, m)
    return TensionProblem(A, A @ random_tensions(rng, m), T_MIN, T_MAX)


def random_infeasible(rng, m):
    """Return a wrench pushed out of the available wrench set along a direction, by 0.001 N to 20 N.

    With fewer than six cables half of the directions lie in the range of A: those are infeasible, the others singular.
    """
    A = geometric_matrix(rng, m)
    d = A @ rng.normal(size=m) if m < 6 and rng.random() < 0.5 else rng.normal(size=6)
    d /= np.linalg.norm(d)
    reach = np.maximum(d @ A * T_MIN, d @ A * T_MAX).sum()
    w = A @ random_tensions(rng, m)
    w += d * (reach - d @ w + 10.0 ** rng.uniform(-3, 1.3))
    return TensionProblem(A, w, T_MIN, T_MAX)


def _zoo():
    rng = np.random.default_rng(2)
    line = np.array([[1.0, -1.0]])
    planar = np.array([[1.0, -1.0, 0.0, 0.5], [0.0, 0.0, 1.0, -1.0]])
    spatial = geometric_matrix(rng, 8)
    inside = rng.uniform(5.0, 40.0, 8)
    flat = spatial.copy()
    flat[3:] = 0.0  # all lines through one point: no moment
    twins = spatial.copy()
    twins[:, 1] = twins[:, 0]
    opposed = spatial.copy()
    opposed[:, 1] = -opposed[:, 0]
    corner = np.where(spatial[2] > 0, T_MAX, T_MIN)
    huge, tiny = 1e6, 1e-6

    yield "one cable", TensionProblem([[2.0]], [10.0], 0, 60), "optimal"
    yield "one cable, wrong way", TensionProblem([[2.0]], [-10.0], 0, 60), "infeasible"
    yield "one cable, across", TensionProblem([[2.0], [0.0]], [10.0, 1.0], 0, 60), "singular"
    yield "one cable, exactly at its limit", TensionProblem([[2.0]], [120.0], 0, 60), "optimal"
    yield "tug of war", TensionProblem(line, [3.0], 1, 60), "optimal"
    yield "tug of war, out of reach", TensionProblem(line, [60.0], 1, 60), "infeasible"
    yield "planar", TensionProblem(planar, [3.0, -2.0], 1, 60), "optimal"
    yield "planar with wish and weights", TensionProblem(planar, [3.0, -2.0], 1, 60, 20, [1, 2, 3, 1e3]), "optimal"
    yield "wish outside the limits", TensionProblem(planar, [3.0, -2.0], 1, 60, [-50, 100, 5, 5]), "optimal"
    yield "no wrench, no pretension", TensionProblem(spatial, np.zeros(6), 0, 60), "optimal"
    yield "no wrench, pretension", TensionProblem(spatial, np.zeros(6), 1, 1e4), "infeasible"
    yield "no wrench, both signs allowed", TensionProblem(spatial, np.zeros(6), -60, 60), "optimal"
    yield "no wrench, a wish", TensionProblem(spatial[:, :6], np.zeros(6), -60, 60, 10), "optimal"
    yield "zero matrix, zero wrench", TensionProblem(np.zeros((6, 3)), np.zeros(6), 1, 60), "optimal"
    yield "zero matrix", TensionProblem(np.zeros((6, 3)), np.ones(6), 1, 60), "singular"
    yield "a cable that does nothing", TensionProblem(np.c_[planar, [0, 0]], [3.0, -2.0], 1, 60), "optimal"
    yield "eight cables", TensionProblem(spatial, spatial @ inside, T_MIN, T_MAX), "optimal"
    yield "lengths in millimetres", TensionProblem(spatial, spatial @ inside, T_MIN, T_MAX, length=1e-3), "optimal"
    yield "twin cables", TensionProblem(twins, twins @ inside, T_MIN, T_MAX), "optimal"
    yield "opposed cables", TensionProblem(opposed, opposed @ inside, T_MIN, T_MAX), "optimal"
    yield "rank three, in range", TensionProblem(flat, flat @ inside, T_MIN, T_MAX), "optimal"
    yield "rank three, a moment required", TensionProblem(flat, spatial @ inside, T_MIN, T_MAX), "singular"
    yield "rank three, too far", TensionProblem(flat, [0, 0, 500, 0, 0, 0], T_MIN, T_MAX), "infeasible"
    yield "all tensions fixed, right", TensionProblem(spatial, spatial @ inside, inside, inside), "optimal"
    yield "all tensions fixed, wrong", TensionProblem(spatial, spatial @ inside + 1, inside, inside), "infeasible"
    low, high = np.full(8, T_MIN), np.full(8, T_MAX)
    low[:3] = high[:3] = inside[:3]
    yield "three tensions fixed", TensionProblem(spatial, spatial @ inside + 1e-3, low, high), "infeasible"
    yield "one tension fixed", TensionProblem(spatial, spatial @ inside, np.r_[inside[0], low[1:]], high), "optimal"
    yield "no upper limit", TensionProblem(spatial, spatial @ inside, T_MIN, np.inf), "optimal"
    yield "no limits at all", TensionProblem(spatial, spatial @ inside, -np.inf, np.inf), "optimal"
    yield "no upper limit, wrong way", TensionProblem(np.abs(planar), [-3.0, 2.0], 0, np.inf), "infeasible"
    yield "upper limit 1e12", TensionProblem(spatial, spatial @ inside, T_MIN, 1e12), "optimal"
    yield "upper limit 1e12, wrong way", TensionProblem(np.abs(planar), [-3.0, 2.0], 0, 1e12), "infeasible"
    yield "corner of the available wrenches", TensionProblem(spatial, spatial @ corner, T_MIN, T_MAX), "optimal"
    yield (
        "just beyond that corner",
        TensionProblem(spatial, spatial @ corner + [0, 0, 1e-4, 0, 0, 0], T_MIN, T_MAX),
        "infeasible",
    )
    yield "heavy", TensionProblem(spatial, spatial @ inside * huge, T_MIN * huge, T_MAX * huge), "optimal"
    yield "light", TensionProblem(spatial, spatial @ inside * tiny, T_MIN * tiny, T_MAX * tiny), "optimal"
    yield "large rows", TensionProblem(spatial * huge, spatial @ inside * huge, T_MIN, T_MAX), "optimal"
    yield "small rows", TensionProblem(spatial * tiny, spatial @ inside * tiny, T_MIN, T_MAX), "optimal"
    yield "a light load on a strong crane", TensionProblem(spatial, spatial @ inside * tiny, 0, huge), "optimal"
    yield "five cables, in range", TensionProblem(spatial[:, :5], spatial[:, :5] @ inside[:5], T_MIN, T_MAX), "optimal"
    yield "five cables, out of range", TensionProblem(spatial[:, :5], spatial @ inside, T_MIN, T_MAX), "singular"


ZOO = {name: Case(problem, status) for name, problem, status in _zoo()}
