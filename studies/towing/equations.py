"""Paper C's model, equations 3 to 13, compared with the model of this toolkit."""

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import Dynamics, load
from ..accounts.account import Chapter
from ..accounts.claim import Claim, Verdict
from .claims import claim

ANGLES = np.array([0.3, -0.4, 0.5])  # roll, pitch, yaw [rad], inside the paper's (-1, 1)
RATES = np.array([1.0, 1.0, 1.0])  # their time derivatives [rad/s]
FEWER = (3, 4, 5)  # cables, than J has rows
SECOND = np.array([0.5, -0.5, 0.5])  # and second ones [rad/s^2]
MEANT = {"the dynamic equations": 4.0, "the bounds of the tensions": 11.0}  # numbers of equations by what they are
SIZES = {3: "wang-ctmrts", 4: "wang-ctmrts-4", 5: "wang-ctmrts-5", 6: "wang-ctmrts-6"}  # robots by m


def chapter() -> Chapter:
    """Check each equation of section 3 that can be tested."""
    claims = [_rotation(), _rigid(), _inertia(), _weight(), _gyroscopic(), _direction(), _second_form(), _shape()]
    return Chapter([*claims, _summed(), _angular_acceleration(), _inverse(), _symbols(), _references()])


def turned_home() -> np.ndarray:
    """Return the load at home, rotated as an arbitrary posture, (6,) [m, rad]."""
    return np.concatenate([load("wang-ctmrts").home[:3], ANGLES])


def _rotation() -> Claim:
    """Compare the cable lengths of Eq. 1 with distances of the attachments by scipy's rotation."""
    robot = load("wang-ctmrts")
    turn = Rotation.from_euler("ZYX", ANGLES[::-1]).as_matrix()
    ends = turned_home()[:3] + robot.attachments @ turn.T
    return claim("eq-3-rotation").compared(
        tuple(Dynamics(robot).cable_lengths(turned_home()).tolist()),
        printed=tuple(np.linalg.norm(robot.carrier_home[:, :3] - ends, axis=1).tolist()),
    )


def _rigid() -> Claim:
    moments = np.sort(np.diag(load("wang-ctmrts").inertia))
    return claim("section-5-rigid").stated(
        float(moments[:2].sum()), bool(moments[2] <= moments[:2].sum() + 1e-12), printed=float(moments[2])
    )


def masses() -> np.ndarray:
    """Return six points, (6, 3) [m] in {P}, each with a sixth of the load's mass, that have its inertia."""
    robot = load("wang-ctmrts")
    moments = np.diag(robot.inertia)
    squares = np.maximum(moments.sum() / 2 - moments, 0.0)  # sum of m x^2, m y^2 and m z^2 of all points
    arms = np.diag(np.sqrt(3 * squares / robot.platform.mass))
    return np.vstack([arms, -arms])


def _inertia() -> Claim:
    """Compare R I R^T with the inertia of rotated point masses."""
    robot, turn = load("wang-ctmrts"), Rotation.from_euler("ZYX", ANGLES[::-1]).as_matrix()
    points = masses() @ turn.T
    summed = (points**2).sum() * np.eye(3) - points.T @ points
    off = np.abs(turn @ robot.inertia @ turn.T - robot.platform.mass / len(points) * summed).max()
    return claim("eq-10").compared(float(off))


def _weight() -> Claim:
    """Compare G with minus the slope of the potential energy of point masses, by position and by rotation."""
    robot, turn = load("wang-ctmrts"), Rotation.from_euler("ZYX", ANGLES[::-1])
    share, step = robot.platform.mass / 6, 1e-4

    def energy(move: np.ndarray) -> float:
        places = move[:3] + (Rotation.from_rotvec(move[3:]) * turn).apply(masses())
        return float(-share * (places @ np.array(robot.gravity)).sum())

    slope = [(energy(row) - energy(-row)) / (2 * step) for row in step * np.eye(6)]
    return claim("eq-8").compared(tuple(-part for part in slope), printed=(0.0, 0.0, -robot.weight, 0.0, 0.0, 0.0))


