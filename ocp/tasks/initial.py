"""`Initial`: the state that a motion starts from, as measured on a robot that moves."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import Field

from ...errors import InputError
from ...models import Robot
from ...models.part import Part, Pose

__all__ = ["Initial", "check_initial"]

STILL: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Initial(Part):
    """The state at the start of a motion, in {G}: it replaces what `tube.ends` and `base.ends` require there."""

    pose: Pose = Field(description="(x, y, z, roll, pitch, yaw) of the platform [m, rad]")
    velocity: Pose = Field(default=STILL, description="their time derivatives [m/s, rad/s]")
    acceleration: Pose | None = Field(
        default=None, description="the second ones [m/s^2, rad/s^2]; default: as the planner chooses"
    )
    carrier_pose: tuple[Pose, ...] | None = Field(
        default=None, description="of each carrier [m, rad]; default: as base.ends requires"
    )
    carrier_velocity: tuple[Pose, ...] | None = Field(
        default=None, description="of each carrier [m/s, rad/s]; default: at rest, if carrier_pose is given"
    )

    def of(self, owner: int | None) -> Iterator[tuple[int, Pose]]:
        """Yield what is given of the platform (None) or of a carrier: the order of the derivative, and the value."""
        if owner is None:
            yield 0, self.pose
            yield 1, self.velocity
            if self.acceleration is not None:
                yield 2, self.acceleration
        elif self.carrier_pose is not None:
            yield 0, self.carrier_pose[owner]
            yield 1, STILL if self.carrier_velocity is None else self.carrier_velocity[owner]


def check_initial(robot: Robot, initial: Initial, frame: str, where: str) -> None:
    """Check that an initial state fits a robot and the frame of a path.

    Raises
    ------
    InputError
        Naming the field, what is accepted and the value.
    """
    if frame != "world":
        raise InputError(f"{where}: initial must be left out for a path in the frame of a carrier, {frame!r}")
    count = len(robot.carriers)
    for name in ("carrier_pose", "carrier_velocity"):
        rows = getattr(initial, name)
        if rows is not None and len(rows) != count:
            raise InputError(
                f"{where}: initial.{name} must have a row for each of the {count} carriers, got {len(rows)}"
            )
    if initial.carrier_velocity is not None and initial.carrier_pose is None:
        raise InputError(f"{where}: initial.carrier_velocity must be left out without initial.carrier_pose")
