"""`Model`: residuals of measurements and their derivatives, by parameters and by poses.

With the reading y of a cable, its length l at the pose, offset o, scale s and the file's scale s0,

    e = (f l - o - s y) / sigma                      if all poses were measured
    e = (s0 / s (f l - o) - s0 y) / sigma            if any pose is unknown

The second is in the units of the reading. The first would shrink with the robot, so a robot of zero size would fit
best. With known poses the first is a linear regression, which readings that hardly change do not determine. f is 1, or
1 / (1 + t / (E A)) if tensions were measured, because readings refer to the unstrained cable.

The pose of sample k is the pose measured at t_k + clock, or an initial one, plus a translation and a small rotation in
{G}. These increments are unknowns if the pose was measured with an error or not at all.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.display import Displayed
from ...models import points
from ...models.robot import Robot
from ..logs.measurements import Measurements, measured_poses
from ..logs.pose_track import PoseTrack
from .geometry import runs
from .parameters import OF_CABLE, Parameters, prior_sigmas


class State(NamedTuple):
    """Parameters and poses.

    Attributes
    ----------
    x
        Parameters, (P,).
    shift, turn
        Increments of the poses from their initial values, in {G}: (N, 3) [m], (N, 3, 3).
    """

    x: np.ndarray
    shift: np.ndarray
    turn: np.ndarray


class Residuals(NamedTuple):
    """Differences divided by their standard deviations: readings (m, N), poses (N, 6) and parameters (P,)."""

    readings: np.ndarray
    poses: np.ndarray
    parameters: np.ndarray

    @property
    def cost(self) -> float:
        """Return the sum of squares, inf where a cable has no length."""
        total = sum(float(np.vdot(part, part)) for part in self)
        return total if np.isfinite(total) else np.inf

    @property
    def of_samples(self) -> np.ndarray:
        """Return the sum of squares of each sample's readings and pose, (N,), inf where a cable has no length."""
        total = (self.readings**2).sum(axis=0) + (self.poses**2).sum(axis=1)
        return np.where(np.isfinite(total), total, np.inf)


class Derivatives(NamedTuple):
    """Derivatives of the residuals of readings.

    Attributes
    ----------
    cables
        Derivatives by the nine parameters of the cable itself, (m, N, 9).
    others
        Derivatives by clock offset and slips, (m, N, 1 + slips).
    poses
        Derivatives by shift and rotation of the sample itself, (m, N, 6).
    arms, lengths
        R b of each cable (m, N, 3) [m], and its length (m, N) [m].
    """

    cables: np.ndarray
    others: np.ndarray
    poses: np.ndarray
    arms: np.ndarray
    lengths: np.ndarray


