"""Paper C's model, equations 3 to 13, compared with the model of this toolkit."""

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import Dynamics, Robot, load
from ..accounts.account import Chapter
from ..accounts.claim import Claim, Verdict
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
    claims = [_rotation(), _rigid(), _inertia(), _weight(), _gyroscopic(), _direction(), _second_form(), _shape()]
    dynamic = MEANT["the dynamic equations"]
    references = claim("equation-references").compared((dynamic, dynamic))
    return Chapter([*claims, _summed(), _angular_acceleration(), _inverse(), _symbols(), references])


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


def _rotation() -> Claim:
    """Compare the cable lengths of Eq. 1 with distances of the attachments by scipy's rotation."""
    robot, pose = load("wang-ctmrts"), turned_home()
    printed = np.linalg.norm(lines(robot, pose)[0], axis=1)
    return claim("eq-3-rotation").compared(Dynamics(robot).cable_lengths(pose), printed=printed)


def _rigid() -> Claim:
    moments = np.sort(np.diag(load("wang-ctmrts").inertia))
    others = moments[:2].sum()
    return claim("section-5-rigid").stated(others, moments[2] <= others + 1e-12, printed=moments[2])


def masses() -> np.ndarray:
    """Return six points, (6, 3) [m] in {P}, each with a sixth of the load's mass, that have its inertia."""
    robot = load("wang-ctmrts")
    moments = np.diag(robot.inertia)
    squares = np.maximum(moments.sum() / 2 - moments, 0.0)  # sum of m x^2, m y^2 and m z^2 of all points
    arms = np.diag(np.sqrt(3 * squares / robot.platform.mass))
    return np.vstack([arms, -arms])


def _inertia() -> Claim:
    """Compare R I R^T with the inertia of rotated point masses."""
    robot, turn = load("wang-ctmrts"), TURN.as_matrix()
    points = masses() @ turn.T
    summed = (points**2).sum() * np.eye(3) - points.T @ points
    off = np.abs(turn @ robot.inertia @ turn.T - robot.platform.mass / len(points) * summed).max()
    return claim("eq-10").compared(off)


def _weight() -> Claim:
    """Compare G with minus the slope of the potential energy of point masses, by position and by rotation."""
    robot = load("wang-ctmrts")
    share, step = robot.platform.mass / 6, 1e-4

    def energy(move: np.ndarray) -> float:
        places = move[:3] + (Rotation.from_rotvec(move[3:]) * TURN).apply(masses())
        return float(-share * (places @ np.array(robot.gravity)).sum())

    slope = [(energy(-row) - energy(row)) / (2 * step) for row in step * np.eye(6)]
    return claim("eq-8").compared(slope, printed=(0.0, 0.0, -robot.weight, 0.0, 0.0, 0.0))


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


def _gyroscopic() -> Claim:
    omega, alpha, moment = _turning()
    turn = TURN.as_matrix()
    inertia = turn @ load("wang-ctmrts").inertia @ turn.T
    left_out = moment - inertia @ alpha
    apart = np.abs(left_out - np.cross(omega, inertia @ omega)).max()
    return claim("eq-4-gyroscopic").compared(np.linalg.norm(left_out), apart=apart)


def _direction() -> Claim:
    """Compute static tensions at home with the printed e_i, which point from the robot to the load."""
    robot = load("wang-ctmrts")
    A = Dynamics(robot).wrench_matrix(robot.home)[:3]
    tensions = np.linalg.solve(-A, [0.0, 0.0, robot.weight])
    return claim("eq-6-direction").stated(tensions, (tensions > 0).all())


def _second_form() -> Claim:
    """Compare R_p (P_i - b_i) / |L_i|, the second form without P_i in {P}, with the moment of the first form."""
    vectors, arms = lines(load("wang-ctmrts"), turned_home())
    e = -vectors / np.linalg.norm(vectors, axis=1)[:, None]  # along P_i - b_i
    first, second = (np.linalg.norm(moments, axis=1).max() for moments in (np.cross(arms, e), TURN.apply(e)))
    return claim("eq-6-second").compared(first, printed=second)


def _shape() -> Claim:
    A = Dynamics(load("wang-ctmrts")).wrench_matrix(turned_home())
    size, printed = ("{} x {}".format(*matrix.shape) for matrix in (A, A.T))
    return claim("eq-5-shape").stated(size, size == printed, printed=printed)


def _summed() -> Claim:
    """Compare J T, with the tensions as a column, with the sum of each cable's force and moment, for every m."""
    off = []
    for m, name in SIZES.items():
        robot, pose = load(name), turned_home()
        vectors, arms = lines(robot, pose)
        pulls = np.arange(1.0, m + 1)[:, None] * vectors / np.linalg.norm(vectors, axis=1)[:, None]
        summed = np.concatenate([pulls.sum(axis=0), np.cross(arms, pulls).sum(axis=0)])
        off.append(np.abs(Dynamics(robot).wrench_matrix(pose) @ np.arange(1.0, m + 1) - summed).max())
    return claim("eq-7").compared(max(off))


def _symbols() -> Claim:
    """Compute how L_1 changes as the load moves, with b_1 in the local and in the global coordinate system."""
    robot, shift = load("wang-ctmrts"), np.array([0.1, 0.0, 0.0])
    end, place, arm = robot.carrier_home[0, :3], robot.home[:3], robot.attachments[0]
    before = np.linalg.norm(end - (place + arm))
    change = np.linalg.norm(end - (place + shift + arm)) - before
    inside = np.linalg.norm((end - place + place + shift) - (place + shift + arm)) - before  # b_1 moves too
    return claim("table-1").compared(change, printed=inside)


def _angular_acceleration() -> Claim:
    _, alpha, _ = _turning()
    return claim("eq-12-angular-acceleration").compared(alpha, printed=SECOND)


def _inverse() -> Claim:
    ranks = [rank(Dynamics(load(SIZES[m])).wrench_matrix(turned_home())) for m in FEWER]
    return has_rank_6("eq-13-inverse", ranks)


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
        f"between two similar hexagons, this toolkit's choice, the rank is {ranks[0]}, with crossed pairs of the same "
        f"points {ranks[1]}"
    )


def rank(A: np.ndarray) -> int:
    """Return the rank of a wrench matrix (6, m); singular values below 1e-9 of the largest are rounding."""
    return int(np.linalg.matrix_rank(A, rtol=1e-9))
