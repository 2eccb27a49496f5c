"""What a predictive controller moves of the carriers: coordinates that they leave, or directions of fixed cables."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from typing_extensions import override

from ..errors import InputError
from ..models.dynamics import dynamics_of
from ..models.robot import Robot
from .machine import carriers_of, directions
from .pending import Pending
from .tethers import AXES, CABLE, LENGTH, TETHER_COLUMNS

__all__ = ["Flown", "Freed", "Moved", "Tethered"]


class Moved(Protocol):
    """Coordinates of carriers that a solution moves, with accelerations as its controls.

    Attributes
    ----------
    freed
        (f, 2), carrier and coordinate of each that may leave the reference.
    tethers
        (k, TETHER_COLUMNS), the cables of fixed length, with two coordinates each.
    count
        How many there are, f + 2 k.
    late
        Number of stages after which an acceleration that is commanded now is there.
    """

    freed: np.ndarray
    tethers: np.ndarray
    count: int
    late: int

    def reset(self) -> None:
        """Forget all earlier steps."""
        ...

    def along(self, platform: np.ndarray, carriers: np.ndarray) -> np.ndarray:
        """Return them and two derivatives, (K, 3, f), of motions (K, 3, 6) and (K, c, 3, 6)."""
        ...

    def now(self, dt: float, measured: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return them and their rate, (2, f), `dt` [s] after the last step.

        Parameters
        ----------
        measured
            (1 + c, 12), poses and velocities.
        reference
            (3, f), what `along` returns of the reference.
        """
        ...

    def under_way(self) -> np.ndarray:
        """Return the accelerations of the stages that earlier commands decide, (late, f), less the reference's."""
        ...

    def order(self, planned: np.ndarray, more: np.ndarray, platform: np.ndarray, carriers: np.ndarray) -> None:
        """Write how carriers should move, (c, 3, 6), with accelerations (f,), and the platform's (6,).

        The accelerations are those of the reference now, and what the solution adds to them.
        """
        ...

    def rest(self, stage: float, carriers: np.ndarray) -> None:
        """Write how carriers should move, (c, 3, 6), where there is no solution."""
        ...


