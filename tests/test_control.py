"""One step of control: the wrench of a wanted acceleration, tensions in every case, and what acts beside the cables."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.control import ANSWERS, ComputedTorque, OpenLoop, Predictive, Reference, State
from towline.control.lag import TensionLoop
from towline.control.settings import reach_of
from towline.core import control_move_on
from towline.models import Dynamics, Robot, load
from towline.models.record import record_of
from towline.plant import Plant
from towline.simulation import simulate
from towline.solvers import TensionProblem, solve
from towline.statics.distribution import tensions as distribute

from .soak.control_steps import random_steps

ROBOTS = ["cogiro", "wang-flying", "caroca-pulleys", "planar-4", "wang-ctmrts-6", "multi-quadrotor-4", "flycrane"]


def at_home(robot, rows=None):
    """Return a state and a reference at rest at home, for one robot or for a batch."""
    lead = () if rows is None else (rows,)
    pose, carriers = np.tile(robot.home, (*lead, 1)), np.tile(robot.carrier_home, (*lead, 1, 1))
    state = State(pose, np.zeros_like(pose), carriers, np.zeros_like(carriers))
    return state, Reference(robot.home, np.zeros(6), np.zeros(6), robot.carrier_home, *(0 * robot.carrier_home,) * 2)


def turning(angles):
    """Return P of angles (..., 3), with which rates in the body's axes are P dTheta, (..., 3, 3)."""
    zero, (sr, sp, _), (cr, cp, _) = 0 * angles[..., 0], *(np.moveaxis(f(angles), -1, 0) for f in (np.sin, np.cos))
    rows = [1 + zero, zero, -sp], [zero, cr, sr * cp], [zero, -sr, cr * cp]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def in_body(angles, rates, bends):
    """Return rate and angular acceleration in the body's axes: P dTheta, P ddTheta + dP dTheta (complex step)."""
    P, dP = turning(angles), turning(angles + 1e-30j * rates).imag / 1e-30
    return (P @ rates[..., None])[..., 0], (P @ bends[..., None] + dP @ rates[..., None])[..., 0]


@pytest.mark.parametrize("name", ROBOTS)
def test_the_problem_of_a_step_is_that_of_the_symbolic_dynamics(name):
    """The kernel goes by rotation vectors and the body's axes, `Dynamics` by Euler angles and CasADi."""
    robot, rng, rows = load(name), np.random.default_rng(5), 40
    dynamics, c = Dynamics(robot), len(robot.carriers)
    pose = robot.home + rng.normal(scale=0.2, size=(rows, 6)) * robot.dof_mask
    velocity = rng.normal(size=(rows, 6)) * robot.dof_mask
    carriers = robot.carrier_home + rng.normal(scale=0.1, size=(rows, c, 6))
    moving = rng.normal(size=(rows, c, 6))
    wanted, speed = rng.normal(size=(rows, 6)) * robot.dof_mask, rng.normal(size=(rows, 6)) * robot.dof_mask
    still = np.zeros((c, 6))
    controller = ComputedTorque(name, bandwidth=2.0, damping=0.7, observer=0.0, reach=(0.0, 0.0))
    controller.step(
        0.0, State(pose, velocity, carriers, moving), Reference(robot.home, speed, wanted, carriers, still, still)
    )
    off = Rotation.from_euler("ZYX", pose[:, :2:-1]).inv() * Rotation.from_euler("ZYX", robot.home[:2:-1])
    planned = [off.apply(part) for part in in_body(robot.home[3:], speed[:, 3:], wanted[:, 3:])]
    rate, bent = in_body(pose[:, 3:], velocity[:, 3:], 0 * velocity[:, 3:])
    alpha = planned[1] + 2 * 0.7 * 2.0 * (planned[0] - rate) + 4.0 * off.as_rotvec()
    acceleration = wanted + 2 * 0.7 * 2.0 * (speed - velocity) + 4.0 * (robot.home - pose)
    acceleration[:, 3:] = np.linalg.solve(turning(pose[:, 3:]), (alpha - bent)[..., None])[..., 0]
    w = (
        dynamics.required_wrench(pose, velocity, acceleration, carriers, moving, np.zeros((rows, c, 6)))
        * robot.dof_mask
    )
    A = dynamics.wrench_matrix(pose, carriers) * robot.dof_mask[:, None]
    np.testing.assert_allclose(controller._problems.A, A, atol=1e-12)
    np.testing.assert_allclose(controller._problems.w, w, rtol=1e-11, atol=1e-11 * np.abs(w).max())


def with_frame_turned(robot, angles):
    """Return a robot that differs in the axes of its platform's frame alone, and its attitude at home: (3,) [rad]."""
    data = robot.model_dump(mode="json", exclude_none=True)
    T = (Rotation.from_euler("ZYX", angles[::-1]).inv() * Rotation.from_euler("ZYX", robot.home[:2:-1])).as_matrix()
    inertia, platform = T @ robot.inertia @ T.T, data["platform"]
    platform |= {"inertia": [*np.diag(inertia), *inertia[np.triu_indices(3, 1)]], "com": T @ robot.platform.com}
    platform["home"] = [*robot.home[:3], *angles]
    platform.pop("shape", None)
    for cable, attachment in zip(data["cables"], robot.attachments, strict=True):
        cable["attachment"] = T @ attachment
    return Robot.model_validate(data), Rotation.from_matrix(T)


