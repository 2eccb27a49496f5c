"""The plant against closed forms, conservation laws, inverse dynamics and its own order of convergence."""

import time

import numpy as np
import pytest

from towline import Dynamics, Robot, SolverError, load, tensions
from towline.base.errors import InputError
from towline.models.points import rotations
from towline.plant import Plant

from .framed import framed

G = 9.81


def mass_on_cables(cables=1, mass=2.0, dof=("x", "y", "z"), gravity=(0, 0, -G), anchor=(0.0, 0.0, 0.0), **cable):
    """Return a mass of 2 kg, 1 m below its anchor."""
    platform = {"mass": mass, "dof": list(dof), "home": [0, 0, -1, 0, 0, 0]}
    return framed([(anchor, (0, 0, 0))] * cables, platform, {"gravity": list(gravity)}, **{"t_max": 1e4, **cable})


def held(plant, steps, *arguments, **others):
    """Return a command that does not change, for many steps."""
    command = plant.command(*arguments, **others)
    return np.broadcast_to(command, (steps, len(command)))


def lengths_at(robot, pose=None):
    return Dynamics(robot).cable_lengths(robot.home if pose is None else pose)


def dropped_mass(k, mass, drop, duration):
    """Return the depth of a mass below the point at which its spring begins to pull, as it falls and bounces on it."""
    omega, speed, sag = np.sqrt(k / mass), np.sqrt(2 * G * drop), mass * G / k
    caught = 2 * (np.pi - np.arctan(speed / omega / sag)) / omega
    flown, left = 2 * speed / G, duration - np.sqrt(2 * drop / G)
    while left > caught + flown:
        left -= caught + flown
    if left < caught:
        return sag * (1 - np.cos(omega * left)) + speed / omega * np.sin(omega * left)
    return G * (left - caught) ** 2 / 2 - speed * (left - caught)


