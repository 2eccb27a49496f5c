"""`Initial` and `Final`: the measured state from which a motion starts, and the state in which it ends."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from ...base.errors import InputError
from ...models import Robot
from ...models.part import Finite, Part, Pose, Vector3, optional
from .paths import PoseOrPosition

STILL: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _six_zeros(value: Any) -> Any:
    return STILL if isinstance(value, int | float) and not isinstance(value, bool) and value == 0 else value


OrZero = Annotated[PoseOrPosition, BeforeValidator(_six_zeros, json_schema_input_type=Pose | Vector3 | Literal[0])]


class _State(Part):
    """State at one end of a motion."""

    def of(self, owner: int | None) -> Iterator[tuple[int, Pose]]:
        """Yield the given values of the platform (None) or a carrier, each with the order of its derivative."""
        names = ("pose", "velocity", "acceleration")
        rows = [getattr(self, name if owner is None else f"carrier_{name}", None) for name in names]
        pose, velocity, acceleration = rows if owner is None else [row and row[owner] for row in rows]
        if pose is not None:
            yield 0, pose
            velocity = STILL if velocity is None else velocity
        if velocity is not None:
            yield 1, velocity
            if acceleration is not None:
                yield 2, acceleration


class Initial(_State):
    """The state at the start of a motion, in {G}; it overrides `tube.ends` and `base.ends` there."""

    pose: PoseOrPosition = Field(description="pose of the platform, (x, y, z) or (x, y, z, roll, pitch, yaw) [m, rad]")
    velocity: PoseOrPosition = optional("time derivative of the pose [m/s, rad/s]", STILL)
    acceleration: PoseOrPosition | None = optional(
        "second time derivative [m/s^2, rad/s^2]; default: chosen by the planner"
    )
    carrier_pose: tuple[Pose, ...] | None = optional("pose of each carrier [m, rad]; default: as base.ends requires")
    carrier_velocity: tuple[Pose, ...] | None = optional(
        "velocity of each carrier [m/s, rad/s]; default: at rest, if carrier_pose is given"
    )
    tensions: tuple[Finite, ...] | None = optional(
        "tension of each cable, clipped to the limits [N]; they determine the acceleration at the start; "
        "default: chosen by the planner"
    )


class Final(_State):
    """The state at the end of a motion, in {G}; given fields override `tube.ends` and `base.ends`."""

    pose: PoseOrPosition | None = optional(
        "pose of the platform [m, rad]; default: anywhere in the tube if velocity is given, otherwise as "
        "tube.ends requires"
    )
    velocity: OrZero | None = optional(
        "time derivative of the pose [m/s, rad/s], or 0: at rest; default: at rest, if pose is given"
    )
    acceleration: OrZero | None = optional(
        "second time derivative [m/s^2, rad/s^2], or 0; default: 0 if velocity is 0 and pose is not given, otherwise "
        "chosen by the planner"
    )
    carrier_pose: tuple[Pose, ...] | None = optional("pose of each carrier [m, rad]; default: as base.ends requires")
    carrier_velocity: tuple[Pose, ...] | None = optional(
        "velocity of each carrier [m/s, rad/s]; default: at rest, if carrier_pose is given"
    )
    carrier_acceleration: tuple[Pose, ...] | None = optional(
        "acceleration of each carrier [m/s^2, rad/s^2]; default: chosen by the planner"
    )

    @property
    def rests_anywhere(self) -> bool:
        """Return whether the platform comes to rest where the planner chooses."""
        return self.pose is None and self.velocity == STILL and self.acceleration is None


def check_ends(robot: Robot, initial: Initial | None, final: Final | None, frame: str, where: str) -> None:
    """Check that an initial and a final state fit a robot and the frame of a path.

    Raises `InputError` naming the field, what is accepted and the value.
    """
    count = len(robot.carriers)
    for name, state in (("initial", initial), ("final", final)):
        if state is None:
            continue
        if frame != "world":
            raise InputError(f"{where}: {name} must be left out for a path in the frame of a carrier, {frame!r}")
        for field in ("carrier_pose", "carrier_velocity", "carrier_acceleration"):
            rows = getattr(state, field, None)
            if rows is None:
                continue
            if len(rows) != count:
                raise InputError(
                    f"{where}: {name}.{field} must have a row for each of the {count} carriers, got {len(rows)}"
                )
            if state.carrier_pose is None:
                raise InputError(f"{where}: {name}.{field} must be left out without {name}.carrier_pose")
    if final is not None and final.acceleration is not None and final.pose is None and final.velocity is None:
        raise InputError(f"{where}: final.acceleration must be left out without final.pose or final.velocity")
    tensions = None if initial is None else initial.tensions
    if tensions is not None and len(tensions) != robot.m:
        raise InputError(
            f"{where}: initial.tensions must have a number for each of the {robot.m} cables, got {len(tensions)}"
        )
