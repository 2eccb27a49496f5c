"""Paper C's model, equations 3 to 13, compared with the model of this toolkit."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import Dynamics, load
from ..accounts.account import Chapter
from ..accounts.claim import Claim, Verdict, compared, stated

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
    return compared(
        "eq-3-rotation",
        "Eqs. 1, 2, 3",
        "The lengths follow from a rotation about Z by phi_3, then Y by phi_2, then X by phi_1.",
        tuple(np.linalg.norm(robot.carrier_home[:, :3] - ends, axis=1).tolist()),
        tuple(Dynamics(robot).cable_lengths(turned_home()).tolist()),
        within=1e-12,
        agrees="An independent rotation, by the paper's equations at one posture, gives the same lengths.",
        differs="An independent rotation gives other lengths.",
        unit="m",
    )


def _rigid() -> Claim:
    moments = np.sort(np.diag(load("wang-ctmrts").inertia))
    return stated(
        "section-5-rigid",
        "section 5",
        "The moments of inertia are those of a rigid body (largest moment, sum of the others).",
        float(moments[2]),
        float(moments[:2].sum()),
        holds=bool(moments[2] <= moments[:2].sum() + 1e-12),
        agrees="The largest is the sum of the others, as in a flat body: just possible.",
        differs="The largest exceeds the sum of the others, which is impossible for a rigid body.",
        unit="kg m^2",
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
    return compared(
        "eq-10",
        "Eq. 10",
        "I' = R I R^T is the inertia in {O} (largest difference from six point masses with this inertia, rotated).",
        0.0,
        float(off),
        within=1e-12,
        agrees="At an arbitrary posture both are the same.",
        differs="The inertia of the rotated masses is another.",
        unit="kg m^2",
    )


def _weight() -> Claim:
    """Compare G with minus the slope of the potential energy of point masses, by position and by rotation."""
    robot, turn = load("wang-ctmrts"), Rotation.from_euler("ZYX", ANGLES[::-1])
    share, step = robot.platform.mass / 6, 1e-4

    def energy(move: np.ndarray) -> float:
        places = move[:3] + (Rotation.from_rotvec(move[3:]) * turn).apply(masses())
        return float(-share * (places @ np.array(robot.gravity)).sum())

    slope = [(energy(row) - energy(-row)) / (2 * step) for row in step * np.eye(6)]
    return compared(
        "eq-8",
        "Eq. 8",
        "G = [0, 0, -M g, 0, 0, 0]^T (minus the slope of the potential energy of six point masses).",
        (0.0, 0.0, -robot.weight, 0.0, 0.0, 0.0),
        tuple(-part for part in slope),
        within=1e-6,
        agrees="The weight is a force without a moment about the mass centre.",
        differs="The slope of the potential energy is another.",
        unit="N, N m",
    )


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
    return compared(
        "eq-4-gyroscopic",
        "Eqs. 4, 9",
        "The moments of the cables need to give no more than M ddX (moment that is left out).",
        0.0,
        float(np.linalg.norm(left_out)),
        within=1e-3,
        agrees="At the tested posture and rates no moment is left out.",
        differs="omega x I' omega is left out, which has the computed norm at rates of 1 rad/s (difference "
        f"{apart:.0e} N m).",
        unit="N m",
    )


def _direction() -> Claim:
    """Compute static tensions at home with the printed e_i, which point from the robot to the load."""
    robot = load("wang-ctmrts")
    A = Dynamics(robot).wrench_matrix(robot.home)[:3]
    tensions = np.linalg.solve(-A, [0.0, 0.0, robot.weight])
    return stated(
        "eq-6-direction",
        "Eq. 6",
        "e_i, from the robot-end to the load, is the direction of the force of a cable with T_i > 0.",
        "T_i > 0",
        tuple(tensions.tolist()),
        holds=bool((tensions > 0).all()),
        agrees="Tensions above zero hold the load at home.",
        differs="With this direction the computed tensions would hold the load at home: the cables would push. The "
        "force "
        "points from the load to the robot-end.",
        unit="N",
    )


def _second_form() -> Claim:
    """Compare R_p (P_i - b_i) / |L_i|, the second form without P_i in {P}, with the moment of the first form."""
    robot, pose = load("wang-ctmrts"), turned_home()
    turn = Rotation.from_euler("ZYX", ANGLES[::-1])
    arms = turn.apply(robot.attachments)
    lines = pose[:3] + arms - robot.carrier_home[:, :3]  # P_i - b_i
    e = lines / np.linalg.norm(lines, axis=1)[:, None]
    first, second = np.cross(arms, e), turn.apply(e)
    return compared(
        "eq-6-second",
        "Eq. 6",
        "The moments (R_p P_i) x e_i of the first form are R_p x (P_i - b_i) / |P_i - b_i| of the second (largest norm "
        "of either, where R_p x is read as R_p times).",
        float(np.linalg.norm(second, axis=1).max()),
        float(np.linalg.norm(first, axis=1).max()),
        within=1e-9,
        agrees="Both forms are the same.",
        differs="A vector product of a matrix and a vector is not defined, and read as a matrix product it has no arm: "
        "P_i in {P} is missing after R_p.",
        unit="m",
    )


def _shape() -> Claim:
    A = Dynamics(load("wang-ctmrts")).wrench_matrix(load("wang-ctmrts").home)
    printed = A.T.shape
    return stated(
        "eq-5-shape",
        "Eqs. 4, 5",
        "J = [J_1 ... J_m]^T, and J T is a wrench (shape of J for m = 3).",
        f"{printed[0]} x {printed[1]}",
        f"{A.shape[0]} x {A.shape[1]}",
        holds=printed[1] == A.shape[1] and printed[0] == 6,
        agrees="The product is defined.",
        differs="With the transpose the product J T is not defined; each cable is a column of J, not a row.",
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
    return compared(
        "eq-7",
        "Eqs. 6, 7",
        "T = [T_1 ... T_m]^T, and J T is the wrench of all cables (largest difference from the sum over the cables, "
        "m = 3, 4, 5, 6).",
        0.0,
        float(max(off)),
        within=1e-9,
        agrees="With the columns of J, as corrected in Eqs. 5 and 6, it is.",
        differs="The sum over the cables is another.",
        unit="N, N m",
    )


def _symbols() -> Claim:
    """Compute how L_1 changes as the load moves, with b_1 in the local and in the global coordinate system."""
    robot, shift = load("wang-ctmrts"), np.array([0.1, 0.0, 0.0])
    end, place, arm = robot.carrier_home[0, :3], robot.home[:3], robot.attachments[0]
    before = np.linalg.norm(end - (place + arm))
    change = np.linalg.norm(end - (place + shift + arm)) - before
    inside = np.linalg.norm((end - place + place + shift) - (place + shift + arm)) - before  # b_1 moves too
    return compared(
        "table-1",
        "Table 1, Eq. 1",
        "b_i is a point in the local coordinate system (change of L_1 when the load moves by 0.1 m along x).",
        float(inside),
        float(change),
        within=1e-9,
        agrees="The length changes alike.",
        differs="A point of the local coordinate system moves with the load. b_i is in the global one, as section 3 "
        "states.",
        unit="m",
    )


def _angular_acceleration() -> Claim:
    _, alpha, _ = _turning()
    return compared(
        "eq-12-angular-acceleration",
        "Eq. 12",
        "The second derivatives of the angles are the angular acceleration about X, Y and Z.",
        tuple(SECOND.tolist()),
        tuple(alpha.tolist()),
        within=1e-3,
        agrees="They are the same at the tested posture and rates.",
        differs="At angles of (0.3, -0.4, 0.5) rad and rates of 1 rad/s the angular acceleration is the computed one, "
        "dP dphi + P ddphi.",
        unit="rad/s^2",
    )


def _inverse() -> Claim:
    ranks = {m: rank(Dynamics(load(SIZES[m])).wrench_matrix(turned_home())) for m in FEWER}
    return stated(
        "eq-13-inverse",
        "Eq. 13",
        "T = J^-1 (M ddX - G - W_e) for m = 3, 4, 5 cables (rank of J).",
        (6.0,) * len(ranks),
        tuple(float(size) for size in ranks.values()),
        holds=all(size == 6 for size in ranks.values()),
        otherwise=Verdict.IMPOSSIBLE,
        agrees="J has rank 6 for each m.",
        differs="An inverse needs six independent columns, and J has m. With six cables it depends on the geometry, "
        f"which the paper does not print: {six_cables()}.",
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
    return compared(
        "equation-references",
        "Eqs. 3, 4, 13, 17",
        "T is expressed by Eq. 3 (above Eq. 13), and least squares solve Eq. 3 (above Eq. 17).",
        (3.0, 3.0),
        (dynamic, dynamic),
        within=0.0,
        agrees="These are the numbers of the equations.",
        differs="Eq. 3 is the rotation matrix; both are about Eq. 4, in which T is.",
    )


def rank(A: np.ndarray) -> int:
    """Return the rank of a wrench matrix (6, m); singular values below 1e-9 of the largest are rounding."""
    return int(np.linalg.matrix_rank(A, rtol=1e-9))
