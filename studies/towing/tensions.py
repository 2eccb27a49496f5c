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
from .equations import SIZES, rank, turned_home
from .workspace import in_prism, loops

SAFETY = (1.5, 2.0)  # n of Eq. 11
SAMPLES = 6000


def chapter() -> Chapter:
    """Check least norm, null space and the rank test of step (d)."""
    return Chapter(
        [_limit(), _singular(), _least_norm(), _freedom(), _scalar(), _rank_test(), _postures()],
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
    for name in SIZES.values():
        J = Dynamics(load(name)).wrench_matrix(turned_home())
        ranks.append(float(rank(J @ J.T)))
    return stated(
        "eq-16-inverse",
        "Eq. 16",
        "J^+ = J^T (J J^T)^-1 is the Moore-Penrose inverse for m = 3, 4, 5, 6 (rank of J J^T).",
        (6.0, 6.0, 6.0, 6.0),
        tuple(ranks),
        holds=all(size == 6 for size in ranks),
        otherwise=Verdict.IMPOSSIBLE,
        agrees="J J^T has rank 6 for each m.",
        differs="J J^T is 6 x 6, and with fewer than six cables its rank is smaller, so it has no inverse. The "
        "pseudo-inverse by singular values always exists.",
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
        agrees="No tensions inside the limits that balance the weight have a smaller norm; the printed column is |J^+ "
        "b|.",
        differs="Inside the limits the least norm is another one.",
        unit="N",
    )


def _freedom() -> Claim:
    left = [m - rank(Dynamics(load(name)).wrench_matrix(turned_home())) for m, name in SIZES.items()]
    of_forces = [m - rank(forces(load(name)).A) for m, name in SIZES.items()]
    return stated(
        "eq-17-null-space",
        "Eq. 17",
        "Null(J) lambda leaves a choice of tensions with up to six cables and six rows (size of the null space).",
        "a choice",
        tuple(float(size) for size in left),
        holds=all(size > 0 for size in left[1:]),
        agrees="There is a null space for m = 4, 5, 6.",
        differs="The null space has the computed sizes for m = 3, 4, 5, 6: independent columns leave no choice, and "
        "six "
        "columns are dependent only where the robot is singular, as with these regular hexagons. For the three rows of "
        f"force alone the sizes are {', '.join(str(int(size)) for size in of_forces)}.",
    )


def _scalar() -> Claim:
    low, high, at = _choices()
    return stated(
        "eq-17-lambda",
        "Eq. 17",
        "Any scalar lambda in (0, 1) keeps the bounds of Eq. 11 (range that does, forces alone, m = 4, lambda in N).",
        (0.0, 1.0),
        (low, high),
        holds=low <= 0.0 and high >= 1.0 and high - low <= 1.1,
        agrees="The range that keeps the bounds is the printed one.",
        differs="The bounds of Eq. 11 give the computed range, not (0, 1)"
        f"{'' if low <= 0 else ', and T prime itself exceeds them'}. With m - rank > 1 lambda is a vector. The "
        "tensions "
        f"T' are {', '.join(f'{tension:.1f}' for tension in at)} N.",
        unit="N",
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
