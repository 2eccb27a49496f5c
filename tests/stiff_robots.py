"""Robots of the library with elastic cables, and their inertia."""

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
