"""`formation`: how flying carriers rest around their platform with all cables taut, near where they are.

The unknowns are roll and pitch of the platform, up to 0.6 rad, poses of the carriers except their yaw, and tensions.
They balance all weights inside the limits of tensions and efforts, with cables of their lengths, and differ little from
where they are:

    min   sum of |p_i - p_i0|^2 + level (length of the robot)^2 |tilt - tilt0|^2
    s.t.  A t + m g = 0,   l_i = L_i,   efforts of carriers and tensions inside their limits
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from ..base.display import record
from ..models import kinematics
from ..models.cables.pulley import Exit
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


def formation(
    robot: Robot, pose: np.ndarray, carrier_pose: np.ndarray, lengths: np.ndarray, level: float = 1.0
) -> Formation:
    """Return the formation nearest to a pose (6,) and carriers (c, 6) [m, rad], with cables of `lengths`, (m,) [m].

    With a larger `level` the platform tilts less, and carriers are further away. If none is found, it is the one that
    misses the smallest part of the wrench.
    """
    for most in (0.0, np.inf):  # of the missing wrench
        if (found := _solved(robot, pose, carrier_pose, lengths, level, most)) is not None:
            return found
    weight = np.append(robot.platform.mass * np.array(robot.gravity), np.zeros(3))
    return Formation(pose, carrier_pose, np.zeros(robot.m), -weight)


class _Row(NamedTuple):
    """A constraint: low <= value <= high, in parts of the characteristic force or length."""

    value: ca.SX  # (k, 1)
    low: float | np.ndarray = 0.0
    high: float | np.ndarray = 0.0


def _solved(
    robot: Robot, pose: np.ndarray, carriers: np.ndarray, lengths: np.ndarray, level: float, most: float
) -> Formation | None:
    """Return the nearest formation that misses up to `most` in a row, as a part of the force scale, or None."""
    c, m = len(robot.carriers), robot.m
    tilt, moved = ca.SX.sym("tilt", 2), ca.SX.sym("moved", 5, c)  # moved: x, y, z, roll and pitch of the carriers
    t, missing = ca.SX.sym("t", m), ca.SX.sym("missing", 6)
    at, placed = ca.vertcat(pose[:3], tilt, pose[5]), ca.vertcat(moved, ca.DM(carriers[:, 5]).T).T  # (c, 6)
    run = kinematics.cables(robot, at, kinematics.anchors(robot, placed), kinematics.axes(robot, placed))
    rows = [*_at_rest(robot, at, run, t, missing, lengths), *_inside_efforts(robot, placed, run, t)]
    cost = ca.sumsqr(moved[:3, :] - ca.DM(carriers[:, :3]).T) + level * robot.length**2 * ca.sumsqr(tilt - pose[3:5])
    cost += PENALTY * robot.length**2 * ca.sumsqr(missing)
    unknowns, values = ca.vertcat(tilt, ca.vec(moved), t, missing), ca.vertcat(*(row.value for row in rows))
    solver = ca.nlpsol("formation", "ipopt", {"x": unknowns, "f": cost, "g": values}, OPTIONS)
    room, free = MARGIN * (robot.t_max - robot.t_min), np.full(5 * c, np.inf)
    pulls = np.clip(robot.force_scale / m, robot.t_min, robot.t_max)
    found = solver(
        x0=np.hstack([pose[3:5], carriers[:, :5].ravel(), pulls, np.zeros(6)]),
        lbx=np.hstack([[-TILT, -TILT], -free, robot.t_min + room, np.full(6, -most)]),
        ubx=np.hstack([[TILT, TILT], free, robot.t_max - room, np.full(6, most)]),
        lbg=np.hstack([np.broadcast_to(row.low, row.value.numel()) for row in rows]),
        ubg=np.hstack([np.broadcast_to(row.high, row.value.numel()) for row in rows]),
    )
    if not solver.stats()["success"]:
        return None
    tilted, places, tensions, lacking = np.split(np.asarray(found["x"]).ravel(), np.cumsum([2, 5 * c, m]))
    placed_at = np.column_stack([places.reshape(c, 5), carriers[:, 5]])
    return Formation(
        np.hstack([pose[:3], tilted, pose[5]]), placed_at, tensions, lacking * robot.force_scale / robot.wrench_scale
    )


def _at_rest(robot: Robot, pose: ca.SX, run: Exit, tensions: ca.SX, missing: ca.SX, lengths: np.ndarray) -> list[_Row]:
    """Return the balance of the platform, up to the `missing` part of its wrench, and the lengths of the cables."""
    A = kinematics.wrench_matrix(robot, pose, run.directions)
    weight = np.append(robot.platform.mass * np.array(robot.gravity), np.zeros(3))
    return [
        _Row(robot.wrench_scale / robot.force_scale * (A @ tensions + weight) + missing),
        _Row((ca.vec(run.lengths) - lengths) / robot.length),
    ]


def _inside_efforts(robot: Robot, carriers: ca.SX, run: Exit, tensions: ca.SX) -> list[_Row]:
    """Return the efforts of the carriers at rest under the pull of their cables, and their limits less a margin."""
    still, gravity, force = ca.DM.zeros(6, 1), np.array(robot.gravity), robot.force_scale
    rows = []
    for index, carrier in enumerate(robot.carriers):
        own = carriers[index, :].T
        pull = pull_on_carrier(robot, index, run, own, tensions)
        for effort in carrier.required_effort(own, still, still, pull, gravity):
            room = MARGIN * (effort.high - effort.low)
            rows.append(_Row(effort.values / force, (effort.low + room) / force, (effort.high - room) / force))
    return rows
