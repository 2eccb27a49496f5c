"""The forces that motors of winches need to pull and to accelerate their winches while a robot stops.

A winch with the inertia J (a mass on the cable) needs the force t - J d2l/dt2, and friction; see `Winch`.
"""

import numpy as np

from ..base.text import quantity
from ..models.dynamics import dynamics_of
from ..models.robot import Robot
from ..models.trajectory import Trajectory, moved_on

SHORT = 1e-3  # [s], of differences of lengths
OF_FORCE = 1e-3  # of a motor's force: what the needed one may exceed it by
STILL = 1e-9  # of what the plan needs


def has_winches(robot: Robot) -> bool:
    """Return whether winches that the file describes change the lengths of cables."""
    return robot.fixed_lengths is None and any(cable.winch for cable in robot.cables)


def _winches(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return the inertias [kg], (m,), and the largest forces [N], (m,), of the winches of the file."""
    each = [(cable.winch.inertia, cable.winch.tension_max) if cable.winch else (0.0, np.inf) for cable in robot.cables]
    inertia, most = np.array(each).T
    return inertia, most


def shares_of_winches(robot: Robot, trajectory: Trajectory, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return first and second derivatives of the lengths by tau, (n, m), over the accelerations that motors can give.

    These have half of the force that the planned tensions leave, the other half is for other tensions; and as much as
    the plan itself needs.
    """
    motions, dynamics = trajectory.at(tau), dynamics_of(robot)
    before, now, after = (
        dynamics.cable_lengths(*(moved_on(motion, sign * SHORT)[0] for motion in motions)) for sign in (-1, 0, 1)
    )
    v, g = (after - before) / (2 * SHORT), (after - 2 * now + before) / SHORT**2
    planned = 0.0 if trajectory.tensions is None else np.nan_to_num(trajectory.tensions(tau))
    inertia, most = _winches(robot)
    largest = np.maximum((most - planned) / 2, (1 + STILL) * inertia * np.abs(g))
    return inertia * v / largest, inertia * g / largest


def largest_forces(robot: Robot) -> list[float]:
    """Return the largest force of the motor of each winch, (m,) [N]; infinity without a winch in the file."""
    return _winches(robot)[1].tolist()


def forces_of_winches(robot: Robot, times: np.ndarray, lengths: np.ndarray, tensions: np.ndarray) -> np.ndarray:
    """Return the sizes of the forces of motors, (n, m) [N], that pull with tensions and accelerate their winches."""
    acceleration = np.gradient(np.gradient(lengths, times, axis=0), times, axis=0)
    return np.abs(tensions - _winches(robot)[0] * acceleration)


def overloaded_winch(robot: Robot, times: np.ndarray, lengths: np.ndarray, tensions: np.ndarray) -> str:
    """Return which winch needs the largest force beyond its motor's, to pull with tensions and to be accelerated."""
    if not has_winches(robot):
        return ""
    most, force = _winches(robot)[1], forces_of_winches(robot, times, lengths, tensions)
    row, cable = np.unravel_index(int(np.argmax(force - most)), force.shape)
    if force[row, cable] <= most[cable] * (1 + OF_FORCE):
        return ""
    needs, has = quantity(force[row, cable], "N"), quantity(most[cable], "N")
    return f"winch_force of cable {cable + 1} must be at most {has} but is {needs} at t = {times[row]:.3f} s"
