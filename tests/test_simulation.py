"""Flights: plans flown by a controller, in wind, with sensors and faults; the same seed, the same flight."""

import copy

import numpy as np
import pytest
from scipy.optimize import linprog

from towline import load, plan
from towline.base.errors import InputError
from towline.control import ANSWERS, Command, ComputedTorque, Controller, LengthControl, OpenLoop, Predictive, State
from towline.control.trajectory import read_trajectory
from towline.core._core import sense, winch_lengths
from towline.models import Dynamics, Robot
from towline.ocp import Task
from towline.plant import Plant, layout
from towline.plant.steps import steps_in
from towline.simulation import Wall, simulate
from towline.simulation.flights import report


def planned(name, change, **task):
    """Plan a line from home."""
    robot = load(name)
    line = {
        "kind": "line",
        "start": robot.home.tolist(),
        "end": (robot.home + np.pad(change, (0, 6 - len(change)))).tolist(),
    }
    result = plan(name, {"path": line, "duration": 3, "steps": 25} | task)
    assert result.feasible, result.report()
    return result


FREE = {"tube": {"position": 0.05, "attitude": 0.3}, "base": {"kind": "free"}}
LINES = {
    "cogiro": ([0.3, 0.2, 0.1], {}),
    "caroca-pulleys": ([0.2, 0.1, 0.1], {}),
    "planar-4": ([0.1, 0, 0.1], {}),
    "wang-ctmrts": ([0.1, 0.05, 0.05], FREE),
    "wang-flying-quadrotor": ([0.5, 0, 0], FREE | {"margin": 0.3}),
    "multi-quadrotor-3": ([1.0, 0, 0], FREE),
    "flycrane": ([0.5, 0, 0], FREE),
}


@pytest.fixture(scope="module")
def crane():
    return planned("ipanema-1", [0.2, 0.1, 0.1], margin=5)


@pytest.mark.parametrize("name", LINES)
def test_a_robot_of_each_kind_flies_its_plan(name):
    change, task = LINES[name]
    flight = simulate(name, planned(name, change, **task), period=4e-3, tolerance=2e-3)
    assert flight.passed, flight.report()
    assert flight.error[-1] < 1e-3


def test_a_flight_has_the_tensions_that_its_motion_requires(crane):
    """Inverse dynamics, by CasADi, of the motion that the plant computed: its accelerations by differences."""
    robot = load("ipanema-1")
    flight = simulate(robot, crane, period=5e-4)
    data, dynamics = flight.trajectory, Dynamics(robot)
    inner = slice(2, -2)
    pose, velocity, acceleration = (data[part].values[inner] for part in ("pose", "velocity", "acceleration"))
    w = dynamics.required_wrench(pose, velocity, acceleration)
    given = np.einsum("kij,kj->ki", dynamics.wrench_matrix(pose), data["tensions"].values[inner])
    np.testing.assert_allclose(given, w, atol=2e-3 * np.abs(w).max())


def test_references_are_the_plan_also_between_its_samples(crane):
    trajectory = read_trajectory(load("ipanema-1"), crane, None)
    (pose, velocity, acceleration), _ = trajectory.at(crane.audit.times)
    np.testing.assert_allclose(pose, crane.audit.motion.pose, atol=1e-9)
    np.testing.assert_allclose(velocity, crane.audit.motion.velocity, atol=1e-7)
    np.testing.assert_allclose(acceleration, crane.audit.motion.acceleration, atol=1e-4)


def test_the_report_says_that_the_plan_is_infeasible(tmp_path, crane):
    task = {"path": {"kind": "line", "start": [0, 0, -1], "end": [0, 0, -3]}, "duration": 0.5}
    dropped = plan("wang-flying", task)
    assert dropped.status == "infeasible"
    flight = simulate("wang-flying", dropped.save(tmp_path / "dropped.nc"), duration=0.05)
    assert "reference          a plan that is infeasible" in str(flight.report())
    assert flight.to_dict()["reference"].startswith("a plan that is infeasible")
    assert "a plan that is infeasible" in report(simulate("wang-flying", dropped, duration=0.05, runs=2)).text()
    assert "infeasible" not in str(simulate("ipanema-1", crane, duration=0.05).report())


NOISE = {"position": 1e-3, "attitude": 1e-3, "velocity": 5e-3, "tension": 0.1, "delay": 2e-3}


