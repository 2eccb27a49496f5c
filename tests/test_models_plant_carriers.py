"""Carriers that move: cables of fixed length below them stay taut, and references move within a step."""

import time
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, make_smoothing_spline
from scipy.spatial.transform import Rotation

from towline import Dynamics, Robot, load, simulate
from towline.control.controller import HOLD
from towline.plant import Plant

G, AWAY = 9.81, np.array([1.0, 0.4, 0.3]) / np.sqrt(1.25)


def robot_of(cables, mass, turns=True, home=(0, 0, -1), carrier=(0, 0, 0)):
    """Return a load below one prescribed carrier; each cable is (anchor, attachment)."""
    platform = {"mass": mass, "home": [*home, 0, 0, 0], "dof": ["x", "y", "z"]}
    if turns:
        inertia = [0.02 * mass, 0.02 * mass, 0.03 * mass, 0, 0, 0]
        platform = {"mass": mass, "home": [*home, 0, 0, 0], "inertia": inertia}
    ends = [{"carrier": "top", "anchor": list(a), "attachment": list(b), "t_min": 0, "t_max": 1e4} for a, b in cables]
    top = {"name": "top", "kind": "prescribed", "home": [*carrier, 0, 0, 0]}
    given = {"name": "load", "source": "a test", "platform": platform, "carriers": [top], "cables": ends}
    return Robot.model_validate(given)


def ring(count, radius, height=0.0, ahead=0.0):
    angles = 2 * np.pi * np.arange(count) / count + ahead * (-1) ** np.arange(count)
    return [(radius * np.cos(angle), radius * np.sin(angle), height) for angle in angles.tolist()]


RIGS = {
    "one cable": (robot_of([((0, 0, 0), (0, 0, 0))], 0.0052, turns=False), 0.1),
    "tripod": (robot_of([(a, (0, 0, 0)) for a in ring(3, 0.5)], 0.05, turns=False), 0.02),
    "swing of 4": (robot_of(list(zip(ring(4, 0.25), ring(4, 0.25, 0.05), strict=True)), 1.0), 0.02),
    "platform of 6": (robot_of(list(zip(ring(6, 0.6), ring(6, 0.25, 0.05, 0.5), strict=True)), 1.0), 0.02),
}


def motion(kind, dt, size, seconds=2.0):
    """Return the carrier's motion at the beginnings of steps: pose, velocity, acceleration, each (K, 1, 6)."""
    t = dt * np.arange(round(seconds / dt))
    w = 2 * np.pi
    if kind == "harmonic":
        parts = np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)
    elif kind == "piecewise":  # accelerations that jump
        acceleration = np.where(np.floor(t / 0.25 + 1e-9) % 4 < 2, 30.0, -30.0)
        acceleration[np.floor(t / 0.25 + 1e-9) % 4 % 3 == 0] *= -1
        velocity = dt * np.concatenate([[0], np.cumsum(acceleration)[:-1]])
        parts = dt * np.concatenate([[0], np.cumsum(velocity + dt / 2 * acceleration)[:-1]]), velocity, acceleration
    else:  # samples of a motion capture
        way, rate, noise = kind
        samples = np.arange(0.0, seconds + 0.1, 1 / rate)
        noisy = np.sin(w * samples) + noise / size * np.random.default_rng(3).normal(size=len(samples))
        spline = (CubicSpline if way == "through" else make_smoothing_spline)(samples, noisy)
        parts = spline(t), spline.derivative(1)(t), spline.derivative(2)(t)
    moving = np.zeros((3, len(t), 1, 6))
    for part, values in zip(moving, parts, strict=True):
        part[:, 0, :3] = size * values[:, None] * AWAY
    return moving


