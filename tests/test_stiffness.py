"""Stiffness and natural frequencies against the plant and simulations, and the stiffest tensions against grids."""

import time

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from towline import Dynamics, simulate, solve_batch, tensions
from towline.base.errors import InputError
from towline.control import LengthControl
from towline.plant import Plant
from towline.statics.stiffness import natural_frequencies, stiffest

from .framed import framed
from .stiff_robots import elastic, inertia


def displaced(robot, pose, delta):
    R = Rotation.from_euler("ZYX", pose[5:2:-1])
    turned = Rotation.from_rotvec(delta[3:]) * R
    com = np.array(robot.platform.com)
    return np.r_[pose[:3] + R.apply(com) + delta[:3] - turned.apply(com), turned.as_euler("ZYX")[::-1]]


@pytest.mark.parametrize("pulleys", [None, {"radius": 0.15}])
def test_stiffness_is_the_difference_of_the_plants_forces(pulleys):
    """From rest, the plant of displaced platforms with the same unstrained lengths accelerates by -M^-1 K delta."""
    robot = elastic("ipanema-2", 2e4, pulleys=pulleys)
    pose = robot.home + np.array([0.7, -0.4, 0.3, 0.1, -0.2, 0.3])
    pulls = tensions(robot, pose, t_ref=60.0).tensions
    plant, dt, step = Plant(robot), 1e-6, 2e-4
    lengths = plant.read(plant.start(pose, tensions=pulls)).lengths
    poses = np.array([displaced(robot, pose, sign * delta) for delta in step * np.eye(6) for sign in (1, -1)])
    start = plant.start(poses, lengths=lengths)
    after = plant.run(start, np.tile(plant.command(lengths), (12, 1, 1)), dt).states[:, -1]
    spin = np.einsum("nij,nj->ni", plant.read(after).rotation, plant.read(after).rate) / dt
    com = np.einsum("nij,j->ni", plant.read(start).rotation, robot.platform.com)
    linear = plant.read(after).velocity[:, :3] / dt + np.cross(spin, com)
    forces = np.array([inertia(robot, at) @ np.r_[a, b] for at, a, b in zip(poses, linear, spin, strict=True)])
    K = Dynamics(robot).stiffness(pose, pulls)
    assert_allclose(K, -(forces[::2] - forces[1::2]).T / (2 * step), rtol=1e-6, atol=1e-6 * np.abs(K).max())


def test_a_platform_that_is_pushed_swings_at_its_natural_frequencies():
    """Lengths are held after a short push: the peaks of the motion's spectrum are the natural frequencies."""
    robot = elastic("ipanema-2", 3e3, t_min=40.0, inertia=[0.7, 1.1, 1.6, 0.1, 0.05, -0.1])
    pilot = LengthControl(robot, proportional=0, integral=0)
    push = "push 6 -4 5 0.9 1.2 -0.8 at 0 for 0.02"
    run = simulate(robot, robot.home, controller=pilot, duration=12.0, events=[push], period=4e-3)
    assert run.passed
    motion = run.trajectory["pose"].values[10:]
    count = 8 * len(motion)
    spectrum = np.abs(np.fft.rfft((motion - motion.mean(0)) * np.hanning(len(motion))[:, None], count, axis=0))
    spectrum /= spectrum.max(axis=0)
    inner = spectrum[1:-1]
    peaks = (inner > spectrum[:-2]) & (inner > spectrum[2:]) & (inner > 0.5)
    seen = np.fft.rfftfreq(count, 4e-3)[1:-1][peaks.any(axis=1)]
    expected = natural_frequencies(robot, robot.home, tensions(robot, robot.home).tensions)
    nearest = np.abs(seen[:, None] / expected - 1)
    assert nearest.min(axis=0).max() < 0.01  # each frequency has a peak
    assert nearest.min(axis=1).max() < 0.01  # each peak has a frequency


def test_frequencies_of_many_poses_are_generalised_eigenvalues():
    robot = elastic("ipanema-2", 1e4, inertia=[0.7, 1.1, 1.6, 0.1, 0.05, -0.1])
    rng = np.random.default_rng(1)
    poses = robot.home + 0.3 * rng.normal(size=(20, 6))
    pulls = rng.uniform(5, 100, (20, 8))
    found = natural_frequencies(robot, poses, pulls)
    for pose, t, f in zip(poses, pulls, found, strict=True):
        K = Dynamics(robot).stiffness(pose, t)
        squares = eigh((K + K.T) / 2, inertia(robot, pose), eigvals_only=True)
        assert_allclose(f, np.sqrt(squares) / (2 * np.pi), rtol=1e-9)
        assert_allclose(f, Dynamics(robot).natural_frequencies(pose, t, elastic=True)[0], rtol=1e-9)


