"""Predictive control: its model beside the symbolic dynamics, what it gains, and that it always answers."""

import copy
import pickle

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from towline import plan
from towline.base.errors import InputError
from towline.control import ANSWERS, ComputedTorque, Controller, Predictive, Reference, State
from towline.control.carrier_references import Freed
from towline.control.keep_out import Surroundings, _distance
from towline.control.records import TETHER
from towline.control.weights import Weights, terminal, weights
from towline.core import control_carriers, control_coordinates, control_stages
from towline.models import Dynamics, Robot, load
from towline.models.points import placed
from towline.models.record import record_of
from towline.simulation import simulate
from towline.solvers.horizon import Horizon, Residuals

pytestmark = pytest.mark.usefixtures("stable_at_home")
LAWS = Predictive, ComputedTorque
PERIOD = 2e-3  # [s]: twice the default, which halves the processor time


def rest(robot):
    state = State(robot.home, np.zeros(6), robot.carrier_home, 0 * robot.carrier_home)
    return state, Reference(robot.home, np.zeros(6), np.zeros(6), robot.carrier_home, *(0 * robot.carrier_home,) * 2)


@pytest.mark.parametrize("name", ["wang-flying", "caroca-pulleys", "planar-4", "wang-ctmrts-4"])
def test_stages_are_the_symbolic_dynamics_to_first_order(name):
    """Accelerations by CasADi, from the wrench of the tensions; derivatives by central differences of these."""
    robot, rng, count, dt = load(name), np.random.default_rng(1), 4, 0.02
    dynamics, m, c = Dynamics(robot), robot.m, len(robot.carriers)
    free = robot.dof_mask.astype(bool)
    freed, n = np.array([(0, 0), (0, 1), (0, 2)]), 18
    A, B, offset = np.zeros((count, n, n)), np.zeros((count, n, m + 3)), np.zeros((count, n))
    carriers = np.zeros((count + 1, c, 12))
    carriers[:, :, :6] = robot.carrier_home
    states, controls = np.zeros((count + 1, n)), rng.uniform(1, 50, size=(count, m + 3))
    states[:, :6] = robot.home + 0.05 * rng.normal(size=(count + 1, 6)) * robot.dof_mask
    states[:, 6:12] = 0.3 * rng.normal(size=(count + 1, 6)) * robot.dof_mask
    states[:, 12:15] = robot.carrier_home[0, :3] + 0.02 * rng.normal(size=(count + 1, 3))
    disturbance = rng.normal(size=6)
    given = (freed, np.zeros(0, TETHER), np.full(count, dt), disturbance, carriers, states, controls)
    control_stages(record_of(robot), *given, A, B, offset)

    def move(x, u):
        places = robot.carrier_home.copy()
        places[0, :3] = x[12:15]
        still = dynamics.required_wrench(x[:6], x[6:12], np.zeros(6))
        H = np.stack([dynamics.required_wrench(x[:6], x[6:12], unit) - still for unit in np.eye(6)], axis=1)
        right, a = dynamics.wrench_matrix(x[:6], places) @ u[:m] + disturbance - still, np.zeros(6)
        a[free] = np.linalg.solve(H[np.ix_(free, free)], right[free])
        y = x.copy()
        y[:6] += dt * x[6:12] + dt**2 / 2 * a
        y[6:12] += dt * a
        y[12:15] += dt * x[15:] + dt**2 / 2 * u[m:]
        y[15:] += dt * u[m:]
        return y

    change = np.concatenate([free, free, np.ones(6, dtype=bool)])
    for k in range(count):
        x, u = states[k], controls[k]
        np.testing.assert_allclose(A[k] @ x + B[k] @ u + offset[k], move(x, u), atol=1e-12)
        by_x = [(move(x + 1e-5 * unit, u) - move(x - 1e-5 * unit, u)) / 2e-5 for unit in np.eye(n)]
        by_u = [(move(x, u + 1e-3 * unit) - move(x, u - 1e-3 * unit)) / 2e-3 for unit in np.eye(m + 3)]
        np.testing.assert_allclose(A[k][:, change], np.stack(by_x, axis=1)[:, change], rtol=1e-5, atol=2e-6)
        np.testing.assert_allclose(B[k], np.stack(by_u, axis=1), atol=1e-9)