@dataclass(frozen=True, eq=False)
class Model(Displayed):
    """Measurements of a robot, and the unknowns that explain them.

    Attributes
    ----------
    weights
        1 for each reading that is used, 0 for one that is left out, (m, N).
    start
        Initial poses where none was measured, (N, 6) [m, rad]; default: home.
    track
        Measured poses over time; default: the clock offset is 0.
    upright
        Standard deviation of unmeasured orientations about their initial values [rad]; inf: none.
    """

    parameters: Parameters
    measurements: Measurements
    prior: dict[str, float]
    weights: np.ndarray
    start: np.ndarray | None = None
    track: PoseTrack | None = None
    upright: float = np.inf

    @property
    def robot(self) -> Robot:
        """Return the robot of the file."""
        return self.parameters.robot

    @cached_property
    def _given(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return measured_poses(self.robot, self.measurements)

    @cached_property
    def pose_sigmas(self) -> np.ndarray:
        """Return the standard deviation of each coordinate of each pose, (N, 6) [m, rad].

        Inf: not measured; 0: exact, or locked by `platform.dof`.
        """
        sigma = self.measurements.sigma
        known = self._given[2] | (self.track is not None)
        unknown = np.repeat([np.inf, self.upright], 3)
        result = np.where(known, np.repeat([sigma.position, sigma.rotation], 3), unknown)
        result[:, self.robot.dof_mask == 0] = 0.0
        return result

    @cached_property
    def poses_vary(self) -> np.ndarray:
        """Return which coordinates of poses vary, (N, 6) of bool."""
        return self.pose_sigmas > 0

    @cached_property
    def prior_sigmas(self) -> np.ndarray:
        """Return the standard deviations of the parameters about those of the file, (P,); inf: none."""
        return prior_sigmas(self.parameters, self.prior)

    @cached_property
    def _stretch(self) -> np.ndarray:
        """Return the length without strain for each metre of length, (m, N)."""
        tensions, stiffness = self.measurements.tensions, [cable.stiffness for cable in self.robot.cables]
        if tensions is None:
            return np.ones((self.robot.m, 1))
        by = [1 / value if value else 0.0 for value in stiffness]
        return 1 / (1 + np.maximum(tensions.T, 0.0) * np.array(by)[:, None])

    def begin(self) -> State:
        """Return the parameters of the file, at the initial poses."""
        count = len(self.measurements)
        return State(self.parameters.first.copy(), np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)))

    def poses(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (N, 3) [m] and rotations (N, 3, 3) of the platform."""
        position, rotation, _, _ = self._base(state.x[self.parameters.clock])
        return position + state.shift, state.turn @ rotation

    def inside(self, state: State) -> np.ndarray:
        """Return which samples have a pose at their time, (N,) of bool: a clock offset may exceed the record."""
        if self.track is None:
            return np.ones(len(self.measurements), dtype=bool)
        return self.track.inside(state.x[self.parameters.clock])

    def _base(self, clock: float) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]:
        if self.track is not None:
            return self.track.at(clock)
        return (*self._begun, None, None)

    @cached_property
    def _begun(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the measured, or else the initial, positions (N, 3) [m] and rotations (N, 3, 3)."""
        position, rotation, known = self._given
        if self.start is not None and not known.all():
            place, turned = ~known[:, 0], ~known[:, 3]
            position, rotation = position.copy(), rotation.copy()
            position[place] = self.start[place, :3]
            rotation[turned] = points.rotations(self.start[turned, 3:])
        return position, rotation

    def residuals(self, state: State) -> Residuals:
        """Return the residuals of readings, poses and parameters."""
        return self._evaluate(state, False)[0]

    def linearised(self, state: State) -> tuple[Residuals, Derivatives]:
        """Return the residuals and their derivatives."""
        residuals, derivatives = self._evaluate(state, True)
        assert derivatives is not None
        return residuals, derivatives

    def _evaluate(self, state: State, derive: bool) -> tuple[Residuals, Derivatives | None]:
        robot, parameters = self.robot, self.parameters
        table, m = parameters.table(state.x), robot.m
        base_position, base_rotation, velocity, rate = self._base(state.x[parameters.clock])
        position, rotation = base_position + state.shift, state.turn @ base_rotation
        arms = np.matmul(table[:, None, None, 3:6], np.swapaxes(rotation, 1, 2))[:, :, 0]  # (m, N, 3), R b
        run = runs(robot, table, position, rotation)
        slip = self.slips(state.x)
        scale0 = parameters.table(parameters.first)[:, 7:8]
        size_is_open = bool(np.isinf(self.pose_sigmas).any())
        scale = table[:, 7:8]
        ratio, own = (scale0 / scale, scale0) if size_is_open else (np.ones_like(scale), scale)
        inside = self.inside(state)
        weights = self.weights * inside / self.measurements.sigma.lengths
        excess = self._stretch * run.lengths - table[:, 6:7] - slip  # scale times reading, without noise
        readings = weights * (ratio * excess - own * self.measurements.lengths.T)
        sigmas = self.pose_sigmas
        poses = np.zeros((len(position), 6))
        held = (sigmas > 0) & np.isfinite(sigmas)
        if held.any():
            moved = np.concatenate([state.shift, Rotation.from_matrix(state.turn).as_rotvec()], axis=1)
            poses[held] = moved[held] / sigmas[held]
        residuals = Residuals(readings, poses, (state.x - parameters.first) / self.prior_sigmas)
        if not derive:
            return residuals, None
        gain = weights * ratio
        by_length = (gain * self._stretch)[..., None]
        along = by_length * run.directions  # by the attachment in {G}
        cables = np.empty((m, len(position), OF_CABLE))
        cables[..., :6] = by_length * run.by_geometry[..., :6]
        cables[..., 6] = -gain
        cables[..., 7] = -gain * (excess / scale if size_is_open else self.measurements.lengths.T)
        cables[..., 8] = by_length[..., 0] * run.by_geometry[..., 6]
        by_pose = np.concatenate([along, np.cross(arms, along)], axis=2)
        others = np.zeros((m, len(position), 1 + len(parameters.slips)))
        if velocity is not None and rate is not None:
            others[..., 0] = np.einsum("mni,ni->mn", by_pose, np.concatenate([velocity, rate], axis=1))
        for column, (cable, first) in enumerate(parameters.slips, start=1):
            others[cable, first:, column] = -gain[cable, first:]
        return residuals, Derivatives(cables, others, by_pose, arms, run.lengths)

    def slips(self, x: np.ndarray) -> np.ndarray:
        """Return the sum of each cable's slips so far, (m, N) [m]."""
        result = np.zeros((self.robot.m, len(self.measurements)))
        for (cable, first), size in zip(self.parameters.slips, x[self.parameters.clock + 1 :], strict=True):
            result[cable, first:] += size
        return result

    def lengths(self, state: State) -> np.ndarray:
        """Convert the readings to cable lengths, (N, m) [m]."""
        table = self.parameters.table(state.x)
        unstrained = table[:, 6:7] + self.slips(state.x) + table[:, 7:8] * self.measurements.lengths.T
        return (unstrained / self._stretch).T

    def moved(self, state: State, dx: np.ndarray, dq: np.ndarray | None) -> State:
        """Return the state after changes of parameters (P,) and of poses (N, 6), or None if no pose varies."""
        if dq is None:
            return state._replace(x=state.x + dx)
        return State(state.x + dx, state.shift + dq[:, :3], Rotation.from_rotvec(dq[:, 3:]).as_matrix() @ state.turn)
