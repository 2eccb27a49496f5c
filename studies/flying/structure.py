"""Paper F's robot: figures 1 and 2 drawn from its numbers, Eqs. 2 and 3, and a small displacement (Eq. 8)."""

import numpy as np
from scipy.spatial.transform import Rotation

from ...figures.curves import curve_in_space
from ...figures.drawing import Drawing
from ...figures.robot import draw
from ...models import Dynamics, load
from ...models.points import rotations
from ...statics.scene import scene_at
from ..accounts.claim import Chapter, Claim
from .claims import claim
from .rotations import Instants, instants, relative_error

ROUNDING = 1e-12  # [m]
RANK = 1e-9  # of the largest singular value: those below are rounding errors, the printed pairing has rank 3
SMALL = 1e-4  # a small displacement [m] and rotation [rad]
SHOWN = (np.array([0.5, 0.4, 1.4, 0.1, -0.15, 0.3]), np.array([0.15, -0.1, -1.0, 0.2, 0.1, -0.2]))
"""Poses of {A} in {G} and of {B} in {A} in figure 2."""
AXES = 0.25 * np.array([[1, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 1]])  # of a frame, as one line [m]


def chapter() -> Chapter:
    """Check how the robot is put together."""
    robot = load("wang-flying-printed")
    tensions = np.linalg.pinv(Dynamics(robot).wrench_matrix(robot.home), rcond=RANK)[:, 2] * robot.weight
    scene = scene_at(robot, robot.home, tensions, "the printed pairing at home")
    about = "Figure 1: quadrotor, ring of anchors, six cables and platform, from Table 1"
    drawings = {"structure": Drawing(about, draw(scene)), "frames": _frames()}
    return Chapter([_suspended(), *_points(instants())], drawings)


def _suspended() -> Claim:
    """Balance the weight at home with the tensions of least norm, for the printed pairing and for crossed pairs."""
    pulls, left = [], []
    for name in ("wang-flying-printed", "wang-flying"):
        robot = load(name)
        A, w = Dynamics(robot).wrench_matrix(robot.home), np.array([0, 0, robot.weight, 0, 0, 0])
        tensions = np.linalg.pinv(A, rcond=RANK) @ w
        pulls.append(tensions.min())
        left.append(np.abs(A @ tensions - w).max())
    return claim("fig-1").stated(pulls, min(pulls) > 0 and max(left) < ROUNDING)


def _points(samples: Instants) -> list[Claim]:
    dynamics, robot = Dynamics(load("wang-flying")), load("wang-flying")
    x_A, x_b = samples.base.pose[:, None, :3], samples.body.pose[:, None, :3]
    R_A, R_B = samples.R_A.R.transpose(0, 2, 1), samples.R_B.R.transpose(0, 2, 1)  # of rows, from the right
    # A_i and B_i in {G} by Eqs. 2 and 3, (n, 6, 3) each [m], compared with the points of the model at the world poses.
    anchors, ends = robot.anchors @ R_A + x_A, x_b @ R_A + robot.attachments @ R_B @ R_A + x_A
    world, _, _ = dynamics.relative.motion_in_world(*samples.body, *samples.base)
    own = np.concatenate(dynamics.points(world, samples.base.pose[:, None]), axis=1)
    # The loop from O over O_A and A_i, and over O_A, O_B and B_i, with L_i = R_A (a_i - x_b - R_B b_i).
    L = (robot.anchors - x_b - robot.attachments @ R_B) @ R_A
    # B + dB, and the attachments of a platform that was moved and turned by little, at tilted poses.
    small = SMALL * np.array([0.6, -0.8, 0.5, 0.3, 0.9, -0.7])
    arms = ends - (x_b @ R_A + x_A)
    moved = small[:3] + arms @ Rotation.from_rotvec(small[3:]).as_matrix().T - arms
    linear = small[:3] + np.cross(small[3:], arms)  # Eq. 10
    angles = samples.base.pose[:, 3:]
    change = rotations(angles + small[3:]) - rotations(angles)
    by_angles = small[:3] + np.einsum("nij,mj->nmi", change, robot.attachments)
    by_vector = small[:3] + np.cross(small[3:], robot.attachments @ R_A)
    share = relative_error(by_vector, by_angles).max()
    return [
        claim("eq-3").compared(np.abs(np.concatenate([anchors, ends], axis=1) - own).max(), within=ROUNDING),
        claim("fig-2").compared(np.linalg.norm(ends + L - anchors, axis=-1).max(), within=ROUNDING),
        claim("eq-8").stated(share, share < SMALL, apart=np.linalg.norm(moved - linear, axis=-1).max(), small=SMALL),
    ]


def _frames() -> Drawing:
    robot, (base, body) = load("wang-flying-printed"), SHOWN
    R_A, R_B = rotations(base[3:]), rotations(body[3:])
    x_B = base[:3] + R_A @ body[:3]
    anchor, end = base[:3] + R_A @ robot.anchors[0], x_B + R_A @ R_B @ robot.attachments[0]
    lines = {
        "{G}": AXES,
        "{A}": base[:3] + AXES @ R_A.T,
        "{B}": x_B + AXES @ (R_A @ R_B).T,
        "x_A": np.stack([np.zeros(3), base[:3]]),
        "R_A x_b": np.stack([base[:3], x_B]),
        "R_A a_1": np.stack([base[:3], anchor]),
        "R_A R_B b_1": np.stack([x_B, end]),
        "L_1": np.stack([end, anchor]),
    }
    return Drawing(
        "Figure 2: the frames {G}, {A} and {B} with their axes (x ends in a dot), and the vectors of Eqs. 2 to 4",
        curve_in_space(lines),
    )