def team_motion(robot, rng):
    """Return places of carriers with cables of fixed length, and the coordinates of these that the controller has."""
    tethers, lengths = Predictive(robot)._moved.tethers, robot.fixed_lengths

    def carriers(pose, coordinates):
        _, attachments = Dynamics(robot).points(pose, robot.carrier_home)
        cy, sy = np.cos(pose[5]), np.sin(pose[5])
        places = robot.carrier_home.copy()
        for i, (a, b) in enumerate(coordinates.reshape(-1, 2)):
            e1, e2, n = tethers["axes"][i]
            n = n if n[2] > 0 else -n  # up
            along = a * e1 + b * e2 + np.sqrt(lengths[i] ** 2 - a**2 - b**2) * n
            places[i, :3] = attachments[i] + [cy * along[0] - sy * along[1], sy * along[0] + cy * along[1], along[2]]
        return places

    coordinates = 0.3 * rng.normal(size=2 * len(tethers))
    return tethers, carriers, coordinates


def test_stages_of_a_team_are_the_symbolic_dynamics_to_first_order():
    """Accelerations by CasADi with the quadrotors where a formula in NumPy puts them, and central differences."""
    robot, rng, dt = load("multi-quadrotor-3"), np.random.default_rng(5), 0.02
    tethers, carriers, coordinates = team_motion(robot, rng)
    dynamics, m, n = Dynamics(robot), 3, 24
    A, B, offset = np.zeros((1, n, n)), np.zeros((1, n, 9)), np.zeros((1, n))
    x, u = np.concatenate([0.2 * rng.normal(size=12), coordinates, rng.normal(size=6)]), rng.uniform(1, 20, 9)
    x[5] = 1.0  # a team turns with its load
    still = np.concatenate([robot.carrier_home, 0 * robot.carrier_home], axis=1)[None]
    disturbance = rng.normal(size=6)
    given = (np.zeros((0, 2), dtype=np.int64), tethers, np.full(1, dt), disturbance, still, x[None], u[None])
    control_stages(record_of(robot), *given, A, B, offset)

    def move(x, u):
        rest = dynamics.required_wrench(x[:6], x[6:12], np.zeros(6))
        H = np.stack([dynamics.required_wrench(x[:6], x[6:12], unit) - rest for unit in np.eye(6)], axis=1)
        pulls = dynamics.wrench_matrix(x[:6], carriers(x[:6], x[12:18])) @ u[:m]
        a = np.concatenate([np.linalg.solve(H, pulls + disturbance - rest), u[m:]])
        rates = np.concatenate([x[6:12], x[18:]])
        place = np.concatenate([x[:6], x[12:18]]) + dt * rates + dt**2 / 2 * a
        rates = rates + dt * a
        return np.concatenate([place[:6], rates[:6], place[6:], rates[6:]])

    np.testing.assert_allclose(A[0] @ x + B[0] @ u + offset[0], move(x, u), atol=1e-11)
    by_x = [(move(x + 1e-5 * unit, u) - move(x - 1e-5 * unit, u)) / 2e-5 for unit in np.eye(n)]
    change = np.r_[0:6, 12:24]
    np.testing.assert_allclose(A[0][:, change], np.stack(by_x, axis=1)[:, change], rtol=1e-4, atol=5e-6)
    by_u = [(move(x, u + 1e-3 * unit) - move(x, u - 1e-3 * unit)) / 2e-3 for unit in np.eye(9)]
    np.testing.assert_allclose(B[0], np.stack(by_u, axis=1), atol=1e-9)


def test_directions_are_measured_as_carriers_are_commanded():
    """Carriers that move as directions say have cables of constant length, and give the directions back."""
    robot, rng = load("multi-quadrotor-4"), np.random.default_rng(6)
    tethers, carriers, coordinates = team_motion(robot, rng)
    motion = np.concatenate([0.3 * rng.normal(size=(3, 6)), 0.1 * rng.normal(size=(3, 8))], axis=1)
    motion[0, 6:] = coordinates
    commanded = np.zeros((4, 3, 6))
    control_carriers(record_of(robot), tethers, motion, commanded)
    np.testing.assert_allclose(commanded[:, 0, :3], carriers(motion[0, :6], coordinates)[:, :3], atol=1e-12)
    both = np.concatenate([motion[None, :, :6], commanded])
    found = np.zeros((1, 3, 8))
    control_coordinates(record_of(robot), tethers, both, found)
    np.testing.assert_allclose(found[0], motion[:, 6:], atol=1e-5)
    for s in (-0.01, 0.0, 0.01):  # its second derivative over time is zero, so that the length changes by s^3
        place = both[:, 0] + s * both[:, 1] + s**2 / 2 * both[:, 2]
        lengths = Dynamics(robot).cable_lengths(place[0], place[1:])
        np.testing.assert_allclose(lengths, robot.fixed_lengths, atol=20 * abs(s) ** 3 + 1e-9)


