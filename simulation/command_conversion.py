"""`Orders`: convert controller commands and wind to plant commands, by `Drives` with lag, gain and friction."""

from collections.abc import Sequence

import numpy as np

from ..base.errors import InputError
from ..control import Command
from ..control.lag import Lag
from ..core import winch_forces, winch_lengths
from ..models.points import shortest_way
from ..models.trajectory import Motion, moved_on
from ..plant import Plant, layout
from .conditions import Experiment, Wind
from .mismatch import LAGS, TENSIONS, Drawn

FASTEST = 1e3  # [m/s], of the air
SLOW = 0.01  # [m/s] of a cable: slower, dry friction is less, without which it would chatter at rest
SHORTEST = 1e-3  # of a period: of lags, which divide


class Orders:
    """Convert controller commands to plant commands for each drive type.

    Drives of winches with forces are assumed to compensate friction and inertia of their winch as far as the motor
    permits: core/plant/winch_forces.h. Elastic cables without winches in their file are assumed to have
    winches that reach the tension: core/plant/winch_lengths.c. Both measure tensions and work within the period, or
    within each of its parts (`plant.steps.windings_in`). Carriers are commanded for one instant and move like the
    reference until the next.

    - `plant`: the plant.
    - `conditions`: conditions of the runs.
    - `seeds`: seed of the wind and of the drives, one for each run.
    - `record`: the robot as events change it; default: the plant's.
    """

    def __init__(self, plant: Plant, conditions: Experiment, seeds: Sequence[int], record: np.ndarray | None = None):
        robot, times = plant.robot, conditions.period * np.arange(len(conditions.references))
        self._parts, self._drive, self._fixed = conditions.windings, plant.drive, robot.fixed_lengths is not None
        self._period, self._settings = conditions.period / self._parts, plant.settings
        commanded = layout.BODY * (1 + len(robot.carriers)) + layout.REFERENCE * robot.m
        self._commanded = slice(commanded, commanded + robot.m)  # lengths commanded last, in a state
        self._record = plant.record if record is None else record
        rigid = np.flatnonzero(plant.record["cable"]["stiffness"][: robot.m] == 0)
        self._rigid = int(rigid[0]) if rigid.size else None  # a cable with tensions that no length determines
        self._last = np.full((len(seeds), 2, robot.m), np.nan)  # as `winch_lengths` keeps them of a period
        wind = conditions.wind
        self.wind = None if wind is None else np.stack([_air(wind, times, seed) for seed in seeds], axis=1)
        calm = None if self.wind is None else np.zeros(3)
        row = plant.command(np.ones(robot.m), wind=calm, wrench=conditions.disturbance)
        differ, self._imperfect = conditions.mismatch, None
        if differ.of_drives:
            self._imperfect = Drives([differ.drawn(robot, seed) for seed in seeds], self._period)
        self._moves, count = any(carrier.moves for carrier in robot.carriers), len(robot.carriers)
        self._rows = np.tile(row, (len(seeds), 1 + self._moves, 1))  # a second, of the next period, has only carriers
        m, first = robot.m, layout.REFERENCE_POSE
        blocks = self._rows[:, :, layout.COMMANDS + m :].reshape(len(seeds), -1, count, layout.CARRIER)
        rows, carriers = self._rows[:, 0], blocks[:, 0]
        # Views of the parts of all rows.
        self._wrenches, self._constant = rows[:, layout.WRENCH : layout.COMMANDS], conditions.disturbance
        self._on_carriers = carriers[..., layout.CARRIER_WRENCH : first]
        self._cables = rows[:, layout.COMMANDS : layout.COMMANDS + m]
        self._actuation = carriers[..., : max(len(carrier.actuators) for carrier in robot.carriers)]
        if self._moves:
            self._starts = carriers[..., first:].reshape(len(seeds), count, 3, 6)
            self._begins: Motion = (self._starts[:, :, 0], self._starts[:, :, 1], self._starts[:, :, 2])
            self._ends = blocks[:, 1, :, first:].reshape(len(seeds), count, 3, 6)
            # Deviation of a constant acceleration from the next reference: pose, velocity, acceleration, (K, 3, c, 6).
            motion = np.array([reference[3:6] for reference in conditions.references])
            missed = np.zeros_like(motion)
            pose, velocity, acceleration = np.moveaxis(motion[:-1], 1, 0)
            ends = moved_on((pose, velocity, acceleration), conditions.period)
            missed[:-1] = motion[1:] - np.stack(ends, axis=1)
            shares = [_share(part / self._parts, conditions.period) for part in range(1, 1 + self._parts)]
            self._missed = [(share @ missed.swapaxes(1, 2)).swapaxes(1, 2) for share in shares]  # at the end of parts

    def push(self, wrenches: np.ndarray) -> None:
        """Add wrenches on platform and carriers, (N, 1 + c, 6) [N, N m], to the constant one, until the next call."""
        np.add(self._constant, wrenches[:, 0], out=self._wrenches)
        self._on_carriers[:] = wrenches[:, 1:]

    def rows(self, k: int, command: Command, lengths: np.ndarray, states: np.ndarray, part: int = 0) -> np.ndarray:
        """Return the rows of a part of period `k`, (N, 1 or 2, k).

        Lengths and rates are (N, 2, m), states (N, n), as the part begins. If carriers move, the second row has their
        references at its end. Each call overwrites the rows of the last.
        """
        rows, drives = self._rows[:, 0], self._imperfect
        if self.wind is not None:
            rows[:, layout.WIND : layout.WRENCH] = self.wind[k]
        if command.lengths is not None:
            if self._drive != "lengths":
                raise InputError(f"drive must be 'lengths' for a controller that commands lengths, got {self._drive!r}")
            self._cables[:] = command.lengths if drives is None else drives.lengths(command.lengths)
            self._last[:] = np.nan  # the next tensions come from a motion that `winch_lengths` has not followed
            if part < self._parts - 1:
                last = states[:, self._commanded]
                self._cables[:] = last + (self._cables - last) / (self._parts - part)
        elif self._drive == "lengths" and self._fixed:
            self._cables[:] = states[:, self._commanded]
        else:
            tensions = np.ascontiguousarray(command.tensions, dtype=float).reshape(len(self._last), -1)
            if drives is not None:
                tensions = drives.tensions(tensions, lengths[:, 1])
            if self._drive != "lengths":
                self._cables[:] = tensions
            elif self._rigid is not None:
                raise InputError(
                    f"drive must not be 'lengths' for commanded tensions if cables do not stretch, got no stiffness of "
                    f"cables[{self._rigid}]"
                )
            else:
                winch_lengths(self._record, states, lengths, tensions, self._last, self._rows, self._period)
        if self._moves:
            begins = self._begins
            for begin, ordered in zip(begins, command[1:4], strict=True):
                begin[:] = ordered
            for order, end in enumerate(moved_on(begins, (part + 1) * self._period)):
                np.add(end, self._missed[part][k, order], out=self._ends[:, :, order])
            if part:
                for order, begin in enumerate(moved_on(begins, part * self._period)):
                    np.add(begin, self._missed[part - 1][k, order], out=self._starts[:, :, order])
            if drives is not None:
                drives.follow(self._starts, self._ends)
        if command.actuation is not None:
            self._actuation[:] = command.actuation if drives is None else drives.actuation(command.actuation)
        if self._drive == "forces":  # which depend on how carriers move
            winch_forces(self._record, self._settings, np.ascontiguousarray(states), self._rows, self._period)
        return self._rows


