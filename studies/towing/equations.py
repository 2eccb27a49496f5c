"""Paper C's model, equations 3 to 13, compared with the model of this toolkit."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import Dynamics, load
from ..accounts.account import Chapter
from ..accounts.claim import Claim, Verdict, compared, stated

ANGLES = np.array([0.3, -0.4, 0.5])  # roll, pitch, yaw [rad], inside the paper's (-1, 1)
RATES = np.array([1.0, 1.0, 1.0])  # their time derivatives [rad/s]
SECOND = np.array([0.5, -0.5, 0.5])  # and second ones [rad/s^2]
SIZES = {3: "wang-ctmrts", 4: "wang-ctmrts-4", 5: "wang-ctmrts-5", 6: "wang-ctmrts-6"}  # robots by m


def chapter() -> Chapter:
    """Check each equation of section 3 that can be tested."""
    return Chapter([_rotation(), _rigid(), _gyroscopic(), _direction(), _shape(), _angular_acceleration(), _inverse()])


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
        agrees="An independent rotation gives the same lengths; the printed column is Eqs. 1 to 3 at one posture.",
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
        "The moments of the cables only have to give M ddX (moment that is left out).",
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
    ranks = {m: rank(Dynamics(load(name)).wrench_matrix(turned_home())) for m, name in SIZES.items()}
    return stated(
        "eq-13-inverse",
        "Eq. 13",
        "T = J^-1 (M ddX - G - W_e) for m = 3, 4, 5, 6 cables (rank of J).",
        (6.0, 6.0, 6.0, 6.0),
        tuple(float(size) for size in ranks.values()),
        holds=all(size == 6 for size in ranks.values()),
        otherwise=Verdict.IMPOSSIBLE,
        agrees="J has rank 6 for each m.",
        differs="An inverse needs rank 6, and the computed ranks are smaller. Six cables can have rank 6, but not "
        "between "
        "two similar regular hexagons, as here.",
    )


def rank(A: np.ndarray) -> int:
    """Return the rank of a wrench matrix (6, m); singular values below 1e-9 of the largest are rounding."""
    return int(np.linalg.matrix_rank(A, rtol=1e-9))
