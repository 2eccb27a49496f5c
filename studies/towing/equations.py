"""Paper C's model, equations 3 to 13, compared with the model of this toolkit."""

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import Dynamics, Robot, load
from ..accounts.claim import Chapter, Claim, Verdict
from .claims import claim

ANGLES = np.array([0.3, -0.4, 0.5])  # roll, pitch, yaw [rad], inside the paper's (-1, 1)
TURN = Rotation.from_euler("ZYX", ANGLES[::-1])
RATES = np.array([1.0, 1.0, 1.0])  # their time derivatives [rad/s]
FEWER = (3, 4, 5)  # cables, than J has rows
SECOND = np.array([0.5, -0.5, 0.5])  # and second ones [rad/s^2]
MEANT = {"the dynamic equations": 4.0, "the bounds of the tensions": 11.0}  # numbers of equations by what they are
SIZES = {3: "wang-ctmrts", 4: "wang-ctmrts-4", 5: "wang-ctmrts-5", 6: "wang-ctmrts-6"}  # robots by m


def chapter() -> Chapter:
    """Check each equation of section 3 that can be tested."""
    ranks = [rank(Dynamics(load(SIZES[m])).wrench_matrix(turned_home())) for m in FEWER]
    dynamic = MEANT["the dynamic equations"]
    references = claim("equation-references").compared((dynamic, dynamic))
    return Chapter([*_body(), *_forces(), has_rank_6("eq-13-inverse", ranks), _symbols(), references])


def turned_home() -> np.ndarray:
    """Return the load at home, rotated as an arbitrary posture, (6,) [m, rad]."""
    return np.concatenate([load("wang-ctmrts").home[:3], ANGLES])


