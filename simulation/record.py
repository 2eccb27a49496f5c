"""`Record`: the complete history of one run, `Period` by `Period`."""

from typing import NamedTuple

import numpy as np

from ..base.display import Displayed
from ..control import ANSWERS, Command
from ..control.command import NOTHING
from ..models.robot import Robot


class Period(NamedTuple):
    """A period of parallel runs, from its beginning on. The next one overwrites its arrays."""

    number: int  # number of the period, from 0
    alive: np.ndarray  # runs that have not diverged at its end, (N,)
    motions: np.ndarray  # as `core.sense` writes them
    lengths: np.ndarray  # likewise
    tensions: np.ndarray  # mean tensions over the period, (N, m) [N]
    command: Command  # command of all runs; for a single run its arrays have no leading dimension


class Record(Displayed):
    """Record motions, lengths, tensions and commands of one run, a row for each period."""

    def __init__(self, robot: Robot, periods: int):
        carriers, m = len(robot.carriers), robot.m
        self.actuation = np.full((periods, carriers, max(len(carrier.actuators) for carrier in robot.carriers)), np.nan)
        self.motions = np.full((periods, 1 + carriers, 12), np.nan)
        self.lengths, self.tensions = (np.full((periods, m), np.nan) for _ in range(2))
        self.commanded, self.commanded_lengths = (np.full((periods, m), np.nan) for _ in range(2))
        self.answered = np.zeros(periods, dtype=np.int8)
        self.direction, self.shortfall = np.full((periods, 6), np.nan), np.full(periods, np.nan)
        self.unexplained = np.full(periods, np.nan)
        self.released = np.zeros((periods, m), dtype=bool)
        self.orders = np.full((periods, carriers, 6), np.nan)

    def take(self, period: Period) -> None:
        """Keep a period."""
        k, command = period.number, period.command
        self.motions[k], self.lengths[k], self.tensions[k] = period.motions[0], period.lengths[0, 0], period.tensions[0]
        self.commanded[k], self.answered[k], self.orders[k] = command.tensions, command.answered, command.carrier_pose
        if command.answered:
            if not 0 < command.answered < len(ANSWERS) or command.answered != int(command.answered):
                raise IndexError(command.answered)
            self.direction[k], self.shortfall[k] = command.direction, command.shortfall
        if command.lengths is not None:
            self.commanded_lengths[k] = command.lengths
        if command.released is not None:
            self.released[k] = command.released
        if command.unexplained is not NOTHING:
            self.unexplained[k] = command.unexplained
        if command.actuation is not None:
            self.actuation[k] = command.actuation
