"""Which parameters measurements suffice for: `usual`, `is_enough`, `check_enough`."""

from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...base.text import counted
from ...models.robot import Robot
from ..logs.measurements import Measurements, measured, measured_poses, tracked
from .balance import Balance, hangs, needs_balance
from .clock import CLOCK_RANGE, is_still, moves_smoothly, winds
from .model import Model
from .parameters import IN_BALANCE, Parameters
from .sightings import sighted


def usual(robot: Robot, measurements: Measurements) -> tuple[str, ...]:
    """Return the default free parameters: offsets, anchors if the readings change, the clock if motion was measured.

    Gravity at rest without measured positions tells the CoM in the place of the anchors: a wrong CoM would move these
    far, and it is less certain in files.
    """
    still = is_still(measurements)
    if still and measurements.carrier_poses is None:
        return ("offsets",)
    if _rests_without_positions(robot, measurements):
        return ("offsets", "com")
    groups = ("anchors", "offsets", "clock")
    known = measurements.times is not None and not still and is_enough(robot, measurements, ("clock",))
    return groups if known and winds(measurements) and moves_smoothly(robot, measurements) else groups[:-1]


def _rests_without_positions(robot: Robot, measurements: Measurements) -> bool:
    """Return whether gravity tells poses at rest, of which no positions were measured, and the CoM."""
    moves = robot.dof_mask > 0
    known = measured_poses(robot, measurements)[2][:, :3][:, moves[:3]].any()
    if known or not moves[3:].any() or measurements.carrier_poses is not None:
        return False
    rests = needs_balance(robot, measurements) and Balance(robot, measurements).at_rest
    return rests and is_enough(robot, measurements, ("offsets", "com"))


def is_enough(robot: Robot, measurements: Measurements, groups: tuple[str, ...]) -> bool:
    """Return whether there are enough measurements for these parameters without a prior."""
    try:
        check_enough(robot, measurements, groups, {})
    except InputError:
        return False
    return True


def check_enough(robot: Robot, measurements: Measurements, groups: tuple[str, ...], prior: dict[str, float]) -> None:
    """Raise InputError unless there are at least as many equations as unknowns, and times and poses for a clock."""
    parameters = Parameters(robot, groups)
    if "clock" in groups:
        known = tracked(robot, measurements)
        if measurements.times is None:
            raise InputError("measurements.times must be given to estimate a clock offset, got none")
        if known.sum() < 4:
            raise InputError(
                f"measurements.poses must have at least 4 rows to estimate a clock offset, got {known.sum()}"
            )
        if measurements.times[-1] - measurements.times[0] <= 2 * CLOCK_RANGE / 10:
            raise InputError(
                f"measurements.times must span more than {CLOCK_RANGE / 5:g} s to estimate a clock offset, got "
                f"{measurements.times[-1] - measurements.times[0]:g} s"
            )
    framed = [name for name in ("frame", "body") if name in groups]
    if framed and not measured(measurements).any():
        raise InputError(f"measurements.poses must be given to estimate {', '.join(framed)}, got none")
    of_forces = [name for name in groups if name in (*IN_BALANCE, "stiffness", "elasticity")]
    known = {"com", "elasticity"} if hangs(robot, measurements) else {"com"}
    if measurements.tensions is None and not set(of_forces) <= known:
        flies = any(carrier.actuators for carrier in robot.carriers)
        hint = " (or thrusts, attitudes and times of the carriers in a log)" if flies else ""
        raise InputError(f"measurements.tensions must be given to estimate {', '.join(of_forces)}{hint}, got none")
    model = Model(parameters, measurements, prior, np.ones((robot.m, len(measurements)), dtype=bool))
    model = replace(model, interpolates="clock" in groups)
    if not set(IN_BALANCE).isdisjoint(groups) and (robot.weight == 0.0 or model.balanced is None):
        needed = "gravity" if robot.weight == 0.0 else "tensions, unless the robot has fewer cables than coordinates"
        raise InputError(f"free must not have {', '.join(of_forces)} without {needed}, got robot {robot.name}")
    unknown = np.isinf(model.pose_sigmas)
    spare = robot.m + (model.balanced.equations if model.balanced else 0) + sighted(measurements) - unknown.sum(axis=1)
    equations = int(np.maximum(spare, 0).sum())
    wanted = int((parameters.varies & np.isinf(model.prior_sigmas)).sum())
    if equations < wanted or equations == 0:
        lost = int(unknown.any(axis=1).sum())
        poses = f" with {counted(lost, 'unknown pose')}" if lost else ""
        raise InputError(
            f"measurements must give an equation for each of the {wanted} parameters without a prior, got {equations} "
            f"from {len(measurements)} samples of {robot.m} cables{poses}"
        )