class Freed:
    """Coordinates of carriers whose place is commanded: a solution starts where the last command left them."""

    def __init__(self, reach: np.ndarray, strongest: float):
        self.freed = np.ascontiguousarray(np.argwhere(reach))
        self.tethers, self.count, self.late = np.zeros((0, TETHER_COLUMNS)), len(self.freed), 0
        self._strongest = strongest
        self.reset()

    def reset(self) -> None:
        """Forget all earlier steps."""
        self._placed = np.full((3, self.count), np.nan)  # place, rate and acceleration, as commanded

    def along(self, platform: np.ndarray, carriers: np.ndarray) -> np.ndarray:
        """Return them and two derivatives, (K, 3, f), of motions (K, 3, 6) and (K, c, 3, 6)."""
        del platform
        chosen, coordinate = self.freed.T
        return np.stack([carriers[:, chosen, order, coordinate] for order in range(3)], axis=1)

    def now(self, dt: float, measured: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return them and their rate, (2, f): the reference's in the first step, then as ordered."""
        del measured
        place, rate, acceleration = self._placed
        if dt > 0:
            place += dt * rate + dt * dt / 2 * acceleration
            rate += dt * acceleration
        else:
            self._placed[:2], self._placed[2] = reference[:2], 0.0
        return self._placed[:2]

    def under_way(self) -> np.ndarray:
        """Return no stages, (0, f)."""
        return np.zeros((0, self.count))

    def order(self, planned: np.ndarray, more: np.ndarray, platform: np.ndarray, carriers: np.ndarray) -> None:
        """Write how carriers should move, (c, 3, 6), with the accelerations (f,)."""
        del platform
        self._placed[2] = planned + more
        chosen, coordinate = self.freed.T
        carriers[chosen, :, coordinate] = self._placed.T

    def rest(self, stage: float, carriers: np.ndarray) -> None:
        """Write how carriers come to rest, (c, 3, 6)."""
        slower = np.clip(-self._placed[1] / stage, -self._strongest, self._strongest)
        self.order(slower, np.zeros(self.count), np.zeros(6), carriers)


class Flown(Freed):
    """Coordinates of carriers that fly: a solution starts where they are measured.

    They turn before they accelerate, so that what is commanded beside the reference comes after a delay.
    """

    def __init__(self, reach: np.ndarray, strongest: float, delay: float, stage: float):
        self._pending = Pending(round(delay / stage), stage)
        super().__init__(reach, strongest)
        self.late = self._pending.late

    @override
    def reset(self) -> None:
        super().reset()
        self._pending.reset(self.count)

    @override
    def now(self, dt: float, measured: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return them and their rate, (2, f), as measured."""
        self._pending.wait(dt)
        chosen, coordinate = self.freed.T
        self._placed[0], self._placed[1] = measured[1 + chosen, coordinate], measured[1 + chosen, 6 + coordinate]
        return self._placed[:2]

    @override
    def under_way(self) -> np.ndarray:
        return self._pending.means()

    @override
    def order(self, planned: np.ndarray, more: np.ndarray, platform: np.ndarray, carriers: np.ndarray) -> None:
        self._pending.add(more)
        super().order(planned, more, platform, carriers)

    @override
    def rest(self, stage: float, carriers: np.ndarray) -> None:
        """Leave carriers to their reference."""


class Tethered:
    """Directions of cables of fixed length, one for each carrier: a solution starts where they are measured."""

    def __init__(self, robot: Robot, arrays: tuple[np.ndarray, ...], delay: float, stage: float):
        self.freed = np.zeros((0, 2), dtype=np.int64)
        self.tethers = _tethers(robot)
        self.count, self._robot = 2 * len(self.tethers), arrays
        self._pending = Pending(round(delay / stage), stage)
        self.late = self._pending.late
        self._directions, self._carriers_of = directions(), carriers_of()
        self.reset()

    def reset(self) -> None:
        """Forget all earlier steps."""
        self._now, self._measured = np.zeros((1, 3, self.count)), np.zeros((0, 12))
        self._pending.reset(self.count)

    def along(self, platform: np.ndarray, carriers: np.ndarray) -> np.ndarray:
        """Return them and two derivatives, (K, 3, f), of motions (K, 3, 6) and (K, c, 3, 6)."""
        result = np.zeros((len(platform), 3, self.count))
        motions = np.concatenate([platform[:, None], carriers], axis=1)
        self._directions(self._robot, self.tethers, motions.reshape(*motions.shape[:2], 18), result)
        return result

    def now(self, dt: float, measured: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return them and their rate, (2, f), as measured."""
        del reference
        self._pending.wait(dt)
        self._measured = measured
        motions = np.concatenate([measured, np.zeros((len(measured), 6))], axis=1)
        self._directions(self._robot, self.tethers, motions[None], self._now)
        return self._now[0, :2]

    def under_way(self) -> np.ndarray:
        """Return the accelerations of the stages that earlier commands decide, (late, f), less the reference's."""
        return self._pending.means()

    def order(self, planned: np.ndarray, more: np.ndarray, platform: np.ndarray, carriers: np.ndarray) -> None:
        """Write how carriers should move, (c, 3, 6), with accelerations (f,) and the platform's (6,)."""
        self._pending.add(more)
        motion = np.zeros((3, 6 + self.count))
        motion[:2, :6], motion[:2, 6:] = self._measured[0].reshape(2, 6), self._now[0, :2]
        motion[2, :6], motion[2, 6:] = platform, planned + more
        moving = np.zeros((len(carriers), 3, 6))
        moving[:, :2] = self._measured[1:].reshape(-1, 2, 6)
        self._carriers_of(self._robot, self.tethers, motion, moving)
        carriers[:, :, :3] = moving[:, :, :3]

    def rest(self, stage: float, carriers: np.ndarray) -> None:
        """Leave carriers to their reference."""


def _tethers(robot: Robot) -> np.ndarray:
    """Return the cables of fixed length, in the columns of `tethers`, with axes along and across them at home.

    Raises
    ------
    InputError
        If a carrier has none or several.
    """
    lengths: Any = robot.fixed_lengths
    for carrier in robot.carriers:
        owned = sum(cable.carrier == carrier.name for cable in robot.cables)
        if owned != 1:
            raise InputError(
                f"robot must have one cable of fixed length on each carrier, got {robot.name!r} with {owned} on "
                f"{carrier.name!r}"
            )
    anchors, attachments = dynamics_of(robot).points(robot.home, robot.carrier_home)
    cy, sy = np.cos(robot.home[5]), np.sin(robot.home[5])
    level = np.array([[cy, sy, 0], [-sy, cy, 0], [0, 0, 1]])
    result = np.zeros((robot.m, TETHER_COLUMNS))
    for i, along in enumerate((anchors - attachments) @ level.T):
        n = along / np.linalg.norm(along)
        across = np.cross(np.eye(3)[2], n)
        first = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-6 else np.eye(3)[0]
        result[i, CABLE], result[i, LENGTH] = i, lengths[i]
        result[i, AXES:] = np.concatenate([first, np.cross(n, first), n])
    return result