def test_carriers_with_two_cables_have_one_coordinate():
    """They move on a circle about the line of the attachments, and are placed and measured the same."""
    robot, rng = load("flycrane"), np.random.default_rng(7)
    controller = Predictive(robot)
    assert controller._moved.count == 3
    motion = np.concatenate([0.3 * rng.normal(size=(3, 6)), 0.1 * rng.normal(size=(3, 3))], axis=1)
    motion[0, 3:5] *= 0.3
    commanded = np.zeros((3, 3, 6))
    control_carriers(record_of(robot), controller._moved.tethers, motion, commanded)
    lengths = Dynamics(robot).cable_lengths(motion[0, :6], commanded[:, 0])
    np.testing.assert_allclose(lengths, robot.fixed_lengths, atol=1e-12)
    found = np.zeros((1, 3, 3))
    both = np.concatenate([motion[None, :, :6], commanded])
    control_coordinates(record_of(robot), controller._moved.tethers, both, found)
    np.testing.assert_allclose(found[0], motion[:, 6:], atol=1e-5)
    push = 0.05 * 9.81 * robot.platform.mass * np.array([1, 0.5, -0.5, 0, 0.05, 0])
    flight = simulate(robot, robot.home, duration=1.5, period=2 * PERIOD, controller=controller, disturbance=push)
    assert flight.error[-1] < 1e-3


def test_a_carrier_with_three_cables_is_where_the_load_has_it():
    """It has no coordinate of its own: its place follows from three lengths, which CasADi confirms."""
    given = load("multi-quadrotor-3").model_dump(exclude_defaults=True)
    given["carriers"] = ({**given["carriers"][0], "home": (0, 0, 1.5, 0, 0, 0), "thrust_max": 80},)
    for cable in given["cables"]:
        length = float(np.linalg.norm(np.array([0, 0, 1.5]) - np.array(cable["attachment"])))
        cable |= {"carrier": given["carriers"][0]["name"], "length": length}
    robot = Robot.model_validate(given)
    controller = Predictive(robot)
    assert controller._moved.count == 0
    motion, commanded = 0.2 * np.random.default_rng(1).normal(size=(3, 6)), np.zeros((1, 3, 6))
    control_carriers(record_of(robot), controller._moved.tethers, motion, commanded)
    lengths = Dynamics(robot).cable_lengths(motion[0], commanded[:, 0])
    np.testing.assert_allclose(lengths, robot.fixed_lengths, atol=1e-12)
    push = [1, 0, 0, 0, 0, 0]
    given = {"duration": 1.0, "period": 2 * PERIOD, "disturbance": push}
    flights = [simulate(robot, robot.home, law(robot), **given) for law in LAWS]
    assert flights[0].error.max() < 0.5 * flights[1].error.max()


def test_quadrotors_with_winches_correct_the_errors_of_their_load():
    """Their places are measured; gains this high are stable only with the delay of the attitude in the prediction."""
    robot = load("multi-quadrotor-3").model_copy(update={"drive": "both"})
    push = 0.05 * 9.81 * robot.platform.mass * np.array([1, 0.5, -0.5, 0, 0, 0])
    laws = Predictive(robot, bandwidth=8, carrier_bandwidth=16), ComputedTorque(robot)
    given = {"duration": 1.2, "period": PERIOD, "disturbance": push}
    late = [simulate(robot, robot.home, law, **given).error[500:].max() for law in laws]
    assert late[0] < 1e-3 < 5e-3 < late[1]


def test_the_cost_of_what_no_control_reaches_is_that_of_a_series():
    """An error that stays for ever costs Q + 0.95 Q + 0.95^2 Q + ..."""
    rest = terminal(np.eye(2), np.array([[0.0], [1.0]]), Weights(np.array([2.0, 1.0]), np.array([1.0])))
    assert rest[0, 0] == pytest.approx(2.0 / (1 - 0.95), rel=1e-6)
    assert rest[1, 1] < 2.0


