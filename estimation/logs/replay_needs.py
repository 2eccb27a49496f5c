"""`missing_for_replay`: what the fields of a log lack for a replay, so that `towline log` and replays agree."""

from collections.abc import Collection

from ...models.robot import Robot
from .mapping import Fields

TO_COMPARE = "poses, or tensions or lengths that do not drive the plant"


def missing_for_replay(
    found: Fields, commands: Fields, timed: bool, robot: Robot | None = None, placed: Collection[str] = ()
) -> str | None:
    """Return what a log lacks for a replay, or None.

    - `found`: fields of the measurements.
    - `commands`: fields of commands and efforts, as of `command_fields`.
    - `timed`: True if the measurements have times.
    - `robot`: the robot, if it is known.
    - `placed`: names of the carriers whose positions were recorded.
    """
    fixed = robot is not None and robot.fixed_lengths is not None
    moving = [] if robot is None else [one.name for one in robot.carriers if one.free_coordinates(robot.drive)]
    turns = robot is None or bool(robot.dof_mask[3:].any())
    if not timed:
        return "times"
    if lost := next((name for name in moving if name not in placed), None):
        return f"poses of carrier {lost} ({lost}_x, ..., {lost}_qw)"
    whole = bool(found.position) and (bool(found.orientation) or not turns)
    if not (whole or found.directions) and (moving or not found.lengths):
        return "poses of the platform, position and orientation,"
    read = bool(found.lengths) and commands.commands != found.lengths
    pulled = bool(commands.efforts if not found.tensions else commands.commands != found.tensions)
    compared = bool(found.position or found.directions) + bool(turns and found.orientation) + read + pulled
    driving = 0 if fixed or commands.commands else 1  # measured lengths or tensions
    return None if compared > driving else TO_COMPARE