@pytest.mark.parametrize(("stiffness", "steps"), [(1e4, 4000), (1e5, 8000), (1e6, 32000)])
def test_a_dropped_mass_bounces_as_in_closed_form(stiffness, steps):
    plant = Plant(mass_on_cables(stiffness=stiffness))
    start = plant.start(pose=[0, 0, -0.7, 0, 0, 0], lengths=[1.0])
    expected = -1 - dropped_mass(stiffness, 2.0, 0.3, 1.0)
    errors = []
    for count in (steps // 2, steps):
        end = plant.run(start, held(plant, count, [1.0]), 1.0 / count, keep=count).states[-1]
        errors.append(abs(plant.read(end).pose[2] - expected))
    assert errors[1] < 1e-9
    assert np.log2(errors[0] / errors[1]) > 3.5


@pytest.mark.parametrize("damping", [0.0, 200.0])
@pytest.mark.parametrize(("stiffness", "coarse"), [(1e4, 1), (1e5, 2), (1e6, 12)])
def test_the_order_of_convergence_survives_contacts(stiffness, coarse, damping):
    robot = load("wang-flying")
    plant = Plant(robot, stiffness=stiffness, damping=damping)
    lengths = lengths_at(robot) * (1 + np.random.default_rng(0).uniform(-20, 20, 6) / stiffness)
    start = plant.start(velocity=[0.2, 0.1, -0.1, 0.3, 0.2, 0.5], lengths=lengths)
    commands = held(plant, 500, lengths)
    runs = [plant.run(start, commands, 5e-4, substeps=coarse * n) for n in (1, 2, 4, 16)]
    slack = runs[-1].tensions == 0
    assert (np.diff(slack, axis=0) != 0).sum() > 5, "cables get slack and taut"
    poses = [plant.read(run.states[-1]).pose for run in runs]
    errors = [np.abs(pose - poses[-1]).max() for pose in poses[:-1]]
    assert np.log2(errors[0] / errors[2]) / 2 > 3.5


def energy(robot, plant, state, lengths, stiffness):
    """Return kinetic, potential and elastic energy of a robot whose carriers rest [J]."""
    now = plant.read(state)
    R, com = now.rotation, np.array(robot.platform.com)
    velocity = now.velocity[:3] + R @ np.cross(now.rate, com)
    kinetic = 0.5 * robot.platform.mass * velocity @ velocity + 0.5 * now.rate @ robot.inertia @ now.rate
    potential = -robot.platform.mass * np.dot(robot.gravity, now.pose[:3] + R @ com)
    stretch = np.maximum(lengths_at(robot, now.pose) - lengths, 0)
    return kinetic + potential + (0.5 * stiffness * stretch**2 / lengths).sum()


@pytest.mark.parametrize("name", ["wang-flying", "cogiro", "caroca-pulleys"])
def test_energy_is_kept_without_damping(name):
    robot, stiffness = load(name), 2e4
    plant = Plant(robot, stiffness=stiffness, damping=0)
    lengths = lengths_at(robot) * (1 + 2e-3 * np.random.default_rng(1).uniform(-1, 0.5, robot.m))
    start = plant.start(velocity=[0.3, 0.2, 0.4, 0.3, -0.2, 0.2], lengths=lengths)
    run = plant.run(start, held(plant, 500, lengths), 1e-3, substeps=40)
    assert (run.tensions == 0).any()
    assert (run.tensions > 0).any()
    energies = [energy(robot, plant, state, lengths, stiffness) for state in run.states[::50]]
    moving = energies[0] - energy(robot, plant, plant.start(), lengths_at(robot), stiffness)
    assert np.ptp(energies) < 1e-9 * abs(moving)


def test_a_stuck_winch_and_a_cut_cable_take_their_own_energy_and_no_other():
    """The work of motors is energy: a winch that sticks loses J v^2 / 2, a cut cable t^2 L / 2EA and its winch's.

    A cable that is wound up at the rate v, under the tension t, takes its strain energy t^2 / 2EA v with it.
    """
    J, EA, winch = 2.0, 2e4, {"inertia": 2.0, "friction": 0.0, "speed_max": 1e3, "force_max": 1e6}
    data = load("planar-4").model_dump(mode="json")
    for cable in data["cables"]:
        cable |= {"stiffness": EA, "damping": 0.0, "winch": winch}
    robot = Robot.model_validate(data)
    rest, plant = np.asarray(tensions(robot, robot.home).tensions), Plant(robot, drive="forces")
    held_cables, turning = np.ones(robot.m), np.ones(robot.m)

    def total(state):
        now = plant.read(state)
        stretched = np.maximum(lengths_at(robot, now.pose) - now.lengths, 0)
        own = 0.5 * EA * stretched**2 / now.lengths
        return (
            energy(robot, plant, state, now.lengths, EA)
            - own @ (1 - held_cables)
            + 0.5 * J * turning @ now.length_rates**2
        )

    state = plant.start(tensions=rest)
    expected, moved = total(state), 0.0
    for phase, pulls in enumerate(rest * (1 + 0.2 * np.sin(np.arange(3)[:, None] + np.arange(robot.m)))):
        if phase:  # a winch sticks, then the cable of another one is cut
            now, index = plant.read(state), 2 - phase
            t = EA * max(lengths_at(robot, now.pose)[index] / now.lengths[index] - 1, 0.0)
            lost = 0.5 * J * now.length_rates[index] ** 2 + (phase == 2) * t**2 / (2 * EA) * now.lengths[index]
            assert lost > 1e-4
            expected, turning[index] = expected - lost, 0.0
            state = (plant.stick if phase == 1 else plant.cut)(state, index)
            held_cables[index] = 2 - phase
        run = plant.run(state, held(plant, 1000, pulls), 2e-4)
        state, lengths = run.states[-1], plant.read(run.states).lengths
        strain = run.tensions**2 / (2 * EA)
        wound = np.diff(lengths, axis=0)
        expected -= turning @ (wound.sum(axis=0) * pulls + ((strain[1:] + strain[:-1]) / 2 * wound).sum(axis=0))
        moved += np.abs(wound).sum()
        assert total(state) == pytest.approx(expected, abs=1e-6)
    assert moved > 0.1


def test_a_pendulum_swings_in_the_period_of_the_elliptic_integral():
    from scipy.special import ellipk

    plant = Plant(mass_on_cables(dof=("x", "z")))
    angle = 1.0
    start = plant.start(pose=[np.sin(angle), 0, -np.cos(angle), 0, 0, 0])
    period = 4 * np.sqrt(1 / G) * ellipk(np.sin(angle / 2) ** 2)
    run = plant.run(start, held(plant, 1000, [1.0]), period / 1000, substeps=4)
    poses = plant.read(run.states).pose
    assert np.abs(poses[-1] - poses[0]).max() < 1e-9
    assert np.abs(np.hypot(poses[:, 0], poses[:, 2]) - 1).max() < 1e-12
    swing = np.arctan2(poses[:, 0], -poses[:, 2])
    speed_squared = 2 * G * (np.cos(swing) - np.cos(angle))
    assert np.abs(run.tensions[:, 0] - 2.0 * (G * np.cos(swing) + speed_squared)).max() < 1e-8


def test_a_cable_without_stiffness_catches_a_mass():
    """Falling 1 m from beside its anchor, it keeps of its velocity what is across the cable."""
    plant = Plant(mass_on_cables(dof=("x", "z")))
    start = plant.start(pose=[0.6, 0, 0, 0, 0, 0], lengths=[1.0])
    caught = np.sqrt(2 * 0.8 / G)
    before = plant.run(start, held(plant, 100, [1.0]), caught / 100 * (1 - 1e-9))
    assert np.abs(plant.read(before.states[-1]).velocity[2] + G * caught) < 1e-6
    after = plant.run(before.states[-1], held(plant, 1, [1.0]), 2e-9 * caught)
    along = np.array([0.6, -0.8])
    falling = np.array([0.0, -G * caught])
    expected = falling - along * (along @ falling)
    assert np.abs(plant.read(after.states[-1]).velocity[[0, 2]] - expected).max() < 1e-7
    assert after.tensions[-1, 0] == pytest.approx(2.0 * (expected @ expected + G * 0.8), rel=1e-6)


def momentum_and_energy(robot, plant, state):
    """Return momentum, angular momentum about the origin and kinetic energy of platform and carriers."""
    now = plant.read(state)
    linear, angular, energy = np.zeros(3), np.zeros(3), 0.0
    inertias = [robot.inertia] + [np.diag(carrier.body.inertia[:3]) for carrier in robot.carriers]
    masses = [robot.platform.mass] + [carrier.body.mass for carrier in robot.carriers]
    poses, velocities = np.vstack([now.pose, now.carrier_pose]), np.vstack([now.velocity, now.carrier_velocity])
    rates = np.vstack([now.rate, now.carrier_rate])
    rotations = np.concatenate([now.rotation[None], now.carrier_rotation])
    for m, inertia, pose, velocity, rate, R in zip(masses, inertias, poses, velocities, rates, rotations, strict=True):
        linear += m * velocity[:3]
        angular += m * np.cross(pose[:3], velocity[:3]) + R @ inertia @ rate
        energy += 0.5 * m * velocity[:3] @ velocity[:3] + 0.5 * rate @ inertia @ rate
    return np.concatenate([linear, angular]), energy


@pytest.mark.parametrize("name", ["multi-quadrotor-4", "flycrane", "wang-flying-quadrotor"])
def test_impacts_keep_momentum_and_never_gain_energy(name):
    """Nothing acts from outside on a load and its quadrotors that float without gravity."""
    robot = load(name).model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    plant, rng, impacts = Plant(robot, stiffness=0), np.random.default_rng(4), 0
    for trial in range(20):
        velocities = rng.normal(size=(1 + len(robot.carriers), 6))
        state = plant.start(velocity=velocities[0], carrier_velocity=velocities[1:])  # taut, with jumps ahead
        lengths = lengths_at(robot)
        if trial >= 15:
            lengths = lengths * rng.uniform(1.0, 1.005, robot.m)
            state = plant.start(velocity=velocities[0], carrier_velocity=velocities[1:], lengths=lengths)
        run = plant.run(state, held(plant, 200, lengths), 1e-3, substeps=4)
        values = [momentum_and_energy(robot, plant, state) for state in (state, *run.states[::20])]
        momenta, energies = np.array([value[0] for value in values]), np.array([value[1] for value in values])
        scale = max(1, np.abs(momenta).max())
        assert np.abs(momenta[1] - momenta[0]).max() < 1e-12 * scale, "the first impact"
        # Between impacts lengths are held by shifts of some 1e-12 m, which turn a little angular momentum.
        assert np.ptp(momenta[:, :3], axis=0).max() < 1e-12 * scale
        assert np.ptp(momenta, axis=0).max() < 1e-9 * scale
        assert (np.diff(energies) < 1e-10 * energies[0]).all()
        impacts += energies[-1] < 0.999 * energies[0]
        now = plant.read(run.states)
        stretched = Dynamics(robot).cable_lengths(now.pose, now.carrier_pose) - lengths
        assert stretched.max() < 1e-11
        assert (run.tensions >= 0).all()
    assert impacts > 10


STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


@pytest.mark.parametrize(
    ("name", "stiffness"),
    [
        ("wang-flying", 2e3),
        ("wang-flying-quadrotor", 2e3),
        ("caroca-pulleys", 2e3),
        ("example-spatial", 2e3),
        ("planar-4", 2e3),
        ("wang-ctmrts", None),
        ("multi-quadrotor-3", None),
        ("flycrane", None),
        ("cogiro", 0),
        ("caroca-pulleys", 0),
    ],
)
def test_inverse_dynamics_gives_the_tensions_back(name, stiffness):
    """Differentiate the velocities of a simulated motion, and compute the wrench that they need by `Dynamics`."""
    robot = load(name)
    dynamics, plant = Dynamics(robot), Plant(robot, stiffness=stiffness, damping=5.0 if stiffness else None)
    dt, count = 2e-4, len(robot.carriers)
    rng = np.random.default_rng(5)
    velocity = robot.dof_mask * rng.normal(size=6) * 0.1
    shape = (9, count, 6)
    others = {}
    if any(carrier.kind == "prescribed" for carrier in robot.carriers):
        t = dt * np.arange(9)[:, None, None]
        jerky = rng.normal(size=(3, count, 6))
        others = {
            "carrier_pose": robot.carrier_home + t * jerky[0] + t**2 / 2 * jerky[1],
            "carrier_velocity": jerky[0] + t * jerky[1],
            "carrier_acceleration": np.broadcast_to(jerky[1], shape),
        }
    if any(carrier.kind == "mobile" for carrier in robot.carriers):
        others["carrier_pose"] = robot.carrier_home + 0.01
    if any(carrier.kind == "quadrotor" for carrier in robot.carriers):
        others["actuation"] = [[1.3 * c.mass * G + robot.weight / count, 0.02, -0.01, 0.03] for c in robot.carriers]
    if robot.platform.aero:
        others["wind"] = [3.0, -2.0, 1.0]
    lengths = lengths_at(robot) * (1 - 10.0 / stiffness if stiffness else 1)
    start = plant.start(velocity=velocity, lengths=lengths)
    commands = plant.command(lengths, **others)
    commands = np.broadcast_to(commands, (9, commands.shape[-1]))
    run = plant.run(start, commands, dt, substeps=4)
    middle = plant.read(run.states[4])
    accelerations = STENCIL @ plant.read(run.states[:9]).velocity / dt
    w = dynamics.required_wrench(middle.pose, middle.velocity, accelerations, wind=others.get("wind"))
    A = dynamics.wrench_matrix(middle.pose, middle.carrier_pose)
    rows = robot.dof_mask > 0
    assert (run.tensions[4] > 0).any()
    assert np.abs(A[rows] @ run.tensions[4] - w[rows]).max() < 1e-8 * max(1.0, np.abs(w).max())


def test_wang_flying_runs_300_times_as_fast_as_time():
    robot = load("wang-flying")
    plant = Plant(robot)
    start = plant.start(tensions=np.full(6, 3.0), velocity=[0.1, 0, 0, 0, 0, 0.1])
    commands = held(plant, 10_000, plant.read(start).lengths, wind=[1.0, 0, 0])
    plant.run(start, commands[:2], 1e-3)
    times = []
    for _ in range(5):
        begun = time.process_time()
        plant.run(start, commands, 1e-3, keep=100)
        times.append(time.process_time() - begun)
    assert min(times) < 10.0 / 300


@pytest.mark.parametrize(("name", "stiffness"), [("wang-flying", None), ("wang-flying", 0), ("flycrane", None)])
def test_batches_and_threads_give_the_bits_of_single_rows(name, stiffness):
    robot = load(name)
    plant = Plant(robot, stiffness=stiffness)
    rng = np.random.default_rng(2)
    starts = plant.start(velocity=rng.normal(size=(5, 6)), tensions=rng.uniform(0, 5, (5, 6)))
    lengths = lengths_at(robot) * rng.uniform(0.99, 1.01, (5, 30, 6))
    poses = robot.carrier_home + 1e-3 * rng.normal(size=(5, 30, len(robot.carriers), 6))
    moves = rng.random((2, 5, 30, 1, 1)) < 0.5  # some carriers move in some steps, and rest in others
    velocities, accelerations = moves * rng.normal(size=(2, *poses.shape))
    commands = plant.command(lengths, None, poses, velocities, accelerations, wrench=rng.normal(size=(5, 30, 6)))
    all_rows = plant.run(starts, commands, 1e-3, threads=1)
    shared = plant.run(starts, commands, 1e-3, threads=3)
    assert (all_rows.states == shared.states).all()
    state = starts[3]
    for k in range(30):
        state = plant.step(state, commands[3, k], 1e-3)
        assert (plant.read(state).lengths == plant.read(all_rows.states[3, k + 1]).lengths).all()
    assert (state == all_rows.states[3, -1]).all()
    assert plant.run(starts[:, None], commands[None, :], 1e-3).states.shape == (5, 5, 31, plant.size)


def test_commanded_tensions_pull_as_they_are_and_lag_if_wanted():
    robot = load("cogiro")
    dynamics = Dynamics(robot)
    exact = Plant(robot, drive="tensions")
    w = dynamics.required_wrench(robot.home, np.zeros(6), np.zeros(6))
    t = np.linalg.lstsq(dynamics.wrench_matrix(robot.home), w, rcond=None)[0]
    run = exact.run(exact.start(), held(exact, 10, np.maximum(t, 0)), 1e-3)
    assert run.tensions == pytest.approx(np.broadcast_to(np.maximum(t, 0), run.tensions.shape))
    lagging = Plant(robot, drive="tensions", tension_lag=0.01)
    run = lagging.run(lagging.start(), held(lagging, 20, np.full(8, 500.0)), 1e-3)
    assert run.tensions[:, 0] == pytest.approx(500 * (1 - np.exp(-run.times / 0.01)), abs=1e-3)


WINCH = {"inertia": 0.5, "friction": 3.0, "speed_max": 2.0, "force_max": 100.0}


def test_a_winch_sticks_slips_and_stops():
    """A weight of 19.62 N pulls cable from a winch whose motor pulls with less; friction holds within 3 N."""
    robot = mass_on_cables(dof=("z",), winch=WINCH)
    plant = Plant(robot, drive="forces")
    rest = plant.start(lengths=[1.0])
    for force in (2 * G - 2.9, 2 * G + 2.9):
        run = plant.run(rest, held(plant, 10, [force]), 1e-2)
        assert plant.read(run.states[-1]).pose[2] == pytest.approx(-1.0, abs=1e-12)
        assert run.tensions[-1, 0] == pytest.approx(2 * G, rel=1e-12)
    run = plant.run(rest, held(plant, 10, [2 * G - 5]), 1e-2)
    acceleration = -2.0 / (2.0 + 0.5)  # 5 N less 3 N of friction, on mass and winch
    assert plant.read(run.states).pose[:, 2] == pytest.approx(-1 + acceleration * run.times**2 / 2, abs=1e-12)
    # Then the motor brakes: 6 N and friction stop it, after which 6 N haul it in, against friction.
    speed = acceleration * 0.1
    braked = plant.run(run.states[-1], held(plant, 100, [2 * G + 6]), 1e-2)
    stopped = -speed / (9 / 2.5)
    low = plant.read(run.states[-1]).pose[2] + speed * stopped / 2
    later = np.maximum(braked.times - stopped, 0)
    after = braked.times > stopped
    expected = low + (3 / 2.5) * later**2 / 2
    assert plant.read(braked.states).pose[after, 2] == pytest.approx(expected[after], abs=1e-9)


def test_elastic_winches_converge_through_stick_and_slip():
    plant = Plant(mass_on_cables(dof=("z",), winch=WINCH, stiffness=2e3, damping=1.0), drive="forces")
    start = plant.start(lengths=[0.98])
    ends = []
    for substeps in (2, 4, 8, 32):
        run = plant.run(start, held(plant, 200, [2 * G - 2.0]), 2e-3, substeps=substeps)
        ends.append(plant.read(run.states[-1]).pose[2])
    rates = plant.read(run.states).length_rates[:, 0]
    assert (rates == 0).any()
    assert (rates > 0).any()
    errors = [abs(end - ends[-1]) for end in ends[:-1]]
    assert np.log2(errors[0] / errors[2]) / 2 > 3.5


def test_a_servo_winch_follows_lengths_inside_its_limits():
    plant = Plant(mass_on_cables(dof=("z",), winch=WINCH, stiffness=1e4, damping=50.0))
    t = 1e-3 * np.arange(1, 1501)
    wanted = 1 + 0.2 * (1 - np.cos(2 * t))
    commands = plant.command(wanted[:, None])
    run = plant.run(plant.start(lengths=[1.0]), commands, 1e-3)
    assert np.abs(plant.read(run.states).lengths[1:, 0] - wanted).max() < 1e-4
    jump = plant.run(plant.start(lengths=[1.0]), held(plant, 1000, [4.0]), 1e-3)
    rates = plant.read(jump.states).length_rates[:, 0]
    assert rates.max() == pytest.approx(2.0, rel=1e-6)
    assert plant.read(jump.states).lengths[-1, 0] < 3.01


def test_lengths_are_reached_and_rates_integrated():
    robot = mass_on_cables(stiffness=1e4, damping=20.0)
    wanted = np.linspace(1.0, 1.2, 51)[1:, None]
    plant = Plant(robot)
    run = plant.run(plant.start(), plant.command(wanted), 1e-2, substeps=5)
    assert plant.read(run.states).lengths[1:] == pytest.approx(wanted, abs=1e-14)
    rates = Plant(robot, drive="rates")
    run_of_rates = rates.run(rates.start(), held(rates, 50, [0.4]), 1e-2, substeps=5)
    assert run_of_rates.states[-1, :26] == pytest.approx(run.states[-1, :26], abs=1e-12)


def test_mobile_carriers_stay_inside_their_limits():
    robot = load("wang-ctmrts")
    plant = Plant(robot)
    home = robot.carrier_home
    far = home.copy()
    far[0, 0] += 2.0
    commands = held(plant, 3000, lengths_at(robot) + 2.0, carrier_pose=far)
    now = plant.read(plant.run(plant.start(), commands, 1e-3).states)
    speeds = np.linalg.norm(now.carrier_velocity[:, 0, :3], axis=1)
    assert speeds.max() == pytest.approx(robot.carriers[0].speed_max, rel=1e-3)
    assert speeds.max() < robot.carriers[0].speed_max * (1 + 1e-9)
    assert np.abs(np.diff(speeds)).max() < robot.carriers[0].acceleration_max * 1e-3 * (1 + 1e-6)
    assert now.carrier_pose[-1, 0] == pytest.approx(far[0], abs=1e-6)
    assert (now.carrier_pose[:, 1:] == home[1:]).all()
    # Inside its limits it is a critically damped lag: 1 - (1 + w t) exp(-w t).
    near = home.copy()
    near[0, 1] += 1e-3
    run = plant.run(plant.start(), held(plant, 100, lengths_at(robot) + 2.0, carrier_pose=near), 2e-3)
    moved = plant.read(run.states).carrier_pose[:, 0, 1] - home[0, 1]
    assert moved == pytest.approx(1e-3 * (1 - (1 + 20 * run.times) * np.exp(-20 * run.times)), abs=1e-9)


def test_a_quadrotor_tumbles_through_vertical_pitch():
    """Without cables it turns as a free body: by a torque about its y axis, at a constant angular acceleration."""
    robot = load("wang-flying-quadrotor")
    plant = Plant(robot)
    start = plant.start(lengths=np.full(6, 100.0))
    run = plant.run(start, held(plant, 1000, np.full(6, 100.0), actuation=[[0, 0, 0.3, 0]]), 1e-3)
    angle = 0.5 * (0.3 / 0.06) * run.times**2
    assert angle[-1] > np.pi / 2
    now = plant.read(run.states)
    assert now.carrier_rotation[:, 0, 2, 2] == pytest.approx(np.cos(angle), abs=1e-9)
    assert now.carrier_rate[:, 0, 1] == pytest.approx(0.3 / 0.06 * run.times, abs=1e-9)
    assert now.carrier_pose[:, 0, 2] == pytest.approx(-0.5 * G * run.times**2, abs=1e-9)


def test_cut_and_stuck_cables():
    robot = load("wang-flying")
    plant = Plant(robot)
    start = plant.start(tensions=np.full(6, 3.0))
    lengths = plant.read(start).lengths
    for cut in (plant.cut(start, 2), plant.stick(plant.cut(start, 2), 2)):  # no winch makes it whole again
        run = plant.run(cut, held(plant, 100, lengths), 1e-3)
        assert (run.tensions[:, 2] == 0).all()
        assert (run.tensions[:, 3] > 0).all()
    stuck = plant.run(plant.stick(start, 1), held(plant, 100, lengths - 0.01), 1e-3)
    assert (plant.read(stuck.states).lengths[:, 1] == lengths[1]).all()
    assert plant.read(stuck.states).lengths[-1, 0] == pytest.approx(lengths[0] - 0.01)
    for drive in ("lengths", "tensions"):
        plant = Plant(load("multi-quadrotor-3"), drive=drive)
        start = plant.start()
        for cable in range(3):
            start = plant.cut(start, cable)
        falling = plant.run(start, held(plant, 100, np.ones(3)), 1e-2)
        assert plant.read(falling.states).pose[:, 2] == pytest.approx(-0.5 * G * falling.times**2, abs=1e-9)
        assert (falling.tensions == 0).all()


def test_cables_of_no_length_and_redundant_ones_stay_finite():
    for stiffness in (1e4, None):
        robot = mass_on_cables(cables=3) if stiffness is None else mass_on_cables(cables=3, stiffness=stiffness)
        plant = Plant(robot)
        start = plant.start(tensions=np.full(3, 2 * G / 3))
        run = plant.run(start, held(plant, 200, plant.read(start).lengths), 1e-3)
        assert plant.read(run.states).pose[:, 2] == pytest.approx(-1, abs=1e-12)
        assert run.tensions.sum(axis=1) == pytest.approx(2 * G, rel=1e-9)
        for drive in ("lengths", "tensions"):
            plant = Plant(robot, drive=drive)
            at_anchor = plant.start(pose=np.zeros(6), lengths=np.ones(3))
            run = plant.run(at_anchor, held(plant, 300, np.ones(3)), 1e-3)
            assert np.isfinite(run.states).all()
            assert np.isfinite(run.tensions).all()


def test_fully_constrained_cables_without_stiffness_hold_the_platform():
    robot = load("ipanema-1")
    plant = Plant(robot)
    run = plant.run(plant.start(), held(plant, 100, lengths_at(robot)), 1e-3)
    assert np.abs(plant.read(run.states).pose - robot.home).max() < 1e-9
    w = Dynamics(robot).required_wrench(robot.home, np.zeros(6), np.zeros(6))
    assert Dynamics(robot).wrench_matrix(robot.home) @ run.tensions[-1] == pytest.approx(w, abs=1e-6)
    # Cables above and below the platform: no pose has all lengths if one cable is shorter by anything.
    for shorter in (1e-6, 1e-3):
        lengths = lengths_at(robot) - shorter * np.eye(8)[0]
        with pytest.raises(SolverError, match="give the cables a stiffness if no pose has the commanded lengths"):
            plant.run(plant.start(), held(plant, 100, lengths), 1e-3)
    # With play, no cable is longer than its length.
    slacker = lengths_at(robot) + np.random.default_rng(1).uniform(1e-4, 1e-3, 8)
    run = plant.run(plant.start(lengths=slacker), held(plant, 100, slacker), 1e-3)
    assert (Dynamics(robot).cable_lengths(plant.read(run.states).pose) <= slacker + 1e-9).all()


def test_wrong_input_is_one_line():
    robot = load("wang-flying")
    plant = Plant(robot)
    start, lengths = plant.start(), np.ones(6)
    command = plant.command(lengths)
    for dt in (0.0, -1e-3, float("nan"), "1"):
        with pytest.raises(InputError, match="dt must be a number from 1e-12"):
            plant.step(start, command, dt)
    with pytest.raises(InputError, match="cables must be finite numbers, got nan at index"):
        plant.command([1, 1, np.nan, 1, 1, 1])
    with pytest.raises(InputError, match="commands must be finite numbers, got nan"):
        plant.step(start, command * np.nan, 1e-3)
    with pytest.raises(InputError, match=r"cables must be lengths >= 0.001 m, got 0 m"):
        plant.command(np.zeros(6))
    with pytest.raises(InputError, match=r"commands must have the shape \(\.\.\., K, 46\)"):
        plant.run(start, np.zeros((3, 4)), 1e-3)
    with pytest.raises(InputError, match="state must"):
        plant.step(start[:-1], command, 1e-3)
    with pytest.raises(InputError, match="cable must be a whole number from 0 to 5"):
        plant.cut(start, 6)
    with pytest.raises(InputError, match="drive must be one of lengths, rates, forces, tensions"):
        Plant(robot, drive="torque")
    with pytest.raises(InputError, match=r"drive must not be 'forces' unless every cable has a winch, got none in"):
        Plant(robot, drive="forces")
    with pytest.raises(InputError, match=r"contacts must be 'located' unless all cables stretch"):
        Plant(load("cogiro"), contacts="sampled")
    with pytest.raises(InputError, match="wind must be left out for robot 'cogiro'"):
        Plant(load("cogiro")).command(np.ones(8), wind=[1, 0, 0])
    with pytest.raises(InputError, match="lengths must be None if tensions are given"):
        plant.start(tensions=np.ones(6), lengths=np.ones(6))
    with pytest.raises(InputError, match="stiffness must be finite numbers >= 0"):
        Plant(robot, stiffness=-1.0)
    with pytest.raises(SolverError, match=r"diverges in steps of 0\.5 s"):
        plant.run(plant.start(lengths=np.full(6, 0.5)), held(plant, 1000, np.full(6, 0.5)), 0.5)


def test_states_are_read_as_they_are_made():
    robot = load("cogiro")
    plant, rng = Plant(robot), np.random.default_rng(7)
    poses, velocities = rng.uniform(-1.5, 1.5, (50, 6)), rng.normal(size=(50, 6))
    carriers = rng.uniform(-1.5, 1.5, (50, 1, 6))
    now = plant.read(plant.start(poses, velocities, carriers, lengths=np.ones(8)))
    assert now.pose == pytest.approx(poses, abs=1e-12)
    assert now.velocity == pytest.approx(velocities, abs=1e-9)
    assert now.carrier_pose == pytest.approx(carriers, abs=1e-12)
    assert now.rotation == pytest.approx(rotations(poses[:, 3:]), abs=1e-14)
    assert (now.lengths == 1).all()
    moving = plant.read(plant.start(carrier_velocity=np.ones((1, 6))))
    assert (moving.carrier_velocity == 0).all(), "the ground"


def test_hostile_commands_leave_finite_states():
    """Jumps of commands, of carriers and of thrusts, cuts and stuck winches, on random robots and drives."""
    rng = np.random.default_rng(11)
    for name in [
        "wang-flying",
        "wang-flying-printed",
        "flycrane",
        "wang-ctmrts-5",
        "cogiro",
        "planar-4",
        "point-mass-3",
    ]:
        for drive in ("lengths", "rates", "forces", "tensions"):
            data = load(name).model_dump(mode="json")
            for cable in data["cables"]:
                cable |= {"winch": WINCH | {"friction": rng.choice([0.0, 2.0])}} if drive == "forces" else {}
            robot = Robot.model_validate(data)
            plant = Plant(robot, drive=drive, stiffness=rng.choice([0.0, 2e4]), damping=rng.choice([0.0, 50.0]))
            lengths, count = lengths_at(robot), len(robot.carriers)
            state = plant.start(
                velocity=robot.dof_mask * rng.normal(size=6), lengths=lengths * rng.uniform(0.98, 1.02, robot.m)
            )
            state = plant.stick(plant.cut(state, 0), 1)
            size = {"lengths": lengths, "rates": 0.5}.get(drive, 3 * robot.force_scale / robot.m)
            cables = size * rng.uniform(0.95 if drive == "lengths" else -0.5, 1.05, (40, robot.m))
            actuators = max(len(carrier.actuators) for carrier in robot.carriers)
            commands = plant.command(
                cables.repeat(5, axis=0),
                actuation=rng.uniform(-1e3, 1e3, (200, count, actuators)),
                carrier_pose=robot.carrier_home + 0.02 * rng.normal(size=(200, count, 6)),
            )
            run = plant.run(state, commands, 1e-3)
            assert np.isfinite(run.states).all()
            assert (run.tensions >= 0).all()
            assert (run.tensions[:, 0] == 0).all()