def test_a_team_carries_its_load_though_it_is_pushed_and_a_quadrotor_heavier_than_in_its_file():
    """At 0.5 m/s and 0.8 m/s^2: what is measured as thrust is what the quadrotor with 30 % more mass needs more."""
    robot = load("multi-quadrotor-3")
    line = {"kind": "line", "start": [0, 0, 0], "end": [0.5, 0, 0.1]}
    made = plan(robot, {"path": line, "duration": 1.9, "base": {"kind": "free"}, "steps": 20})
    first, *others = robot.carriers
    lighter = robot.model_copy(update={"carriers": (first.model_copy(update={"mass": first.mass / 1.3}), *others)})
    push = 0.1 * 9.81 * robot.platform.mass * np.array([1, 0.5, -0.5, 0, 0.05, 0])
    heavy = simulate(robot, made, Predictive(lighter), period=2 * PERIOD)
    assert heavy.error.max() < 3e-3
    pushed = [simulate(robot, made, law(lighter), period=2 * PERIOD, disturbance=push) for law in LAWS]
    rms = [np.sqrt((flight.error**2).mean()) for flight in pushed]
    assert rms[0] < 0.03
    assert rms[0] < 0.25 * rms[1]
    assert pushed[0].error[-1] < 2e-3
    assert pushed[0].answered["as planned"] > 0.99 * len(pushed[0].error)


@pytest.mark.parametrize("name", ["ipanema-1", "ipanema-2"])
def test_a_motion_in_the_plane_of_symmetry_of_a_robot_has_solutions(name):
    """What is zero by symmetry is nothing but rounding, and no residual: no step had a solution of its own before."""
    robot = load(name)
    controller, residuals = Predictive(robot), []

    class Witness(Controller):
        def step(self, time, state, reference):
            command = controller.step(time, state, reference)
            residuals.append(max(controller._horizon.residuals))
            return command

        def follow(self, *coming):
            controller.follow(*coming)

    line = {
        "kind": "line",
        "start": robot.home[:3].tolist(),
        "end": (robot.home[:3] + np.array([0.2, 0, 0.2])).tolist(),
    }
    run = simulate(robot, line, Witness(), duration=0.3)
    assert max(residuals) <= 1e-6
    assert run.answered["as planned"] == len(run.error)
    assert run.error.max() < 4e-3  # 18 mm of ipanema-2 by computed torque


def test_predictive_control_without_any_solution_is_given_up(monkeypatch):
    """Computed torque has the robot then, which is not to be called predictive control."""
    robot = load("planar-4")
    controller = Predictive(robot)
    monkeypatch.setattr(Horizon, "residuals", Residuals(1.0, 1.0, 1.0, 1.0))
    simulate(robot, robot.home, controller, duration=0.2)
    assert controller.handed_over is not None
    assert controller.handed_over.time < 0.1


def test_a_motion_is_flown_that_runs_out_of_tensions_step_by_step():
    """1 m of each coordinate in 0.95 s is too fast for caroca: there are wrenches that no tensions inside limits give.

    A controller of the same bandwidth that knows only now comes to such a wrench, proven by a direction in which all
    tensions together give less, and is off by more than 20 cm.
    """
    robot, proofs = load("caroca"), []

    class Witness(ComputedTorque):
        def step(self, time, state, reference):
            command = super().step(time, state, reference)
            if ANSWERS[command.answered] == "soft wrench":
                proofs.append((self.problems.A[0].copy(), self.problems.w[0].copy(), command))
            return command

    line = {"kind": "line", "start": robot.home[:3].tolist(), "end": (robot.home[:3] + 1).tolist()}
    ahead = simulate(robot, line, duration=0.95, period=PERIOD, controller=Predictive(robot))
    blind = simulate(robot, line, duration=0.95, period=PERIOD, controller=Witness(robot, 40, observer=60))
    assert ahead.passed
    assert ahead.answered["as planned"] == 475
    assert ((ahead.record.commanded >= robot.t_min) & (ahead.record.commanded <= robot.t_max)).all()
    assert not blind.passed
    assert ahead.error.max() < 0.05 < 0.2 < blind.error.max()
    A, w, command = proofs[0]
    most = np.maximum(command.direction @ A * robot.t_min, command.direction @ A * robot.t_max).sum()
    assert command.direction @ w - most > 0.9 * command.shortfall > 0


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "sphere", "centre": [0.1, 0.2, 0.3], "radius": 0.5},
        {"kind": "capsule", "start": [0, 0, -1], "end": [0.5, 0, 1], "radius": 0.2},
        {"kind": "box", "min": [-0.4, -0.2, -0.1], "max": [0.4, 0.3, 0.5], "attitude": [0.3, 0.2, 1.0]},
    ],
)
def test_distances_from_bodies_are_lengths_along_their_normals(body):
    """A point goes to the surface by its distance along the normal, and its distance changes by what it moves."""
    (shape,) = Surroundings(load("cogiro"), None, [body])._bodies
    points = np.random.default_rng(3).normal(size=(200, 3))
    distance, normals = _distance(shape, points)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(_distance(shape, points - distance[:, None] * normals)[0], 0.0, atol=1e-9)
    outside = distance > 0
    further, _ = _distance(shape, points + 0.1 * normals)
    np.testing.assert_allclose(further[outside], distance[outside] + 0.1, atol=1e-9)
    centre = np.array(body.get("centre", [0, 0.05, 0.2] if body["kind"] == "box" else [0.25, 0, 0]))
    assert _distance(shape, centre)[0] < 0


