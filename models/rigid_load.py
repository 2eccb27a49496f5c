"""`RigidLoad`: a rigid body on the platform, and the robot that carries it."""

from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field

from .part import AT_ORIGIN, Inertia, NonNegative, Part, Vector3, inertia_matrix, optional
from .robot import Robot

ROUNDING = 1e-12  # of the largest moment of inertia


def _check_positive_semidefinite(inertia: Inertia) -> Inertia:
    moments = np.linalg.eigvalsh(inertia_matrix(inertia))
    if moments[0] < -ROUNDING * max(moments[-1], 0.0):
        raise ValueError(f"must have principal moments >= 0 kg m^2; the smallest moment is {moments[0]:g}")
    return inertia


class RigidLoad(Part):
    """A rigid body that is fixed to the platform, in addition to the platform of the robot's file."""

    mass: NonNegative = Field(description="mass of the load [kg]; 0: none")
    com: Vector3 = optional("CoM of the load in the platform frame [m]", (0.0, 0.0, 0.0))
    inertia: Annotated[Inertia, AfterValidator(_check_positive_semidefinite)] = optional(
        "inertia (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the CoM of the load in platform axes [kg m^2], as entries of the "
        "tensor, so Ixy is minus the integral of x y dm",
        AT_ORIGIN,
    )

    def on(self, robot: Robot) -> Robot:
        """Return the robot with a platform that includes the load."""
        platform = robot.platform
        bodies = [(platform.mass, platform.com, platform.inertia or AT_ORIGIN), (self.mass, self.com, self.inertia)]
        mass = platform.mass + self.mass
        com = sum((m * np.array(c) for m, c, _ in bodies), np.zeros(3)) / mass
        total = np.zeros((3, 3))
        for m, c, inertia in bodies:
            arm = np.array(c) - com
            total += inertia_matrix(inertia) + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        changes: dict[str, Any] = {"mass": mass, "com": tuple(com.tolist())}
        if platform.inertia is not None:
            changes["inertia"] = tuple(total[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist())
        return robot.model_copy(update={"platform": platform.model_copy(update=changes)})