def _share(part: float, period: float) -> np.ndarray:
    """Return what pose, velocity and acceleration, (3, 3), have after a part of a period of what they miss at its end.

    A polynomial of fifth degree begins without any of it, as the path of a carrier (core/plant/carrier_paths.h).
    """
    powers = part ** np.arange(3.0, 6.0)
    of_pose = np.array([[10, -4, 0.5], [-15, 7, -1], [6, -3, 0.5]])  # of the powers 3, 4 and 5, by what is missed
    slopes = np.stack([powers, np.arange(3, 6) * powers / part, [6 * part, 12 * part**2, 20 * part**3]])
    units = period ** np.arange(3.0)
    return slopes @ of_pose * units / units[:, None]


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


class Drives:
    """Turn commands into what the drives of N runs make of them.

    - `drawn`: numbers of each run.
    - `period`: period of the commands [s].
    """

    def __init__(self, drawn: Sequence[Drawn], period: float):
        self._period = period
        self._gain, self._friction = (np.array([getattr(one, name) for one in drawn]) for name in TENSIONS)
        lags = [np.array([getattr(one, name) for one in drawn]) for name in LAGS]
        self._winches, self._rotors = (Lag(lag) if lag.any() else None for lag in (lags[0], lags[1][..., None]))
        self._carriers = np.maximum(lags[2], SHORTEST * period)[..., None] if lags[2].any() else None  # (N, c, 1)
        self._poses: np.ndarray | None = None  # of the carriers, (N, c, 6)

    def tensions(self, command: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return the tensions that winches give in a period, (N, m) [N], for the rates of cable lengths then."""
        given = self._gain * np.asarray(command, dtype=float)
        given = given if self._winches is None else self._winches.follow(given, self._period)
        return np.maximum(given + self._friction * np.tanh(rates / SLOW), 0.0)

    def lengths(self, command: np.ndarray) -> np.ndarray:
        """Return the unstrained lengths that winches have reached at the end of a period, (N, m) [m]."""
        if self._winches is None:
            return command
        self._winches.follow(np.broadcast_to(command, self._gain.shape), self._period)
        return self._winches.value

    def actuation(self, command: np.ndarray) -> np.ndarray:
        """Return what actuators give on average in a period, (N, c, a)."""
        if self._rotors is None:
            return command
        return self._rotors.follow(command.reshape(len(self._gain), *command.shape[-2:]), self._period)

    def follow(self, starts: np.ndarray, ends: np.ndarray) -> None:
        """Replace the motion that carriers should have as a period begins and ends, (N, c, 3, 6) each, by their own.

        What a carrier is behind, e, obeys tau de/dt = tau v - e with the velocity v that it should have. It begins
        where it should be.
        """
        if self._carriers is None:
            return
        tau, period = self._carriers, self._period
        at = starts[:, :, 0]
        behind = np.zeros_like(at) if self._poses is None else shortest_way(at - self._poses)
        after = moved_on((at, starts[:, :, 1], starts[:, :, 2]), period)
        steady = tau * (starts[:, :, 1] - tau * starts[:, :, 2])
        late = tau * (after[1] - tau * starts[:, :, 2]) + (behind - steady) * np.exp(-period / tau)
        for motion, e in ((starts, behind), (ends, late)):
            motion[:, :, 0] -= e
            motion[:, :, 2] = (motion[:, :, 1] - e / tau) / tau
            motion[:, :, 1] = e / tau
        self._poses = ends[:, :, 0].copy()