def test_the_same_seed_is_the_same_file_and_another_one_is_not(tmp_path, crane):
    files = [
        simulate("ipanema-1", crane, noise=NOISE, seed=seed, duration=1.0).save(tmp_path / f"{k}.nc").read_bytes()
        for k, seed in enumerate((3, 3, 4))
    ]
    assert files[0] == files[1]
    assert files[0] != files[2]


def test_a_flight_of_many_is_the_flight_alone():
    task = {"wind": (4, 2, 0.5), "gusts": 1.0, "noise": NOISE, "duration": 1.0, "tolerance": 0.02}
    many = simulate("wang-flying", load("wang-flying").home, runs=3, seed=7, **task)
    singles = [simulate("wang-flying", load("wang-flying").home, seed=seed, **task).trajectory for seed in (7, 8, 9)]
    parts = np.arange(singles[0].sizes["time"]) * 100 // singles[0].sizes["time"]
    for name, of, by in (("error", "tracking_error", np.max), ("tension_min", "tensions", np.min),
                         ("tension_max", "tensions", np.max)):  # fmt: skip
        last = [np.array([by(one[of].values[parts == part]) for part in sorted(set(parts))]) for one in singles]
        found = many[f"{name}_quantiles"].values[:, sorted(set(parts))]
        np.testing.assert_allclose(found, np.quantile(last, many["quantile"].values, axis=0), rtol=1e-6)
    alone = simulate("wang-flying", load("wang-flying").home, seed=9, **task)
    assert many["error_max"].values[2] == alone.error.max()
    assert many["tension_max"].values[2] == alone.record.tensions.max()
    assert bool(many["passed"].values[2]) == alone.passed
    assert many["answered"].values[2].tolist() == list(alone.answered.values())
    assert len(set(many["error_max"].values)) == 3
    assert "all the same" not in report(many).text()


def test_slack_cables_count_in_many_flights_as_alone_and_cut_ones_never():
    """Winch 1 of wang-flying stops under a side force, so that its cable gets slack; cable 3 tears."""
    task = {"events": ["stick 1 at 0.1", "cut 3 at 0.5"], "duration": 1.0, "tolerance": 10.0}
    task |= {"disturbance": [2.0, 0, 0, 0, 0, 0]}
    alone = simulate("wang-flying", load("wang-flying").home, **task)
    taut = alone.record.tensions > 0
    assert not taut[500:, 2].any()
    others = np.delete(np.arange(6), 2)
    slack_s = (~taut[:, others]).any(axis=1).sum() * alone.period
    assert 0.01 < slack_s < 0.3
    assert alone.slack_s == pytest.approx(slack_s)
    many = simulate("wang-flying", load("wang-flying").home, **task, runs=2)
    np.testing.assert_allclose(many["slack_s"].values, slack_s)
    assert (
        "identical, because nothing is random (see --gusts, --noise and --mismatch); treated as one run"
        in report(many).text()
    )
    assert "0 to 97.5 % (95 % confidence)" in report(many).text()  # one run that failed: p <= 1 - 0.025


def test_the_drag_of_a_steady_wind_is_what_the_observer_reports():
    robot, wind = load("wang-flying"), (5.0, -2.0, 0.0)
    controller = ComputedTorque(robot, observer=20.0)
    flight = simulate(robot, robot.home, controller, wind=wind, duration=1.5)
    rest = (robot.home, *np.zeros((2, 6)), robot.carrier_home, *np.zeros((2, 1, 6)))
    dynamics = Dynamics(robot)
    drag = dynamics.required_wrench(*rest) - dynamics.required_wrench(*rest, wind=np.array(wind))
    np.testing.assert_allclose(controller.disturbance[0], drag, atol=1e-4)
    assert flight.passed


@pytest.mark.parametrize("noise", [0.0, 0.5])
@pytest.mark.parametrize(("name", "survives"), [("caroca", True), ("ipanema-1", False)])
def test_a_cut_cable_is_survived_where_the_others_can_do_without_it(name, survives, noise):
    """A linear program decides beforehand. Sensors of tensions may have noise [N]."""
    robot = load(name)
    rest = np.zeros((2, 6))
    A, w = Dynamics(robot).wrench_matrix(robot.home), Dynamics(robot).required_wrench(robot.home, *rest)
    bounds = list(zip(robot.t_min, robot.t_max, strict=True))
    bounds[0] = (0, 0)
    possible = linprog(np.zeros(robot.m), A_eq=A, b_eq=w, bounds=bounds).success
    flight = simulate(
        robot, robot.home, events=["cut 1 at 0.3"], duration=1.3, tolerance=0.02, noise={"tension": noise}
    )
    after = flight.record.answered[900:]
    assert possible == survives
    if survives:
        assert flight.passed, flight.report()
        assert flight.error[-1] < 1e-3 + 1e-2 * noise
        assert (after == 0).all()
        little = np.maximum(robot.t_min, 1e-3 * robot.t_max)[0]
        assert (flight.record.commanded[400:, 0] == little).all()
    else:
        assert not flight.passed
        assert (after > 0).any()
        assert flight.figures_of_merit()["shortfall_max"] > 1.0


