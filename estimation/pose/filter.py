"""`PoseFilter`: pose and velocity of a moving platform from a stream of measurements (extended Kalman filter).

The state is the position p, the rotation R, velocity v, angular velocity w, and the linear and angular acceleration
in addition to a reference's, all in {G}; the last two change by white jerk. With a reference it thus filters the error
to the reference, and its bandwidth may be far below the motion's. Errors are (p, small rotation, v, w, a,
alpha) and, once an inertial sensor is used, the biases of its rates and accelerations.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base.display import Displayed, record
from ...base.inputs import InputError, finite_array, number, real_array, shown
from ...core import lines
from ...models import points
from ...models.files import AnyRobot, as_robot
from ...models.part import LARGEST
from ...models.record import record_of
from .from_lengths import pose_from_lengths
from .one_rotation import axes_of, cross, turn_by, vector_of

SIGMA = {"lengths": 1e-3, "position": 1e-3, "rotation": 1e-3, "rate": 1e-2, "acceleration": 0.1}
SIGMA |= {"tensions": 0.02, "forces": 0.02, "rate_bias": 0.02, "acceleration_bias": 0.2}
SMALLEST, MOST = 1e-9, 1e6
JERK = 10.0  # [m/s^2.5], which the bandwidths of controllers need
BEGIN = 0.02, 0.1  # factors of the first standard deviations of velocities and accelerations, with a reference
WALK = 1e-4, 1e-3  # of biases: [rad/s^1.5], [m/s^2.5]
LARGEST_ERROR = 5.0  # standard deviations of a length; larger ones are wrong readings
SHIFT, TURN, SPEED, SPIN, PUSH, TWIRL = (slice(3 * k, 3 * k + 3) for k in range(6))


class MotionEstimate(NamedTuple):
    """Pose and velocity of the platform at a time.

    Attributes:
        time: Time of the estimate [s].
        pose: (x, y, z, roll, pitch, yaw) of the platform frame in {G}, (6,) [m, rad].
        velocity: Its time derivative, (6,); rates of roll and yaw are nan at a pitch of 90 degrees.
        twist: Velocity of the platform frame and angular velocity, in {G}, (6,) [m/s, rad/s].
        covariance: Covariance of x, y, z, a small rotation in {G}, and the twist, (12, 12).
        left_out: Indices of the cables whose lengths were excluded as wrong readings.
    """

    time: float
    pose: np.ndarray
    velocity: np.ndarray
    twist: np.ndarray
    covariance: np.ndarray
    left_out: tuple[int, ...] = ()

    __repr__ = record


class PoseFilter(Displayed):
    """Estimate pose and velocity of a platform from lengths, poses, an inertial sensor or tensions, or several of them.

    The first update must have lengths or a pose. A search starts again if most lengths are wrong.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        sigma: Standard deviations of errors: `lengths` [m], `position` [m], `rotation` [rad], `rate` [rad/s],
            `acceleration` [m/s^2], `tensions` (relative), unmodelled `forces` (relative to the weight), and of the
            constant biases `rate_bias` [rad/s] and `acceleration_bias` [m/s^2]. Default: 1 mm, 1 mm, 1 mrad,
            0.01 rad/s, 0.1 m/s^2, 2 %, 2 %, 0.02 rad/s, 0.2 m/s^2.
        jerk: Densities of the white jerk [m/s^2.5] and [rad/s^2.5]: standard deviations of the change of acceleration
            in a second, relative to a reference if there is one. Default: 10 m/s^2.5, and 10 m/s^2.5
            divided by the robot's `length`. With less jerk the filter is slower, and its estimates less noisy; see
            `control.Filtered`.
        sensor: Position of the inertial sensor in the platform frame, (3,) [m]; its axes are the axes of the platform.

    Raises:
        InputError: If an argument has a wrong value.
    """

    def __init__(
        self,
        robot: AnyRobot,
        sigma: Mapping[str, float] | None = None,
        jerk: Sequence[float] | None = None,
        sensor: ArrayLike = (0.0, 0.0, 0.0),
    ):
        self.robot = as_robot(robot)
        self._sigma = SIGMA | _sigmas(sigma)
        linear, angular = (JERK, JERK / self.robot.length) if jerk is None else finite_array("jerk", jerk, (2,))
        self._jerk = number("jerk", linear, 0.0, LARGEST), number("jerk", angular, 0.0, LARGEST)
        self._sensor = finite_array("sensor", sensor, (3,))
        self._moves = np.tile(self.robot.dof_mask, 3)  # (18,)
        self._free, self._force = np.flatnonzero(self.robot.dof_mask), self.robot.force_scale
        self._gravity, self._com = np.array(self.robot.gravity), np.array(self.robot.platform.com)
        self._inertia, self._home = self.robot.inertia, self.robot.carrier_home
        self._record = record_of(self.robot).copy()
        self._record["com"] = 0.0  # moments about the platform frame
        self.reset()

    def reset(self) -> None:
        """Forget all measurements."""
        self._time: float | None = None
        self._x = np.zeros(24)  # p, unused, v, w, a, alpha, biases
        self._R, self._P = np.eye(3), np.zeros((18, 18))
        self._input: np.ndarray | None = None
        self._left_out: tuple[int, ...] = ()
        self._step: tuple[float, np.ndarray, np.ndarray] | None = None

    def noise(self, rate: float) -> dict[str, float]:
        """Return the standard deviations that noise of the poses causes in the estimates, for `sensors` of controllers.

        They are `position` [m], `attitude` [rad], `velocity` [m/s] and `attitude_rate` [rad/s]. Errors that the
        permitted jerk causes are of about the same size, but are not included: they change slowly, so that controllers
        do not amplify them. With white jerk q and noise of the density s = sigma / sqrt(rate), the filter is a
        Butterworth filter of the bandwidth b = (q / s)^(1/3). The noise then causes the variance 5/3 s^2 b of its
        position and 3/2 s^2 b^3 of its velocity.

        Args:
            rate: Rate of the measured poses [1/s].

        Raises:
            InputError: If the rate is not a number from 1e-3 to 1e6.
        """
        root = np.sqrt(number("rate", rate, 1e-3, 1e6))
        density = np.array([self._sigma["position"], self._sigma["rotation"]]) / root
        band = np.cbrt(np.array(self._jerk) / density)
        place, speed = density * np.sqrt(5 / 3 * band), density * np.sqrt(1.5 * band**3)
        names = "position", "attitude", "velocity", "attitude_rate"
        return dict(zip(names, map(float, (*place, *speed)), strict=True))

    def update(
        self,
        time: float,
        lengths: ArrayLike | None = None,
        pose: ArrayLike | None = None,
        rate: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        tensions: ArrayLike | None = None,
        reference: Sequence[ArrayLike] | None = None,
        carrier_pose: ArrayLike | None = None,
    ) -> MotionEstimate:
        """Return the estimate at `time`, with the measurements of that time; without any it is a prediction.

        Args:
            time: Time, not before the last update [s].
            lengths: Cable lengths from anchor to attachment (m,) [m]; nan: not measured.
            pose: Measured pose (6,) [m, rad], for example by motion capture; nan: not measured.
            rate, acceleration: Angular velocity [rad/s] and specific force [m/s^2] of an inertial sensor in platform
                axes, (3,).
            tensions: Tensions at the attachments (m,) [N], which accelerate the platform; its mass must be right.
            reference: Reference pose and its first and second time derivative, each (6,), such as a `Reference`.
            carrier_pose: Poses of the carriers in {G}, (c, 6); default: at home.

        Raises:
            InputError: If an argument has a wrong shape or value, the time is earlier than the last one, or the first
                update has neither lengths nor a pose.
        """
        robot = self.robot
        time = number("time", time, -LARGEST, LARGEST)
        if self._time is not None and time < self._time:
            raise InputError(f"time must not decrease until reset(), got {time:g} s after {self._time:g} s")
        given = None if lengths is None else _some("lengths", lengths, robot.m)
        seen = None if pose is None else _some("pose", pose, 6)
        seen = None if seen is None or np.isnan(seen).any() else seen
        carriers = self._home
        if carrier_pose is not None:
            carriers = finite_array("carrier_pose", carrier_pose, carriers.shape)
        felt = [_vector(*pair) for pair in (("rate", rate), ("acceleration", acceleration))]
        strong = None if tensions is None else finite_array("tensions", tensions, (robot.m,))
        ahead = None if reference is None else _acceleration(reference)
        if given is not None and (given <= 0.0).any():
            raise InputError(f"lengths must be numbers > 0 [m], or nan, got {np.nanmin(given):g}")
        if self._time is None:
            self._begin(given, seen, carriers)
            if reference is not None:
                self._begin_along(reference)
        else:
            self._predict(time - self._time, ahead)
        self._time, self._input, self._left_out = time, ahead, ()
        if felt[0] is not None or felt[1] is not None:
            self._by_inertia(*felt)
        if strong is not None:
            self._by_tensions(strong, carriers)
        if seen is not None:
            self._by_pose(seen)
        if given is not None:
            self._by_lengths(given, carriers)
        return self._estimate()

    def _estimate(self) -> MotionEstimate:
        assert self._time is not None
        pose = np.concatenate([self._x[SHIFT], points.angles(self._R)])
        twist = np.concatenate([self._x[SPEED], self._x[SPIN]])
        axes, sine = axes_of(pose[3:]), np.cos(pose[4])
        rates = np.full(3, np.nan) if abs(sine) < 1e-9 else np.linalg.solve(axes, twist[3:])
        velocity = np.concatenate([twist[:3], rates])
        return MotionEstimate(self._time, pose, velocity, twist, self._P[:12, :12].copy(), self._left_out)

    def _begin(self, lengths: np.ndarray | None, pose: np.ndarray | None, carriers: np.ndarray) -> None:
        """Start at a measured pose, or at the pose of the lengths, with unknown velocities."""
        if pose is None and (lengths is None or np.isnan(lengths).any()):
            raise InputError("lengths or pose must be given in full for the first update, got neither")
        sigma, size = self._sigma, self.robot.length
        P = np.repeat([1.0, 1.0, *self._jerk, *self._jerk], 3) ** 2
        if pose is not None:
            P[:6] = np.repeat([sigma["position"], sigma["rotation"]], 3) ** 2
            P, found = np.diag(P), pose
        else:
            estimate = pose_from_lengths(self.robot, lengths, None, carriers, sigma["lengths"])  # type: ignore[arg-type]
            P, found = np.diag(P), estimate.pose
            far = np.diag(np.repeat([size, 1.0], 3) ** 2)  # of what lengths do not determine
            noise = estimate.covariance_of_noise
            P[:6, :6] = noise if np.isfinite(noise).all() else far
        self._x[:18] = 0.0
        self._x[SHIFT], self._R = found[:3], points.rotations(found[3:])
        covariance = self._P.copy()
        covariance[:18, :], covariance[:, :18] = 0.0, 0.0
        covariance[:18, :18] = P * np.outer(self._moves, self._moves)
        self._P = covariance

    def _begin_along(self, reference: Sequence[ArrayLike]) -> None:
        """Start with about the velocity of the reference."""
        pose, velocity = (np.asarray(part, dtype=float) for part in tuple(reference)[:2])
        self._x[SPEED], self._x[SPIN] = velocity[:3], axes_of(pose[3:]) @ velocity[3:]
        shares = np.repeat([1.0, *BEGIN], 6)
        self._P[:18, :18] *= np.outer(shares, shares)

    def _accelerations(self) -> np.ndarray:
        """Return the linear and angular acceleration in {G}, (6,)."""
        return np.concatenate([self._x[PUSH], self._x[TWIRL]]) + (0.0 if self._input is None else self._input)

    def _predict(self, dt: float, ahead: np.ndarray | None) -> None:
        """Move on by `dt` [s]; the acceleration of the reference is the mean of those at both ends."""
        if dt == 0.0:
            return
        last, x = self._input, self._x
        if ahead is not None:
            self._input = ahead if last is None else (ahead + last) / 2
        acceleration = self._accelerations()
        turn = turn_by(dt * x[SPIN] + dt**2 / 2 * acceleration[3:])
        x[SHIFT] += dt * x[SPEED] + dt**2 / 2 * acceleration[:3]
        x[SPEED] += dt * acceleration[:3]
        x[SPIN] += dt * acceleration[3:]
        self._R = turn @ self._R
        if self._step is None or self._step[0] != dt or len(self._step[1]) != len(self._P):
            self._step = dt, *self._transition(dt)
        _, F, Q = self._step
        F[TURN, TURN] = turn
        self._P = F @ self._P @ F.T + Q

    def _transition(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the transition matrix without turns, and the covariance that a step of `dt` [s] adds, (n, n)."""
        F, Q = np.eye(len(self._P)), np.zeros_like(self._P)
        for first, jerk in ((0, self._jerk[0]), (3, self._jerk[1])):
            p, v, a = (np.arange(first + k, first + k + 3) for k in (0, 6, 12))
            F[p, v] = F[v, a] = dt
            F[p, a] = dt**2 / 2
            q = jerk**2
            Q[p, p], Q[v, v], Q[a, a] = q * dt**5 / 20, q * dt**3 / 3, q * dt
            Q[p, v] = Q[v, p] = q * dt**4 / 8
            Q[p, a] = Q[a, p] = q * dt**3 / 6
            Q[v, a] = Q[a, v] = q * dt**2 / 2
        Q[:18, :18] *= self._moves
        if len(Q) > 18:
            Q[np.arange(18, 24), np.arange(18, 24)] = np.repeat(WALK, 3) ** 2 * dt
        return F, Q

    def _correct(self, innovation: np.ndarray, H: np.ndarray, R: np.ndarray) -> None:
        """Update by measured minus expected values (k,), with their derivatives (k, n) and covariance (k, k)."""
        HP = H @ self._P
        gain = np.linalg.solve(HP @ H.T + R, HP)  # (k, n)
        step = innovation @ gain
        P = self._P - HP.T @ gain
        self._P = (P + P.T) / 2
        self._x[: len(step)] += step
        self._x[TURN] = 0.0
        self._R = turn_by(step[TURN]) @ self._R

    def _rows(self, count: int) -> np.ndarray:
        return np.zeros((count, len(self._P)))

    def _by_pose(self, pose: np.ndarray) -> None:
        turned = points.rotations(pose[3:]) @ self._R.T
        H = self._rows(6)
        H[:, :6] = np.eye(6)
        sigma = np.repeat([self._sigma["position"], self._sigma["rotation"]], 3)
        self._correct(np.concatenate([pose[:3] - self._x[SHIFT], vector_of(turned)]), H, np.diag(sigma**2))

    def _geometry(self, carriers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the lengths (m,) [m] and the wrench matrix about the platform frame, (6, m)."""
        m = self.robot.m
        poses = np.concatenate([self._x[SHIFT], points.angles(self._R)])[None]
        expected, A = np.empty((1, m)), np.empty((1, 6, m))
        lines(self._record, poses, carriers, expected, A, None, None, None)
        return expected[0], A[0]

    def _by_lengths(self, lengths: np.ndarray, carriers: np.ndarray) -> None:
        expected, A = self._geometry(carriers)
        H = self._rows(self.robot.m)
        H[:, :6] = -A.T
        error, variance = lengths - expected, self._sigma["lengths"] ** 2
        spread = (H[:, :6] @ self._P[:6, :6] * H[:, :6]).sum(axis=1) + variance
        known = ~np.isnan(lengths)
        wrong = known & ~(np.abs(error) <= LARGEST_ERROR * np.sqrt(spread))
        if 2 * wrong.sum() > known.sum() and known.all():
            self._begin(lengths, None, carriers)
            return
        self._left_out = tuple(np.flatnonzero(wrong).tolist())
        used = known & ~wrong
        self._correct(error[used], H[used], variance * np.eye(int(used.sum())))

    def _by_inertia(self, rate: np.ndarray | None, force: np.ndarray | None) -> None:
        if len(self._P) == 18:
            biases = np.repeat([self._sigma["rate_bias"], self._sigma["acceleration_bias"]], 3)
            P = np.diag(np.concatenate([np.zeros(18), biases**2]))
            P[:18, :18] = self._P
            self._P = P
        x, to_platform = self._x, self._R.T
        if rate is not None:
            H = self._rows(3)
            H[:, TURN], H[:, SPIN], H[:, 18:21] = to_platform @ cross(x[SPIN]), to_platform, np.eye(3)
            self._correct(rate - to_platform @ x[SPIN] - x[18:21], H, self._sigma["rate"] ** 2 * np.eye(3))
        if force is not None:
            to_platform, spin = self._R.T, self._x[SPIN]
            acceleration, arm = self._accelerations(), self._R @ self._sensor
            about, lever = cross(spin), cross(arm)
            around = about @ arm
            felt = acceleration[:3] - lever @ acceleration[3:] + about @ around - self._gravity
            H = self._rows(3)
            H[:, TURN], H[:, PUSH], H[:, 21:] = to_platform @ cross(felt), to_platform, np.eye(3)
            H[:, TWIRL] = -to_platform @ lever
            H[:, SPIN] = -to_platform @ (cross(around) + about @ lever)
            innovation = force - to_platform @ felt - x[21:]
            self._correct(innovation, H, self._sigma["acceleration"] ** 2 * np.eye(3))

    def _by_tensions(self, tensions: np.ndarray, carriers: np.ndarray) -> None:
        """Update by Newton's and Euler's equations about the platform frame, whose acceleration the tensions give."""
        R, spin, rows, A = self._R, self._x[SPIN], self._free, self._geometry(carriers)[1]
        mass, arm, inertia = self.robot.platform.mass, R @ self._com, R @ self._inertia @ R.T
        acceleration, about, lever = self._accelerations(), cross(spin), cross(arm)
        around, momentum = about @ arm, inertia @ spin
        force = mass * (acceleration[:3] - lever @ acceleration[3:] + about @ around - self._gravity)
        moment = inertia @ acceleration[3:] + about @ momentum + lever @ force
        H = self._rows(6)
        H[:3, SPIN] = -mass * (cross(around) + about @ lever)
        H[:3, PUSH], H[:3, TWIRL] = mass * np.eye(3), -mass * lever
        H[3:] = lever @ H[:3]
        H[3:, SPIN] += about @ inertia - cross(momentum)
        H[3:, TWIRL] += inertia
        size = np.maximum(np.abs(tensions), self._force / len(tensions)) * self._sigma["tensions"]
        covariance = (A * size**2) @ A.T + np.diag((self._sigma["forces"] * self._force / self.robot.wrench_scale) ** 2)
        innovation = A @ tensions - np.concatenate([force, moment])
        self._correct(innovation[rows], H[rows], covariance[rows[:, None], rows])


def _sigmas(sigma: Any) -> dict[str, float]:
    if sigma is None:
        return {}
    if not isinstance(sigma, Mapping):
        raise InputError(f"sigma must be a mapping of {', '.join(SIGMA)}, or None, got {shown(sigma)}")
    for name in sigma:
        if name not in SIGMA:
            raise InputError(f"sigma must have only the keys {', '.join(SIGMA)}, got {shown(name)}")
    return {name: number(f"sigma.{name}", value, SMALLEST, MOST) for name, value in sigma.items()}


def _some(name: str, value: ArrayLike, size: int) -> np.ndarray:
    """Return numbers (size,) that may be nan, or raise InputError."""
    array = np.array(real_array(name, value), dtype=float)
    if array.shape != (size,):
        raise InputError(f"{name} must have the shape ({size},), got {array.shape}")
    if (np.abs(array) > LARGEST).any():
        raise InputError(f"{name} must be numbers up to {LARGEST:g}, or nan, got {np.nanmax(np.abs(array)):g}")
    return array


def _vector(name: str, value: ArrayLike | None) -> np.ndarray | None:
    return None if value is None else finite_array(name, value, (3,))


def _acceleration(reference: Sequence[ArrayLike]) -> np.ndarray:
    """Return the linear and angular acceleration in {G} of a reference pose and its derivatives, (6,)."""
    try:
        parts = tuple(reference)[:3]
    except TypeError:
        parts = ()
    if len(parts) < 3:
        raise InputError(f"reference must be a pose, a velocity and an acceleration, each (6,), got {shown(reference)}")
    names = ("reference pose", "reference velocity", "reference acceleration")
    pose, velocity, acceleration = (finite_array(*pair, (6,)) for pair in zip(names, parts, strict=True))
    axes, rates = axes_of(pose[3:]), velocity[3:]
    turning = rates[0] * cross(axes @ rates) @ axes[:, 0] + rates[1] * rates[2] * cross(axes[:, 2]) @ axes[:, 1]
    return np.concatenate([acceleration[:3], axes @ acceleration[3:] + turning])
