"""Paper C's tensions, equations 11, 16 and 17 and step (d): least norm, null space and rank."""

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, Robot, load
from ...solvers import TensionProblem, solve
from ...workspace import EquilibriumPosture
from ..accounts.claim import Chapter, Claim, Verdict
from .claims import claim
from .equations import FEWER, SIZES, has_rank_6, rank, six_cables, turned_home
from .workspace import in_prism, loops

SAFETY = (1.5, 2.0)  # n of Eq. 11
SAMPLES = 6000
POSITIONS = 400  # of the load, at which all lambda in (0, 1) are tried


def chapter() -> Chapter:
    """Check least norm, null space and the rank test of step (d)."""
    most = load("wang-ctmrts").t_max.max()
    J = {m: Dynamics(load(SIZES[m])).wrench_matrix(turned_home()) for m in FEWER}
    left = [m - rank(J[m]) for m in FEWER]
    of_forces = {m: m - rank(forces(load(name)).A) for m, name in SIZES.items()}
    at, _, low, high = _choices()
    claims = [
        claim("eq-11-limit").undetermined(most * np.array(SAFETY), printed=most),
        has_rank_6("eq-16-inverse", [rank(J[m] @ J[m].T) for m in FEWER]),
        _least_norm(),
        claim("eq-17-null-space").stated(
            left,
            all(size > 0 for size in left[1:]),
            six=six_cables(),
            of_forces=", ".join(map(str, of_forces.values())),
        ),
        claim("eq-17-lambda").stated((low, high), low <= 0 and high >= 1, at=", ".join(f"{T:.1f}" for T in at)),
        _scalar_elsewhere(),
        # Dimension of the solutions with one scalar, and of all solutions.
        claim("eq-17-general").compared([free for m, free in of_forces.items() if m > 3], printed=1.0),
        _cases(),
        _rank_test(),
        _postures(),
    ]
    return Chapter(claims, {"null-space": _along_null_space()})


def forces(robot: Robot, pose: np.ndarray | None = None) -> TensionProblem:
    """Return the balance of forces alone at rest, at a pose (6,); default: home."""
    A = Dynamics(robot).wrench_matrix(robot.home if pose is None else pose)[:3]
    return TensionProblem(A, [0.0, 0.0, robot.weight], robot.t_min, robot.t_max)


def _least_norm() -> Claim:
    """Compare the method `min-norm` with the pseudo-inverse, where that is inside the limits."""
    norms, own = [], []
    for m, name in SIZES.items():
        if m == 3:
            continue
        problem = forces(load(name))
        solution = solve(problem, method="min-norm")
        assert solution.tensions is not None
        norms.append(np.linalg.norm(np.linalg.pinv(problem.A) @ problem.w))
        own.append(np.linalg.norm(solution.tensions))
    return claim("eq-16-least-norm").compared(own, printed=norms, within=1e-09 * max(norms))


def _scalar_elsewhere() -> Claim:
    """Count the positions at which tensions inside the bounds exist, and those at which all lambda in (0, 1) give them.

    The sign of a null vector is free, so both are tried.
    """
    robot = load(SIZES[4])
    rng, edge = np.random.default_rng(17), np.array([0.9, 0.9, 0.3])
    poses = robot.home + np.hstack([rng.uniform(-edge, edge, (POSITIONS, 3)), np.zeros((POSITIONS, 3))])
    held, kept = 0, 0
    for pose in poses:
        problem = forces(robot, pose)
        if not solve(problem).feasible:
            continue
        special, null = _null_space(problem)
        ends = [special + sign * chosen * null for sign in (1, -1) for chosen in (0.0, 1.0)]
        inside = [bool((t >= problem.t_min).all() and (t <= problem.t_max).all()) for t in ends]
        held += 1
        kept += all(inside[:2]) or all(inside[2:])  # what holds at both ends holds between them
    return claim("eq-17-workspace").stated(kept / held, kept == held, lost=held - kept, held=held)


def _choices() -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return T', the null vector of length one, and the range of lambda inside the limits, m = 4."""
    problem = forces(load(SIZES[4]))
    special, null = _null_space(problem)
    with np.errstate(divide="ignore"):
        ends = np.sort(np.stack([(problem.t_min - special) / null, (problem.t_max - special) / null]), axis=0)
    return special, null, float(ends[0].max()), float(ends[1].min())


def _null_space(problem: TensionProblem) -> tuple[np.ndarray, np.ndarray]:
    """Return T' and the null vector of length one whose first entry is positive, (m,) each, if there is only one."""
    return np.linalg.pinv(problem.A) @ problem.w, problem.null_space[:, -1]


def _along_null_space() -> Drawing:
    special, null, low, high = _choices()
    choices = np.linspace(1.3 * low - 0.3 * high, 1.3 * high - 0.3 * low, 101)
    panel = Panel.of_cables("tension [N]", special + choices[:, None] * null, {"0 N": 0.0})
    return Drawing(
        "Tensions T' + lambda Null(J) of four cables at home, forces alone; inside the limits between the dotted lines",
        curves(choices, "lambda [N]", [panel], marks={"smallest": low, "largest": high}),
    )


def _rank_test() -> Claim:
    """Check the relative residual of the six rows at random postures of W2, with tensions nearest to balance."""
    samples = loops("variable-length", count=SAMPLES)
    places, robot = samples.places.only(samples.held), samples.robot
    A = Dynamics(robot).wrench_matrix(places.pose, places.carriers) * robot.wrench_scale[:, None]
    w = np.array([0.0, 0.0, robot.weight, 0.0, 0.0, 0.0])
    left = w - (A @ (np.linalg.pinv(A) @ w)[..., None])[..., 0]
    relative = np.linalg.norm(left, axis=1) / robot.weight
    passed = (relative < 1e-9).mean()
    return claim("step-d-rank").stated(
        passed, passed > 0.0, otherwise=Verdict.IMPOSSIBLE, count=len(relative), quantile=np.quantile(relative, 0.01)
    )


def _cases() -> Claim:
    """Solve three balances, one of each case of the ranks, by least squares: residual, and freedom of the solutions."""
    level, four = load(SIZES[3]), load(SIZES[4])
    A = Dynamics(level).wrench_matrix(level.home)
    w = np.array([0.0, 0.0, level.weight, 0.0, 0.0, 0.0])
    cases = [(A, w), (A[:3], w[:3]), (Dynamics(four).wrench_matrix(four.home)[:3], w[:3])]
    found = []
    for matrix, wrench in cases:
        unsolved = np.linalg.norm(matrix @ np.linalg.pinv(matrix) @ wrench - wrench) > 1e-9 * level.weight
        free = matrix.shape[1] - rank(matrix)
        found.append("none" if unsolved else "one" if free == 0 else "infinitely many")
    return claim("rank-cases").stated(", ".join(found), found == ["none", "one", "infinitely many"])


def _postures() -> Claim:
    """Check where there is a posture in balance, and whether its cables pull if and only if it is in the prism."""
    samples = loops("variable-length", count=SAMPLES, seed=1)
    inside = in_prism(samples.robot, samples.places.pose[:, :3])
    pose, tensions = EquilibriumPosture().postures(samples.robot, samples.places)
    solved = np.isfinite(pose[:, 0])
    agree = ((tensions > 0).all(axis=1) == inside)[solved]
    shares = solved.mean(), agree.mean()
    return claim("step-e-unique").stated(shares, min(shares) > 0.98)