def test_a_stuck_winch_holds_the_unstrained_length_of_its_cable():
    """By Hooke's law and the damper, from lengths and tensions: before the fault the unstrained length changes."""
    made = planned("wang-flying", [0.03, 0, -0.05])
    cable = load("wang-flying").cables[1]
    flight = simulate("wang-flying", made, events=["stick 2 at 1.4"], tolerance=0.5)
    t, length = flight.record.tensions[:, 1], flight.record.lengths[:, 1]
    t = t[:-1] - (cable.damping or 0.0) * np.diff(length) / flight.period  # means of the periods
    unstrained = cable.stiffness * (length[1:] + length[:-1]) / 2 / (t + cable.stiffness)
    np.testing.assert_allclose(unstrained[1425:], unstrained[-1], rtol=1e-6)
    assert np.ptp(unstrained[1000:1390]) > 1e-3
    assert np.abs(flight.record.tensions - flight.record.commanded)[1410:, 1].max() > 1.0


def test_tensions_that_a_controller_commands_are_no_rates_of_lengths():
    """Tensions of 60 N were taken for 60 m/s, and the robot fell."""
    with pytest.raises(InputError, match="drive must be one of lengths, forces, tensions, got 'rates'"):
        simulate("planar-4", load("planar-4").home, duration=0.1, drive="rates")


@pytest.mark.parametrize(
    ("robot", "drive", "message"),
    [
        ("cogiro", None, "drive 'tensions', in which winches hold no length; .* 'cogiro' needs a stiffness or a winch"),
        ("wang-flying", "tensions", "events\\[0\\] must be left out with drive 'tensions'"),
        ("multi-quadrotor-3", None, "must be left out for robot 'multi-quadrotor-3', which has no winches"),
    ],
)
def test_a_winch_that_would_stick_without_an_effect_is_refused(robot, drive, message):
    """Where cables have the commanded tension, or a fixed length, the motion would be the same to the last bit."""
    with pytest.raises(InputError, match=message):
        simulate(robot, load(robot).home, events=["stick 2 at 0.1"], duration=0.2, drive=drive)


def test_a_controller_that_misses_its_time_leaves_the_last_command(crane):
    calm = simulate("ipanema-1", crane)
    missed = simulate("ipanema-1", crane, events=["miss 0.03 at 1.5"])
    assert calm.error.max() < missed.error.max() < 5e-3
    ordered = missed.record.commanded
    assert (ordered[1500:1530] == ordered[1499]).all()
    assert (ordered[1530] != ordered[1499]).any()


def test_a_carrier_that_loses_its_thrust_has_its_weight_and_its_cable_alone():
    """By Newton, from the flight's velocities, tensions and the direction of the cable."""
    robot = load("multi-quadrotor-3")
    flight = simulate(robot, robot.home, events=["lose quad2 at 0.2"], duration=0.4)
    assert not flight.passed
    poses = flight.record.motions[:, :, :6]
    anchors, attachments = Dynamics(robot).points(poses[:, 0], poses[:, 1:])
    along = (attachments - anchors)[:, 1]
    along /= np.linalg.norm(along, axis=1)[:, None]
    expected = robot.gravity + flight.record.tensions[:, 1, None] / robot.carriers[1].mass * along
    acceleration = np.gradient(flight.record.motions[:, 2, 6:9], flight.period, axis=0)
    np.testing.assert_allclose(acceleration[205:-1], expected[205:-1], atol=0.02)
    assert np.nanmax(flight.trajectory["actuation"].sel(carrier="quad2", actuator="thrust").values[200:]) > 0