def frame_turned(pose, velocity, T):
    """Return pose and velocity of a frame that is turned by T in the platform's axes, (..., 6)."""
    turned = np.atleast_2d(pose).copy(), np.atleast_2d(velocity).copy()
    angles, rates = turned[0][:, 3:], turned[1][:, 3:]
    rate = T.apply(in_body(angles, rates, rates)[0])
    angles[:] = (Rotation.from_euler("ZYX", angles[:, ::-1]) * T.inv()).as_euler("ZYX")[:, ::-1]
    rates[:] = np.linalg.solve(turning(angles), rate[..., None])[..., 0]
    return tuple(part.reshape(np.shape(pose)) for part in turned)


@pytest.mark.parametrize("pitch", [0.5 * np.pi, -0.5 * np.pi, 1.56, 1.7])
def test_the_axes_of_the_platforms_frame_mean_nothing(pitch):
    """With late states too, near a pitch of 90 degrees and across it: the tensions are those of any other frame."""
    robot, rng = load("ipanema-2"), np.random.default_rng(3)
    turned, T = with_frame_turned(robot, np.array([0.3, pitch, -0.2]))
    one, other = ComputedTorque(robot, integral=30.0), ComputedTorque(turned, integral=30.0)
    (state, home), size = at_home(robot), np.repeat([0.05, 0.1], 3)
    for k in range(30):
        pose, velocity = robot.home + size * rng.normal(size=6), 3 * size * rng.normal(size=6)
        wanted, speed = robot.home + size * rng.normal(size=6), size * rng.normal(size=6)
        seen = 2e-3 * k - 0.01 * (k % 2)
        state = state._replace(pose=pose, velocity=velocity, time=seen)
        there = state._replace(**dict(zip(("pose", "velocity"), frame_turned(pose, velocity, T), strict=True)))
        expected = one.step(2e-3 * k, state, home._replace(pose=wanted, velocity=speed))
        pose, velocity = frame_turned(wanted, speed, T)
        # That its second derivatives are zero is something else in other angles.
        bends = in_body(wanted[3:], speed[3:], np.zeros(3))[1]
        bent = in_body(pose[3:], velocity[3:], np.zeros(3))[1]
        bend = np.append(np.zeros(3), np.linalg.solve(turning(pose[3:]), T.apply(bends) - bent))
        found = other.step(2e-3 * k, there, home._replace(pose=pose, velocity=velocity, acceleration=bend))
        np.testing.assert_allclose(found.tensions, expected.tensions, atol=1e-6 * robot.t_max.max())
        assert found.answered == expected.answered
    np.testing.assert_allclose(other.disturbance, one.disturbance, atol=1e-6 * robot.weight)


@pytest.mark.parametrize("pitch", [0.5 * np.pi, -0.5 * np.pi, 1.5707])
def test_a_robot_is_held_at_a_pitch_of_90_degrees_as_at_any_other(pitch):
    robot = load("ipanema-2")
    turned, _ = with_frame_turned(robot, np.array([0.3, pitch, -0.2]))
    push = 0.05 * robot.weight * np.repeat([1.0, robot.length], 3) * [1, -0.6, 0.8, 0.5, 0.4, -0.3]
    runs = [simulate(each, each.home, duration=0.4, period=2e-3, disturbance=push) for each in (robot, turned)]
    assert 1e-3 < runs[0].error.max() < 0.01
    np.testing.assert_allclose(runs[1].error, runs[0].error, atol=1e-7)
    assert runs[1].answered == runs[0].answered
    with pytest.raises(InputError, match=r"at home must be from -1.5 to 1.5 rad for predictive control, got -?1.57"):
        Predictive(turned)


def test_predictive_control_hands_over_before_a_pitch_of_90_degrees():
    turned, _ = with_frame_turned(load("ipanema-2"), np.array([0.0, 1.45, 0.0]))
    start, end = turned.home.tolist(), turned.home.tolist()
    end[4] += 0.2
    line = {"kind": "line", "start": start, "end": end}
    controller = Predictive(turned)
    run = simulate(turned, line, controller, duration=1.5, period=2e-3)
    assert run.passed, run.failures
    assert run.error.max() < 1e-3
    assert run.handed_over < run.times[[each.pose[4] < 1.5 for each in run.references].index(False)]
    assert "pitches beyond 1.5 rad" in controller.handed_over.reason


@pytest.mark.parametrize("name", ["cogiro", "ipanema-2", "wang-flying"])
def test_a_step_gives_the_tensions_of_the_distribution(name):
    robot = load(name)
    state, reference = at_home(robot)
    t_ref = robot.t_min + 0.1 * (robot.t_max - robot.t_min)
    command = ComputedTorque(name).step(0.0, state, reference._replace(tensions=t_ref))
    assert ANSWERS[command.answered] == "as planned"
    expected = distribute(name, robot.home, t_ref=t_ref).tensions
    np.testing.assert_allclose(command.tensions, expected, atol=1e-9 * robot.t_max.max())


