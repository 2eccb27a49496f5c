"""Paper C's tensions, equations 11, 16 and 17 and step (d): least norm, null space and rank."""

from __future__ import annotations

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, Robot, load
from ...solvers import TensionProblem, solve
from ...workspace import EquilibriumPosture
from ..accounts.account import Chapter
from ..accounts.claim import Claim, Verdict, compared, stated, undetermined
from .equations import FEWER, SIZES, rank, six_cables, turned_home
from .workspace import in_prism, loops

SAFETY = (1.5, 2.0)  # n of Eq. 11
SAMPLES = 6000
POSITIONS = 400  # of the load, at which all lambda in (0, 1) are tried


def chapter() -> Chapter:
    """Check least norm, null space and the rank test of step (d)."""
    claims = [_limit(), _singular(), _least_norm(), _freedom(), _scalar(), _scalar_elsewhere(), _general(), _cases()]
    return Chapter(
        [*claims, _rank_test(), _postures()],
        {"null-space": _along_null_space()},
    )


def forces(robot: Robot, pose: np.ndarray | None = None) -> TensionProblem:
    """Return the balance of forces alone at rest, at a pose (6,); default: home."""
    A = Dynamics(robot).wrench_matrix(robot.home if pose is None else pose)[:3]
    return TensionProblem(A, [0.0, 0.0, robot.weight], robot.t_min, robot.t_max)


def _limit() -> Claim:
    most = float(load("wang-ctmrts").t_max.max())
    return undetermined(
        "eq-11-limit",
        "Eq. 11, section 5",
        "T_fmax = T_lim / n with 1.5 <= n <= 2.",
        most,
        tuple(most * n for n in SAFETY),
        missing="Neither T_lim nor n is printed. T_lim between the computed values gives T_fmax = 500 N.",
        unit="N",
    )


def _singular() -> Claim:
    ranks = []
    for m in FEWER:
        J = Dynamics(load(SIZES[m])).wrench_matrix(turned_home())
        ranks.append(float(rank(J @ J.T)))
    return stated(
        "eq-16-inverse",
        "Eq. 16",
        "J^+ = J^T (J J^T)^-1 is the Moore-Penrose inverse for m = 3, 4, 5 (rank of J J^T).",
        (6.0,) * len(ranks),
        tuple(ranks),
        holds=all(size == 6 for size in ranks),
        otherwise=Verdict.IMPOSSIBLE,
        agrees="J J^T has rank 6 for each m.",
        differs="J J^T is 6 x 6, and with fewer than six cables its rank is at most m, so it has no inverse. The "
        "pseudo-inverse by singular values always exists. With six cables J J^T has an inverse where J has one: "
        f"{six_cables()}.",
    )


def _least_norm() -> Claim:
    """Compare the method `min-norm` with the pseudo-inverse, where that is inside the limits."""
    norms, own = [], []
    for m, name in SIZES.items():
        if m == 3:
            continue
        problem = forces(load(name))
        pseudo = np.linalg.pinv(problem.A) @ problem.w
        solution = solve(problem, method="min-norm")
        assert solution.tensions is not None
        norms.append(float(np.linalg.norm(pseudo)))
        own.append(float(np.linalg.norm(solution.tensions)))
    return compared(
        "eq-16-least-norm",
        "Eq. 16",
        "J^+ b is the solution of least norm (norms for m = 4, 5, 6 at home, forces alone).",
        tuple(norms),
        tuple(own),
        within=1e-9 * max(norms),
        agrees="No tensions inside the limits that balance the weight have a smaller norm than |J^+ b|.",
        differs="Inside the limits the least norm is another one.",
        unit="N",
    )


def _freedom() -> Claim:
    left = [m - rank(Dynamics(load(SIZES[m])).wrench_matrix(turned_home())) for m in FEWER]
    of_forces = [m - rank(forces(load(name)).A) for m, name in SIZES.items()]
    return stated(
        "eq-17-null-space",
        "Eq. 17",
        "Null(J) lambda leaves a choice of tensions with m = 3, 4, 5 cables and six rows (size of the null space).",
        "a choice",
        tuple(float(size) for size in left),
        holds=all(size > 0 for size in left[1:]),
        agrees="There is a null space for m = 4, 5.",
        differs="Independent columns leave no choice, and m columns are dependent only where the robot is singular. "
        f"With six cables the null space has 6 less the rank of J: {six_cables()}. For the three rows of force "
        f"alone the sizes for m = 3, 4, 5, 6 are {', '.join(str(int(size)) for size in of_forces)}.",
    )


def _scalar() -> Claim:
    low, high, at = _choices()
    return stated(
        "eq-17-lambda",
        "Eq. 17",
        "Any scalar lambda in (0, 1) keeps the bounds of Eq. 11 (range that does, forces alone, m = 4 at home, "
        "lambda in N for a null vector of length one).",
        (0.0, 1.0),
        (low, high),
        holds=low <= 0.0 and high >= 1.0,
        agrees="It does, where the load is in the middle: all lambda between the computed ends do, as the tensions T' "
        f"are {', '.join(f'{tension:.1f}' for tension in at)} N. See `eq-17-workspace` for other positions.",
        differs="Some lambda in (0, 1) exceed the bounds, as the tensions T' are "
        f"{', '.join(f'{tension:.1f}' for tension in at)} N.",
        unit="N",
    )


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
    return stated(
        "eq-17-workspace",
        "Eq. 17",
        "Wherever tensions inside the bounds of Eq. 11 exist, any scalar lambda in (0, 1) gives such tensions (share "
        "of random positions, forces alone, m = 4, level).",
        1.0,
        kept / held,
        holds=kept == held,
        agrees="At all positions it does.",
        differs=f"At {held - kept} of {held} positions T' exceeds a bound or is within 1 N of one, and lambda must be "
        "chosen so that the bounds hold.",
    )