def test_cables_of_fixed_length_carry_the_weight_from_the_start_of_a_rounded_plan():
    """By statics, where the plan's cables are 6 nm too long: no winch reels these in and lets the platform drop."""
    robot = load("multi-quadrotor-3")
    pose = np.array(robot.home) - [0, 0, 6e-9, 0, 0, 0]
    tensions = simulate(robot, pose, duration=0.02).record.tensions
    anchors, attachments = Dynamics(robot).points(robot.home, robot.carrier_home)
    along = (anchors - attachments) / np.linalg.norm(anchors - attachments, axis=1)[:, None]
    np.testing.assert_allclose(tensions @ along[:, 2], robot.platform.mass * 9.81, rtol=1e-3)


def test_winding_makes_the_tension_that_is_ordered():
    """The tension of a linear cable with damper, whose length moves evenly in a first period, then with acceleration.

    Ordered is the mean of the second period but for the cable's own stiffness, whose tension grows until its end. After
    a period too short to show how rates change, they are taken to stay.
    """
    rng = np.random.default_rng(2)
    EA, C = rng.uniform(1e4, 1e6, 4), rng.uniform(0, 300, 4)
    plant = Plant("planar-4", stiffness=EA, damping=C)
    own, order = rng.uniform(1, 5, (3, 4)), rng.uniform(5, 50, (3, 4))
    states, rows = plant.start(lengths=own), np.tile(plant.command(np.ones(4)), (3, 1))
    wound = rows[:, layout.COMMANDS : layout.COMMANDS + 4]
    lengths = np.stack([own * rng.uniform(1, 1.002, (3, 4)), rng.normal(size=(3, 4))], axis=1)
    last, acceleration = np.full((3, 2, 4), np.nan), np.zeros((3, 4))
    for period in (5e-4, 1.4e-3, 1e-5, 1e-3):
        acceleration *= period != 1e-3
        winch_lengths(plant.record, states, lengths, order, last, rows, period)
        rate = lengths[:, 1] + period / 2 * acceleration - (wound - own) / period  # mean, of the elongation
        bent = period**2 / 12 * acceleration  # what the mean of a parabola is below that of its ends
        reached = EA * (lengths[:, 0] - own + period * rate - bent) / own + C * rate
        np.testing.assert_allclose(reached, order, rtol=1e-8)
        acceleration = rng.normal(size=(3, 4))
        lengths[:, 0] += period * (lengths[:, 1] + period / 2 * acceleration)  # one period later
        lengths[:, 1] += period * acceleration


class Mixed(Controller):
    """Order lengths for a tenth of a second, before and after it tensions."""

    def __init__(self, robot):
        self.both = ComputedTorque(robot), LengthControl(robot)

    def reset(self):
        for one in self.both:
            one.reset()

    def step(self, time, state, reference):
        return [one.step(time, state, reference) for one in self.both][0.1 <= time < 0.2]


def test_a_fast_motion_with_stiff_dampers_is_flown_as_with_exact_tensions():
    """Also where a controller orders lengths in between, and by Newton's law with the mean tensions of sensors.

    A winch whose cable's rate lags by half a period acts like 0.1 kg more on each cable: 19 mm in this motion. Without
    the rate of the last period, the platform acts like 0.06 kg more (0.8 mm), and means of
    tensions at the ends of a period are as far from its momentum.
    """
    robot = load("wang-flying")
    line = {"kind": "line", "start": [0, 0, -1], "end": [0.3, 0, -1.2]}
    made = plan(robot, {"path": line, "duration": 0.5, "base": {"kind": "free"}})
    run = simulate(robot, made)
    assert run.error.max() < 7e-4
    assert simulate(robot, made, Mixed(robot)).error.max() < 0.05
    motions = run.record.motions
    A = Dynamics(robot).wrench_matrix(motions[:, 0, :6], motions[:, 1:, :6])
    pulls = (A @ run.record.tensions[..., None])[:-1, :3, 0]
    change = robot.platform.mass * (np.diff(motions[:, 0, 6:9], axis=0) / run.period - robot.gravity)
    np.testing.assert_allclose(pulls, change, atol=0.02)