def lines(robot: Robot, pose: np.ndarray, ends: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the vectors from attachments to robot-ends, and the arms of the attachments, (..., m, 3) each [m].

    By scipy's rotations; `pose` is (..., 6), and `ends` (..., m, 3), default: the robot-ends at home.
    """
    turns = Rotation.from_euler("ZYX", pose[..., :2:-1]).as_matrix()
    arms = robot.attachments @ np.swapaxes(turns, -1, -2)
    return (robot.carrier_home[:, :3] if ends is None else ends) - pose[..., None, :3] - arms, arms


def masses() -> np.ndarray:
    """Return six points, (6, 3) [m] in {P}, each with a sixth of the load's mass, that have its inertia."""
    robot = load("wang-ctmrts")
    moments = np.diag(robot.inertia)
    squares = np.maximum(moments.sum() / 2 - moments, 0.0)  # sum of m x^2, m y^2 and m z^2 of all points
    arms = np.diag(np.sqrt(3 * squares / robot.platform.mass))
    return np.vstack([arms, -arms])


def _body() -> list[Claim]:
    robot, pose, turn = load("wang-ctmrts"), turned_home(), TURN.as_matrix()
    # Eq. 1: the distances of the attachments by scipy's rotation.
    distances = np.linalg.norm(lines(robot, pose)[0], axis=1)
    moments = np.sort(np.diag(robot.inertia))
    others = moments[:2].sum()
    # R I R^T compared with the inertia of rotated point masses.
    points = masses() @ turn.T
    share, step = robot.platform.mass / len(points), 1e-4
    summed = share * ((points**2).sum() * np.eye(3) - points.T @ points)

    def energy(move: np.ndarray) -> float:
        places = move[:3] + (Rotation.from_rotvec(move[3:]) * TURN).apply(masses())
        return float(-share * (places @ np.array(robot.gravity)).sum())

    # G compared with minus the slope of the potential energy of point masses, by position and by rotation.
    slope = [(energy(-row) - energy(row)) / (2 * step) for row in step * np.eye(6)]
    return [
        claim("eq-3-rotation").compared(Dynamics(robot).cable_lengths(pose), printed=distances),
        claim("section-5-rigid").stated(others, moments[2] <= others + 1e-12, printed=moments[2]),
        claim("eq-10").compared(np.abs(turn @ robot.inertia @ turn.T - summed).max()),
        claim("eq-8").compared(slope, printed=(0.0, 0.0, -robot.weight, 0.0, 0.0, 0.0)),
    ]


def _turning() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angular velocity and acceleration in {O} by differences of the rotation, and the required moment."""
    step = 1e-4

    def rotation(t: float) -> Rotation:
        return Rotation.from_euler("ZYX", (ANGLES + RATES * t + SECOND * t**2 / 2)[::-1])

    def velocity(t: float) -> np.ndarray:
        return (rotation(t + step) * rotation(t - step).inv()).as_rotvec() / (2 * step)

    acceleration = (velocity(step) - velocity(-step)) / (2 * step)
    still = np.zeros(3)
    moment = Dynamics(load("wang-ctmrts")).required_wrench(turned_home(), np.r_[still, RATES], np.r_[still, SECOND])[3:]
    return velocity(0.0), acceleration, moment


def _forces() -> list[Claim]:
    robot, pose, turn = load("wang-ctmrts"), turned_home(), TURN.as_matrix()
    dynamics = Dynamics(robot)
    omega, alpha, moment = _turning()
    inertia = turn @ robot.inertia @ turn.T
    left_out = moment - inertia @ alpha
    apart = np.abs(left_out - np.cross(omega, inertia @ omega)).max()
    # Static tensions at home with the printed e_i, which point from the robot to the load.
    tensions = np.linalg.solve(-dynamics.wrench_matrix(robot.home)[:3], [0.0, 0.0, robot.weight])
    # R_p (P_i - b_i) / |L_i|, the second form without P_i in {P}, compared with the moment of the first form.
    vectors, arms = lines(robot, pose)
    e = -vectors / np.linalg.norm(vectors, axis=1)[:, None]  # along P_i - b_i
    first, second = (np.linalg.norm(moments, axis=1).max() for moments in (np.cross(arms, e), TURN.apply(e)))
    A = dynamics.wrench_matrix(pose)
    size, printed = ("{} x {}".format(*matrix.shape) for matrix in (A, A.T))
    return [
        claim("eq-4-gyroscopic").compared(np.linalg.norm(left_out), apart=apart),
        claim("eq-6-direction").stated(tensions, (tensions > 0).all()),
        claim("eq-6-second").compared(first, printed=second),
        claim("eq-5-shape").stated(size, size == printed, printed=printed),
        claim("eq-7").compared(max(_off_sum(m) for m in SIZES)),
        claim("eq-12-angular-acceleration").compared(alpha, printed=SECOND),
    ]


def _off_sum(m: int) -> float:
    """Compare J T, with the tensions as a column, with the sum of each cable's force and moment [N, N m]."""
    robot, pose = load(SIZES[m]), turned_home()
    vectors, arms = lines(robot, pose)
    pulls = np.arange(1.0, m + 1)[:, None] * vectors / np.linalg.norm(vectors, axis=1)[:, None]
    summed = np.concatenate([pulls.sum(axis=0), np.cross(arms, pulls).sum(axis=0)])
    return np.abs(Dynamics(robot).wrench_matrix(pose) @ np.arange(1.0, m + 1) - summed).max()


def _symbols() -> Claim:
    """Compute how L_1 changes as the load moves, with b_1 in the local and in the global coordinate system."""
    robot, shift = load("wang-ctmrts"), np.array([0.1, 0.0, 0.0])
    end, place, arm = robot.carrier_home[0, :3], robot.home[:3], robot.attachments[0]
    before = np.linalg.norm(end - (place + arm))
    change = np.linalg.norm(end - (place + shift + arm)) - before
    inside = np.linalg.norm((end - place + place + shift) - (place + shift + arm)) - before  # b_1 moves too
    return claim("table-1").compared(change, printed=inside)


def has_rank_6(name: str, ranks: list[int]) -> Claim:
    """Return a claim that needs rank 6 for each number of cables in `FEWER`."""
    printed, otherwise = [6] * len(ranks), Verdict.IMPOSSIBLE
    return claim(name).stated(ranks, ranks == printed, printed, otherwise, six=six_cables())


def six_cables() -> str:
    """State the ranks of two robots with six cables: the library's two hexagons, and crossed pairs of their points."""
    robot, pose = load(SIZES[6]), turned_home()
    arms = lines(robot, pose)[1][[1, 0, 3, 2, 5, 4]]
    vectors = robot.carrier_home[:, :3] - pose[:3] - arms
    J = np.hstack([vectors, np.cross(arms, vectors)]).T / np.linalg.norm(vectors, axis=1)
    ranks = rank(Dynamics(robot).wrench_matrix(pose)), rank(J)
    return (
        f"the rank is {ranks[0]} between two similar hexagons, which is this toolkit's choice, and {ranks[1]} with "
        "crossed pairs of the same points"
    )


def rank(A: np.ndarray) -> int:
    """Return the rank of a wrench matrix (6, m); singular values below 1e-9 of the largest are rounding."""
    return int(np.linalg.matrix_rank(A, rtol=1e-9))