def _turning() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angular velocity and acceleration in {O} by differences of the rotation, and the required moment."""
    step = 1e-4

    def rotation(t: float) -> np.ndarray:
        return Rotation.from_euler("ZYX", (ANGLES + RATES * t + SECOND * t**2 / 2)[::-1]).as_matrix()

    def velocity(t: float) -> np.ndarray:
        skew = (rotation(t + step) - rotation(t - step)) / (2 * step) @ rotation(t).T
        return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])

    acceleration = (velocity(step) - velocity(-step)) / (2 * step)
    still = np.zeros(3)
    moment = Dynamics(load("wang-ctmrts")).required_wrench(turned_home(), np.r_[still, RATES], np.r_[still, SECOND])[3:]
    return velocity(0.0), acceleration, moment


def _gyroscopic() -> Claim:
    omega, alpha, moment = _turning()
    turn = Rotation.from_euler("ZYX", ANGLES[::-1]).as_matrix()
    inertia = turn @ load("wang-ctmrts").inertia @ turn.T
    left_out = moment - inertia @ alpha
    gyroscopic = np.cross(omega, inertia @ omega)
    apart = float(np.abs(left_out - gyroscopic).max())
    return claim("eq-4-gyroscopic").compared(float(np.linalg.norm(left_out)), apart=apart)


def _direction() -> Claim:
    """Compute static tensions at home with the printed e_i, which point from the robot to the load."""
    robot = load("wang-ctmrts")
    A = Dynamics(robot).wrench_matrix(robot.home)[:3]
    tensions = np.linalg.solve(-A, [0.0, 0.0, robot.weight])
    return claim("eq-6-direction").stated(tuple(tensions.tolist()), bool((tensions > 0).all()))


def _second_form() -> Claim:
    """Compare R_p (P_i - b_i) / |L_i|, the second form without P_i in {P}, with the moment of the first form."""
    robot, pose = load("wang-ctmrts"), turned_home()
    turn = Rotation.from_euler("ZYX", ANGLES[::-1])
    arms = turn.apply(robot.attachments)
    lines = pose[:3] + arms - robot.carrier_home[:, :3]  # P_i - b_i
    e = lines / np.linalg.norm(lines, axis=1)[:, None]
    first, second = np.cross(arms, e), turn.apply(e)
    return claim("eq-6-second").compared(
        float(np.linalg.norm(first, axis=1).max()), printed=float(np.linalg.norm(second, axis=1).max())
    )


def _shape() -> Claim:
    A = Dynamics(load("wang-ctmrts")).wrench_matrix(load("wang-ctmrts").home)
    printed = A.T.shape
    return claim("eq-5-shape").stated(
        f"{A.shape[0]} x {A.shape[1]}",
        printed[1] == A.shape[1] and printed[0] == 6,
        printed=f"{printed[0]} x {printed[1]}",
    )


def _summed() -> Claim:
    """Compare J T, with the tensions as a column, with the sum of each cable's force and moment, for every m."""
    off = []
    for m, name in SIZES.items():
        robot, pose = load(name), turned_home()
        arms = Rotation.from_euler("ZYX", ANGLES[::-1]).apply(robot.attachments)
        lines = robot.carrier_home[:, :3] - pose[:3] - arms
        pulls = np.arange(1.0, m + 1)[:, None] * lines / np.linalg.norm(lines, axis=1)[:, None]
        summed = np.concatenate([pulls.sum(axis=0), np.cross(arms, pulls).sum(axis=0)])
        off.append(np.abs(Dynamics(robot).wrench_matrix(pose) @ np.arange(1.0, m + 1) - summed).max())
    return claim("eq-7").compared(float(max(off)))


def _symbols() -> Claim:
    """Compute how L_1 changes as the load moves, with b_1 in the local and in the global coordinate system."""
    robot, shift = load("wang-ctmrts"), np.array([0.1, 0.0, 0.0])
    end, place, arm = robot.carrier_home[0, :3], robot.home[:3], robot.attachments[0]
    before = np.linalg.norm(end - (place + arm))
    change = np.linalg.norm(end - (place + shift + arm)) - before
    inside = np.linalg.norm((end - place + place + shift) - (place + shift + arm)) - before  # b_1 moves too
    return claim("table-1").compared(float(change), printed=float(inside))


def _angular_acceleration() -> Claim:
    _, alpha, _ = _turning()
    return claim("eq-12-angular-acceleration").compared(tuple(alpha.tolist()), printed=tuple(SECOND.tolist()))


def _inverse() -> Claim:
    ranks = {m: rank(Dynamics(load(SIZES[m])).wrench_matrix(turned_home())) for m in FEWER}
    return claim("eq-13-inverse").stated(
        tuple(float(size) for size in ranks.values()),
        all(size == 6 for size in ranks.values()),
        printed=(6.0,) * len(ranks),
        otherwise=Verdict.IMPOSSIBLE,
        six=six_cables(),
    )


def six_cables() -> str:
    """State the ranks of two robots with six cables: the library's two hexagons, and crossed pairs of their points."""
    robot, pose = load(SIZES[6]), turned_home()
    crossed = robot.attachments[[1, 0, 3, 2, 5, 4]]
    arms = Rotation.from_euler("ZYX", ANGLES[::-1]).apply(crossed)
    lines = robot.carrier_home[:, :3] - pose[:3] - arms
    J = np.hstack([lines, np.cross(arms, lines)]).T / np.linalg.norm(lines, axis=1)
    ranks = rank(Dynamics(robot).wrench_matrix(pose)), rank(J)
    return (
        f"between two similar hexagons, this toolkit's choice, the rank is {ranks[0]}, with crossed pairs of the same "
        f"points {ranks[1]}"
    )


def _references() -> Claim:
    dynamic = MEANT["the dynamic equations"]
    return claim("equation-references").compared((dynamic, dynamic))


def rank(A: np.ndarray) -> int:
    """Return the rank of a wrench matrix (6, m); singular values below 1e-9 of the largest are rounding."""
    return int(np.linalg.matrix_rank(A, rtol=1e-9))
