"""The start of a unit: plant and controller of a robot, at the beginning of a motion."""

from typing import Any

import numpy as np

from ...control.computed_torque import ComputedTorque
from ...control.fallback import CARRIED
from ...control.state import Reference, State
from ...models.record import record_of
from ...models.robot import Robot
from ...plant import Plant
from ...plant.reading import sensed
from ...plant.steps import ANGLE, fastest_motion, winding_time

PERIOD = 1e-3  # [s], of `simulate`
LONGEST = 1e9  # [s]: what is as good as infinity


class _Exported(ComputedTorque):
    """A controller whose settings can be read."""

    def data(self) -> dict[str, Any]:
        """Return the members of `towline_unit` that describe it."""
        low_high = self._boxes or [np.full((len(self.robot.carriers), 3), sign * np.inf) for sign in (-1, 1)]
        bandwidth = float(np.sqrt(self._settings["kp"][0]))
        return {
            "controller": self._settings,
            "bandwidth": bandwidth,
            "damping": float(self._settings["kd"][0]) / (2 * bandwidth),
            "integral": float(self._settings["ki"][0]),
            "length": self.robot.length,
            "negligible": self._negligible,
            "carried": CARRIED * self.robot.force_scale,
            "little": self._little,
            "box": np.stack(low_high),
            "platform": self._platform[0],
        }


def data_at(robot: Robot, plant: Plant, reference: Reference) -> dict[str, Any]:
    """Return the members of `towline_unit` at a reference, on which the robot is, with its tensions."""
    pulls = np.zeros(robot.m) if reference.tensions is None else np.maximum(reference.tensions, 0.0)
    motion = (reference.pose, reference.velocity, reference.carrier_pose, reference.carrier_velocity)
    fixed, fastest = plant.fixed_lengths(pulls), max(fastest_motion(plant))
    state = plant.start(*motion, tensions=pulls if fixed is None else None, lengths=fixed)
    motions, lengths = sensed(robot, state)
    carriers = np.stack(reference[3:6], axis=1)  # (c, 3, 6)
    given = np.vstack([np.concatenate(motion[:2]), np.concatenate(motion[2:], axis=1)])
    measured = np.where(np.isnan(motions), given, motions)  # at a pitch of 90 degrees
    controller = _Exported(robot)
    command = controller.step(0.0, State(*motion, pulls), reference)
    controller.reset()
    return {
        "robot": plant.record,
        "plant": plant.settings,
        "longest_step": ANGLE / fastest if fastest else PERIOD,
        "winding_time": min(winding_time(plant), LONGEST),
        "mass": robot.platform.mass,
        "state": state,
        "last": np.full(2 * robot.m, np.nan),
        "known": record_of(robot),
        "period": PERIOD,
        **controller.data(),
        "measured": measured.ravel(),
        "lengths": lengths.ravel(),
        "tension": pulls,
        "mean_tension": pulls,
        "reference": np.concatenate(reference[:3]),
        "carriers": carriers.ravel(),
        "jerks": np.zeros(carriers.size // 3),
        "t_ref": np.zeros(robot.m) if reference.tensions is None else reference.tensions,
        "ordered": np.stack(command[1:4], axis=1).ravel(),
        "ordered_jerks": np.zeros(carriers.size // 3),
        "tensions": command.tensions,
        "winches": {"lengths": plant.read(state).lengths if fixed is None else fixed, "rates": np.zeros(robot.m)}.get(
            plant.drive, command.tensions
        ),
        "actuation": np.zeros(0) if command.actuation is None else command.actuation.ravel(),
        "wind": np.zeros(3),
        "wrench": np.zeros(6),
    }
