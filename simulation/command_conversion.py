"""`Orders`: convert controller commands and wind to plant commands."""

from collections.abc import Sequence

import numpy as np

from ..base.errors import InputError
from ..control import Command
from ..core import winch_lengths
from ..models.trajectory import moved_on
from ..plant import Plant, layout
from .drives import Drives
from .experiment import Experiment, Wind

FASTEST = 1e3  # [m/s], of the air


class Orders:
    """Convert controller commands to plant commands for each drive type.

    Drives of tensions and of winches with forces receive the tensions themselves. Elastic cables without winches in
    their file are assumed to have winches that measure their tension and reach it within the period:
    core/plant/winch_lengths.c. Carriers are commanded for one instant and move like the reference until the next.

    - `plant`: the plant.
    - `conditions`: conditions of the runs.
    - `seeds`: seed of the wind and of the drives, one for each run.
    - `record`: the robot as events change it; default: that of the plant.
    """

    def __init__(self, plant: Plant, conditions: Experiment, seeds: Sequence[int], record: np.ndarray | None = None):
        robot, times = plant.robot, conditions.period * np.arange(len(conditions.references))
        self._period, self._drive, self._fixed = conditions.period, plant.drive, robot.fixed_lengths
        self._record = plant.record if record is None else record
        self._last_rates = np.full((len(seeds), robot.m), np.nan)
        wind = conditions.wind
        self.wind = None if wind is None else np.stack([_air(wind, times, seed) for seed in seeds], axis=1)
        calm = None if self.wind is None else np.zeros(3)
        row = plant.command(np.ones(robot.m), wind=calm, wrench=conditions.disturbance)
        differ, self._imperfect = conditions.mismatch, None
        if differ.of_drives:
            self._imperfect = Drives([differ.drawn(robot, seed) for seed in seeds], conditions.period)
        self._moves, count = any(carrier.moves for carrier in robot.carriers), len(robot.carriers)
        self._rows = np.tile(row, (len(seeds), 1 + self._moves, 1))  # a second, of the next period, has only carriers
        m, first = robot.m, layout.REFERENCE_POSE
        blocks = self._rows[:, :, layout.COMMANDS + m :].reshape(len(seeds), -1, count, layout.CARRIER)
        rows, carriers = self._rows[:, 0], blocks[:, 0]
        # Views of the parts of all rows.
        self._wrenches, self._constant = rows[:, layout.WRENCH : layout.COMMANDS], conditions.disturbance
        self._on_carriers = carriers[..., layout.CARRIER_WRENCH : first]
        self._cables = rows[:, layout.COMMANDS : layout.COMMANDS + m]
        self._poses, self._velocities = carriers[..., first : first + 6], carriers[..., first + 6 : first + 12]
        self._accelerations = carriers[..., first + 12 : first + 18]
        self._actuation = carriers[..., : max(len(carrier.actuators) for carrier in robot.carriers)]
        if self._moves:
            self._starts = carriers[..., first:].reshape(len(seeds), count, 3, 6)
            self._ends = blocks[:, 1, :, first:].reshape(len(seeds), count, 3, 6)
            # What a constant acceleration misses of the next reference: pose, velocity and acceleration, (K, 3, c, 6).
            motion = np.array([reference[3:6] for reference in conditions.references])
            self._missed = np.zeros_like(motion)
            pose, velocity, acceleration = np.moveaxis(motion[:-1], 1, 0)
            ends = moved_on((pose, velocity, acceleration), self._period)
            self._missed[:-1] = motion[1:] - np.stack(ends, axis=1)

    def push(self, wrenches: np.ndarray) -> None:
        """Add wrenches on platform and carriers, (N, 1 + c, 6) [N, N m], to the constant one, until the next call."""
        np.add(self._constant, wrenches[:, 0], out=self._wrenches)
        self._on_carriers[:] = wrenches[:, 1:]

    def rows(self, k: int, command: Command, lengths: np.ndarray, states: np.ndarray) -> np.ndarray:
        """Return the rows of period `k`, (N, 1 or 2, k); lengths and rates are (N, 2, m), states (N, n), as it begins.

        Where carriers move, the second has their references at the end. Each call overwrites the rows of the last.
        """
        rows, drives = self._rows[:, 0], self._imperfect
        if self.wind is not None:
            rows[:, layout.WIND : layout.WRENCH] = self.wind[k]
        if command.lengths is not None:
            if self._drive != "lengths":
                raise InputError(f"drive must be 'lengths' for a controller that commands lengths, got {self._drive!r}")
            self._cables[:] = command.lengths if drives is None else drives.lengths(command.lengths)
        elif self._drive == "lengths" and self._fixed is not None:
            self._cables[:] = self._fixed
        else:
            tensions = np.ascontiguousarray(command.tensions, dtype=float).reshape(self._last_rates.shape)
            if drives is not None:
                tensions = drives.tensions(tensions, lengths[:, 1])
            if self._drive != "lengths":
                self._cables[:] = tensions
            else:
                winch_lengths(self._record, states, lengths, tensions, self._last_rates, self._rows, self._period)
        if self._moves:
            self._poses[:], self._velocities[:] = command.carrier_pose, command.carrier_velocity
            self._accelerations[:] = command.carrier_acceleration
            motion = self._poses, self._velocities, self._accelerations
            for order, end in enumerate(moved_on(motion, self._period)):
                np.add(end, self._missed[k, order], out=self._ends[:, :, order])
            if drives is not None:
                drives.follow(self._starts, self._ends)
        if command.actuation is not None:
            self._actuation[:] = command.actuation if drives is None else drives.actuation(command.actuation)
        return self._rows


def _air(wind: Wind, times: np.ndarray, seed: int) -> np.ndarray:
    """Return the velocity of the air in one run, (K, 3) [m/s]; refuse invalid results of a user's function."""
    try:
        velocity = np.asarray(wind(times, seed), dtype=float)
    except (TypeError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"wind must be a function of times and a seed that returns (n, 3) [m/s]: {reason}") from None
    accepted = f"wind must return ({len(times)}, 3) finite numbers up to {FASTEST:g} m/s"
    if velocity.shape != (len(times), 3):
        raise InputError(f"{accepted}, got shape {velocity.shape}")
    if not (np.abs(velocity) <= FASTEST).all():
        worst = velocity.ravel()[int(np.argmin(np.abs(velocity) <= FASTEST))]
        raise InputError(f"{accepted}, got {worst:g}")
    return velocity
