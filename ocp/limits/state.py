"""`State`: the state at one instant, as CasADi symbols, on which a limit may depend."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ...models import Robot, kinematics
from ...models.cables.pulley import Exit
from ...models.carriers import Effort
from ...models.rigid_body import pull_on_carrier
from ...models.rotation import rotation


class Body(NamedTuple):
    """The motion of platform or carrier in {G}: (x, y, z, roll, pitch, yaw) and its time derivatives, (6, 1) each."""

    pose: ca.SX  # [m, rad]
    velocity: ca.SX  # [m/s, rad/s]
    acceleration: ca.SX  # [m/s^2, rad/s^2]

    @classmethod
    def symbols(cls) -> Self:
        """Return a motion of three symbols; expressions cannot be differentiated with respect to parts of a symbol."""
        return cls(ca.SX.sym("x", 6), ca.SX.sym("v", 6), ca.SX.sym("a", 6))

    @classmethod
    def at_rest(cls, pose: Sequence[float]) -> Self:
        """Return the motion of a body that never moves, as numbers."""
        return cls(ca.SX(ca.DM(pose)), ca.SX(6, 1), ca.SX(6, 1))

    @property
    def moves(self) -> bool:
        """Return whether its motion is symbols or expressions, not numbers."""
        return not self.pose.is_constant()

    @property
    def position(self) -> ca.SX:
        """Return the origin of its frame, (3, 1) [m]."""
        return self.pose[:3]

    @property
    def upright(self) -> ca.SX:
        """Return the cosine of the angle of its z axis to the vertical, (1, 1)."""
        return ca.cos(self.pose[3]) * ca.cos(self.pose[4])


@dataclass(frozen=True)
class State(Displayed):
    """The state at one instant, in {G}.

    Attributes:
        platform: Motion of the platform.
        carriers: Motion of each carrier.
        tensions: (m, 1) [N].
        off_path: Offset of the platform from its path, in the path's axes, (6, 1) [m, rad].
    """

    robot: Robot
    platform: Body
    carriers: tuple[Body, ...]
    tensions: ca.SX
    off_path: ca.SX

    @cached_property
    def com(self) -> ca.SX:
        """Return the CoM of the platform, (3, 1) [m]."""
        return kinematics.transform(self.platform.pose, np.array([self.robot.platform.com]))

    @cached_property
    def carrier_poses(self) -> ca.SX:
        """Return the poses of all carriers, (c, 6) [m, rad]."""
        return ca.vertcat(*(carrier.pose.T for carrier in self.carriers))

    @cached_property
    def anchors(self) -> ca.SX:
        """Return the anchors, (3, m) [m]."""
        return kinematics.anchors(self.robot, self.carrier_poses)

    @cached_property
    def attachments(self) -> ca.SX:
        """Return the attachments, (3, m) [m]."""
        return kinematics.transform(self.platform.pose, self.robot.attachments)

    @cached_property
    def run(self) -> Exit:
        """Return directions, exit points and lengths of the cables."""
        axes = kinematics.axes(self.robot, self.carrier_poses)
        return kinematics.cables(self.robot, self.platform.pose, self.anchors, axes)

    @cached_property
    def cable_speeds(self) -> ca.SX:
        """Return the rates of the lengths of the cables, (m, 1) [m/s]; limits share the expression."""
        return self.rate(self.run.lengths)

    @cached_property
    def cable_accelerations(self) -> ca.SX:
        """Return the second derivatives of the lengths of the cables, (m, 1) [m/s^2]."""
        if self.robot.pulley_radii.any():
            return self.rate(self.cable_speeds)
        # Written out, the second derivatives of programs cost a fifth less.
        d = self.attachments - self.anchors
        v = self.rate(d)
        a = self.rate(v)
        return (ca.sum1(v**2).T - self.cable_speeds**2) / self.run.lengths - ca.sum1(self.run.directions * a).T

    @cached_property
    def efforts(self) -> list[tuple[Effort, ...]]:
        """Return the efforts that motion and cables require of each carrier."""
        robot, gravity = self.robot, np.array(self.robot.gravity)
        return [
            carrier.required_effort(*body, pull_on_carrier(robot, i, self.run, body.pose, self.tensions), gravity)
            for i, (carrier, body) in enumerate(zip(robot.carriers, self.carriers, strict=True))
        ]

    def toward(self, other: Self, share: float) -> Self:
        """Return this state with the poses at a share of the straight way to those of another."""

        def moved(own: Body, its: Body) -> Body:
            return own._replace(pose=own.pose + share * (its.pose - own.pose))

        carriers = tuple(map(moved, self.carriers, other.carriers))
        return replace(self, platform=moved(self.platform, other.platform), carriers=carriers)

    def rate(self, values: ca.SX) -> ca.SX:
        """Return the time derivative of an expression of the poses and velocities."""
        moving = [body for body in (self.platform, *self.carriers) if body.moves]
        parts = [pair for pose, velocity, a in moving for pair in ((pose, velocity), (velocity, a))]
        rates = (ca.jtimes(ca.vec(values), *pair) for pair in parts)
        return ca.reshape(sum(rates, ca.SX.zeros(values.numel())), *values.shape)

    def on_platform(self, points: ca.SX) -> ca.SX:
        """Return points (3, k) of {G} in the platform's frame, (3, k) [m]."""
        turned = rotation(self.platform.pose[3:6])
        return turned.T @ (points - ca.repmat(self.platform.position, 1, points.shape[1]))