def test_perfect_sensors_report_the_motion_that_a_state_was_made_of():
    """Through quaternions and rates in the bodies' axes, and a CoM away from the platform's frame."""
    robot, rng, rows = load("wang-flying-quadrotor"), np.random.default_rng(8), 20
    robot = robot.model_copy(update={"platform": robot.platform.model_copy(update={"com": (0.1, -0.2, 0.05)})})
    plant, dynamics = Plant(robot), Dynamics(robot)
    pose, velocity = rng.normal(size=(2, rows, 6))
    carriers, moving = rng.normal(size=(2, rows, 1, 6))
    carriers[:, :, 2] += 3.0
    states = plant.start(pose, velocity, carriers, moving)
    motions, lengths = np.zeros((rows, 2, 12)), np.zeros((rows, 2, robot.m))
    sense(plant.record, states, motions, lengths)
    turn = np.mod(motions[:, 0, 3:6] - pose[:, 3:] + np.pi, 2 * np.pi) - np.pi
    near = np.abs(pose[:, 4]) < 1.5  # beyond a right angle of pitch other angles are the same attitude
    np.testing.assert_allclose(motions[near, 0, :3], pose[near, :3], atol=1e-12)
    np.testing.assert_allclose(turn[near], 0, atol=1e-9)
    np.testing.assert_allclose(motions[near, 0, 6:], velocity[near], atol=1e-9)
    np.testing.assert_allclose(motions[:, 1, :3], carriers[:, 0, :3], atol=1e-12)
    np.testing.assert_allclose(lengths[:, 0], dynamics.cable_lengths(pose, carriers), atol=1e-12)


def test_sensors_report_late_and_with_the_noise_that_is_stated():
    """A controller that writes down what it receives beside what is true, from the flight's record."""
    robot = load("cogiro")
    heard = []

    class Listening(ComputedTorque):
        batches = False

        def step(self, time, state, reference):
            heard.append(np.concatenate([state.pose, state.velocity]))
            return super().step(time, state, reference)

    noise = {"position": 1e-3, "attitude_rate": 2e-2, "attitude_bias": 3e-3, "delay": 4e-3}
    flight = simulate(robot, robot.home, Listening(robot, bandwidth=1.0, observer=0.0), noise=noise, duration=2.0)
    added = np.array(heard)[4:] - flight.record.motions[:-4, 0]
    spread = added.std(axis=0)
    np.testing.assert_allclose(spread[:3], 1e-3, rtol=0.1)
    np.testing.assert_allclose(spread[9:], 2e-2, rtol=0.1)
    np.testing.assert_allclose(np.ptp(added[:, 3:9], axis=0), 0, atol=1e-12)
    assert (np.abs(added[0, 3:6]) > 1e-6).all()
    assert (added[0, 6:9] == 0).all()
    assert (np.array(heard)[:4, 3:9] == np.array(heard)[0, 3:9]).all()  # nothing newer has arrived yet


class Falling(Controller):
    """Order nothing."""

    def step(self, time, state: State, reference):
        none = np.zeros(8)
        carriers = (reference.carrier_pose, reference.carrier_velocity, reference.carrier_acceleration)
        return Command(none, *carriers, np.int8(0), np.full(6, np.nan), np.float64(np.nan))


def test_a_controller_of_ones_own_that_orders_nothing_lets_the_load_fall():
    robot = load("cogiro")
    flight = simulate(robot, robot.home, Falling(), duration=0.3)
    assert not flight.passed
    fallen = robot.home[2] - flight.record.motions[:, 0, 2]
    g = -robot.gravity[2]
    # From the beginning of the first period on, in which the tensions end.
    np.testing.assert_allclose(fallen, g * flight.times**2 / 2, atol=1e-9)
    many = simulate(robot, robot.home, Falling(), duration=0.3, runs=2)
    np.testing.assert_allclose(many["error_max"].values, flight.error.max())


def test_a_plan_whose_loads_are_not_described_is_refused(crane):
    loaded = crane.trajectory.assign(phase_load=("phase", [0.0, 12.0]))
    with pytest.raises(InputError, match="must be a plan whose task describes its loads, got one of 12 kg"):
        simulate("ipanema-1", loaded)