@pytest.mark.parametrize("name", ROBOTS)
def test_every_state_is_answered_inside_limits_and_rates(name):
    """Far off, infeasible, singular, with numbers that are none: a command, and how it was answered."""
    robot, rng, rows, steps = load(name), np.random.default_rng(11), 200, 25
    low, high = robot.t_min, robot.t_max
    rate = 0.3 * (high - low) / 1e-3
    controller, last = ComputedTorque(name, rate=rate / 10), None
    state, reference = at_home(robot, rows)
    answers = set()
    for k in range(steps):
        scale = 10.0 ** rng.uniform(-3, 2, (rows, 1))
        pose = state.pose + scale * rng.normal(size=(rows, 6)) * robot.dof_mask
        velocity = scale * rng.normal(size=(rows, 6))
        carriers = state.carrier_pose + scale[:, None] * rng.normal(size=state.carrier_pose.shape)
        pose[rng.random(rows) < 0.03, rng.integers(6)] = rng.choice([np.nan, np.inf, -np.inf])
        pose[rng.random(rows) < 0.03, :3] = robot.anchors[0]
        command = controller.step(1e-3 * k, State(pose, velocity, carriers, state.carrier_velocity), reference)
        assert np.isfinite(command.tensions).all()
        assert ((command.tensions >= low) & (command.tensions <= high)).all()
        if last is not None:
            assert (np.abs(command.tensions - last) <= rate / 10 * 1e-3 * (1 + 1e-9)).all()
        last = command.tensions
        assert np.isfinite(command.carrier_pose).all()
        assert command.actuation is None or np.isfinite(command.actuation).all()
        answers |= {ANSWERS[answer] for answer in command.answered}
        proven = np.isfinite(command.direction).all(axis=1)
        along = np.einsum("nj,nji->ni", command.direction[proven], controller._problems.A[proven])
        bounds = controller._problems.bounds[:, proven]
        most = np.where(along > 0, along * bounds[1], along * bounds[0]).sum(axis=1)
        gap = np.einsum("nj,nj->n", command.direction[proven], controller._problems.w[proven]) - most
        assert (gap > 0).all(), "a direction along which every tension inside the bounds misses the wrench"
    assert {"soft wrench", "hold"} <= answers


@pytest.mark.parametrize("name", ["cogiro", "ipanema-1", "planar-4"])
def test_a_step_is_as_planned_if_its_tensions_give_the_wrench_and_says_how_much_they_miss(name):
    """Above the anchors and far off, where much is missing, by bounded least squares of SciPy.

    The first direction that proves it may be one along which nearly nothing is missing, even of half the weight.
    """
    robot, rng, rows = load(name), np.random.default_rng(3), 60
    state, reference = at_home(robot, rows)
    heights = np.append(rng.uniform(0, 1.6, rows - 1), 1e4) * (robot.anchors[:, 2].max() - robot.home[2])
    turns = np.pad(rng.uniform(-0.1, 0.1, (rows, 3)), ((0, 0), (3, 0)))
    pose = state.pose + robot.dof_mask * (turns + heights[:, None] * np.eye(6)[2])
    controller = ComputedTorque(robot)
    command = controller.step(0.0, state._replace(pose=pose), reference._replace(pose=pose))
    scale, problems, wanted = robot.wrench_scale, controller._problems, command.answered == ANSWERS.index("as planned")
    for row in range(rows):
        A, w = scale[:, None] * problems.A[row], scale * problems.w[row]
        missing = np.sqrt(2 * lsq_linear(A, w, (robot.t_min, robot.t_max), method="bvls", tol=1e-14).cost)
        assert wanted[row] == (missing <= 1e-3 * robot.weight), missing
        if not wanted[row]:
            assert command.shortfall[row] == pytest.approx(missing, rel=1e-3)
    assert 5 < wanted.sum() < rows - 5


def test_a_row_of_a_batch_is_answered_as_it_is_alone():
    robot, rng = load("wang-flying"), np.random.default_rng(2)
    state, reference = at_home(robot, 5)
    together, alone = ComputedTorque(robot, rate=500), ComputedTorque(robot, rate=500)
    for k in range(20):
        pose = state.pose + rng.normal(scale=0.02, size=(5, 6))
        moved = state._replace(pose=pose)
        batch = together.step(1e-3 * k, moved, reference)
        single = alone.step(1e-3 * k, State(*(part[3] for part in moved[:4])), reference)
        np.testing.assert_array_equal(batch.tensions[3], single.tensions)
        assert batch.answered[3] == single.answered


def test_a_state_of_earlier_is_moved_on_as_the_plant_moves():
    """Over 20 ms in which tensions jump, a carrier accelerates, and a push is known: 1 mm off as it was, 1 um moved."""
    robot, age = load("wang-flying"), 0.02
    plant, rng = Plant(robot, drive="tensions"), np.random.default_rng(4)
    at_rest = distribute(robot, robot.home).tensions
    push, bend = np.array([1.0, -2, 0.5, 0.1, 0.05, -0.1]), np.array([[3.0, -2, 1, 0, 0, 0]])
    velocity = np.array([0.5, -0.3, 0.1, 0.2, -0.1, 0.3])
    state = plant.start(robot.home, velocity, robot.carrier_home, 0 * bend, tensions=at_rest)
    commanded = at_rest * rng.uniform(0.5, 2.0, (2, 6))
    for k, pulls in enumerate(commanded):
        late = 0.01 * k
        moved = robot.carrier_home + late**2 / 2 * bend, late * bend, bend
        state = plant.run(state, plant.command(pulls, None, *moved, wrench=push)[None], 0.01).states[-1]
    now = plant.read(state)
    measured = np.zeros((1, 2, 12))
    measured[0, 0], measured[0, 1, :6] = np.append(robot.home, velocity), robot.carrier_home
    was = measured.copy()
    parts = np.repeat(commanded, 10, axis=0)[:, None]
    control_move_on(age / 20, record_of(robot), push[None], parts, None, bend[None], measured)
    exact = np.concatenate([[np.append(now.pose, now.velocity)], np.hstack([now.carrier_pose, now.carrier_velocity])])
    np.testing.assert_allclose(measured[0, :, :6], exact[:, :6], atol=1e-6)
    np.testing.assert_allclose(measured[0, :, 6:], exact[:, 6:], atol=1e-3)
    assert np.abs(was[0, :, :3] - exact[:, :3]).max() > 1e-3