def test_a_locked_platform_has_the_frequencies_of_what_is_free():
    """A platform in a plane between two vertical pairs of cables: stiffness by hand."""
    EA, b, mass, turning, t = 1e4, 0.5, 3.0, 0.4, 50.0
    ends = [((x, 0, z), (x, 0, 0)) for x in (-b, b) for z in (-2, 2)]
    platform = {"mass": mass, "inertia": [1, turning, 1, 0, 0, 0], "dof": ["x", "z", "pitch"], "home": [0] * 6}
    robot = framed(ends, platform, t_min=1, t_max=99, stiffness=EA)
    up = 4 * (EA + t) / 2.0  # of E A / L0 with L0 = 2 m / (1 + t / E A)
    sideways = 4 * t / 2.0
    turn = up * b**2  # the pulls on the turned arms cancel
    expected = np.sqrt([sideways / mass, up / mass, turn / turning]) / (2 * np.pi)
    assert_allclose(natural_frequencies(robot, robot.home, np.full(4, t)), np.sort(expected), rtol=1e-12)


def problems():
    """Yield robots with poses, 200 in total, that have tensions above 1 N."""
    rng = np.random.default_rng(7)
    for name, centre, half in (("ipanema-2", (0, 0, 2.75), (2, 1.5, 0.75)), ("cogiro", (0, 0, 1.75), (4, 3, 1.25))):
        for EA in (1e3, 1e4, 1e5, 1e6):
            robot = elastic(name, EA)
            poses = np.zeros((60, 6))
            poses[:, :3] = centre + np.array(half) * rng.uniform(-1, 1, (60, 3))
            poses[:, 3:] = 0.05 * rng.normal(size=(60, 3))
            w = Dynamics(robot).required_wrench(robot.home, np.zeros(6), np.zeros(6))
            A = Dynamics(robot).wrench_matrix(poses)
            feasible = np.flatnonzero(solve_batch(A, w, robot.t_min, robot.t_max).feasible)[:25]
            assert feasible.size == 25
            for i in feasible:
                yield robot, poses[i], A[i], w


def test_no_tensions_on_a_grid_are_stiffer():
    gains, spent, count = [], [], 0
    for robot, pose, A, w in problems():
        before = time.process_time()
        found = stiffest(robot, pose)
        spent.append(time.process_time() - before)
        t = found.solution.tensions
        count += 1
        assert found.solution.status == "optimal"
        assert_allclose(A @ t, w, atol=1e-6)
        lowest = natural_frequencies(robot, pose, t)[0]
        assert_allclose(found.frequency, lowest, rtol=1e-9)
        assert lowest * (1 - 1e-9) <= found.bound <= lowest * (1 + 1e-6)
        N = np.linalg.svd(A)[2][6:]
        corners = np.abs(robot.t_max.max() - robot.t_min.min()) * np.sqrt(8)
        axis = np.linspace(-corners, corners, 125)
        grid = t + np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2) @ N
        grid = grid[((grid >= robot.t_min) & (grid <= robot.t_max)).all(axis=1)]
        grid = grid[:: max(1, len(grid) // 100)]
        near = t + 1e-3 * corners * np.random.default_rng(count).normal(size=(50, 2)) @ N
        grid = np.vstack([grid, near[((near >= robot.t_min) & (near <= robot.t_max)).all(axis=1)]])
        if len(grid):
            assert natural_frequencies(robot, pose, grid)[:, 0].max() <= found.bound * (1 + 1e-9)
        gains.append(lowest / natural_frequencies(robot, pose, tensions(robot, pose).tensions)[0] - 1)
    assert count == 200
    assert min(gains) > -1e-6
    assert np.median(spent) < 5e-3  # about 0.9 ms, on a machine that does nothing else


def test_what_has_no_stiffest_tensions():
    robot = elastic("ipanema-2", 1e4)
    far = stiffest(robot, [0, 0, 9, 0, 0, 0])
    assert far.solution.status == "infeasible"
    assert far.solution.certificate is not None
    assert np.isnan(far.frequency)
    pushed = stiffest(robot, robot.home, w=[0, 0, 150, 0, 0, 0])
    assert_allclose(Dynamics(robot).wrench_matrix(robot.home)[:3] @ pushed.solution.tensions, [0, 0, 150], atol=1e-6)
    for wrong, message in (
        (lambda: stiffest("ipanema-2", robot.home), r"cables\[0\].t_min must be above 0 N"),
        (lambda: stiffest(elastic("ipanema-2", None), robot.home), r"cables\[0\].stiffness must be E A > 0"),
        (lambda: stiffest(robot, [0, 0]), "pose must have the shape"),
        (lambda: stiffest(robot, np.tile(robot.home, (2, 1))), "pose must belong to one instant"),
        (lambda: stiffest(robot, robot.home, w=[1, 2]), "w must"),
        (lambda: stiffest(robot, robot.home, w=np.full(6, np.nan)), "w must"),
        (lambda: natural_frequencies(robot, robot.home, [1.0]), "tensions must have the shape"),
    ):
        with pytest.raises(InputError, match=message):
            wrong()