def test_periods_that_do_not_divide_the_duration_reach_the_end_of_the_plan(crane):
    run = simulate("ipanema-1", crane, period=0.13)
    assert 23 * 0.13 < crane.duration <= run.lasted * 0.13 == pytest.approx(24 * 0.13)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"reference": "no.nc"}, "reference"),
        ({"reference": [0, 0, 1]}, "reference"),
        ({"reference": np.full(6, np.nan)}, "reference"),
        ({"reference": 3}, "reference"),
        ({"robot": "cogiro"}, "reference must be a plan of robot 'cogiro', got one of 'ipanema-1'"),
        ({"duration": -1}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"noise": {"delay": -1}}, "delay"),
        ({"noise": {"positon": 1}}, "positon"),
        ({"events": ["cut 9 at 1"]}, "1 to 8, got 9"),
        ({"events": ["cut 1"]}, "events"),
        ({"events": "cut 1 at 2"}, "events"),
        ({"events": ["miss x at 2"]}, "events"),
        ({"events": ["lose winch at 1"]}, "with actuators (it has none), got 'winch'"),
        ({"events": ["cut 1 at 3"]}, "events[0] must begin before the end at 3 s, got 3 s"),
        ({"checkpoint": "file"}, "checkpoint must be None without runs"),
        ({"workers": 2}, "workers must be 1 without runs"),
        ({"scheduler": "tcp://no"}, "scheduler must be None without runs"),
        ({"runs": 2, "resume": True}, "checkpoint must be a path if resume is True"),
        ({"runs": 2, "progress": 3}, "progress"),
        ({"wind": (1, 2, 3)}, "wind"),
        ({"gusts": 1}, "gusts"),
        ({"seed": -1}, "seed"),
        ({"period": 0}, "period"),
        ({"period": 5}, "period must be at most the simulated time of 3 s, got 5 s"),
        (
            {"events": [Wall(at=0, point=(9, 0, 0), normal=(-1, 0, 0), stiffness=1, damping=1e9)]},
            "of the period, got 5e-09 s: a wall with a stiffness of 1 N/m and a damping of 1 GN s/m appeared",
        ),
        ({"runs": 0}, "runs"),
        ({"controller": 3}, "controller"),
        ({"disturbance": [1, 2]}, "disturbance"),
        ({"tolerance": -1}, "tolerance"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_line(crane, change, message):
    with pytest.raises(InputError) as error:
        simulate(**{"robot": "ipanema-1", "reference": crane} | change)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


class Wrong(Controller):
    """Return what no plant can follow, from a time [s] on."""

    def __init__(self, change, since):
        self.change, self.since = change, since

    def step(self, time, state: State, reference):
        carriers = (reference.carrier_pose, reference.carrier_velocity, reference.carrier_acceleration)
        command = Command(np.zeros(8), *carriers, 0)
        if time < self.since:
            return command
        if callable(self.change):
            return self.change(command)
        return command._replace(**self.change)


@pytest.mark.parametrize("since", [0, 0.004])
@pytest.mark.parametrize("runs", [None, 2])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda command: None, "must return a Command"),
        (tuple, "must return a Command"),
        ({"tensions": np.zeros(3)}, "tensions of shape"),
        ({"tensions": np.full(8, np.nan)}, "finite tensions"),
        ({"answered": len(ANSWERS)}, "answered from 0 to 5, got 6"),
        ({"answered": 1.5}, "an integer as answered, got 1.5"),
        ({"answered": 2, "shortfall": "much"}, r"shortfall of shape .*, got 'much'"),
        ({"unexplained": np.ones(3)}, "unexplained of shape"),
        ({"carrier_pose": np.zeros(6)}, "carrier_pose of shape"),
    ],
)
def test_what_a_controller_may_return_is_checked(change, message, runs, since):
    with pytest.raises(InputError, match=message) as error:
        simulate("cogiro", load("cogiro").home, Wrong(change, since), duration=0.01, runs=runs)
    assert "\n" not in str(error.value)
    assert str(error.value).endswith(f"at t = {since:g} s")


def test_a_controller_cannot_change_what_errors_are_measured_from():
    class Moving(ComputedTorque):
        def step(self, time, state, reference):
            reference.pose[0] += 1.0
            return super().step(time, state, reference)

    with pytest.raises(ValueError, match="read-only"):
        simulate("cogiro", load("cogiro").home, Moving("cogiro"), duration=0.01)


@pytest.mark.parametrize("runs", [None, 2])
def test_steps_without_an_answer_count_as_held(runs):
    given = {"duration": 0.05, "events": ["miss 0.01 at 0.02"], "runs": runs}
    flight = simulate("wang-flying", load("wang-flying").home, **given)
    if runs is None:
        assert (flight.answered["as planned"], flight.answered["hold"]) == (40, 10)
        assert np.flatnonzero(flight.trajectory["answered"].values).tolist() == list(range(20, 30))
    else:
        assert flight["answered"].sel(answer="hold").values.tolist() == [10, 10]


