"""`Phase`: a part of a task with a path, a load and, optionally, the ground under it."""

from collections.abc import Sequence
from itertools import product

import numpy as np
from pydantic import Field

from ...models.body import AnyBody
from ...models.part import Name, NonNegative, Part, Pose, Positive, PositiveRange, Vector3, optional
from ...models.rigid_load import RigidLoad
from .paths import RestPath, SequencePath, SinglePath
from .paths.sequence import Piece, check_continuity, lasting


class Load(RigidLoad):
    """A rigid body that is fixed to the platform, in addition to the platform of the robot's file."""

    mass: Positive = Field(description="mass [kg]")
    mass_tolerance: float = optional(
        "relative tolerance of the mass; 0.1: tensions exist for every mass from 0.9 to 1.1 times this one",
        0.0,
        ge=0,
        lt=1,
    )
    com_tolerance: tuple[NonNegative, NonNegative, NonNegative] = optional(
        "distance by which the CoM may differ along each axis of the platform [m]: tensions exist for "
        "every CoM in this box",
        (0.0, 0.0, 0.0),
    )
    body: AnyBody | None = optional(
        "convex body in the platform frame, which the plan keeps above the floor, inside the workspace box and "
        "out of keep-out regions while the load is carried; default: none"
    )

    @property
    def numbers(self) -> np.ndarray:
        """Return mass, CoM and inertia, (10,), as `Dynamics.carried_wrench` takes them."""
        return np.array([self.mass, *self.com, *self.inertia])

    @property
    def extremes(self) -> np.ndarray:
        """Return the extreme loads within the tolerances, (k, 10); none without tolerances.

        If tensions exist for these loads, they exist for all within the tolerances. The wrench of a load is affine
        in its mass, and in its CoM if its inertia about the nominal CoM is proportional to its mass. Each wrench is
        therefore a weighted mean of the wrenches of the extreme loads, and the available wrench set is convex.
        """
        masses = np.unique([self.mass * (1 - self.mass_tolerance), self.mass * (1 + self.mass_tolerance)])
        offsets = list(product(*(np.unique([-off, off]) + 0.0 for off in self.com_tolerance)))
        loads = []
        for mass, (x, y, z) in product(masses.tolist(), offsets):
            # About its own CoM, from that about the nominal one (parallel axes).
            nearer = mass * np.array([y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])
            inertia = np.array(self.inertia) * mass / self.mass - nearer
            loads.append([mass, self.com[0] + x, self.com[1] + y, self.com[2] + z, *inertia])
        return np.array(loads) if len(loads) > 1 else np.zeros((0, 10))


class Ground(Part):
    """Ground under the platform or its load: vertical forces that only push, without friction."""

    support: tuple[Vector3, ...] | None = optional(
        "points at which the ground pushes, in the platform frame [m]; default: one below each attachment, "
        "level with the lowest",
        min_length=1,
    )
    slack: bool = optional("true if cables may be slack: their tensions then have the lower limit 0", False)


class Phase(Part):
    """A part of a task: a path, the load, and the ground."""

    name: Name = Field(description="name of the phase, for reports")
    path: SinglePath | None = optional("path of the platform; default: rest at the end of the previous phase")
    duration: Positive | PositiveRange | None = optional(
        "duration [s], at least 0.01; or a range {min, max}, from which the planner takes the shortest "
        "feasible duration; default: the path's own"
    )
    load: Load | None = optional("load fixed to the platform; default: none")
    ground: Ground | None = optional("contact of the platform or its load with the ground; default: no contact")


def path_of(phases: Sequence[Phase]) -> SequencePath:
    """Return the paths of phases as a sequence.

    Raises `ValueError` if a path is missing, does not begin where the one before ends, or has no duration; one line
    that names it.
    """
    joined: list[tuple[SinglePath, float]] = []
    for index, phase in enumerate(phases):
        key, path = f"phases[{index}]", phase.path
        if phase.name in (other.name for other in phases[:index]):
            raise ValueError(f"{key}.name must be unique, got {phase.name!r} twice")
        if path is None:
            if not joined:
                raise ValueError(f"{key}.path must be a path, since no phase comes before it, got nothing")
            before, seconds = joined[-1]
            x, y, z, roll, pitch, yaw = before.at(np.array([seconds]), seconds).pose[0].tolist()
            pose: Pose = (x, y, z, roll, pitch, yaw)
            path = RestPath(kind="rest", frame=before.frame, pose=pose)
        if joined and path.frame != joined[0][0].frame:
            raise ValueError(f"{key}.path.frame must be {joined[0][0].frame!r}, as before, got {path.frame!r}")
        if phase.ground is not None and not isinstance(path, RestPath):
            raise ValueError(f"{key}.path must be of kind rest in a phase on the ground, got {path.kind}")
        try:
            longest = phase.duration.max if isinstance(phase.duration, PositiveRange) else phase.duration
            joined.append((path, lasting(path, longest)))
        except ValueError as error:
            raise ValueError(f"{key}.{error}") from None
    check_continuity(joined, "phases", [k for k, phase in enumerate(phases) if phase.ground is not None])
    parts = tuple(Piece(path=path, duration=seconds) for path, seconds in joined)
    return SequencePath(kind="sequence", frame=joined[0][0].frame, parts=parts)