@pytest.mark.parametrize("law", [ComputedTorque, Predictive])
def test_observers_are_stable_beyond_the_age_at_which_predicted_states_would_upset_them(law):
    """A push that is there at once, and states 40 ms old: K x age is 2.4 with the gains of `Predictive`."""
    robot, period = load("cogiro"), 1e-3

    class Late(law):
        def reset(self):
            super().reset()
            self.states = []

        def step(self, time, state, reference):
            self.states.append(state._replace(time=time))
            return super().step(time, self.states[max(len(self.states) - 41, 0)], reference)

    push = np.array([0.02 * robot.weight, 0, 0, 0, 0, 0])
    flight = simulate(robot, robot.home, Late(robot), duration=0.9, period=period, disturbance=push)
    assert flight.error[-100:].max() < 1e-4 < flight.error.max()
    assert flight.answered["as planned"] == 900


def test_times_of_states():
    robot = load("cogiro")
    state, reference = at_home(robot)
    off = state._replace(pose=robot.home + 1e-3)
    now, stamped = ComputedTorque(robot), ComputedTorque(robot)
    for k in range(3):
        one, other = now.step(1e-3 * k, off, reference), stamped.step(1e-3 * k, off._replace(time=1e-3 * k), reference)
        np.testing.assert_array_equal(one.tensions, other.tensions)
    with pytest.raises(InputError, match=r"state.time must be a number up to the step's time, 0.003 s, got 1"):
        now.step(3e-3, state._replace(time=1.0), reference)
    dead = stamped.step(0.5, off._replace(time=2e-3), reference)
    assert ANSWERS[dead.answered] == "hold"
    np.testing.assert_array_equal(dead.tensions, np.clip(np.zeros(robot.m), robot.t_min, robot.t_max))


def test_an_error_decays_as_the_bandwidth_says():
    """A critically damped error: e(t) = e_0 (1 + w t) exp(-w t)."""
    robot = load("cogiro")
    pose = robot.home + np.array([0.0, 0.0, 0.01, 0, 0, 0])

    class Step:
        natural_duration, frame = 1.0, "world"

        def at(self, times, duration):
            poses = np.tile(robot.home, (len(times), 1))
            poses[times == 0] = pose
            return poses, np.zeros_like(poses), np.zeros_like(poses)

    flight = simulate(robot, Step(), ComputedTorque(robot, bandwidth=8.0, observer=0.0), period=2e-4)
    away = flight.record.motions[:, 0, 2] - robot.home[2]
    times = flight.times
    np.testing.assert_allclose(away[1:], (0.01 * (1 + 8 * times) * np.exp(-8 * times))[1:], atol=2e-5)


def test_the_observer_finds_a_force_and_a_moment_that_nobody_reports():
    robot, push = load("ipanema-1"), np.array([30.0, -20, 10, 1, -2, 0.5])
    pose = robot.home.copy()
    controller = ComputedTorque(robot, observer=20.0)
    flight = simulate(robot, pose, controller, duration=1.0, disturbance=push)
    np.testing.assert_allclose(controller.disturbance[0], push, atol=1e-3)
    without = simulate(robot, pose, ComputedTorque(robot, observer=0.0), duration=1.0, disturbance=push)
    # Without it the stiffness Kp m holds the force at the distance F / (m w^2).
    expected = np.linalg.norm(push[:3]) / (robot.platform.mass * 10.0**2)
    assert without.error[-1] == pytest.approx(expected, rel=0.05)
    assert flight.error[-1] < 1e-3 * without.error[-1] + 1e-6


def test_a_cable_that_was_slack_for_long_counts_again_once_it_pulls():
    """Its sensor reports nothing for 0.2 s, and then what it is commanded."""
    robot = load("caroca")
    state, reference = at_home(robot)
    controller, last = ComputedTorque(robot), distribute(robot, robot.home).tensions
    cut = []
    for k in range(600):
        report = last.copy()
        report[0] = 0.0 if 100 <= k < 300 else report[0]
        last = controller.step(1e-3 * k, state._replace(tensions=report), reference).tensions
        assert (last >= robot.t_min).all()
        cut.append(controller.cut[0])
    cut = np.array(cut)
    assert not cut[:, 1:].any()
    assert not cut[:140, 0].any()
    assert cut[160:300, 0].all()
    assert not cut[350:, 0].any()