def test_a_path_may_be_a_mapping():
    line = {"kind": "line", "start": [0, 0, -1], "end": [0.01, 0, -1.02]}
    alike = [simulate("wang-flying", path, duration=0.1) for path in (line, Task(path=line).path)]
    assert np.array_equal(*(flight.record.motions for flight in alike))
    with pytest.raises(InputError, match=r"path\.kind must be one of circle, feed, line, .*, got 'lin'"):
        simulate("wang-flying", {**line, "kind": "lin"}, duration=0.1)


@pytest.mark.parametrize(
    "wind", [lambda times: times, lambda times, seed: np.zeros(3), lambda times, seed: np.full((len(times), 3), np.nan)]
)
def test_what_a_wind_may_return_is_checked(wind):
    with pytest.raises(InputError, match="wind must") as error:
        simulate("wang-flying", load("wang-flying").home, wind=wind, duration=0.01)
    assert "\n" not in str(error.value)


def test_a_bias_alone_is_sensed():
    """The controller holds what it measures at the reference, so that the platform stands beside it by the bias."""
    robot, size = load("cogiro"), 0.01
    ends = []
    for seed in range(3):
        flight = simulate(robot, robot.home, noise={"position_bias": size}, seed=seed, duration=1.5)
        ends.append(flight.trajectory["pose"].values[-1, :3] - robot.home[:3])
        drawn = np.random.default_rng([seed, 1]).normal(size=3) * size
        np.testing.assert_allclose(ends[-1], -drawn, atol=5e-4)


@pytest.mark.parametrize(("share", "allowed"), [(0.8e-3, True), (1.2e-3, False)])
def test_tensions_may_exceed_their_limit_by_a_thousandth_of_their_range(share, allowed):
    data = load("cogiro").model_dump(mode="json")
    for cable in data["cables"]:
        cable["t_min"] = 0.6 * cable["t_max"]
    robot = Robot.model_validate(data)
    flight = simulate(robot, robot.home, duration=0.01)
    flight.record.tensions[:] = 0.5 * (robot.t_min + robot.t_max)
    flight.record.tensions[3, 2] = robot.t_max[2] + share * (robot.t_max[2] - robot.t_min[2])
    assert any("in cable 3 at t = 0.003 s" in line for line in flight.failures) != allowed


def test_a_period_has_steps_for_the_fastest_spring():
    """A mass on a vertical cable below a quadrotor: they swing against each other with their reduced mass."""
    load_mass, carrier_mass, stiffness, period = 2.0, 0.5, 1e5, 0.2
    quadrotor = load("multi-quadrotor-3").model_dump(mode="json")["carriers"][0]
    quadrotor |= {"name": "top", "mass": carrier_mass, "home": [0, 0, 0, 0, 0, 0]}
    cable = {"carrier": "top", "anchor": [0, 0, 0], "attachment": [0, 0, 0], "t_min": 0, "t_max": 100}
    robot = Robot.model_validate(
        {
            "name": "pendulum",
            "source": "a test",
            "gravity": [0, 0, -9.81],
            "platform": {"mass": load_mass, "dof": ["x", "y", "z"], "home": [0, 0, -1, 0, 0, 0]},
            "carriers": [quadrotor],
            "cables": [cable | {"stiffness": stiffness, "damping": 0}],
        }
    )
    frequency = np.sqrt(stiffness / 1.0 * (1 / load_mass + 1 / carrier_mass))
    assert steps_in(period, Plant(robot)) == np.ceil(period * frequency)


def test_actuators_are_listed_where_only_some_carriers_have_any():
    data = load("wang-flying-quadrotor").model_dump(mode="json")
    data["carriers"].append({"name": "post", "kind": "ground"})
    robot = Robot.model_validate(data)
    actuation = simulate(robot, robot.home, duration=0.01).trajectory["actuation"]
    assert actuation["actuator"].values.tolist() == ["thrust", "torque x", "torque y", "torque z"]
    weight = (robot.platform.mass + robot.carriers[0].mass) * 9.81
    assert actuation.sel(carrier="quad", actuator="thrust")[-1] == pytest.approx(weight, rel=1e-3)


def test_a_flight_has_what_a_plan_has_and_reports_it(crane):
    flight = simulate("ipanema-1", crane, duration=0.01)
    assert set(crane.trajectory.variables) <= set(flight.trajectory.variables)
    report = flight.report().splitlines()
    assert report[0].startswith("ipanema-1, simulation of 0.01 s: PASSED")
    named = ["position error", "tensions", "slack", "controller status", "controller time"]
    assert [line.strip()[: len(name)] for line, name in zip(report[1:], named, strict=True)] == named
    tensions = flight.record.tensions
    assert f"{tensions.min():.4g} N to {tensions.max():.4g} N" in report[2]


