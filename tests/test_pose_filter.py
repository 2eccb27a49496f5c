"""The filter of poses, against motions by white jerk that plain NumPy integrates and measures."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from towline import InputError, load, plan, simulate
from towline.control import ANSWERS, ComputedTorque, Filtered, Reference, State
from towline.estimation import PoseFilter

PARTS, SENSOR = 10, np.array([0.1, 0.0, 0.05])
SIGMA = {"lengths": 1e-3, "position": 1e-3, "rotation": 1e-3, "rate": 0.01, "acceleration": 0.1, "tensions": 0.02}
SIGMA |= {"forces": 0.02, "rate_bias": 0.02, "acceleration_bias": 0.2}


def motion(robot, draw, steps, dt, ahead=None):
    """Positions, rotations, velocities, rates, accelerations and angular accelerations by white jerk, at each step."""
    h, free = dt / PARTS, robot.dof_mask
    p, R, v, w = robot.home[:3].copy(), Rotation.from_euler("xyz", robot.home[3:]), np.zeros(3), np.zeros(3)
    a, b = 0.3 * draw.normal(size=3) * free[:3], 0.3 / robot.length * draw.normal(size=3) * free[3:]
    for k in range(steps):
        more = np.zeros(6) if ahead is None else ahead(k * dt)
        yield p, R, v, w, a + more[:3], b + more[3:]
        for i in range(PARTS):
            more = np.zeros(6) if ahead is None else ahead(k * dt + (i + 0.5) * h)
            p, R = p + h * v + h**2 / 2 * (a + more[:3]), Rotation.from_rotvec(h * w + h**2 / 2 * (b + more[3:])) * R
            v, w = v + h * (a + more[:3]), w + h * (b + more[3:])
            a, b = (x + np.sqrt(h) * draw.normal(size=3) * part for x, part in ((a, free[:3]), (b, free[3:])))


def lengths_at(robot, p, R):
    along = robot.anchors - p - R.apply(robot.attachments)
    return np.linalg.norm(along, axis=1)


def measured(robot, draw, now, biases, use):
    """Readings with noise of `SIGMA`, from geometry and from Newton's and Euler's equations about the CoM."""
    p, R, _, w, a, b = now
    given = {}
    if "lengths" in use:
        given["lengths"] = lengths_at(robot, p, R) + draw.normal(0, 1e-3, robot.m)
    if "pose" in use:
        turn = Rotation.from_rotvec(draw.normal(0, 1e-3, 3)) * R
        given["pose"] = np.concatenate([p + draw.normal(0, 1e-3, 3), turn.as_euler("xyz")])
    if "inertia" in use:
        r = R.apply(SENSOR)
        force = a + np.cross(b, r) + np.cross(w, np.cross(w, r)) - robot.gravity
        given["rate"] = R.inv().apply(w) + biases[:3] + draw.normal(0, 0.01, 3)
        given["acceleration"] = R.inv().apply(force) + biases[3:] + draw.normal(0, 0.1, 3)
    if "tensions" in use:
        c, inertia, free = (
            R.apply(robot.platform.com),
            R.as_matrix() @ robot.inertia @ R.as_matrix().T,
            robot.dof_mask > 0,
        )
        arms = R.apply(robot.attachments) - c
        u = (robot.anchors - p - c - arms) / lengths_at(robot, p, R)[:, None]
        A = np.vstack([u.T, np.cross(arms, u).T])[free]
        force = robot.platform.mass * (a + np.cross(b, c) + np.cross(w, np.cross(w, c)) - robot.gravity)
        wrench = np.concatenate([force, inertia @ b + np.cross(w, inertia @ w)])
        wrench = (wrench + 0.02 * robot.force_scale / robot.wrench_scale * draw.normal(size=6))[free]
        level = np.full(robot.m, 2 * robot.force_scale / robot.m)
        t = level + np.linalg.pinv(A) @ (wrench - A @ level)
        given["tensions"] = t + 0.02 * np.maximum(np.abs(t), robot.force_scale / robot.m) * draw.normal(size=robot.m)
    return given


def error(found, now):
    p, R, v, w = now[:4]
    turn = R * Rotation.from_euler("xyz", found.pose[3:]).inv()
    return np.concatenate([p - found.pose[:3], turn.as_rotvec(), v - found.twist[:3], w - found.twist[3:]])


@pytest.mark.parametrize(
    ("name", "use"),
    [
        ("cogiro", ("lengths",)),
        ("cogiro", ("pose",)),
        ("cogiro", ("lengths", "inertia", "tensions")),
        ("planar-4", ("lengths", "tensions")),
    ],
)
def test_errors_are_as_large_as_the_covariance(name, use):
    robot, squares = load(name), []
    free = np.tile(robot.dof_mask > 0, 2)
    for seed in range(12):
        draw = np.random.default_rng(seed)
        follow, biases = PoseFilter(robot, SIGMA, (1.0, 1.0), SENSOR), draw.normal(size=6) * np.repeat([0.02, 0.2], 3)
        for k, now in enumerate(motion(robot, draw, 30, 0.01)):
            found = follow.update(0.01 * k, **measured(robot, draw, now, biases, use))
        off = error(found, now)[free]
        squares.append(off @ np.linalg.solve(found.covariance[np.ix_(free, free)], off))
        assert not error(found, now)[~free].any()
    assert chi2.ppf(1e-3, 12 * free.sum()) < sum(squares) < chi2.ppf(1 - 1e-3, 12 * free.sum())


def test_a_known_reference_is_no_disturbance():
    """A fast motion with little jerk beside it: nothing lags where the filter knows the reference."""
    robot, draw, dt = load("cogiro"), np.random.default_rng(1), 0.01
    steps, rate = 100, np.array([8.0, 7.0, 6.0, 0.0, 0.0, 5.0])
    size = np.array([0.3, 0.2, 0.1, 0.0, 0.0, 0.2])

    def reference(t):
        sine, cosine = np.sin(rate * t), np.cos(rate * t)
        return robot.home + size * (rate * t - sine), size * rate * (1 - cosine), size * rate**2 * sine

    errors = []
    for knows in (True, False):
        follow = PoseFilter(robot, SIGMA, (0.05, 0.05))
        off = []
        for k in range(steps):
            pose, velocity, acceleration = reference(k * dt)
            seen = pose + draw.normal(0, 1e-3, 6)
            still = np.zeros((1, 6))
            given = Reference(pose, velocity, acceleration, still, still, still)
            found = follow.update(k * dt, pose=seen, reference=given if knows else None)
            off.append(np.abs(found.velocity - velocity)[:3].max())
        errors.append(max(off[50:]))
    assert errors[0] < 0.01 < 0.1 < errors[1]


def test_wrong_lengths_are_left_out_and_a_lost_platform_is_found():
    robot, draw = load("cogiro"), np.random.default_rng(2)
    follow, R = PoseFilter(robot), Rotation.identity()
    lengths = lengths_at(robot, robot.home[:3], R)
    for k in range(50):
        found = follow.update(0.01 * k, lengths + draw.normal(0, 1e-3, 8))
    wrong = lengths + np.array([0, 0, 0.05, 0, 0, 0, 0, 0])
    assert follow.update(0.5, wrong).left_out == (2,)
    wrong[5] = np.nan
    np.testing.assert_allclose(follow.update(0.51, wrong).pose, robot.home, atol=3e-3)
    ahead = follow.update(0.61)
    assert np.linalg.det(ahead.covariance) > np.linalg.det(found.covariance)
    there = robot.home[:3] + np.array([1.0, -0.5, 0.3])
    np.testing.assert_allclose(follow.update(0.7, lengths_at(robot, there, R)).pose[:3], there, atol=3e-3)
    follow.reset()
    np.testing.assert_allclose(follow.update(0.0, lengths).pose, robot.home, atol=1e-6)


def test_every_attitude_has_a_twist():
    """Turning through a pitch of 90 degrees, where roll and yaw have no rates."""
    robot, spin = load("cogiro"), np.array([0.1, 1.0, 0.2])
    follow = PoseFilter(robot)
    for k in range(200):
        turn = Rotation.from_rotvec(0.01 * k * spin).as_euler("xyz")
        found = follow.update(0.01 * k, pose=np.concatenate([robot.home[:3], turn]))
        assert np.isfinite(found.twist).all()
    np.testing.assert_allclose(found.twist[3:], spin, atol=0.02)


def test_poses_without_velocities_control_a_robot():
    robot = load("cogiro")
    motion = plan(robot, {"path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.2, 1.2]}, "duration": 1.0})
    noise = {"position": 1e-3, "attitude": 1e-3, "differenced": True}
    assert not simulate(robot, motion, ComputedTorque(robot), noise=noise).to_dict()["passed"]
    for sensors in ({}, {"rate": 200, "delay": 0.005, "stamped": True}):
        controller = Filtered(ComputedTorque(robot), PoseFilter(robot))
        assert simulate(robot, motion, controller, noise=noise | sensors).to_dict()["error_rms"] < 5e-3


@pytest.mark.parametrize(("jerk", "rate"), [(0.3, 100.0), (10.0, 400.0)])
def test_the_noise_of_estimates_is_known(jerk, rate):
    """At rest the errors are due to noise alone; the first quarter of the steps is not counted."""
    robot, draw, steps, sigma = load("cogiro"), np.random.default_rng(6), 1600, np.repeat([1e-3, 4e-4], 3)
    follow = PoseFilter(robot, {"position": 1e-3, "rotation": 4e-4}, (jerk, jerk / robot.length))
    found = [follow.update(k / rate, pose=robot.home + sigma * draw.normal(size=6)) for k in range(steps)]
    off = np.array([np.append(each.pose - robot.home, each.velocity) for each in found[steps // 4 :]])
    expected = follow.noise(rate)
    assert list(expected) == ["position", "attitude", "velocity", "attitude_rate"]
    np.testing.assert_allclose(
        np.sqrt(np.square(off).reshape(-1, 4, 3).mean(axis=(0, 2))), list(expected.values()), rtol=0.15
    )


class Alone:
    """A filter that does not show its robot, so that it is told the reference alone."""

    def __init__(self, follow):
        self.reset, self.update = follow.reset, follow.update


def test_a_filter_that_knows_what_the_tensions_do_may_be_slower_than_the_controller():
    """Its bandwidth is (0.3 / (1 mm sqrt(2 ms)))^(1/3), 19 rad/s; those of controller and observer add up to 20.

    The loop of a double integrator, an observer, and this filter with the reference alone is unstable below three times
    that (eigenvalues of its six states).
    """
    robot, errors = load("cogiro"), []
    noise = {"position": 1e-3, "attitude": 2e-4, "differenced": True}
    push = 0.05 * robot.weight * np.eye(6)[0]
    for shown in (lambda follow: follow, Alone):
        follow = shown(PoseFilter(robot, {"rotation": 2e-4}, jerk=(0.3, 0.3 / robot.length)))
        controller = Filtered(ComputedTorque(robot), follow)
        run = simulate(robot, robot.home, controller, noise=noise, duration=0.8, period=2e-3, disturbance=push)
        errors.append(run.error)
    assert errors[0].max() < 6e-3
    assert errors[0][-100:].max() < 1e-3
    assert errors[1].max() > 0.1


def rests(pose, time, pulls=None):
    """A state and a reference of cogiro at home."""
    robot, still = load("cogiro"), np.zeros((1, 6))
    middle = (robot.t_min + robot.t_max) / 4
    planned = Reference(robot.home, still[0], still[0], robot.carrier_home, still, still, middle)
    return State(pose, still[0], robot.carrier_home, still, pulls, time), planned


def test_a_late_first_pose_and_a_state_from_the_future_leave_a_controller_usable():
    robot = load("cogiro")
    late, known = Filtered(ComputedTorque(robot), PoseFilter(robot)), ComputedTorque(robot)
    state, planned = rests(robot.home, 0.99)
    np.testing.assert_allclose(
        late.step(1.0, state, planned).tensions, known.step(1.0, state, planned).tensions, atol=1e-6
    )
    for time in (5.0, np.nan):
        with pytest.raises(InputError, match=r"state.time must be a number up to the step's time"):
            late.step(1.01, *rests(robot.home, time))
    assert late.step(1.01, *rests(robot.home, 1.0)).answered == 0
    late.reset()
    answers = [late.step(k, *rests(pose, k)).answered for k, pose in enumerate((np.full(6, np.nan), robot.home))]
    assert answers == [ANSWERS.index("hold"), 0]  # it begins with the first pose that is measured


class Blind(ComputedTorque):
    """A controller that does not use measured tensions itself."""

    def step(self, time, state, reference):
        return super().step(time, state._replace(tensions=None), reference)


def test_without_a_value_of_a_force_sensor_the_commanded_tensions_count():
    robot, found = load("cogiro"), []
    for pulls in (None, np.append(np.full(7, 1000.0), np.nan)):
        controller = Filtered(Blind(robot), PoseFilter(robot))
        for k in range(20):
            pose = robot.home + 1e-3 * min(k, 10) * np.eye(6)[0]
            command = controller.step(0.01 * k, *rests(pose, 0.01 * k, pulls))
        found.append(command.tensions)
    np.testing.assert_array_equal(*found)


LENGTHS = np.full(8, 8.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda follow: follow.update(0.0), "lengths or pose must be given in full for the first update"),
        (lambda follow: follow.update(np.nan, LENGTHS), "time must be a number from"),
        (lambda follow: [follow.update(t, LENGTHS) for t in (1, 0)], r"time must not decrease until reset\(\), got"),
        (lambda follow: follow.update(0.0, np.ones(7)), r"lengths must have the shape \(8,\), got \(7,\)"),
        (lambda follow: follow.update(0.0, -LENGTHS), r"lengths must be numbers > 0 \[m\], or nan, got -8"),
        (lambda follow: follow.update(0.0, LENGTHS * np.inf), "lengths must be numbers up to .*, or nan, got inf"),
        (lambda follow: follow.update(0.0, pose=["a"] * 6), "pose must be"),
        (lambda follow: follow.update(0.0, LENGTHS, rate=[0, 0]), r"rate must be an array of shape \(3,\)"),
        (lambda follow: follow.update(0.0, LENGTHS, tensions=[np.nan] * 8), "tensions must be an array of shape"),
        (lambda follow: follow.update(0.0, LENGTHS, reference=1.0), "reference must be a pose, a velocity and"),
        (lambda follow: follow.update(0.0, LENGTHS, reference=[0, 0, 0]), "reference pose must be an array of shape"),
        (lambda follow: follow.update(0.0, LENGTHS, carrier_pose=[1]), "carrier_pose must be an array of shape"),
        (lambda follow: PoseFilter(follow.robot, 1e-3), "sigma must be a mapping of lengths, position"),
        (lambda follow: PoseFilter(follow.robot, {"length": 1}), "must have only the keys lengths, .*, got 'length'"),
        (lambda follow: PoseFilter(follow.robot, {"lengths": 0}), "sigma.lengths must be a number from 1e-09"),
        (lambda follow: PoseFilter(follow.robot, jerk=(-1, 1)), "jerk must be a number from 0"),
        (lambda follow: follow.noise(0.0), r"rate must be a number from 0.001"),
        (lambda follow: Filtered(None, follow), "controller must be"),
        (lambda follow: Filtered(ComputedTorque("planar-4"), follow), "robot, planar-4, got one for cogiro"),
        (lambda follow: Filtered(ComputedTorque("cogiro"), 1), "filter must be a PoseFilter, or have its methods"),
    ],
)
def test_wrong_input_is_one_line(call, message):
    with pytest.raises(InputError, match=message):
        call(PoseFilter("cogiro"))