def test_rows_are_left_out_where_their_limit_is_far_and_never_where_it_is_exceeded():
    robot = load("cogiro")
    surroundings = Surroundings(robot, 0.1, [{"kind": "sphere", "centre": [0, 0, 0], "radius": 0.5}])
    for off, tube, ball in ((0.0, True, True), (100.0, True, False)):
        horizon = Horizon(1, 12, 8, surroundings.rows)
        horizon.A[0] = np.eye(12)
        states = np.zeros((2, 12))
        states[:, 0] = off
        surroundings.write(horizon, states, np.zeros((2, 12)), 1.0)
        assert list(horizon.C[0].any(axis=1)) == [tube, ball]


def test_the_last_solution_serves_as_long_as_it_reaches(monkeypatch):
    robot = load("cogiro")
    controller, (state, reference) = Predictive(robot, observer=0.0), rest(robot)
    first = controller.step(0.0, state, reference)
    assert ANSWERS[first.answered] == "as planned"
    monkeypatch.setattr(Horizon, "solve", lambda horizon, warm: None)
    monkeypatch.setattr(Horizon, "residuals", property(lambda horizon: Residuals(*[1.0] * len(Residuals._fields))))
    answers, reaches = [], controller._times[-1]
    for time in np.linspace(0.2, 1.4, 7) * reaches:
        command = controller.step(time, state, reference)
        answers.append(ANSWERS[command.answered])
        np.testing.assert_allclose(command.tensions, first.tensions, rtol=5e-3)
    assert answers == ["shifted plan"] * 5 + ["as planned"] * 2


def test_each_body_and_the_tube_has_a_row_of_its_own():
    robot, rng = load("cogiro"), np.random.default_rng(2)
    bodies = [{"kind": "sphere", "centre": [x, 0.5, 1], "radius": 0.5} for x in (-1, 1)]
    states, wanted = 0.3 * rng.normal(size=(2, 3, 12))

    def rows(tube, keep_out):
        surroundings = Surroundings(robot, tube, keep_out)
        horizon = Horizon(2, 12, 8, surroundings.rows)
        horizon.A[:] = np.eye(12)
        surroundings.write(horizon, states, wanted, 1.0)
        return np.concatenate([horizon.C, horizon.d[..., None]], axis=2)

    alone = [rows(0.1, []), rows(None, bodies[:1]), rows(None, bodies[1:])]
    np.testing.assert_array_equal(rows(0.1, bodies), np.concatenate(alone, axis=1))
    assert np.concatenate(alone, axis=1).any(axis=2).all()


def test_deviations_of_carriers_decay_with_their_bandwidth():
    """The poles of a double integrator with the cost of a freed coordinate, by the Riccati equation of SciPy."""
    robot, returning = load("wang-ctmrts"), 1.7
    reach = np.array([0.5, 0.2])
    by = weights(robot, np.full(6, 4.0), reach, returning, 0.02, np.zeros((6, 2)))
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    for k in range(2):
        cost = by.controls[[robot.m + k]]
        P = solve_continuous_are(A, B, np.diag(by.states[[12 + k, 14 + k]]), cost[None])
        np.testing.assert_allclose(np.linalg.eigvals(A - B @ B.T @ P / cost), -returning, rtol=1e-4)
    assert by.states[13] / by.states[12] == pytest.approx((reach[0] / reach[1]) ** 2)


def test_a_tube_is_kept_that_a_push_would_leave():
    """By 30 mm and more."""
    robot = load("multi-quadrotor-3")
    push = 0.1 * 9.81 * robot.platform.mass * np.array([1, 0.5, -0.5, 0, 0, 0])
    law = Predictive(robot, bandwidth=3, tube=0.02)
    assert simulate(robot, robot.home, law, duration=0.8, period=2 * PERIOD, disturbance=push).error.max() < 0.022