@pytest.mark.parametrize(("options", "largest"), [({}, 5e-3), ({"tension_loop": 20.0}, 3e-3)])
def test_winches_that_give_nine_tenths_leave_no_offset(options, largest):
    """Their sensors report it. An observer that takes reports as they are leaves 0.1 g / w^2: 10 mm for ever."""
    robot = load("cogiro")
    plant, controller = Plant(robot, drive="tensions"), ComputedTorque(robot, **options)
    (_, reference), pulls = at_home(robot), distribute(robot, robot.home).tensions
    state, off = plant.start(tensions=pulls), np.zeros(1500)
    for k in range(len(off)):
        now = plant.read(state)
        off[k] = np.linalg.norm(now.pose[:3] - robot.home[:3])
        measured = State(now.pose, now.velocity, now.carrier_pose, now.carrier_velocity, pulls)
        command = controller.step(1e-3 * k, measured, reference)
        assert ((command.tensions >= robot.t_min) & (command.tensions <= robot.t_max)).all()
        pulls = 0.9 * command.tensions
        state = plant.step(state, plant.command(pulls), 1e-3)
    assert off[-1] < 1e-4
    assert off.max() < largest


def test_the_tension_loop_stands_still_at_limits_and_for_cables_that_are_cut():
    low, high, none = np.array([1.0, 1.0]), np.array([20.0, 10.5]), np.array([[False, False]])
    loop = TensionLoop(20.0, 0.005, low, high, np.full(2, np.inf))
    wanted, pulls = np.array([[10.0, 10.0]]), np.array([[10.0, 10.0]])
    for _ in range(1000):
        pulls = 0.9 * loop.sent(1e-3, wanted, wanted, pulls, none)
    np.testing.assert_allclose(pulls, [[10.0, 0.9 * 10.5]], rtol=1e-6)
    lower = loop.sent(1e-3, wanted - 5.0, wanted, pulls, none)  # nothing has wound up beyond the limit
    assert lower[0, 1] == pytest.approx(5.5, abs=0.02)  # one step on
    np.testing.assert_array_equal(loop.sent(1e-3, wanted, wanted - 5.0, pulls, np.array([[True, False]]))[0, 0], 10.0)
    np.testing.assert_array_equal(loop.sent(1e-3, wanted, wanted, np.full((1, 2), np.nan), none)[0, 0], 10.0)


@pytest.mark.parametrize("name", ["multi-quadrotor-3", "multi-quadrotor-4", "wang-ctmrts"])
def test_fewer_cables_than_coordinates_give_what_they_can(name):
    """A calm motion is as planned while it is near; a push of half the weight takes more than carriers can bring."""
    robot = load(name)
    end = (robot.home[:3] + np.array([0.2, 0.1, 0.1])).tolist()
    line = {"kind": "line", "start": robot.home[:3].tolist(), "end": end}
    calm = simulate(robot, line, ComputedTorque(robot), duration=2.0, period=4e-3)
    status = np.where(calm.error > calm.tolerance, "off the reference", "as planned")
    assert [ANSWERS[each] for each in calm.record.answered] == status.tolist()
    push = 0.5 * robot.weight * np.array([1, 0.4, 0, 0, 0, 0])
    pushed = simulate(robot, robot.home, ComputedTorque(robot), duration=1.5, period=4e-3, disturbance=push)
    assert pushed.error.max() > 0.2
    assert pushed.answered["soft wrench"] > 125


def test_carriers_react_to_what_the_plan_does_not_know_alone():
    """A platform in the wind of its plan, whose tensions carry the drag, under a base that might move and need not."""
    robot, wind = load("wang-flying"), np.array([4.0, -2.0, 0.0])
    dynamics, still = Dynamics(robot), np.zeros((2, 1, 6))
    rest = (robot.home, *np.zeros((2, 6)), robot.carrier_home, *still)
    A, w = dynamics.wrench_matrix(robot.home, robot.carrier_home), dynamics.required_wrench(*rest, wind=wind)
    planned = solve(TensionProblem(A, w, robot.t_min, robot.t_max)).tensions

    class Planned(ComputedTorque):
        """Fly with the tensions of the plan, which knows the wind."""

        batches = False

        def step(self, time, state, reference):
            return super().step(time, state, reference._replace(tensions=planned))

    moved = []
    for controller in (Planned(robot, reach=(0.5, 0.0)), ComputedTorque(robot, reach=(0.5, 0.0))):
        flight = simulate(robot, robot.home, controller, wind=wind, duration=3.0)
        moved.append(np.linalg.norm(flight.record.motions[-1, 1, :3] - robot.carrier_home[0, :3]))
    assert moved[0] < 0.01 * moved[1]
    assert moved[1] > 0.05


@pytest.mark.parametrize("gains", [{}, {"bandwidth": 20.0, "observer": 20.0}, {"bandwidth": 40.0, "observer": 60.0}])
@pytest.mark.parametrize("damping", [20.0, 300.0])  # 1.5 times that of the file
def test_quadrotors_that_take_over_a_disturbance_do_not_swing(gains, damping):
    """Cables damp what quadrotors do when they turn, and the observer takes these tensions for a disturbance."""
    data = load("wang-flying-quadrotor").model_dump()
    data["cables"] = [{**cable, "damping": damping} for cable in data["cables"]]
    robot = Robot.model_validate(data)
    controller = ComputedTorque(robot, reach=(0.5, 0.0), **gains)
    still = simulate(robot, robot.home, controller, duration=1.0)
    assert still.error.max() < 1e-8  # rounding errors do not grow
    pushed = simulate(robot, robot.home, controller, duration=1.5, disturbance=(0.4, 0.3, 0.2, 0, 0, 0))
    assert pushed.passed
    assert pushed.error[-100:].max() < 1e-4
    assert np.linalg.norm(pushed.record.motions[-1, 1, :3] - robot.carrier_home[0, :3]) > 0.01


