"""Exists placement: somewhere in the reach boxes of the mobile carriers a condition holds.

Half of the tried placements are points of a scrambled Sobol sequence in the product of the boxes. The others are ever
smaller steps from the best of them, each kept if it reduces the shortfall of the condition. Points and steps are the
same for every configuration, so the result does not depend on other configurations. It is one-sided: a placement proves
that the condition holds, but a search without a result proves nothing.
"""

from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ...base.errors import InputError
from ...models import Robot
from ...models.part import NonNegative, optional
from ...models.points import anchors, attachments
from ..condition import AnyCondition, Condition, Places
from ..region import reach_boxes

ROUNDS = 6  # from a box to a sphere and back
MISPLACED = 1e12  # larger than the shortfall of any condition where the carriers fit
LARGEST_STEP, SMALLEST_STEP = 0.5, 0.02  # of a box, or of all turns


class ExistsPlacement(Condition):
    """A condition holds for the given carriers, or for another placement of the mobile ones in their reach boxes.

    If the robot's drive is fixed-length, only placements are tried in which the distance from each anchor to its
    attachment is the length of the cable. If it is variable-length, mobile carriers keep their positions, and only
    attitudes are tried (`turn`).
    """

    kind: Literal["exists-placement"] = "exists-placement"
    condition: AnyCondition = Field(description="condition that must hold for a placement")
    tries: Annotated[int, Field(ge=1, le=1_000_000)] = optional("number of placements that are tried", 32)
    turn: NonNegative = optional("maximum change of roll, pitch and yaw, which are tried too [rad]; default: none", 0.0)
    seed: Annotated[int, Field(ge=0)] = optional("seed of the placements", 0)

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        boxes = reach_boxes(robot)
        mobile = [i for i, c in enumerate(robot.carriers) if c.name in boxes and c.free_coordinates(robot.drive)]
        if not mobile and not self.turn:
            raise InputError(
                "exists-placement must have turn > 0, or a robot with mobile carriers and a drive other than "
                f"variable-length, got {robot.name!r}"
            )
        if robot.drive == "fixed-length" and len(set(robot.carrier_of_cable)) < robot.m:
            raise InputError(
                "exists-placement must have a robot with one cable of fixed length per carrier, got "
                f"{robot.name!r} with several"
            )
        held = np.zeros(len(places), dtype=bool)
        if robot.drive != "fixed-length":
            held = self.condition.holds(robot, places)
        searched = np.flatnonzero(~held)
        if searched.size:
            held[searched] = self._search(robot, mobile, places.only(searched))
        return held

    def for_robots(self, robust: float) -> Condition:
        """Return this condition with an inner condition that must hold for a fraction `robust` of the robots."""
        return self.model_copy(update={"condition": self.condition.for_robots(robust)})

    def why_nowhere(self, robot: Robot) -> str | None:
        """Return why the inner condition holds nowhere; None if it may hold."""
        return self.condition.why_nowhere(robot)

    def _search(self, robot: Robot, mobile: list[int], places: Places) -> np.ndarray:
        """Return whether the search finds a placement, (n,) of bool."""
        points, steps = _placements(3 * len(mobile) + 3, self.tries, self.seed)
        least = np.full(len(places), np.inf)
        best = np.zeros((len(places), points.shape[1]))
        for try_, move in enumerate([*points, *steps]):
            left = np.flatnonzero(least > 0)
            if not left.size:
                break
            shares = np.clip(move if try_ < len(points) else best[left] + move, 0.0, 1.0)
            shares = np.broadcast_to(shares, best[left].shape)
            shortfall = self._shortfall(robot, mobile, places.only(left), shares)
            better = shortfall < least[left]
            least[left[better]], best[left[better]] = shortfall[better], shares[better]
        return least == 0

    def _shortfall(self, robot: Robot, mobile: list[int], places: Places, shares: np.ndarray) -> np.ndarray:
        """Return the shortfall of the condition, (n,), plus a penalty where the carriers do not fit."""
        placed, beyond = self._place(robot, mobile, places, shares)
        shortfall = MISPLACED * (1.0 + beyond)
        fits = np.flatnonzero(beyond == 0)
        if fits.size:
            shortfall[fits] = np.minimum(self.condition.shortfall(robot, placed.only(fits)), MISPLACED)
        return shortfall

    def _place(self, robot: Robot, mobile: list[int], places: Places, shares: np.ndarray) -> tuple[Places, np.ndarray]:
        """Return configurations with the carriers at `shares` (n, d) of their boxes, and their misfit, (n,) [m]."""
        pose, carriers = places.pose.copy(), places.carriers.copy()
        if self.turn:
            pose[:, 3:] += self.turn * (2.0 * shares[:, -3:] - 1.0) * robot.dof_mask[3:]
        reach = reach_boxes(robot)
        boxes = {i: reach[robot.carriers[i].name] for i in mobile}
        for k, i in enumerate(mobile):
            low, high = np.array(boxes[i].min), np.array(boxes[i].max)
            carriers[:, i, :3] = low + shares[:, 3 * k : 3 * k + 3] * (high - low)
        placed = Places(pose, carriers)
        beyond = np.zeros(len(places))
        if robot.fixed_lengths is not None:
            ends, starts = attachments(robot, pose), anchors(robot, carriers)
            for cable, i in enumerate(robot.carrier_of_cable):
                away, length = starts[:, cable] - ends[:, cable], robot.fixed_lengths[cable]
                shift = _onto_sphere(away, length) - away
                if i not in mobile:
                    beyond += _more_than_rounding(np.abs(shift).max(axis=-1))
                    continue
                low = np.array(boxes[i].min) - carriers[:, i, :3] + away
                high = np.array(boxes[i].max) - carriers[:, i, :3] + away
                at = away
                # Alternate projections on sphere and box converge to a common point if there is one.
                for _ in range(ROUNDS):
                    at = np.clip(_onto_sphere(at, length), low, high)
                at = _onto_sphere(at, length)
                beyond += _more_than_rounding(np.maximum(low - at, at - high).max(axis=-1))
                carriers[:, i, :3] += at - away
        return placed, beyond


def _onto_sphere(away: np.ndarray, length: float) -> np.ndarray:
    return away * (length / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-12))


def _more_than_rounding(distance: np.ndarray) -> np.ndarray:
    return np.where(distance > 1e-9, distance, 0.0)


@lru_cache(maxsize=4)
def _placements(dimensions: int, tries: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points that fill the unit cube evenly, and steps from the best of them, (k, dimensions) each.

    Every other point is at a corner of the boxes, because carriers are at the ends of their reach where a condition
    barely holds. The last three numbers, the angles of the platform, stay inside.
    """
    from scipy.stats import qmc

    count = (tries + 1) // 2
    rng = np.random.default_rng(seed)
    points = qmc.Sobol(dimensions, rng=rng).random_base2(int(count - 1).bit_length())[:count]
    points[::2, :-3] = np.round(points[::2, :-3])
    sizes = np.geomspace(LARGEST_STEP, SMALLEST_STEP, max(tries - count, 1))[: tries - count]
    return points, rng.normal(size=(tries - count, dimensions)) * sizes[:, None]