def test_a_platform_goes_around_a_body_on_its_way():
    robot = load("cogiro")
    line = {"kind": "line", "start": [0, 0, 2.0], "end": [2.0, 0, 2.0]}
    post = {"kind": "capsule", "start": [1, -0.55, 0], "end": [1, -0.55, 6], "radius": 0.2}
    points = np.vstack([np.zeros(3), robot.attachments])
    flight = simulate(robot, line, duration=2.0, period=2 * PERIOD, controller=Predictive(robot, keep_out=[post]))
    (shape,) = Surroundings(robot, None, [post])._bodies
    nearest = [
        _distance(shape, placed(poses, points))[0].min()
        for poses in (np.stack([each.pose for each in flight.references]), flight.record.motions[:, 0, :6])
    ]
    assert nearest[0] < -0.05
    assert nearest[1] > -0.002
    assert flight.error[-1] < 1e-3


@pytest.mark.parametrize(("name", "reach"), [("cogiro", (0.0, 0.0)), ("wang-flying", (0.5, 0.0))])
def test_gusts_move_the_platform_a_fifth_as_far_as_with_computed_torque(name, reach):
    robot = load(name)
    if robot.platform.aero is None:
        task = {"disturbance": 0.05 * 9.81 * robot.platform.mass * np.array([1, 0.5, -0.5, 0, 0, 0])}
    else:
        task = {"wind": (3, 2, 0.5), "gusts": 1.0}
    flights = [
        simulate(robot, robot.home, law(robot, reach=reach), duration=1.0, period=PERIOD, seed=3, **task)
        for law in (Predictive, ComputedTorque)
    ]
    assert flights[0].passed
    assert flights[0].answered["as planned"] == 500
    assert flights[0].error.max() < 0.2 * flights[1].error.max()


def test_a_motion_whose_acceleration_changes_within_stages_is_followed():
    """Stages of constant acceleration alone were half a stage early: 1 mm."""
    robot = load("planar-4")
    line = {"kind": "line", "start": [0, 0, 0], "end": [0.3, 0, 0.2]}
    made = plan(robot, {"path": line, "duration": 0.5})
    assert simulate(robot, made, controller=Predictive(robot)).error.max() < 1e-4


@pytest.mark.parametrize(
    ("name", "reach"),
    [("cogiro", (0.0, 0.0)), ("wang-flying", (0.3, 0.2)), ("planar-4", (0, 0)), ("multi-quadrotor-3", (0.3, 0))],
)
def test_every_state_is_answered_inside_limits_and_rates(name, reach):
    """Kicked, far off, at an anchor, with numbers that are none, and after pauses."""
    robot, rng = load(name), np.random.default_rng(4)
    low, high = robot.t_min, robot.t_max
    rate = 20 * (high - low)
    controller, (state, reference) = Predictive(robot, rate=rate, reach=reach, stages=8), rest(robot)
    # At rest first: kicked quadrotors lack thrust, and say so until it is all given up.
    last, time, answers = None, 0.0, {ANSWERS[controller.step(-1e-3, state, reference).answered]}
    for k in range(400):
        dt = float(rng.choice([1e-3, 1e-3, 1e-3, 0.05, 2.0]))
        time += dt
        size = 10.0 ** rng.uniform(-4, 1 if k % 5 == 0 else -2)
        pose = robot.home + size * rng.normal(size=6) * robot.dof_mask
        velocity = size * rng.normal(size=6) * robot.dof_mask
        if k % 11 == 0:
            pose[rng.integers(6)] = rng.choice([np.nan, np.inf, 1e300])
        if k % 17 == 0:
            pose[:3] = robot.home_anchors[0]
        command = controller.step(time, state._replace(pose=pose, velocity=velocity), reference)
        t = command.tensions
        assert ((t >= low) & (t <= high)).all()
        if last is not None:
            assert (np.abs(t - last) <= rate * dt * (1 + 1e-9)).all()
        last = t
        for part in (command.carrier_pose, command.carrier_velocity, command.carrier_acceleration):
            assert np.isfinite(part).all()
        answers.add(ANSWERS[command.answered])
    assert {"as planned", "hold"} <= answers


