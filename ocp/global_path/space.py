"""`Space`: the coordinates in which a path is searched, and the poses of platform and carriers that they mean.

They are the platform's free coordinates, and for carriers that may go anywhere the shape of their formation: each keeps
its distance from where its cables attach, and the horizontal part of its offset is multiplied by one matrix for all,

    R(turn) S,    S symmetric: (xx, xy, yy).

A formation that the cables balance at rest stays balanced, since a linear map of balanced horizontal pulls is balanced:
the formation squeezes, stretches and turns, and all shapes on the way are ones that can carry the load.

Coordinates that the task gives at each time are not searched. They depend on how far a configuration is from the start
to the end, along the line between them: as they do in a motion that goes straight, and nearly so in others.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.random import Generator

from ...base.display import Displayed
from ..tasks.ends import carrier_ends, fixed_values
from ..tasks.paths.line import rest_to_rest
from ..tasks.scenario import ATTITUDE, POSITION, Scenario

TIMES = 101  # at which what is given is evaluated, from start to end
HOME_SHAPE = (1.0, 0.0, 1.0)
SMALLEST = 0.15  # of a formation's size, across
FLATTEST = 0.97  # of a cable's length: its largest horizontal part
AS_USUAL = 0.5  # share of the samples that leave attitude, or formation, as it is at the ends
ANYWHERE = 0.5  # share of the samples in the whole box
NEAR = 0.3  # share of those about the line between the ends; the rest is on it
SPREAD = 0.3  # of the box: the farthest that those about it are
SMALL = 0.1  # of the distance of the ends: the smallest size that a robot counts as
AROUND = 1.0  # of the distance of the ends, about them: where a platform without frame and box may go


@dataclass(frozen=True)
class Space(Displayed):
    """The coordinates of a scenario's motions: (platform's free coordinates, shape of the formation)."""

    scenario: Scenario
    given_ends: np.ndarray | None = None  # (2, count), other than those that follow from the task

    @cached_property
    def turns(self) -> bool:
        """Return whether the formation turns on its own: about a platform that has no yaw."""
        return bool(self.shaped and not self.scenario.robot.dof_mask[5])

    @cached_property
    def shaped(self) -> bool:
        """Return whether there is a formation whose shape matters."""
        return len(self.scenario.loose) > 1 and float(np.linalg.norm(self._flat, axis=1).max()) > 0

    @cached_property
    def count(self) -> int:
        """Return the number of coordinates."""
        return len(self.scenario.platform_free) + 3 * self.shaped + self.turns

    @cached_property
    def references(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses of platform and carriers without deviation at start and end, (2, 6) and (2, c, 6)."""
        platform, carriers = self._given
        return platform[[0, -1]], carriers[[0, -1]]

    @cached_property
    def _given(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses of platform and carriers without deviation, (n, 6) and (n, c, 6)."""
        platform, carriers = self.scenario.references(np.linspace(0.0, self.scenario.duration, TIMES))
        return platform.pose, np.stack([carrier.pose for carrier in carriers], axis=1)

    @cached_property
    def _way(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return start and direction of the way, the latter over its squared length, and the law along it (TIMES,)."""
        start, end = self.ends[:, : len(self.scenario.platform_free)]
        way = (end - start) * np.isin(self.scenario.platform_free, POSITION)
        far = float(way @ way)
        return start, way / far if far > 0 else way, rest_to_rest(np.linspace(0.0, 1.0, TIMES))[0]

    def _without_deviation(self, configurations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses of platform (n, 6) and carriers (n, c, 6) that are given, at their share of the way."""
        start, way, law = self._way
        done = np.clip((configurations[:, : len(start)] - start) @ way, 0.0, 1.0)
        where = np.interp(done, law, np.arange(TIMES))
        before = np.minimum(where.astype(int), TIMES - 2)
        after = where - before

        def between(poses: np.ndarray) -> np.ndarray:
            part = after.reshape(-1, *[1] * (poses.ndim - 1))
            return (1 - part) * poses[before] + part * poses[before + 1]

        platform, carriers = self._given
        return between(platform), between(carriers)

    @cached_property
    def ends(self) -> np.ndarray:
        """Return start and end, (2, count)."""
        if self.given_ends is not None:
            return self.given_ends
        free = self.scenario.platform_free
        shape = [*HOME_SHAPE, 0.0][: self.count - len(free)]  # xx, xy, yy, turn
        ends = np.stack([np.r_[pose[free], shape] for pose in self.references[0]])
        for fixed in fixed_values(self.scenario):
            if fixed.order == 0 and fixed.column < len(free):
                ends[fixed.end, fixed.column] += fixed.value
        return ends

    @cached_property
    def offsets(self) -> np.ndarray:
        """Return where each loose carrier is from the middle of its attachments, (k, 3) [m]."""
        scenario = self.scenario
        robot = scenario.robot
        if carrier_ends(scenario.task) in ("exact", "periodic"):
            at, carriers = self.references[0][0], self.references[1][0, :, :3]
        else:
            at, carriers = robot.home, robot.carrier_home[:, :3]
        _, attachments = scenario.dynamics.points(at)
        middles = [attachments[robot.carrier_of_cable == i].mean(axis=0) for i in self.scenario.loose]
        return np.array([carriers[i] - middle for i, middle in zip(self.scenario.loose, middles, strict=True)]).reshape(
            -1, 3
        )

    @cached_property
    def _flat(self) -> np.ndarray:
        return self.offsets[:, :2]

    @cached_property
    def _shares(self) -> np.ndarray:
        """Return the weight of each attachment in the mean of the attachments of a loose carrier, (k, m)."""
        own = self.scenario.robot.carrier_of_cable == np.array(self.scenario.loose)[:, None]
        return own / own.sum(axis=1, keepdims=True)

    @cached_property
    def largest_shape(self) -> float:
        """Return the largest factor of the formation's horizontal size that its distances permit."""
        flat, long = np.linalg.norm(self._flat, axis=1), np.linalg.norm(self.offsets, axis=1)
        return float(np.min(FLATTEST * long[flat > 0] / flat[flat > 0], initial=np.inf))

    @cached_property
    def size(self) -> float:
        """Return the largest distance of what moves from the platform's origin, or part of the ends' distance [m]."""
        robot, ends = self.scenario.robot, self.references[0][:, :3]
        points = np.vstack([robot.attachments, robot.platform.com, self.scenario.body_corners, *self.offsets])
        least = SMALL * float(np.linalg.norm(ends[1] - ends[0]))
        return max(float(np.linalg.norm(points, axis=1).max()), least, 1e-3)

    @cached_property
    def scale(self) -> np.ndarray:
        """Return how many metres a unit of each coordinate moves what it moves farthest, (count,)."""
        points = np.vstack([self.scenario.robot.attachments, self.scenario.body_corners])
        arm = max(float(np.linalg.norm(points, axis=1).max()), 1e-3)
        of_platform = [1.0 if coordinate in POSITION else arm for coordinate in self.scenario.platform_free]
        reach = float(np.linalg.norm(self._flat, axis=1).max(initial=0.0))
        return np.array([*of_platform, *[reach] * (3 * self.shaped + self.turns)])

    @cached_property
    def box(self) -> np.ndarray:
        """Return the lowest and the highest position of the platform, (2, 3) [m]."""
        scenario = self.scenario
        ends = self.references[0][:, :3]
        far = AROUND * float(np.linalg.norm(ends[1] - ends[0])) + 2 * self.size
        low, high = ends.min(axis=0) - far, ends.max(axis=0) + far
        still = [i for i, carrier in enumerate(scenario.robot.carriers) if not carrier.moves]
        if len(still) == len(scenario.robot.carriers) and len(still):
            anchors = scenario.robot.home_anchors
            frame_low, frame_high = anchors.min(axis=0), anchors.max(axis=0)
            wide = frame_high - frame_low > 1e-9
            low = np.where(wide, np.maximum(low, frame_low), low)
            high = np.where(wide, np.minimum(high, frame_high), high)
            low[2] = ends[:, 2].min() - far  # platforms hang below their frame
        if (given := scenario.task.limits.platform_box) is not None:
            low, high = np.maximum(low, given.min), np.minimum(high, given.max)
        return np.stack([np.minimum(low, ends.min(axis=0)), np.maximum(high, ends.max(axis=0))])

    @cached_property
    def groups(self) -> list[np.ndarray]:
        """Return masks (count,) of all coordinates, of position, attitude and formation."""
        free = self.scenario.platform_free
        kinds = np.array([0 if i in POSITION else 1 for i in free] + [2] * (self.count - len(free)))
        return [np.ones(self.count, bool), *(kinds == kind for kind in np.unique(kinds))]

    def sample(self, rng: Generator) -> np.ndarray:
        """Return a random configuration, (count,)."""
        start, end = self.ends
        value = start + rng.random() * (end - start)
        free = self.scenario.platform_free
        places = [k for k, coordinate in enumerate(free) if coordinate in POSITION]
        axes = [free[k] for k in places]
        low, high = self.box[:, axes]
        where = rng.random()
        if where < ANYWHERE:
            value[places] = rng.uniform(low, high)
        elif where < ANYWHERE + NEAR:
            spread = rng.random() ** 2 * SPREAD * np.linalg.norm(high - low)
            value[places] = np.clip(value[places] + rng.normal(0.0, spread, len(places)), low, high)
        angles = [k for k, coordinate in enumerate(free) if coordinate in ATTITUDE]
        if angles and rng.random() > AS_USUAL:
            most = self.scenario.task.tube.turn
            value[angles] += np.clip(rng.normal(0.0, most / 2, len(angles)), -most, most)
        if self.shaped and rng.random() > AS_USUAL:
            value[len(free) :] = self.sample_shape(rng)
        return value

    def sample_shape(self, rng: Generator) -> np.ndarray:
        """Return a formation of two random factors along random axes, turned at random."""
        first, second = rng.uniform(SMALLEST, self.largest_shape, 2)
        axis = rng.uniform(0.0, np.pi)
        c, s = np.cos(axis), np.sin(axis)
        shape = [first * c**2 + second * s**2, (first - second) * c * s, first * s**2 + second * c**2]
        return np.array([*shape, *[rng.uniform(-np.pi, np.pi)] * self.turns])

    def is_mirrored(self, configurations: np.ndarray) -> np.ndarray:
        """Return where the formation is turned inside out, (n,): changes lead there only through a line."""
        xx, xy, yy = configurations[:, self.groups[-1]].T[:3]
        return xx * yy - xy**2 <= 0.0

    def poses(self, configurations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses of the platform (n, 6) and of the carriers (n, c, 6)."""
        scenario = self.scenario
        platform, carriers = self._without_deviation(configurations)
        platform[:, scenario.platform_free] = configurations[:, : len(scenario.platform_free)]
        if self.scenario.loose:
            carriers[:, self.scenario.loose, :3] = self._formation(
                platform, configurations[:, len(scenario.platform_free) :]
            )
        return platform, carriers

    def _formation(self, platform: np.ndarray, shape: np.ndarray) -> np.ndarray:
        """Return where the loose carriers are, (n, k, 3) [m]."""
        _, attachments = self.scenario.dynamics.points(platform, self.references[1][0])
        middles = np.einsum("km,nmi->nki", self._shares, attachments)
        turn = platform[:, 5] - self.references[0][0, 5]
        if self.turns:
            turn = turn + shape[:, 3]
        cos, sin = np.cos(turn), np.sin(turn)
        matrix = np.array([[cos, -sin], [sin, cos]])  # (2, 2, n)
        if self.shaped:
            xx, xy, yy = shape[:, :3].T
            matrix = np.einsum("ijn,jkn->ikn", matrix, np.array([[xx, xy], [xy, yy]]))
        flat = np.einsum("ijn,kj->nki", matrix, self._flat)
        long = np.linalg.norm(self.offsets, axis=1)
        most = np.maximum(FLATTEST * long, np.linalg.norm(self._flat, axis=1))
        flat = flat * np.minimum(1.0, most / np.maximum(np.linalg.norm(flat, axis=2), 1e-12))[..., None]
        high = np.sqrt(np.maximum(long**2 - (flat**2).sum(axis=2), 0.0)) * np.sign(self.offsets[:, 2])
        return middles + np.concatenate([flat, high[..., None]], axis=2)
