"""Robots of the library with elastic cables, their inertia and natural frequencies."""

import numpy as np
from scipy.spatial.transform import Rotation

from towline import Robot, load


def elastic(name, EA, t_min=1.0, pulleys=None, **platform):
    data = load(name).model_dump(mode="json")
    for cable in data["cables"]:
        cable |= {"stiffness": EA, "t_min": max(t_min, cable["t_min"]), "pulley": pulleys}
    return Robot.model_validate({**data, "platform": {**data["platform"], **platform}})


def inertia(robot, pose):
    """Return the inertia of translation and rotation in {G}, (6, 6)."""
    R = Rotation.from_euler("ZYX", pose[5:2:-1]).as_matrix()
    I = np.array(robot.platform.inertia)  # noqa: E741
    I = R @ np.array([[I[0], I[3], I[4]], [I[3], I[1], I[5]], [I[4], I[5], I[2]]]) @ R.T  # noqa: E741
    return np.block([[robot.platform.mass * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), I]])


def frequencies(robot, pose, pulls):
    """Return the natural frequencies with these tensions, ascending [Hz]: by differences of the cables' forces."""
    EA = np.array([cable.stiffness for cable in robot.cables])
    R = Rotation.from_euler("ZYX", pose[5:2:-1]).as_matrix()
    arms, com = (robot.attachments - robot.platform.com) @ R.T, pose[:3] + R @ robot.platform.com

    def strained(delta):
        turn = np.array([[0, -delta[5], delta[4]], [delta[5], 0, -delta[3]], [-delta[4], delta[3], 0]])
        r = arms + arms @ turn.T
        return r, robot.anchors - com - delta[:3] - r

    unstrained = np.linalg.norm(strained(np.zeros(6))[1], axis=1) / (1 + pulls / EA)

    def wrench(delta):
        r, along = strained(delta)
        lengths = np.linalg.norm(along, axis=1)
        forces = (EA * (lengths / unstrained - 1) / lengths)[:, None] * along
        return np.r_[forces.sum(axis=0), np.cross(r, forces).sum(axis=0)]

    K = -np.array([wrench(1e-6 * e) - wrench(-1e-6 * e) for e in np.eye(6)]).T / 2e-6
    moves = np.flatnonzero(robot.dof_mask)
    K, M = (part[np.ix_(moves, moves)] for part in ((K + K.T) / 2, inertia(robot, pose)))
    return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)) / (2 * np.pi)
