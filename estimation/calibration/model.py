"""`Model`: residuals of measurements and their derivatives, by parameters and by poses.

With the reading y of a cable, its length l at the pose, offset o, build-up b, scale s and the file's scale s0,

    e = (f l - o - b y^2 - s y) / sigma                  if all poses were measured
    e = (s0 / s (f l - o - b y^2) - s0 y) / sigma        if any pose is unknown

The second is in the units of the reading. The first would shrink with the robot, so a robot of zero size would fit
best. With known poses the first is a linear regression, which readings that hardly change do not determine. f is 1, or
1 / (1 + t / (E A)) if tensions are known, measured or by the weight that hangs from the cables, because readings refer
to the unstrained cable. Measured tensions are given (`FeltTensions`), those by weight and inertia follow from the
parameters and the pose, both up to errors that are further unknowns of the sample, treated as coordinates of its pose.

Where forces tell more than lengths, or parameters of theirs are free, the balance of the platform (`balance`) is a
further residual of each sample. So are measured directions of cables (`sightings`).

The pose of sample k is the pose measured at t_k + clock, or an initial one, plus a translation and a small rotation in
{G}. These increments are unknowns if the pose was measured with an error or not at all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.display import Displayed
from ...models import points
from ...models.robot import Robot
from ..logs.measurements import Measurements, carriers_of, measured, measured_poses
from ..logs.pose_track import PoseTrack
from .balance import Balance, Balanced, FeltTensions, needs_balance
from .carrier_motion import CarrierMotion
from .geometry import runs
from .parameters import COMMON, FRAMES, IN_BALANCE, OF_CABLE, OF_ROBOT, Parameters, in_plane, prior_sigmas
from .pose_frames import Poses, reframed, twists_of
from .residuals import Derivatives, Residuals, State
from .sightings import sightings

STILL = 1e-4  # [m] along directions that are kept
PART = 4000  # samples whose derivatives are computed together


@dataclass(frozen=True, eq=False)
class Model(Displayed):
    """Measurements of a robot, and the unknowns that explain them."""

    parameters: Parameters
    measurements: Measurements
    prior: dict[str, float]
    weights: np.ndarray  # which readings are used, (m, N) of bool, or factors of their residuals
    start: np.ndarray | None = None  # initial poses where none was measured, (N, 6) [m, rad]; default: home
    track: PoseTrack | None = None  # measured poses over time; default: the clock offset is 0
    upright: float = np.inf  # standard deviation of unmeasured orientations about their initial values [rad]; inf: none
    noise: float = 1.0  # factor of the stated standard deviations of forces
    unbalanced: np.ndarray | None = None  # samples whose balance of forces is left out, (N,) of bool; default: none
    forces: Balance | None = None  # forces of the measurements; default: computed
    weighs: bool = False  # True if the balance of forces is part of the fit whatever the parameters are
    felt: FeltTensions | None = None  # tensions that stretch the cables; default: the measured ones, without errors
    ahead: float = 0.0  # clock offset of the platform's accelerations, near the one of its poses [s]
    interpolates: bool = False  # True if poses between measured ones are known, as with a track
    # measured poses of the carriers over time; default: those of the measurements, without a clock offset
    carriers: CarrierMotion | None = None
    kept: np.ndarray | None = None  # further rows (d, P) of `kept_rows`; default: none

    @property
    def robot(self) -> Robot:
        """Return the robot of the file."""
        return self.parameters.robot

    @cached_property
    def pose_sigmas(self) -> np.ndarray:
        """Return the standard deviation of each coordinate of each pose, and error of tensions, (N, 6 + d) [m, rad, 1].

        Inf: not measured; 0: exact, or locked by `platform.dof`.
        """
        sigma = self.measurements.sigma
        known = measured(self.measurements)
        known = known | (known.any(axis=0) & (self.interpolates or self.track is not None))
        unknown = np.repeat([np.inf, self.upright], 3)
        result = np.where(known, np.repeat([sigma.position, sigma.rotation], 3), unknown)
        result[:, np.flatnonzero(self.robot.dof_mask == 0)] = 0.0
        return np.hstack([result, np.ones((len(result), self._open))])

    @cached_property
    def poses_vary(self) -> np.ndarray:
        """Return which coordinates of poses vary, (N, 6 + d) of bool."""
        return self.pose_sigmas > 0

    @cached_property
    def size_is_open(self) -> bool:
        """Return whether most positions are unknown, so that residuals of readings are those by their scale."""
        return bool(np.isinf(self.pose_sigmas[:, :3]).any(axis=1).mean() > 0.5)

    @property
    def has_unknown_poses(self) -> bool:
        """Return whether some poses were not measured completely."""
        return bool(np.isinf(self.pose_sigmas).any())

    @cached_property
    def prior_sigmas(self) -> np.ndarray:
        """Return the standard deviations of the parameters about the file's values, (P,); inf: none."""
        return prior_sigmas(self.parameters, self.prior)

    @cached_property
    def kept_rows(self) -> np.ndarray:
        """Return all rows (d, P) whose products with the change from the file are zero; a prior holds them, too."""
        rows = np.zeros((0, self.parameters.count)) if self.kept is None else self.kept
        used = np.isfinite(self.prior_sigmas) | ~self.parameters.varies
        return rows[~(rows[:, used] != 0).any(axis=1)]

    @cached_property
    def _in_plane(self) -> np.ndarray:
        """Return what derivatives by ends of cables are multiplied by, so that ends stay in their plane, (m, 6, 6)."""
        given = self.measurements
        leave = given.carrier_poses is not None or given.directions is not None
        return np.broadcast_to(np.eye(6), (self.robot.m, 6, 6)) if leave else in_plane(self.parameters)

    @cached_property
    def _forces(self) -> Balance:
        return self.forces or Balance(self.robot, self.measurements)

    @cached_property
    def balanced(self) -> Balance | None:
        """Return the balance of forces if it is part of the fit, or None."""
        wanted = self.weighs or not set(IN_BALANCE).isdisjoint(self.parameters.groups)
        wanted = wanted or needs_balance(self.robot, self.measurements)
        return self._forces if wanted and self._forces.equations.any() else None

    def only(self, rows: np.ndarray | slice) -> Model:
        """Return the model of some samples (k,) that rise, with the motion of all."""
        samples = np.arange(len(self.measurements))[rows]
        slips = tuple((cable, int(np.searchsorted(samples, first))) for cable, first in self.parameters.slips)
        return replace(
            self,
            parameters=replace(self.parameters, slips=slips) if slips else self.parameters,
            measurements=self.measurements.only(rows),
            weights=self.weights[:, rows],
            start=None if self.start is None else self.start[rows],
            track=None if self.track is None else self.track.at_samples(rows),
            unbalanced=None if self.unbalanced is None else self.unbalanced[rows],
            forces=self._forces.only(rows),
            felt=None if self.felt is None else self.felt.only(rows),
            carriers=None if self.carriers is None else self.carriers.at_samples(rows),
        )

    def parts(self, state: State, backwards: bool = False) -> Iterator[tuple[slice, Model, State]]:
        """Yield the model and the state by samples few enough for all their derivatives, or the last ones first."""
        count = len(self.measurements)
        if count <= PART:
            yield slice(None), self, state
            return
        for first in sorted(range(0, count, PART), reverse=backwards):
            rows = slice(first, first + PART)
            yield rows, self.part(rows), state.only(rows)

    def part(self, rows: np.ndarray | slice) -> Model:
        """Return the model of some samples (k,) that rise, with the weights that they have in the whole log."""
        shared = ("size_is_open", "pulled_at_poses", "prior_sigmas", "kept_rows", "_in_plane")
        part, known = self.only(rows), {name: getattr(self, name) for name in shared}
        balanced = None if self.balanced is None else part.forces
        vars(part).update(known, pose_sigmas=self.pose_sigmas[rows], balanced=balanced)
        return part

    @cached_property
    def felt_tensions(self) -> FeltTensions | None:
        """Return the tensions that stretch the cables, None if none were measured."""
        if self.felt is not None or self.measurements.tensions is None:
            return self.felt
        tensions, _ = self._forces.tensions(self.parameters.table(self.parameters.first), smooth=True)
        return FeltTensions(tensions, np.zeros((*tensions.shape, 0)))

    @cached_property
    def pulled_at_poses(self) -> bool:
        """Return whether cables are stretched by tensions that weight and inertia determine at the estimated poses."""
        if self.felt is None or self.measurements.tensions is not None:
            return False
        if self._open:  # errors of accelerations, far larger at the ends of a log, must be unknowns then
            return bool(self.parameters.groups)
        wanted = "elasticity" in self.parameters.groups or (self.has_unknown_poses and self.balanced is not None)
        return wanted and self._forces.at_rest

    @property
    def _open(self) -> int:
        return 0 if self.felt is None else self.felt.errors.shape[2]

    def _stretch(self, state: State, carried: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the length without strain for each metre of length, its tensions [N], (m, N), and their derivatives.

        These are by the errors of the tensions, (m, N, d). `carried` are the tensions by weight and inertia, (N, m).
        """
        if self.felt_tensions is None:
            return np.ones((self.robot.m, 1)), np.zeros((self.robot.m, 1)), np.zeros((self.robot.m, 1, 0))
        known = self.felt_tensions.tensions if carried is None else carried
        felt = (known + (self.felt_tensions.errors @ state.errors[..., None])[..., 0]).T
        # A bound of zero would be a kink, where no step helps; readings of slack cables are left out anyway.
        least = 0.0 if carried is None else -0.5 / max(float(self.parameters.compliances(state.x).max()), 1e-300)
        tensions = np.maximum(felt, least)
        by_errors = self.felt_tensions.errors.swapaxes(0, 1) * (felt > least)[..., None]
        return 1 / (1 + tensions * self.parameters.compliances(state.x)[:, None]), tensions, by_errors

    def begin(self) -> State:
        """Return the parameters of the file, at the initial poses."""
        count = len(self.measurements)
        errors = np.zeros((count, self._open))
        still, straight = np.broadcast_to(0.0, (count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3))
        return State(self.parameters.first.copy(), still, straight, errors)

    def poses(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (N, 3) [m] and rotations (N, 3, 3) of the platform."""
        position, rotation, _, _ = self._base(state.x)
        return position + state.shift, state.turn @ rotation

    def inside(self, state: State) -> np.ndarray:
        """Return which samples have a pose at their time, (N,) of bool: a clock offset may exceed the record."""
        if self.track is None:
            return np.ones(len(self.measurements), dtype=bool)
        return self.track.inside(state.x[self.parameters.clock])

    def _base(self, x: np.ndarray) -> Poses:
        base = (*self._begun, None, None) if self.track is None else self.track.at(x[self.parameters.clock])
        change = x[self.parameters.clock :][FRAMES]
        return reframed(base, change, self.robot.home[:3]) if change.any() else base

    @cached_property
    def _begun(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the measured, or else the initial, positions (N, 3) [m] and rotations (N, 3, 3)."""
        position, rotation, known = measured_poses(self.robot, self.measurements)
        if self.start is not None and not known.all():
            place, turned = ~known[:, 0], ~known[:, 3]
            position, rotation = position.copy(), rotation.copy()
            position[place] = self.start[place, :3]
            rotation[turned] = points.rotations(self.start[turned, 3:])
        return position, rotation

    def residuals(self, state: State) -> Residuals:
        """Return the residuals of readings, poses and parameters."""
        return Residuals.together([part._evaluate(own, False)[0] for _, part, own in self.parts(state)])

    def cost(self, state: State) -> float:
        """Return the sum of the squares of all residuals, inf where a cable has no length."""
        own = self.of_parameters(state.x)
        return float(own @ own) + sum(
            part._evaluate(of, False)[0].of_samples.sum() for _, part, of in self.parts(state)
        )

    def of_parameters(self, x: np.ndarray) -> np.ndarray:
        """Return the residuals of the parameters (P,) and of kept directions (d,)."""
        change = x - self.parameters.first
        return np.concatenate([change / self.prior_sigmas, self.kept_rows @ change / STILL])

    def linearised(self, state: State) -> tuple[Residuals, Derivatives]:
        """Return the residuals and their derivatives, of all samples at once."""
        residuals, derivatives = self._evaluate(state, True)
        assert derivatives is not None
        return residuals, derivatives

    def _evaluate(self, state: State, derive: bool) -> tuple[Residuals, Derivatives | None]:
        robot, parameters = self.robot, self.parameters
        table, m = parameters.table(state.x), robot.m
        base = _, _, velocity, _ = self._base(state.x)
        position, rotation = base[0] + state.shift, state.turn @ base[1]
        arms = np.einsum("nij,mj->mni", rotation, table[:, 3:6])  # R b
        moving = None if self.carriers is None else self.carriers.at(state.x[parameters.clock])
        at = carriers_of(robot, self.measurements) if moving is None else moving.poses
        run = runs(robot, table, position, rotation, at)
        carried = None if moving is None else moving.of_cables(robot, position + arms)
        slip, y = self.slips(state.x), self.measurements.lengths.T
        stretches = "elasticity" in parameters.groups or bool(parameters.compliances(state.x).any())
        forces, pulls = None, stretches and self.pulled_at_poses
        if self.balanced is not None or pulls:
            placed = position, rotation
            forces = self._forces.at(parameters, state.x, placed, self.ahead, self.noise, derive, pulls)
        pulled = forces if pulls else None
        stretch, tensions, by_errors = self._stretch(state, None if pulled is None else pulled.tensions)
        scale0 = parameters.table(parameters.first)[:, 7:8]
        scale = table[:, 7:8]
        ratio, own = (scale0 / scale, scale0) if self.size_is_open else (np.ones_like(scale), scale)
        inside = self.inside(state)
        weights = self.weights * inside / self.measurements.sigma.lengths
        excess = stretch * run.lengths - table[:, 6:7] - slip - table[:, 9:10] * y**2  # scale times reading
        readings = weights * (ratio * excess - own * y)
        sigmas = self.pose_sigmas
        poses = np.zeros(sigmas.shape)
        held = (sigmas > 0) & np.isfinite(sigmas)
        if held.any():
            turned = points.rotation_vectors(state.turn)
            moved = np.concatenate([state.shift, turned, state.errors], axis=1)
            poses[held] = moved[held] / sigmas[held]
        # Forces alone would move a pose without readings to infinity, where all cables are parallel.
        weighs = inside & (self.weights.any(axis=0) | ~np.isinf(sigmas).any(axis=1))
        weighs = weighs if self.unbalanced is None else weighs & ~self.unbalanced
        in_balance = np.zeros((len(position), 0))
        if self.balanced is not None and forces is not None:
            in_balance = forces.residuals * weighs[:, None]
        seen = sightings(parameters, state.x, (position, rotation), run, at, self.measurements, carried, derive)
        if seen is not None:
            seen.leave_out(~inside)
        seen_residuals = np.zeros((m, len(position), 0)) if seen is None else seen.residuals
        residuals = Residuals(readings, poses, self.of_parameters(state.x), in_balance, seen_residuals)
        if not derive:
            return residuals, None
        gain = weights * ratio
        by_length = (gain * stretch)[..., None]
        by_pose = by_length * run.by_pose
        cables = np.empty((m, len(position), OF_CABLE))
        cables[..., :6] = by_length * (run.by_geometry[..., :6] @ self._in_plane)
        by_parameters = [] if forces is None else [forces.by_parameters, forces.tensions_by_parameters]
        by_poses = [] if forces is None else [forces.by_pose, forces.tensions_by_pose]
        for one in by_parameters:  # of ends, of which forces know no more than lengths do
            if one is not None:
                ends = one[..., : parameters.clock].reshape(*one.shape[:2], m, OF_CABLE)[..., :6]
                ends[:] = (ends[..., None, :] @ self._in_plane)[..., 0, :]
        cables[..., 6] = -gain
        cables[..., 7] = -gain * (excess / scale if self.size_is_open else y)
        cables[..., 8] = by_length[..., 0] * run.by_geometry[..., 6]
        cables[..., 9] = -gain * y**2
        by_strain = -gain * stretch**2 * run.lengths
        cables[..., 10] = by_strain * tensions
        cables[..., 11:] = 0.0
        last = np.flatnonzero(parameters.varies[parameters.clock :])
        moved, others = last[last < OF_ROBOT], np.zeros((m, len(position), len(last)))
        if velocity is not None or (moved >= FRAMES.start).any():
            twists = twists_of(base, state.x[parameters.clock :][FRAMES], robot.home[:3], moved, state.turn)
            others[..., : len(moved)] = np.swapaxes(np.swapaxes(by_pose, 0, 1) @ twists, 0, 1)
            for one, by in zip(by_parameters, by_poses, strict=True):
                if one is not None and by is not None:
                    one[..., parameters.clock + moved] += by[..., :6] @ twists
            if seen is not None and seen.robot is not None and seen.poses is not None:
                seen.robot[..., moved] += seen.poses @ twists
            if carried is not None:
                others[..., last == 0] -= np.einsum("mni,mni->mn", by_pose[..., :3], carried[0])[..., None]
        others[..., last == COMMON] += cables[..., 10:11]
        by_tension = (by_strain * parameters.compliances(state.x)[:, None])[..., None]
        through = None
        if pulled is not None and pulled.tensions_by_parameters is not None and pulled.tensions_by_pose is not None:
            by_pose = by_pose + by_tension * pulled.tensions_by_pose.swapaxes(0, 1)
            through = by_tension * pulled.tensions_by_parameters.swapaxes(0, 1)
        for column, (cable, first) in enumerate(parameters.slips, start=len(moved)):
            others[cable, first:, column] = -gain[cable, first:]
        forces = None if self.balanced is None else self._kept(forces, weighs)
        if self._open:
            by_errors = by_tension * by_errors
            by_pose = np.concatenate([by_pose, np.broadcast_to(by_errors, (*by_pose.shape[:2], self._open))], axis=2)
        return residuals, Derivatives(cables, others, by_pose, arms, run.lengths, forces, seen, through)

    def _kept(self, one: Balanced | None, rows: np.ndarray) -> Balanced | None:
        """Return residuals of samples with their derivatives, zero except in some rows (N,) of bool."""
        if one is None or one.by_parameters is None or one.by_pose is None:
            return one
        kept, more = rows[:, None, None], ((0, 0), (0, 0), (0, self._open))
        return Balanced(one.residuals * rows[:, None], one.by_parameters * kept, np.pad(one.by_pose * kept, more))

    def slips(self, x: np.ndarray) -> np.ndarray:
        """Return the sum of each cable's slips so far, (m, N) [m]."""
        result = np.zeros((self.robot.m, len(self.measurements)))
        for (cable, first), size in zip(self.parameters.slips, x[self.parameters.clock + OF_ROBOT :], strict=True):
            result[cable, first:] += size
        return result

    def lengths(self, state: State) -> np.ndarray:
        """Convert the readings to cable lengths, (N, m) [m]."""
        table = self.parameters.table(state.x)
        y = self.measurements.lengths.T
        unstrained = table[:, 6:7] + self.slips(state.x) + (table[:, 7:8] + table[:, 9:10] * y) * y
        carried = None
        if self.pulled_at_poses:
            carried = self._forces.carrying(self.parameters, state.x, self.poses(state), self.ahead).tensions
        return (unstrained / self._stretch(state, carried)[0]).T

    def moved(self, state: State, dx: np.ndarray, dq: np.ndarray | None) -> State:
        """Return the state after changes of parameters (P,), and of poses and errors, (N, 6 + d) or None if fixed."""
        if dq is None:
            return state._replace(x=state.x + dx)
        turn = Rotation.from_rotvec(dq[:, 3:6]).as_matrix() @ state.turn
        return State(state.x + dx, state.shift + dq[:, :3], turn, state.errors + dq[:, 6:])