def fly(robot, moving, dt, EA, substeps=1, damping=None):
    """Run a load that hangs below its carrier and moves as it does at first."""
    plant = Plant(robot, stiffness=EA, damping=0.005 * EA if damping is None else damping)
    dynamics, still = Dynamics(robot), np.zeros(6)
    lengths = dynamics.cable_lengths(robot.home)
    if EA:
        A, w = dynamics.wrench_matrix(robot.home), dynamics.required_wrench(robot.home, still, moving[2, 0, 0])
        pulls = np.linalg.lstsq(A * robot.dof_mask[:, None], w * robot.dof_mask, rcond=1e-9)[0]
        lengths = lengths / (1 + np.maximum(pulls, 0) / EA)
    at = {"pose": robot.home + moving[0, 0, 0], "velocity": moving[1, 0, 0], "lengths": lengths}
    start = plant.start(carrier_pose=robot.carrier_home + moving[0, 0], carrier_velocity=moving[1, 0], **at)
    commands = plant.command(lengths, None, robot.carrier_home + moving[0], moving[1], moving[2])
    begun = time.process_time()
    run = plant.run(start, commands, dt, substeps=substeps, threads=1)
    return plant.read(run.states), run.tensions, time.process_time() - begun


@pytest.mark.parametrize("kind", ["harmonic", "piecewise", ("near", 100, 2e-5), ("near", 200, 1e-4)], ids=str)
@pytest.mark.parametrize("rig", RIGS)
def test_fixed_lengths_pull_as_stiff_elastic_cables_do(rig, kind):
    robot, size = RIGS[rig]
    stiff = 200.0 * robot.platform.mass / 0.0052  # the strain of EA = 200 N under the lightest load
    for dt, substeps in ((1e-3, 1), (2e-3, 2)):
        moving = motion(kind, dt, size)
        _, elastic, theirs = fly(robot, moving, dt, stiff, substeps)
        _, fixed, ours = fly(robot, moving, dt, 0.0, substeps)
        assert (fixed == 0).mean() <= (elastic == 0).mean()
        assert fixed.mean() == pytest.approx(elastic.mean(), rel=1e-3)
        for _ in range(20):  # by turns, as often as a loaded machine needs until both had a quiet moment
            if ours < 5 * theirs:
                break
            ours = min(ours, fly(robot, moving, dt, 0.0, substeps)[2])
            theirs = min(theirs, fly(robot, moving, dt, stiff, substeps)[2])
        assert ours < 5 * theirs


@pytest.mark.parametrize(
    ("rig", "kind"), [("tripod", ("through", 200, 2e-5)), ("platform of 6", ("through", 100, 2e-5))]
)
def test_noise_that_a_carrier_follows_slackens_stiffer_cables_the_more(rig, kind):
    """A spline through noise accelerates by up to 20 m/s^2: soft cables filter that, stiff ones rattle as fixed do."""
    robot, size = RIGS[rig]
    mass, soft, dt = robot.platform.mass, 200.0 * robot.platform.mass / 0.0052, 1e-3
    moving, slack = motion(kind, dt, size), []
    for factor in (1, 10, 100, 1000):
        fastest = np.sqrt(factor * soft / mass)  # [rad/s], with half of its critical damping
        _, tensions, _ = fly(robot, moving, dt, factor * soft, int(3 * fastest * dt) + 1, fastest * mass)
        slack.append((tensions == 0).mean())
    _, tensions, _ = fly(robot, moving, dt, 0.0)
    assert (np.diff(slack) > 0).all()
    assert (tensions == 0).mean() == pytest.approx(slack[-1], abs=0.06)
    assert slack[0] < 0.05 < 0.15 < slack[-1]


@pytest.mark.parametrize("speed", [-0.05, -0.3, 0.3])
def test_a_carrier_that_jumps_in_velocity_hits_the_load_or_leaves_it_behind(speed):
    """Downwards the load falls freely until g t^2 / 2 = u t; then, as at once upwards, it takes over the velocity u."""
    robot, dt, k = RIGS["one cable"][0], 1e-3, np.arange(200)
    moving = np.zeros((3, 200, 1, 6))
    moving[1, 10:, 0, 2], moving[0, 10:, 0, 2] = speed, speed * dt * (k[10:] - 10)
    now, tensions, _ = fly(robot, moving, dt, 0.0)
    caught = max(-2 * speed / G, 0.0)
    slack = np.flatnonzero(tensions[:, 0] == 0)
    assert len(slack) == pytest.approx(caught / dt, abs=1.5)
    assert now.velocity[12 + len(slack) :, 2] == pytest.approx(speed, abs=1e-9)
    assert tensions[12 + len(slack) :, 0] == pytest.approx(robot.weight, rel=1e-6)
    assert (now.carrier_pose[:, 0, 2] - now.pose[:, 2]).max() < 1 + 1e-11