def test_a_reference_that_is_not_announced_is_followed_too():
    """Stepped by hand, without `follow`: a first step at rest commands the tensions of statics."""
    robot = load("cogiro")
    state, reference = rest(robot)
    w = Dynamics(robot).required_wrench(robot.home, *np.zeros((2, 6)))
    planned = ComputedTorque(robot).step(0.0, state, reference).tensions
    command = Predictive(robot).step(0.0, state, reference._replace(tensions=planned))
    np.testing.assert_allclose(Dynamics(robot).wrench_matrix(robot.home) @ command.tensions, w, atol=1e-3 * w[2])


def test_copies_answer_as_the_original_does():
    robot = load("wang-flying")
    state, reference = rest(robot)
    controller = Predictive(robot, reach=(0.3, 0.0))
    pushed = state._replace(pose=robot.home + 0.01 * np.eye(6)[0])
    for k in range(3):
        controller.step(1e-3 * k, pushed, reference)
    others = copy.deepcopy(controller), pickle.loads(pickle.dumps(controller))
    expected = controller.step(3e-3, pushed, reference).tensions
    for other in others:
        np.testing.assert_array_equal(other.step(3e-3, pushed, reference).tensions, expected)


def test_a_solution_that_is_no_number_is_not_used_and_leaves_nothing_behind():
    """Far-off states overflow the stages; back at home, the controller answers as a new one does."""
    robot = load("cogiro")
    state, reference = rest(robot)
    controller = Predictive(robot, observer=0)
    for k, far in enumerate((1e6, 1e7, 9e8)):
        command = controller.step(0.3 * k, state._replace(pose=robot.home + far * np.eye(6)[2]), reference)
        assert np.isfinite(command.tensions).all()
    for k in range(3):
        back = controller.step(10.0 + k, state, reference).tensions
    new = Predictive(robot, observer=0)
    for k in range(3):
        expected = new.step(10.0 + k, state, reference).tensions
    np.testing.assert_allclose(back, expected, atol=1e-3)


def test_nothing_is_planned_where_residuals_are_no_numbers(monkeypatch):
    monkeypatch.setattr(Horizon, "residuals", Residuals(0.0, 0.0, np.nan, 0.0))
    solve = Horizon.solve

    def without_result(horizon, *arguments, **named):
        solve(horizon, *arguments, **named)
        horizon.converged = False
        return False

    monkeypatch.setattr(Horizon, "solve", without_result)
    robot = load("cogiro")
    state, reference = rest(robot)
    controller = Predictive(robot)
    controller.step(0.0, state, reference)
    assert np.isnan(controller._solved)


def test_references_may_be_announced_with_another_period_than_that_of_the_steps():
    """Every 20 ms, of a motion that turns around within the stages: the command is nearly that of all references."""
    robot = load("cogiro")
    state, still = rest(robot)

    def reference(time):
        w, x = 3.0, np.eye(6)[0]
        place, speed = 0.1 * np.sin(w * time), 0.1 * w * np.cos(w * time)
        return still._replace(pose=robot.home + place * x, velocity=speed * x, acceleration=-(w**2) * place * x)

    commands = []
    for period in (None, 0.02, 0.001):
        controller = Predictive(robot)
        if period is not None:
            controller.follow([reference(period * k) for k in range(round(1.0 / period))], period)
        for time in (0.411, 0.412, 0.413):
            now = reference(time)
            moving = state._replace(pose=now.pose, velocity=now.velocity)
            tensions = controller.step(time, moving, now).tensions
        commands.append(tensions)
    unannounced, sparse, dense = commands
    assert np.abs(sparse - dense).max() < 0.5 * np.abs(unannounced - dense).max() < 0.01  # [N], of 400


def test_wrenches_that_no_cable_gives_do_not_use_up_the_tensions():
    """Four cables of which three are independent, with carriers that stay: tensions answer what they can."""
    robot = load("wang-ctmrts-4")
    controller = Predictive(robot, reach=(0, 0))
    flight = simulate(
        robot, robot.home, duration=1.0, period=PERIOD, controller=controller, disturbance=[5, 3, 0, 0, 0, 0]
    )
    assert flight.error.max() < 0.05
    assert flight.record.tensions.min() > 20


def test_a_calm_motion_at_the_lowest_tensions_is_answered_as_planned():
    robot = load("ipanema-1")
    end = robot.home[:3] + np.array([0.05, 0.04, 0.03])
    line = {"kind": "line", "start": robot.home[:3].tolist(), "end": end.tolist()}
    flight = simulate(robot, line, duration=1.0, period=PERIOD, controller=Predictive(robot))
    assert flight.answered["as planned"] == 500
    assert (flight.record.commanded <= robot.t_min + 1e-9).any()  # [N]; t_min is 0, which no factor makes larger


