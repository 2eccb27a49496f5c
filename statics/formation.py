"""`formation`: how flying carriers rest around their platform with all cables taut, near where they are.

The unknowns are roll and pitch of the platform, up to 0.6 rad, poses of the carriers except their yaw, and tensions.
They balance all weights inside the limits of tensions and efforts, with cables of their lengths, and differ little from
where they are:

    min   sum of |p_i - p_i0|^2 + (length of the robot)^2 |tilt - tilt0|^2
    s.t.  A t + m g = 0,   l_i = L_i,   efforts of carriers and tensions inside their limits
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from ..base.display import record
from ..models import kinematics
from ..models.rigid_body import pull_on_carrier
from ..models.robot import Robot

MARGIN = 0.025  # of a range, that tensions and efforts keep to their limits
TILT = 0.6  # [rad] of the platform, at most
PENALTY = 1e3  # of a missing weight of the platform, over the cost of a carrier a robot's length away
ITERATIONS = 300
OPTIONS = {"print_time": False, "error_on_fail": False}
OPTIONS |= {"ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": ITERATIONS}


class Formation(NamedTuple):
    """An equilibrium of a robot with flying carriers."""

    # poses of the platform, (6,), and of the carriers, (c, 6), in {G} [m, rad]
    pose: np.ndarray
    carrier_pose: np.ndarray
    tensions: np.ndarray  # (m,) [N]
    # what its cables lack to hold the platform: force [N] and moment about the CoM [N m] in {G}, (6,); zeros if it
    # rests
    missing: np.ndarray

    __repr__ = record

    @property
    def exists(self) -> bool:
        """Return whether the robot rests."""
        return not self.missing.any()


def formation(robot: Robot, pose: np.ndarray, carrier_pose: np.ndarray, lengths: np.ndarray) -> Formation:
    """Return the formation nearest to a pose (6,) and carriers (c, 6) [m, rad], with cables of `lengths`, (m,) [m].

    If none is found, it is the one that misses the smallest part of the wrench.
    """
    for most in (0.0, np.inf):  # of the missing wrench
        if (found := _solved(robot, pose, carrier_pose, lengths, most)) is not None:
            return found
    weight = np.append(robot.platform.mass * np.array(robot.gravity), np.zeros(3))
    return Formation(pose, carrier_pose, np.zeros(robot.m), -weight)


def _solved(robot: Robot, pose: np.ndarray, carriers: np.ndarray, lengths: np.ndarray, most: float) -> Formation | None:
    c, m, force, gravity = len(robot.carriers), robot.m, robot.force_scale, np.array(robot.gravity)
    tilt, moved, t, missing = ca.SX.sym("tilt", 2), ca.SX.sym("moved", 5, c), ca.SX.sym("t", m), ca.SX.sym("missing", 6)
    at, placed = ca.vertcat(pose[:3], tilt, pose[5]), ca.vertcat(moved, ca.DM(carriers[:, 5]).T).T  # (c, 6)
    anchors = kinematics.anchors(robot, placed)
    axes = kinematics.axes(robot, placed)
    run = kinematics.cables(robot, at, anchors, axes)
    A = kinematics.wrench_matrix(robot, at, run.directions)
    scale = np.repeat([1.0, 1 / robot.length], 3) / force
    weight = np.append(robot.platform.mass * gravity, np.zeros(3))
    rows = [scale * (A @ t + weight) + missing, (ca.vec(run.lengths) - lengths) / robot.length]
    low = [np.zeros(6 + m)]
    high, still = [*low], ca.DM.zeros(6, 1)
    for index, carrier in enumerate(robot.carriers):
        own = placed[index, :].T
        pull = pull_on_carrier(robot, index, run, own, t)
        for effort in carrier.required_effort(own, still, still, pull, gravity):
            room, count = MARGIN * (effort.high - effort.low), effort.values.numel()
            rows.append(effort.values / force)
            low.append(np.full(count, (effort.low + room) / force))
            high.append(np.full(count, (effort.high - room) / force))
    cost = ca.sumsqr(moved[:3, :] - ca.DM(carriers[:, :3]).T) + robot.length**2 * ca.sumsqr(tilt - pose[3:5])
    cost += PENALTY * robot.length**2 * ca.sumsqr(missing)
    problem = {"x": ca.vertcat(tilt, ca.vec(moved), t, missing), "f": cost, "g": ca.vertcat(*rows)}
    solver = ca.nlpsol("formation", "ipopt", problem, OPTIONS)
    start = np.hstack([pose[3:5], carriers[:, :5].ravel(), np.clip(force / m, robot.t_min, robot.t_max), np.zeros(6)])
    room, free, lack = MARGIN * (robot.t_max - robot.t_min), np.full(2 + 5 * c, np.inf), np.full(6, most)
    free[:2] = TILT
    lower, upper = [-free, robot.t_min + room, -lack], [free, robot.t_max - room, lack]
    of_rows = {"lbg": np.hstack(low), "ubg": np.hstack(high)}
    found = solver(x0=start, lbx=np.hstack(lower), ubx=np.hstack(upper), **of_rows)
    if not solver.stats()["success"]:
        return None
    x = np.asarray(found["x"]).ravel()
    placed = np.column_stack([x[2 : 2 + 5 * c].reshape(c, 5), carriers[:, 5]])
    return Formation(np.hstack([pose[:3], x[:2], pose[5]]), placed, x[2 + 5 * c : -6], x[-6:] / scale)