@pytest.mark.parametrize("parts", [1, 2])
def test_poses_alone_are_a_motion(parts):
    """Velocities and accelerations that are not given are those of the poses."""
    robot, size = RIGS["one cable"]
    dt, moving = 1e-3, motion("harmonic", 1e-3, size)
    _, whole, _ = fly(robot, moving, dt, 0.0)
    plant = Plant(robot)
    at = {"carrier_pose": moving[0, 0], "carrier_velocity": moving[1, 0], "velocity": moving[1, 0, 0]}
    run = plant.run(plant.start(lengths=[1.0], **at), plant.command([1.0], None, *moving[:parts]), dt)
    assert (run.tensions > 0).all()
    assert run.tensions.mean() == pytest.approx(whole.mean(), rel=1e-4)
    assert np.abs(run.tensions - whole)[3:-3].max() < 1e-3 * whole.mean()


def test_poses_that_jump_do_so_from_rest_to_rest():
    robot, k = RIGS["one cable"][0], np.arange(40)
    poses = np.zeros((40, 1, 6))
    poses[:, 0, 0], poses[:, 0, 5] = np.where(k < 20, 0.0, 0.1), np.where(k < 20, 3.1, -3.1)
    plant = Plant(robot, drive="tensions")
    now = plant.read(plant.run(plant.start(carrier_pose=poses[0]), plant.command([0.0], None, poses), 1e-3).states)
    assert now.carrier_pose[:-1, 0] == pytest.approx(poses[:, 0], abs=1e-12)
    assert np.delete(now.carrier_velocity, [19, 20, 21], axis=0) == pytest.approx(0.0, abs=1e-12)


def test_steps_that_are_given_the_next_command_are_those_of_a_run():
    robot, size = RIGS["tripod"]
    moving, plant = motion("harmonic", 1e-3, size, 0.05), Plant(robot)
    lengths = Dynamics(robot).cable_lengths(robot.home)
    at = {"carrier_pose": moving[0, 0], "carrier_velocity": moving[1, 0], "velocity": moving[1, 0, 0]}
    state = plant.start(lengths=lengths, **at)
    commands = plant.command(lengths, None, *moving)
    run = plant.run(state, commands, 1e-3)
    batch = np.stack([state, state])
    for command, after in pairwise(commands):
        state, batch = plant.step(state, command, 1e-3, after), plant.step(batch, command, 1e-3, after)
    np.testing.assert_array_equal(state, run.states[-2])
    np.testing.assert_array_equal(batch, np.stack([state, state]))


@pytest.mark.parametrize(("dt", "within"), [(1e-4, 2e-11), (1e-3, 1e-8), (2e-3, 1e-7)])
def test_a_pendulum_below_a_moving_pivot_is_that_of_minimal_coordinates(dt, within):
    """Its angle from theta'' = -(g sin + a cos) / l, and its tension from Newton's law, by another integrator."""
    robot, (size, w) = RIGS["one cable"][0], (0.1, 2 * np.pi)
    moving = np.zeros((3, round(1.5 / dt), 1, 6))
    t = dt * np.arange(moving.shape[1] + 1)
    for part, values in zip(moving, (np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)), strict=True):
        part[:, 0, 0] = size * values[:-1]
    now, tensions, _ = fly(robot, moving, dt, 0.0)

    def slope(time, y):
        return [y[1], -(G * np.sin(y[0]) - size * w * w * np.sin(w * time) * np.cos(y[0]))]

    angle, rate = solve_ivp(slope, (0, t[-1]), [0, 0], "DOP853", t, rtol=1e-13, atol=1e-14).y
    away = np.abs(now.pose[:, 0] - size * np.sin(w * t) - np.sin(angle)), np.abs(now.pose[:, 2] + np.cos(angle))
    pull = rate**2 + G * np.cos(angle) + size * w * w * np.sin(w * t) * np.sin(angle)
    assert max(part.max() for part in away) < within
    assert np.abs(tensions[:-1, 0] / 0.0052 - pull[:-1]).max() < 1e3 * within