def test_a_controller_that_was_used_before_flies_as_a_new_one():
    robot, controller = load("multi-quadrotor-3"), Predictive("multi-quadrotor-3")
    push = np.array([2.0, 1.0, 0, 0, 0, 0.1])
    simulate(robot, robot.home, duration=0.1, controller=controller, disturbance=-push)
    flights = [
        simulate(robot, robot.home, duration=0.1, controller=each, disturbance=push)
        for each in (controller, Predictive(robot))
    ]
    np.testing.assert_array_equal(flights[0].record.commanded, flights[1].record.commanded)
    np.testing.assert_array_equal(flights[0].record.motions, flights[1].record.motions)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bandwidth": np.nan}, "bandwidth"),
        ({"stages": 0}, "stages"),
        ({"stage": 0}, "stage"),
        ({"reach": 3}, "reach"),
        ({"rate": -1}, "rate"),
        ({"tube": 0}, "tube"),
        ({"keep_out": "box"}, "keep_out"),
        ({"keep_out": [{"kind": "sphere", "centre": [0, 0, 0], "radius": -1}]}, "radius"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(change, message):
    with pytest.raises(InputError, match=message) as error:
        Predictive(**{"robot": "cogiro"} | change)
    assert "\n" not in str(error.value)


def test_a_batch_is_refused():
    robot = load("cogiro")
    state, reference = rest(robot)
    many = State(*(None if part is None else np.stack([part, part]) for part in state))
    with pytest.raises(InputError, match="state must be of one robot, got 2"):
        Predictive(robot).step(0.0, many, reference)


def test_carriers_come_to_rest_no_harder_than_they_can():
    reach = np.array([[True, True, True, False, False, False]])
    moved, stage, strongest, orders = Freed(reach, 2.0), 0.1, 2.0, np.zeros((1, 3, 6))
    moved.now(0.0, np.zeros((2, 12)), np.array([[0.0, 1.0, -3.0], [0.0, 0.1, -0.5], [0.0, 0.0, 0.0]])[:, :3])
    for _ in range(4):
        moved.rest(stage, orders)
        assert np.abs(orders[0, 2, :3]).max() <= strongest
        moved.now(stage, np.zeros((2, 12)), np.zeros((3, 3)))
    np.testing.assert_allclose(moved.now(stage, np.zeros((2, 12)), np.zeros((3, 3)))[1], 0, atol=1e-12)


def test_carriers_turn_far_about_a_load_at_rest():
    """Three carriers 50 degrees off the vertical turn by 150 degrees: up to 95 degrees between directions of a cable.

    By statics each tension is weight / (3 cos 50 degrees). Coordinates about the directions at home end at 72 degrees.
    """
    far, lean, turned, T = 2.0, np.radians(50), np.radians(150), 1.8
    share = np.linspace(0, 1, 26)
    law = share**3 * (10 - 15 * share + 6 * share**2)
    carriers, cables, paths = [], [], {}
    for i, start in enumerate(2 * np.pi * np.arange(3) / 3):
        name, angle = f"r{i}", start + turned * law
        places = np.zeros((26, 6))
        places[:, 0], places[:, 1] = far * np.sin(lean) * np.array([np.cos(angle), np.sin(angle)])
        places[:, 2] = 1.0 + far * np.cos(lean)
        paths[name] = {"kind": "samples", "times": (T * share).tolist(), "poses": places.tolist()}
        reach = {"min": [-3, -3, 0], "max": [3, 3, 4]}
        limits = {"speed_max": 5, "acceleration_max": 20, "reach": reach}
        carriers.append({"name": name, "kind": "mobile", "home": places[0].tolist()} | limits)
        cables.append({"carrier": name, "anchor": [0, 0, 0], "attachment": [0, 0, 0], "t_min": 1, "t_max": 200})
    robot = Robot.model_validate(
        {
            "name": "turning",
            "source": "a test",
            "platform": {"mass": 10, "dof": ["x", "y", "z"], "home": [0, 0, 1, 0, 0, 0]},
            "carriers": carriers,
            "drive": "fixed-length",
            "cables": cables,
        }
    )
    task = {"path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": T, "base": {"kind": "given", "paths": paths}}
    found = plan(robot, task)
    assert found.feasible
    run = simulate(robot, found, Predictive(robot), period=0.004)
    assert run.answered["as planned"] == len(run.error)
    assert run.error.max() < 5e-4
    assert run.record.tensions.min() > 0.99 * 10 * 9.81 / (3 * np.cos(lean))