def test_robot_ends_stay_inside_their_boxes():
    """A side force that the reaction answers with more than the boxes permit."""
    robot = load("wang-ctmrts")
    push = np.array([0.3 * robot.platform.mass * 9.81, 0, 0, 0, 0, 0])
    flight = simulate(
        robot, robot.home, ComputedTorque(robot, reach=(2.0, 0.0)), duration=4.0, period=4e-3, disturbance=push
    )
    places = flight.trajectory["carrier_command"].values[..., :3]
    boxes = [carrier.motion_limits.reach for carrier in robot.carriers]
    for index, box in enumerate(boxes):
        assert (places[:, index] >= box.min).all()
        assert (places[:, index] <= box.max).all()


def test_an_integral_brings_a_platform_back_that_a_force_has_moved():
    robot, push = load("cogiro"), np.array([30.0, 0, 0, 0, 0, 0])
    laws = (ComputedTorque(robot, bandwidth=5.0, observer=0.0, integral=integral) for integral in (0.0, 30.0))
    errors = [simulate(robot, robot.home, law, duration=6.0, period=4e-3, disturbance=push).error for law in laws]
    offset = push[0] / robot.platform.mass / 5.0**2
    assert errors[0][-1] == pytest.approx(offset, rel=0.05)
    assert errors[1][-1] < 0.05 * offset


def test_whole_turns_of_a_reference_change_nothing():
    robot = load("cogiro")
    state, reference = at_home(robot)
    turned = reference._replace(pose=robot.home + 2 * np.pi * np.array([0, 0, 0, 1, -2, 1]))
    commands = [ComputedTorque(robot).step(0.0, state, each).tensions for each in (reference, turned)]
    np.testing.assert_allclose(commands[0], commands[1], atol=1e-6)


@pytest.mark.parametrize("name", ["wang-flying", "wang-ctmrts-6", "flycrane"])
def test_carriers_react_with_the_least_effort_that_gives_the_missing_wrench(name):
    """By differences of the symbolic wrench matrix, away from home, where the plan's tensions miss a little."""
    robot, rng = load(name), np.random.default_rng(3)
    dynamics, count, reach = Dynamics(robot), len(robot.carriers), np.array([0.3, 0.3, 0.3, 0.2, 0.2, 0.2])
    pose = robot.home + robot.dof_mask * rng.normal(scale=0.05, size=6)
    carriers = robot.carrier_home + rng.normal(scale=0.02, size=(count, 6)) * [1, 1, 1, 0, 0, 0]
    controller = ComputedTorque(robot, reach=(0.3, 0.2), observer=0.0, carrier_bandwidth=(bandwidth := 2.0))
    required, rest = dynamics.required_wrench(pose, *np.zeros((2, 6))), np.zeros((2, count, 6))
    t = rng.uniform(0.9, 1.1, robot.m) * np.linalg.pinv(dynamics.wrench_matrix(pose, carriers)) @ required
    t = np.abs(t) + 0.02 * robot.force_scale
    state = State(pose, np.zeros(6), carriers, rest[0])
    reference = Reference(pose, np.zeros(6), np.zeros(6), carriers, *rest, tensions=t)
    for k in range(2):
        command = controller.step(0.01 * k, state, reference)
    scale = np.repeat([1.0, 1 / max(np.abs(robot.home_anchors).max(), np.abs(robot.home_attachments).max(), 1)], 3)
    A, G = scale[:, None] * dynamics.wrench_matrix(pose, carriers), np.zeros((6, count, 6))
    free = np.array([[k in carrier.free_coordinates(robot.drive) and (k < 3 or not carrier.efforts) for k in range(6)]
                     for carrier in robot.carriers])  # fmt: skip
    for c, k in np.argwhere(free):
        step = np.zeros((count, 6))
        step[c, k] = 1e-5
        both = [scale * (dynamics.wrench_matrix(pose, carriers + side * step) @ t) for side in (1, -1)]
        G[:, c, k] = reach[k] * (both[0] - both[1]) / 2e-5
    missing = scale * robot.dof_mask * (required - dynamics.wrench_matrix(pose, carriers) @ t)
    G = G.reshape(6, -1)
    gram = (0.05 * robot.force_scale) ** 2 * A @ A.T + G @ G.T
    effort = (G.T @ np.linalg.solve(gram + 1e-4 * gram.diagonal().max() * np.eye(6), missing)).reshape(count, 6)
    expected = bandwidth**2 * reach * np.clip(effort, -1, 1)
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(command.carrier_acceleration, expected, atol=1e-5 * np.abs(expected).max() + 1e-9)