def test_a_wind_too_fast_is_named():
    storm = lambda times, seed: np.tile([3.0, -2e3, 1.0], (len(times), 1))  # noqa: E731
    with pytest.raises(InputError, match=r"up to 1000 m/s, got -2000$"):
        simulate("wang-flying", load("wang-flying").home, wind=storm, duration=0.01)


def test_a_motion_that_no_numbers_hold_never_passes():
    """A force of 1e300 N: alone and beside others the flight ends, and its figures are those of what was before."""
    robot = load("cogiro")
    push = {"disturbance": np.full(6, 1e300), "duration": 0.05}
    alone = simulate(robot, robot.home, **push)
    assert not alone.passed
    assert "the simulation diverged" in alone.report()
    many = simulate(robot, robot.home, **push, runs=2)
    assert not many["passed"].values.any()
    assert np.isfinite(many["error_max"].values).all()


def test_processes_fly_as_one_does_and_refuse_what_they_cannot_receive():
    """Also with a checkpoint, of which a part is lost."""
    robot = load("wang-flying")
    given = {"noise": NOISE, "duration": 0.02, "runs": 101}
    alone, done = simulate(robot, robot.home, **given), []
    assert alone.identical(simulate(robot, robot.home, **given, workers=2, progress=lambda *all: done.append(all)))
    assert done[-1] == (101, 101, int(alone["passed"].sum()))
    assert len(done) >= 4
    with pytest.raises(InputError, match="workers must be 1"):
        simulate(
            robot, robot.home, wind=lambda times, seed: np.zeros((len(times), 3)), duration=0.01, runs=2, workers=2
        )


@pytest.mark.parametrize("make", [ComputedTorque, Predictive, OpenLoop])
def test_a_controller_of_a_robot_with_other_cables_is_refused_before_the_run(make):
    message = f"controller must be for robot 'cogiro', got {make.__name__} for 'wang-flying'"
    for runs in (None, 2):
        with pytest.raises(InputError, match=message):
            simulate("cogiro", load("cogiro").home, make("wang-flying"), duration=0.1, runs=runs)
    heavier = load("cogiro").model_copy(update={"name": "as-built"})  # the same cables: a model that differs
    assert simulate("cogiro", load("cogiro").home, make(heavier), duration=0.01).lasted == 10


def test_a_plan_whose_dataset_was_changed_is_followed_as_changed(crane):
    robot, changed = crane.scenario.robot, copy.copy(crane)
    dataset = vars(changed)["trajectory"] = crane.trajectory.copy(deep=True)
    dataset["pose"] = dataset["pose"] + np.array([0.1, 0, 0, 0, 0, 0])
    (before, _), (after, _) = (read_trajectory(robot, one, None).at(np.linspace(0, 1, 5)) for one in (crane, changed))
    np.testing.assert_allclose(after[0] - before[0], np.tile([0.1, 0, 0, 0, 0, 0], (5, 1)), atol=1e-9)


@pytest.mark.parametrize(("size", "passes"), [(1.0, True), (0.04, False)])
def test_small_robots_must_stay_nearer_to_their_reference(size, passes):
    """The same push moves a robot with cables of 2.8 m and one with cables of 0.11 m as many millimetres."""
    robot = load("point-mass-3")
    cables = tuple(cable.model_copy(update={"anchor": tuple(size * x for x in cable.anchor)}) for cable in robot.cables)
    platform = robot.platform.model_copy(update={"home": tuple(size * x for x in robot.platform.home)})
    robot = robot.model_copy(update={"cables": cables, "platform": platform})
    push = f"push {0.4 * robot.weight} 0 0 at 0.1 for 0.3"
    run = simulate(robot, {"kind": "rest", "pose": robot.platform.home}, duration=0.5, events=[push])
    lengths = np.linalg.norm(robot.anchors - np.array(robot.platform.home[:3]), axis=1)
    assert run.tolerance == pytest.approx(min(0.05, 0.05 * lengths.mean()), rel=1e-12)
    assert 0.05 * lengths.mean() < run.error.max() < 0.05 or passes
    assert run.passed is passes