def _general() -> Claim:
    """Compare the number of directions along which one scalar moves the tensions with that of all solutions."""
    free = tuple(float(m - rank(forces(load(name)).A)) for m, name in SIZES.items() if m > 3)
    return compared(
        "eq-17-general",
        "Eq. 17",
        "T' + Null(J) lambda with one scalar lambda is the general solution (its dimension, forces alone, m = 4, 5, "
        "6).",
        (1.0,) * len(free),
        free,
        within=0.0,
        agrees="One scalar gives all solutions.",
        differs="Lambda must be a vector with one entry for each dimension of the null space.",
    )


def _choices() -> tuple[float, float, np.ndarray]:
    """Return the range of lambda inside the limits, m = 4, for a null vector of length one, and T' (4,) [N]."""
    problem = forces(load(SIZES[4]))
    special, null = _null_space(problem)
    with np.errstate(divide="ignore"):
        ends = np.sort(np.stack([(problem.t_min - special) / null, (problem.t_max - special) / null]), axis=0)
    return float(ends[0].max()), float(ends[1].min()), special


def _null_space(problem: TensionProblem) -> tuple[np.ndarray, np.ndarray]:
    """Return T' and the null vector of length one whose first entry is positive, (m,) each, if there is only one."""
    null = np.linalg.svd(problem.A)[2][-1]
    return np.linalg.pinv(problem.A) @ problem.w, null * np.sign(null[0])


def _along_null_space() -> Drawing:
    problem = forces(load(SIZES[4]))
    special, null = _null_space(problem)
    low, high, _ = _choices()
    choices = np.linspace(1.3 * low - 0.3 * high, 1.3 * high - 0.3 * low, 101)
    lines = {f"cable {i + 1}": special[i] + choices * null[i] for i in range(4)}
    return Drawing(
        "Tensions T' + lambda Null(J) of four cables at home, forces alone; inside the limits between the dotted lines",
        curves(
            choices, "lambda [N]", [Panel("tension [N]", lines, {"0 N": 0.0})], marks={"smallest": low, "largest": high}
        ),
    )


def _rank_test() -> Claim:
    """Check the relative residual of the six rows at random postures of W2, with tensions nearest to balance."""
    samples = loops("variable-length", count=SAMPLES)
    places = samples.places.only(samples.held)
    robot = samples.robot
    A = Dynamics(robot).wrench_matrix(places.pose, places.carriers)
    A *= robot.wrench_scale[:, None]
    w = np.array([0.0, 0.0, robot.weight, 0.0, 0.0, 0.0])
    left = w - (A @ (np.linalg.pinv(A) @ w)[..., None])[..., 0]
    relative = np.linalg.norm(left, axis=1) / robot.weight
    passed = float((relative < 1e-9).mean())
    return stated(
        "step-d-rank",
        "step (d)",
        "Random postures with rank(A) = rank(A, b) form the workspace (their share of the postures with forces in "
        "balance).",
        "some",
        passed,
        holds=passed > 0.0,
        otherwise=Verdict.IMPOSSIBLE,
        agrees="Some random postures have equal ranks.",
        differs=f"None of {len(relative)} postures has equal ranks: three cables balance six rows only on a set "
        f"without volume. For 1 % of them the residual is at most {np.quantile(relative, 0.01):.2f} of the weight. "
        "The paper's figures show the balance of forces alone.",
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
    return stated(
        "rank-cases",
        "section 4",
        "A T = b has no solution if rank(A) is not rank(A, b), one if both are m, infinitely many if both are less (a "
        "level load with six rows, the same with forces alone, forces of four cables).",
        "none, one, infinitely many",
        ", ".join(found),
        holds=found == ["none", "one", "infinitely many"],
        agrees="These are the three cases of a linear system.",
        differs="The systems have other solutions.",
    )


def _postures() -> Claim:
    """Check where there is a posture in balance, and whether its cables pull if and only if it is in the prism."""
    samples = loops("variable-length", count=SAMPLES, seed=1)
    inside = in_prism(samples.robot, samples.places.pose[:, :3])
    pose, tensions = EquilibriumPosture().postures(samples.robot, samples.places)
    solved = np.isfinite(pose[:, 0])
    pull = (tensions > 0).all(axis=1)
    return stated(
        "step-e-unique",
        "section 4",
        "Where rank(A) = rank(A, b) = m the load is in balance (share of positions with a posture in balance; share of "
        "these whose cables pull if and only if the position is in the prism).",
        (1.0, 1.0),
        (float(solved.mean()), float((pull == inside)[solved].mean())),
        holds=bool(solved.mean() > 0.98 and (pull == inside)[solved].mean() > 0.98),
        agrees="Solving for three angles and three tensions together gives one nearly everywhere, with cables that "
        "pull "
        "inside the prism below the robot-ends.",
        differs="Solving for three angles and three tensions together gives fewer.",
    )