def test_a_base_that_may_react_gives_back_what_a_side_force_takes_of_the_tensions():
    """It goes where the cables carry weight and force with nearly the tensions that carried the weight."""
    robot, push = load("wang-flying"), np.array([0.6, 0.3, 0.0, 0.0, 0.0, 0.0])
    planned = distribute(robot, robot.home).tensions
    changes = []
    for reach in ((0.0, 0.0), (0.5, 0.3)):
        controller = ComputedTorque(robot, reach=reach)
        flight = simulate(robot, robot.home, controller, duration=5.0, disturbance=push)
        assert flight.error[-1] < 1e-4
        changes.append(np.abs(flight.record.tensions[-1] - planned).max())
    assert changes[1] < 0.2 * changes[0]
    dynamics, motion = Dynamics(robot), flight.record.motions[-1]
    w = dynamics.required_wrench(robot.home, *np.zeros((2, 6)), motion[1:, :6], *np.zeros((2, 1, 6))) - push
    A = dynamics.wrench_matrix(motion[0, :6], motion[1:, :6])
    np.testing.assert_allclose(A @ flight.record.tensions[-1], w, atol=2e-3)


def test_a_team_hovers_with_the_thrust_that_statics_requires():
    """At rest each thrust is the weight of its quadrotor and the pull of its cable, as vectors."""
    robot = load("multi-quadrotor-3")
    solution = distribute(robot, robot.home)
    state, reference = at_home(robot)
    command = ComputedTorque(robot).step(0.0, state, reference._replace(tensions=solution.tensions))
    directions = robot.home_anchors - robot.home_attachments
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for index, carrier in enumerate(robot.carriers):
        (cable,) = np.flatnonzero(robot.carrier_of_cable == index)
        force = -carrier.body.mass * np.array(robot.gravity) + command.tensions[cable] * directions[cable]
        axis = Rotation.from_euler("xyz", robot.carrier_home[index, 3:]).as_matrix()[:, 2]
        assert command.actuation[index, 0] == pytest.approx(force @ axis, rel=1e-9)


@pytest.mark.parametrize("name", ["wang-flying", "wang-ctmrts", "cogiro"])
@pytest.mark.parametrize("part", ["carrier_pose", "carrier_velocity", "carrier_acceleration"])
def test_carriers_without_a_reference_go_on_as_measured_and_the_step_says_hold(name, part):
    """`nan` was commanded to the carrier, and the step was "as planned"."""
    robot = load(name)
    state, reference = at_home(robot)
    state.carrier_velocity[0, 0] = 0.3
    lost = getattr(reference, part).copy()
    lost[0, 1] = np.nan
    for controller in (ComputedTorque(robot), Predictive(robot, stages=3)):
        controller.step(0.0, state, reference)
        command = controller.step(1e-3, state, reference._replace(**{part: lost}))
        assert ANSWERS[command.answered] == "hold"
        assert all(np.isfinite(given).all() for given in command[:4])
        if robot.m >= len(robot.platform.dof):  # other carriers help the tensions
            np.testing.assert_array_equal(command.carrier_pose, state.carrier_pose)
            np.testing.assert_array_equal(command.carrier_velocity, state.carrier_velocity)
    assert ANSWERS[OpenLoop(robot).step(0.0, state, reference._replace(**{part: lost})).answered] == "hold"


def test_a_row_that_lacks_thrust_says_so_beside_one_without_a_state():
    """A quadrotor that falls at 8 m/s beyond its load needs 2 x 5 x 8 m/s^2 more; its cable is at no limit."""
    robot = load("multi-quadrotor-3")
    state, reference = at_home(robot, 2)
    state.carrier_pose[0, 1, 2] = np.nan
    state.carrier_velocity[1, 0, 2] = -8.0
    reference = reference._replace(tensions=distribute(robot, robot.home).tensions)
    hover = ComputedTorque(robot).step(0.0, at_home(robot)[0], reference).actuation[0, 0]
    command = ComputedTorque(robot).step(0.0, state, reference)
    assert [ANSWERS[which] for which in command.answered] == ["hold", "soft wrench"]
    body, most = robot.carriers[0].body, robot.carriers[0].actuators[0].high
    assert command.actuation[1, 0, 0] == most
    upwards = Rotation.from_euler("xyz", robot.carrier_home[0, 3:]).as_matrix()[2, 2]
    assert command.shortfall[1] == pytest.approx(hover + body.mass * 2 * 5.0 * 8.0 * upwards - most)


def test_a_quadrotor_that_is_heavier_than_in_its_file_stays_at_its_place():
    """Its estimate of the force that nothing explains is the weight that is missing; without it, it hangs lower."""
    robot = load("multi-quadrotor-3")
    first, *others = robot.carriers
    lighter = robot.model_copy(update={"carriers": (first.model_copy(update={"mass": first.mass / 1.3}), *others)})
    controller, blind = ComputedTorque(lighter), ComputedTorque(lighter, observer=0)
    flight, low = (simulate(robot, robot.home, each, duration=3.0, period=2e-3) for each in (controller, blind))
    assert flight.error[-1] < 1e-2
    assert low.error[-1] > 3 * flight.error[-1]
    controller.reset()
    weight = (first.mass - first.mass / 1.3) * robot.gravity[2]
    motions = flight.record.motions
    for k in range(1500):
        tensions = flight.record.tensions[max(k - 1, 0)]
        state = State(motions[k, 0, :6], motions[k, 0, 6:], motions[k, 1:, :6], motions[k, 1:, 6:], tensions)
        controller.step(2e-3 * k, state, flight.conditions.references[k])
    np.testing.assert_allclose(controller.disturbance_of_carriers[0, 0], [0, 0, weight], atol=0.5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"bandwidth": -1}, "bandwidth"),
        ({"bandwidth": [1, 2]}, "bandwidth"),
        ({"bandwidth": [2, 2, 2, 2, 2, -1]}, "bandwidth"),
        ({"damping": np.nan}, "damping"),
        ({"integral": "much"}, "integral"),
        ({"observer": np.inf}, "observer"),
        ({"rate": [1, 2]}, "rate"),
        ({"reach": 3}, "reach"),
        ({"reach": (0.1, 4)}, "reach"),
        ({"robot": "no-such-robot"}, "no-such-robot"),
    ],
)
def test_wrong_gains_are_refused_in_one_line(arguments, message):
    with pytest.raises(InputError, match=message) as error:
        ComputedTorque(**{"robot": "cogiro"} | arguments)
    assert "\n" not in str(error.value)


