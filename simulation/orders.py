"""`Orders`: what a plant is commanded in each period, from a controller's commands and the wind."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..control import Command
from ..errors import InputError
from ..models.plant import Plant, layout
from .conditions import Conditions, Wind

__all__ = ["Orders"]

FASTEST = 1e3  # [m/s], of the air


class Orders:
    """Translate commands.

    Tensions are commanded as they are if the plant's drive has them, or winches that pull with a force. Elastic cables
    without winches in their file are assumed to have some that measure their tension and reach it within the period:

        t = E A e / L0 + (C + E A dt / L0) v,    v = dl/dt - dL0/dt

    gives the rate of the unstrained length L0, with the elongation e and the rate of the length l at its beginning.

    Parameters
    ----------
    plant
        The plant.
    conditions
        Of the flights.
    seeds
        One for each flight: of its wind.
    """

    def __init__(self, plant: Plant, conditions: Conditions, seeds: Sequence[int]):
        robot, times = plant.robot, conditions.period * np.arange(len(conditions.references))
        self._robot, self._period, self._drive = robot, conditions.period, plant.drive
        self._stiffness, self._damping = (plant.arrays[1][:, column] for column in (layout.STIFFNESS, layout.DAMPING))
        wind = conditions.wind
        self.wind = None if wind is None else np.stack([_air(wind, times, seed) for seed in seeds], axis=1)
        calm = None if self.wind is None else np.zeros(3)
        self._rows = np.tile(plant.command(np.ones(robot.m), wind=calm, wrench=conditions.disturbance), (len(seeds), 1))
        m, first = robot.m, layout.REFERENCE_POSE
        carriers = self._rows[:, layout.COMMANDS + m :].reshape(len(seeds), len(robot.carriers), layout.CARRIER)
        # Views of the parts of all rows.
        self._cables = self._rows[:, layout.COMMANDS : layout.COMMANDS + m]
        self._poses, self._velocities = carriers[..., first : first + 6], carriers[..., first + 6 : first + 12]
        self._accelerations = carriers[..., first + 12 : first + 18]
        self._actuation = carriers[..., : max(len(carrier.actuators) for carrier in robot.carriers)]
        self._moves = any(carrier.moves for carrier in robot.carriers)

    def rows(self, k: int, command: Command, lengths: np.ndarray, unstrained: np.ndarray) -> np.ndarray:
        """Return the rows of period `k`, (N, k), from lengths and rates (N, 2, m) and L0 (N, m), all at its beginning.

        Each call overwrites the rows of the last.
        """
        rows = self._rows
        if self.wind is not None:
            rows[:, layout.WIND : layout.WRENCH] = self.wind[k]
        cables = command.tensions
        if self._drive == "lengths" and self._robot.fixed_lengths is not None:
            cables = self._robot.fixed_lengths
        elif self._drive == "lengths":
            k_of = self._stiffness / unstrained
            relative = (cables - k_of * (lengths[:, 0] - unstrained)) / (self._damping + k_of * self._period)
            cables = np.maximum(unstrained + self._period * (lengths[:, 1] - relative), layout.SHORTEST)
        self._cables[:] = cables
        if self._moves:
            self._poses[:], self._velocities[:] = command.carrier_pose, command.carrier_velocity
            self._accelerations[:] = command.carrier_acceleration
        if command.actuation is not None:
            self._actuation[:] = command.actuation
        return rows


def _air(wind: Wind, times: np.ndarray, seed: int) -> np.ndarray:
    """Return the velocity of the air of one flight, (K, 3) [m/s]; refuse what a user's function may return instead."""
    try:
        velocity = np.asarray(wind(times, seed), dtype=float)
    except (TypeError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"wind must be a function of times and a seed that returns (n, 3) [m/s]: {reason}") from None
    if velocity.shape != (len(times), 3) or not (np.abs(velocity) <= FASTEST).all():
        raise InputError(
            f"wind must return ({len(times)}, 3) numbers up to {FASTEST:g} m/s, got shape {velocity.shape}"
        )
    return velocity