def test_a_jerk_downwards_slackens_a_cable_and_its_impact_takes_energy():
    """The carrier falls at 2 g for 0.1 s, and stops; the load falls freely meanwhile, and is caught."""
    robot, dt = RIGS["one cable"][0], 1e-3
    k = np.arange(1000)
    acceleration = np.where(k < 100, -2 * G, np.where(k < 200, 2 * G, 0.0))
    velocity = dt * np.concatenate([[0], np.cumsum(acceleration)[:-1]])
    moving = np.zeros((3, 1000, 1, 6))
    for part, values in zip(moving, (np.zeros(1000), velocity, acceleration), strict=True):
        part[:, 0, 2] = values
    moving[0, 1:, 0, 2] = np.cumsum(dt * velocity + dt * dt / 2 * acceleration)[:-1]
    moving[0, :, 0, 0] = moving[1, :, 0, 0] = 0.0
    now, tensions, _ = fly(robot, moving, dt, 0.0)
    below = now.carrier_pose[:, 0, 2] - now.pose[:, 2]
    assert below.max() < 1 + 1e-11
    # Both fall g t^2 apart for 0.1 s, 0.0981 m; the carrier is 2 g 0.1^2 lower at the end of it all.
    caught = np.sqrt(2 * 2 * G * 0.1**2 / G)
    slack = tensions[:, 0] == 0
    assert slack[1:199].all()
    assert np.flatnonzero(slack)[-1] == pytest.approx(caught / dt, abs=1)
    rests = k[1:] >= 201
    energy = 0.5 * (now.velocity[:-1, :3] ** 2).sum(axis=1) + G * now.pose[:-1, 2]
    assert np.diff(energy)[rests].max() < 1e-12
    assert tensions[-10:, 0] == pytest.approx(0.0052 * G, rel=1e-9)


def test_far_from_the_origin_a_taut_cable_stays_taut():
    far = (2e4, -3e4, 5e3)
    robot = robot_of([((0, 0, 0), (0, 0, 0))], 0.0052, turns=False, home=np.add(far, (0, 0, -1)).tolist())
    moving = motion("harmonic", 1e-3, 0.1)
    moving[0, :, 0, :3] += far
    plant = Plant(robot)
    state = {"carrier_pose": moving[0, 0], "carrier_velocity": moving[1, 0], "velocity": moving[1, 0, 0]}
    start = plant.start(lengths=[1.0], **state)
    run = plant.run(start, plant.command([1.0], None, *moving), 1e-3)
    assert (run.tensions > 0.03).all()


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_mobile_carriers_are_where_their_reference_is(dt):
    """At 1 m/s a reference that stood still in a step would be late by half of it: 0.5 mm at 1 ms."""
    robot = load("wang-ctmrts")
    plant, speed = Plant(robot), 0.5 * robot.carriers[0].speed_max
    poses = np.tile(robot.carrier_home, (100, 1, 1))
    poses[:, :, 0] += speed * dt * np.arange(100)[:, None]
    velocity = np.zeros_like(poses)
    velocity[:, :, 0] = speed
    lengths = Dynamics(robot).cable_lengths(robot.home) + 1.0
    start = plant.start(carrier_velocity=velocity[0], lengths=lengths)
    now = plant.read(plant.run(start, plant.command(lengths, None, poses, velocity), dt).states)
    assert np.abs(now.carrier_pose[:-1] - poses).max() < 1e-12
    assert now.carrier_velocity[:, :, 0] == pytest.approx(speed, abs=1e-12)


