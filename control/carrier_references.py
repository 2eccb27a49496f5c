"""Coordinates of carriers that a predictive controller moves: deviations from references, or remaining freedoms."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from typing_extensions import override

from ..base.errors import InputError
from ..core import control_carriers, control_coordinates
from ..models.dynamics import dynamics_of
from ..models.record import record_of
from ..models.robot import Robot
from .late_states import Pending
from .records import MOST_TETHERS, TETHER

LEAST_REACH = 0.02  # of the mean length of cables of fixed length: with less, errors of the load are not corrected
SHARE = 0.95  # of the radius of a carrier's motion: beyond, its coordinates are taken to be there
LEAVES = 0.8  # of that: references beyond it get other coordinates
SOME = 40  # references of which one becomes the centre of coordinates


class Moved(ABC):
    """Coordinates of carriers in a predictive solution, with their accelerations as controls."""

    freed: np.ndarray  # carrier and coordinate of each one that may leave the reference, (f, 2) or (0, 2)
    tethers: np.ndarray  # carriers held by cables of fixed length, (k,) of `TETHER`; another array: other coordinates
    count: int  # number of coordinates, f

    @abstractmethod
    def reset(self) -> None:
        """Forget all earlier steps."""

    @abstractmethod
    def along(self, platform: np.ndarray, carriers: np.ndarray) -> np.ndarray:
        """Return the coordinates and two derivatives, (K, 3, f), for motions (K, 3, 6) and (K, c, 3, 6)."""

    def recentre(self, platform: np.ndarray, carriers: np.ndarray) -> None:
        """Change the coordinates of `tethers` if motions as in `along` come near their bounds."""
        return None

    @abstractmethod
    def now(self, dt: float, measured: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return the coordinates and their rates, (2, f), `dt` [s] after the last step.

        - `measured`: (1 + c, 12), poses and velocities.
        - `reference`: (3, f), the result of `along` for the reference.
        """

    def under_way(self) -> np.ndarray:
        """Return the accelerations of the stages that earlier commands determine, (d, f), minus the reference's.

        A new command takes effect after these stages. Default: no stages.
        """
        return np.zeros((0, self.count))

    @abstractmethod
    def write_carriers(self, planned: np.ndarray, more: np.ndarray, platform: np.ndarray, carriers: np.ndarray) -> None:
        """Write the carrier references, (c, 3, 6), from accelerations (f,) and the platform's (6,).

        The accelerations are those of the current reference plus the corrections of the solution.
        """

    @abstractmethod
    def rest(self, stage: float, carriers: np.ndarray) -> None:
        """Write the carrier references, (c, 3, 6), without a solution."""

    def offsets(self, carriers: np.ndarray) -> np.ndarray | None:
        """Return the current deviation from the reference (c, 3, 6) and its rate, (2, c, 6), for `reaction`.

        The default is None, because each carrier follows commands at any position.
        """
        return None