def test_wrong_steps_are_refused_in_one_line():
    robot = load("cogiro")
    controller, (state, reference) = ComputedTorque(robot), at_home(robot)
    controller.step(0.0, state, reference)
    with pytest.raises(InputError, match="time must increase"):
        controller.step(0.0, state, reference)
    with pytest.raises(InputError, match=r"state.velocity must be of shape \(..., 6\), got shape \(3,\)"):
        controller.step(1.0, state._replace(velocity=np.zeros(3)), reference)
    with pytest.raises(InputError, match=r"reference.tensions must be of shape"):
        controller.step(1.0, state, reference._replace(tensions=np.zeros(5)))


def test_what_three_cables_cannot_control_their_robots_can_and_nothing_else():
    """Without motion of the robots all wrenches at right angles to the three cables; with it none is left."""
    robot = load("wang-ctmrts")
    fixed = ComputedTorque(robot, reach=(0.0, 0.0)).uncontrolled
    A = Dynamics(robot).wrench_matrix(robot.home, robot.carrier_home) / np.repeat([1.0, robot.length], 3)[:, None]
    assert fixed.shape == (3, 6)
    np.testing.assert_allclose(fixed @ A, 0, atol=1e-6)
    assert ComputedTorque(robot).uncontrolled.shape == (0, 6)
    assert ComputedTorque("cogiro").uncontrolled.shape == (0, 6)


def test_open_loop_orders_the_plan_and_drifts_where_computed_torque_stays():
    """An unstable pose: the platform hangs below a base that gusts do not move, and nobody answers a push."""
    robot, push = load("wang-flying"), np.array([0.2, 0, 0, 0, 0, 0])
    adrift = simulate(robot, robot.home, OpenLoop(robot), duration=0.5, disturbance=push)
    stays = simulate(robot, robot.home, duration=0.5, disturbance=push)
    assert (adrift.record.commanded == adrift.record.commanded[0]).all()
    first = adrift.error[100]  # while the cables' directions are nearly what they were: a free mass
    assert first == pytest.approx(0.5 * 0.2 / robot.platform.mass * 0.1**2, rel=0.1)
    assert adrift.error[-1] > 10 * stays.error[-1]
    with pytest.raises(InputError, match="quad1"):
        OpenLoop("multi-quadrotor-3")


@pytest.mark.parametrize("name", ["ipanema-2", "wang-flying-quadrotor", "wang-ctmrts-4"])
def test_random_steps_of_closed_loops_keep_every_promise(name):
    """With kicks, jumps, pauses and sensors that report nonsense, as the benchmark does a million times."""
    steps = random_steps(load(name), 3000, 5)
    assert not steps.faults
    assert steps.answered.sum() == 3000
    assert steps.proofs > 1000
    assert steps.answered[ANSWERS.index("hold")] > 300


def test_only_what_is_free_may_deviate():
    """The attitude of a quadrotor follows from its thrust, whatever its reach."""
    flying, mobile = (reach_of(load(name), (0.5, 0.3)) for name in ("multi-quadrotor-4", "wang-ctmrts"))
    np.testing.assert_array_equal(flying, np.tile([0.5, 0.5, 0.5, 0, 0, 0], (4, 1)))
    assert (mobile[:, :3] == 0.5).any(axis=1).all()
    with pytest.raises(InputError, match="reach must be a distance"):
        reach_of(load("cogiro"), (0.5, 1.5))


@pytest.mark.parametrize("roll", [0.3, -1.0, 1.5, 1.6, -1.6, 1.9, 3.0])
def test_a_quadrotor_turns_its_thrust_back_the_short_way(roll):
    """Its home has the thrust that it needs; beyond a right angle to that it turns as hard as at one."""
    robot, attitude = load("multi-quadrotor-3"), 5.0
    controller = ComputedTorque(robot, attitude=attitude)
    state, reference = at_home(robot)
    carriers = state.carrier_pose.copy()
    carriers[:, 3:] = roll, 0.0, 0.0
    command = controller.step(0.0, State(state.pose, state.velocity, carriers, state.carrier_velocity), reference)
    for carrier, pose, torque in zip(robot.carriers, robot.carrier_home, command.actuation[:, 1:], strict=True):
        needed = Rotation.from_euler("ZYX", pose[:2:-1]).as_matrix()[:, 2]
        has = Rotation.from_euler("ZYX", [0, 0, roll]).as_matrix()
        axis = np.cross(has[:, 2], needed)
        axis /= np.linalg.norm(axis) if has[:, 2] @ needed < 0 else 1.0
        expected = attitude**2 * np.diag(carrier.inertia[:3]) @ has.T @ axis
        np.testing.assert_allclose(torque[:2], expected[:2], atol=1e-6)