def test_a_carrier_that_turns_goes_on_without_jumps():
    """Poses and velocities of a smooth motion in all six coordinates, of which commands have samples."""
    robot, dt = RIGS["platform of 6"][0], 2e-3
    rng, t = np.random.default_rng(2), dt * np.arange(501)
    size, w = 0.3 * rng.normal(size=6), rng.uniform(3, 6, 6)
    x, v, a = (size * w**k * f(w * t[:, None]) for k, f in enumerate((np.sin, np.cos, lambda angle: -np.sin(angle))))
    plant = Plant(robot, drive="tensions")
    start = plant.start(carrier_pose=x[:1], carrier_velocity=v[:1])
    parts = [part[:-1, None] for part in (x, v, a)]
    now = plant.read(plant.run(start, plant.command(np.zeros(6), None, *parts), dt).states)
    jerk = np.abs(size * w**3).max()
    assert np.abs(now.carrier_pose[:, 0] - x).max() < 3 * jerk * dt**3 / 6
    assert np.abs(now.carrier_velocity[:, 0] - v).max() < 3 * jerk * dt**2 / 2


def test_carriers_go_on_while_the_controller_does_not_answer():
    """Below a carrier of constant velocity the cables carry the weight, whether or not a command is missed."""
    given = RIGS["tripod"][0].model_dump()
    robot = Robot.model_validate(given | {"drive": "fixed-length"})
    times, motion = np.array([0.0, 1.0]), np.zeros((3, 2, 6))
    motion[0, 1, 0], motion[1, :, 0] = 0.5, 0.5
    parts = zip(("pose", "velocity", "acceleration"), motion, strict=True)
    variables = {f"{owner}{name}": (dims, part) for name, part in parts for owner, dims, part in _of(robot, name, part)}
    flight = simulate(robot, xr.Dataset(variables, {"time": times}), events=["miss 0.05 at 0.5"]).trajectory
    assert np.abs(flight["carrier_pose"] - flight["carrier_reference"]).max() < 1e-9
    assert (flight["answered"] == HOLD).sum() == 50
    assert flight["tensions"].to_numpy() == pytest.approx(robot.weight / 3 / np.sqrt(0.8), rel=1e-6)


def _of(robot, name, part):
    """Return the variables of platform and carrier, which move alike."""
    home = {"platform": robot.home, "carrier": robot.carrier_home[0]} if name == "pose" else {}
    yield "", ("time", "coordinate"), part + home.get("platform", 0.0)
    yield "carrier_", ("time", "carrier", "coordinate"), (part + home.get("carrier", 0.0))[:, None]


def test_wrenches_on_carriers_are_their_momentum():
    """Three quadrotors that fall with their load: cables pull at both ends, so what acts from outside remains."""
    robot, dt = load("multi-quadrotor-3"), 0.2
    plant, wrenches = Plant(robot, drive="lengths"), np.zeros((3, 6))
    wrenches[1] = [3.0, -2.0, 1.0, 0.02, 0.01, -0.03]
    command = plant.command(robot.fixed_lengths, carrier_wrench=wrenches)
    start = plant.start()
    first, last = (plant.read(state) for state in (start, plant.run(start, command[None], dt).states[-1]))
    masses = np.array([robot.platform.mass, *(carrier.mass for carrier in robot.carriers)])
    gained = [np.vstack([now.velocity[None], now.carrier_velocity])[:, :3] for now in (first, last)]
    outside = masses.sum() * np.array(robot.gravity) + wrenches[1, :3]
    np.testing.assert_allclose(masses @ (gained[1] - gained[0]), dt * outside, rtol=1e-9)
    # A cable at the CoM gives no moment, so a carrier turns by M / J t^2 / 2.
    moment = np.array([0.0, 0.0, 0.01])
    alone = plant.command(robot.fixed_lengths, carrier_wrench=np.vstack([np.zeros((2, 6)), [0, 0, 0, *moment]]))
    after = plant.read(plant.run(start, alone[None], dt).states[-1]).carrier_pose[2, 3:]
    R, turned = (Rotation.from_euler("xyz", angles) for angles in (robot.carriers[2].home[3:], after))
    J = R.as_matrix() @ np.diag(robot.carriers[2].inertia[:3]) @ R.as_matrix().T
    expected = np.linalg.solve(J, moment) * dt**2 / 2
    np.testing.assert_allclose((turned * R.inv()).as_rotvec(), expected, atol=1e-3 * np.abs(expected).max())