class Freed(Moved):
    """Coordinates of carriers with commanded positions: a solution starts from the last command."""

    def __init__(self, reach: np.ndarray, strongest: float, boxes: tuple[np.ndarray, np.ndarray] | None = None):
        self.freed = np.ascontiguousarray(np.argwhere(reach))
        self.tethers, self.count = np.zeros(0, TETHER), len(self.freed)
        self._strongest = strongest
        self._low, self._high = np.full(self.count, -np.inf), np.full(self.count, np.inf)
        if boxes is not None:
            chosen, coordinate = self.freed.T
            moves = coordinate < 3
            for side, own in zip(boxes, (self._low, self._high), strict=True):
                own[moves] = side[chosen[moves], coordinate[moves]]
        self.reset()

    @override
    def reset(self) -> None:
        self._placed = np.full((3, self.count), np.nan)  # place, rate and acceleration, as commanded

    @override
    def along(self, platform: np.ndarray, carriers: np.ndarray) -> np.ndarray:
        chosen, coordinate = self.freed.T
        return carriers[:, chosen, :, coordinate].transpose(1, 2, 0)

    @override
    def now(self, dt: float, measured: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return the coordinates and their rates, (2, f): first of the reference, then as commanded."""
        place, rate, acceleration = self._placed
        if self.count and np.isfinite(self._placed).all():
            place += dt * rate + dt * dt / 2 * acceleration
            rate += dt * acceleration
            # They are commanded no further than the sides of their boxes.
            outside = (place < self._low) | (place > self._high)
            np.clip(place, self._low, self._high, out=place)
            rate[outside] = 0.0
        else:
            self._placed[:2], self._placed[2] = reference[:2], 0.0
        return self._placed[:2]

    @override
    def write_carriers(self, planned: np.ndarray, more: np.ndarray, platform: np.ndarray, carriers: np.ndarray) -> None:
        self._placed[2] = planned + more
        chosen, coordinate = self.freed.T
        carriers[chosen, :, coordinate] = self._placed.T

    @override
    def rest(self, stage: float, carriers: np.ndarray) -> None:
        """Bring the carriers to rest."""
        slower = np.clip(-self._placed[1] / stage, -self._strongest, self._strongest)
        self.write_carriers(slower, np.zeros(self.count), np.zeros(6), carriers)

    @override
    def offsets(self, carriers: np.ndarray) -> np.ndarray | None:
        result, (chosen, coordinate) = np.zeros((2, len(carriers), 6)), self.freed.T
        for order in range(2):
            result[order, chosen, coordinate] = self._placed[order] - carriers[chosen, order, coordinate]
        c, s = np.cos(carriers[:, 0, 5]), np.sin(carriers[:, 0, 5])
        roll, pitch = result[..., 3].copy(), result[..., 4].copy()
        result[..., 3], result[..., 4] = c * roll - s * pitch, s * roll + c * pitch
        return result


class Late(Moved):
    """Coordinates whose commanded accelerations take effect after a delay: pending ones are kept."""

    def _wait_for(self, delay: float, stage: float) -> None:
        """Keep commanded accelerations for a delay, of which whole stages are pending [s]."""
        late = round(delay / stage)
        self._under_way = late * stage, late, stage
        self._pending = Pending(delay + stage)

    @override
    def under_way(self) -> np.ndarray:
        return self._pending.means(*self._under_way)

    @override
    def rest(self, stage: float, carriers: np.ndarray) -> None:
        """Leave carriers to their reference."""
        self._pending.add(np.zeros(self.count).tobytes())


class Flown(Late, Freed):
    """Coordinates of flying carriers: a solution starts from the measured state.

    They turn before they accelerate, so commanded deviations from the reference take effect after a delay.
    """

    def __init__(self, reach: np.ndarray, strongest: float, delay: float, stage: float):
        self._wait_for(delay, stage)
        super().__init__(reach, strongest)

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
    def write_carriers(self, planned: np.ndarray, more: np.ndarray, platform: np.ndarray, carriers: np.ndarray) -> None:
        self._pending.add(more.tobytes())
        super().write_carriers(planned, more, platform, carriers)


class Tethered(Late):
    """Degrees of freedom of carriers held by cables of fixed length: a solution starts from the measured state."""

    def __init__(self, robot: Robot, delay: float, stage: float):
        self.freed = np.zeros((0, 2), dtype=np.int64)
        self._model, self._robot = robot, record_of(robot)
        self._at_home = _tethers(robot, robot.home[None], robot.carrier_home[None])
        self.count = int((MOST_TETHERS - self._at_home["cables"]).sum())
        self._wait_for(delay, stage)
        self.reset()

    @override
    def reset(self) -> None:
        self._now, self._measured = np.zeros((1, 3, self.count)), np.zeros((0, 12))
        self.tethers = self._at_home
        self._pending.reset(self.count)

    @override
    def along(self, platform: np.ndarray, carriers: np.ndarray) -> np.ndarray:
        result = np.zeros((len(platform), 3, self.count))
        motions = np.ascontiguousarray(np.concatenate([platform[:, None], carriers], axis=1))
        control_coordinates(self._robot, self.tethers, motions, result)
        return result

    @override
    def recentre(self, platform: np.ndarray, carriers: np.ndarray) -> None:
        ends = np.cumsum(MOST_TETHERS - self.tethers["cables"])
        places = np.split(self.along(platform, carriers)[:, 0] ** 2, ends, 1)
        far = np.array([place.sum(axis=1).max() for place in places[:-1]])
        if (far > (LEAVES * self.tethers["farthest"]) ** 2).any():
            self.tethers = _tethers(self._model, platform[:, 0], carriers[:, :, 0])
            self._pending.reset(self.count)  # these coordinates have other axes

    @override
    def now(self, dt: float, measured: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return them and their rate, (2, f), as measured."""
        self._pending.wait(dt)
        self._measured = measured
        motions = np.concatenate([measured, np.zeros((len(measured), 6))], axis=1)
        control_coordinates(self._robot, self.tethers, motions, self._now)
        return self._now[0, :2]

    @override
    def write_carriers(self, planned: np.ndarray, more: np.ndarray, platform: np.ndarray, carriers: np.ndarray) -> None:
        self._pending.add(more.tobytes())
        motion = np.zeros((3, 6 + self.count))
        motion[:2, :6], motion[:2, 6:] = self._measured[0].reshape(2, 6), self._now[0, :2]
        motion[2, :6], motion[2, 6:] = platform, planned + more
        moving = np.zeros((len(carriers), 3, 6))
        moving[:, :2] = self._measured[1:].reshape(-1, 2, 6)
        control_carriers(self._robot, self.tethers, motion, moving)
        carriers[:, :, :3] = moving[:, :, :3]


def moved_coordinates(
    robot: Robot,
    far: np.ndarray,
    flies: np.ndarray,
    strongest: float,
    boxes: tuple[np.ndarray, np.ndarray] | None,
    delay: tuple[float, float],
) -> tuple[Moved, np.ndarray]:
    """Return the coordinates that may deviate by `far`, (c, 6) [m, rad], and their largest deviations, (f,).

    - `flies`: which carriers fly, (c,).
    - `strongest`: largest acceleration in addition to the reference's [m/s^2, rad/s^2].
    - `boxes`: as in `Freed`.
    - `delay`: time in which flying carriers turn, and duration of a stage [s].
    """
    if robot.fixed_lengths is None:
        late = Flown(far, strongest, *delay) if (far.any(axis=1) & flies).any() else None
        return late or Freed(far, strongest, boxes), far[far > 0]
    moved = Tethered(robot, *delay)
    return moved, np.full(moved.count, max(far.max(), LEAST_REACH * float(robot.fixed_lengths.mean())))


def _tethers(robot: Robot, poses: np.ndarray, carriers: np.ndarray) -> np.ndarray:
    """Return the carriers held by cables of fixed length, (c,) of `TETHER`, with coordinates for these references.

    The coordinates of a carrier are zero near the middle of its directions as seen from the platform.

    - `poses`, `carriers`: poses of platform, (K, 6), and carriers, (K, c, 6).

    Raises `InputError` if a carrier has no cable or more than three of them.
    """
    lengths: Any = robot.fixed_lengths
    anchors, attachments = dynamics_of(robot).points(poses, carriers)
    cy, sy, no, one = np.cos(poses[:, 5]), np.sin(poses[:, 5]), np.zeros(len(poses)), np.ones(len(poses))
    level = np.stack([cy, sy, no, -sy, cy, no, no, no, one], axis=1).reshape(-1, 3, 3)
    result = np.zeros(len(robot.carriers), TETHER)
    for index, (row, carrier) in enumerate(zip(result, robot.carriers, strict=True)):
        which = np.flatnonzero(robot.carrier_of_cable == index)
        if not 1 <= len(which) <= 3:
            raise InputError(
                f"robot must have one to three cables of fixed length on each carrier, got {robot.name!r} with "
                f"{len(which)} on {carrier.name!r}"
            )
        places = (level @ (carriers[:, index, :3] - attachments[:, which].mean(axis=1))[..., None])[..., 0]
        k = _middle_of(places)
        axes = np.linalg.svd((anchors - attachments)[k, which] @ level[k].T)[2]
        # The first span what the cables hold there, and go behind the free ones.
        axes = np.concatenate([axes[len(which) :], axes[: len(which)]])
        at_home = axes @ places[k]
        row["carrier"], row["cables"], row["cable"][: len(which)] = index, len(which), which
        row["length"][: len(which)], row["at_home"], row["axes"] = lengths[which], at_home, axes
        baseline = np.ptp(attachments[k, which], axis=0)
        radius = lengths[which].mean() ** 2 - (baseline @ baseline) / 4
        row["farthest"] = SHARE * np.sqrt(max(radius, 0.0))
    return result


def _middle_of(places: np.ndarray) -> int:
    """Return the index of the one of some places (K, 3) whose largest angle to the direction of any other is least."""
    some = np.unique(np.linspace(0, len(places) - 1, SOME).astype(int))
    directions = places / np.maximum(np.linalg.norm(places, axis=1, keepdims=True), 1e-300)
    return int(some[(directions[some] @ directions.T).min(axis=1).argmax()])
