"""Forward kinematics in C: no warning, nothing for sanitizers to find in any numbers, and the right curvature."""

import subprocess

import numpy as np
import pytest

from towline import available, load
from towline.core import one_pose_from_lengths, pose_covariance, pose_from_lengths
from towline.models import points
from towline.models.dynamics import dynamics_of
from towline.models.record import record_of

from .c_programs import program_of, sources_of, watched_objects

NONSENSE = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300, 0.0]
SIZES = [21, 6, None, 1, 36]  # numbers a row that the program writes: curvature, pose, errors, steps, covariance


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """Return a program that computes poses from lengths, which sanitizers watch."""
    parts = watched_objects(tmp_path_factory, sources_of("pose", "numbers/processor.c"))
    return program_of(tmp_path_factory, "core_pose.c", parts)


def cases(robot, rows, seed):
    """Return carriers, lengths with noise, weights, and poses to start from."""
    rng = np.random.default_rng(seed)
    poses = robot.home + 0.1 * rng.uniform(-1, 1, (rows, 6)) * robot.dof_mask
    carriers = robot.carrier_home + rng.normal(0, 0.05, (rows, len(robot.carriers), 6))
    lengths = dynamics_of(robot).cable_lengths(poses, carriers) + rng.normal(0, 1e-3, (rows, robot.m))
    return carriers, lengths, rng.uniform(500, 1000, robot.m), poses + rng.normal(0, 0.02, (rows, 6)) * robot.dof_mask


def run(program, robot, arrays, damping=1e-3):
    """Return what the program writes, one array for each of `SIZES`."""
    rows = len(arrays[0])
    given = b"".join(np.ascontiguousarray(array).tobytes() for array in (record_of(robot), *arrays))
    done = subprocess.run(
        [program, str(rows), str(damping)], input=given, capture_output=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr.decode()
    sizes = [rows * (robot.m if size is None else size) for size in SIZES]
    parts = np.split(np.frombuffer(done.stdout), np.cumsum(sizes)[:-1])
    return [part.reshape(rows, -1) if rows else part for part in parts]


@pytest.mark.parametrize("name", available())
def test_any_numbers_are_safe_and_harm_no_other_row(program, name):
    """Of 26 rows half have a number that is none, infinite, huge, tiny or zero; the extension gives the same bits."""
    robot, rng, rows = load(name), np.random.default_rng(6), 26
    carriers, lengths, weights, starts = cases(robot, rows, 5)
    good = run(program, robot, (carriers, lengths, weights, starts))
    for row in range(0, rows, 2):
        array = (carriers, lengths, starts)[row // 2 % 3][row]
        array.flat[rng.integers(array.size)] = rng.choice(NONSENSE)
    mixed = run(program, robot, (carriers, lengths, weights, starts))
    for before, after in zip(good, mixed, strict=True):
        np.testing.assert_array_equal(before[1::2], after[1::2])
    poses, errors, steps = starts.copy(), np.empty((rows, robot.m)), np.empty(rows)
    covariances = np.empty((rows, 6, 6))
    record, given = record_of(robot), (lengths, weights, robot.dof_mask, np.array(1e-3))
    pose_from_lengths(record, carriers, *given, poses, errors, steps)
    pose_covariance(record, carriers, weights, poses, covariances)
    for of_program, own in zip(mixed[1:], (poses, errors, steps, covariances), strict=True):
        np.testing.assert_array_equal(of_program, own.reshape(rows, -1))


def test_no_rows_are_no_work(program):
    robot = load("cogiro")
    assert not any(part.size for part in run(program, robot, cases(robot, 0, 1)))


@pytest.mark.parametrize("name", ["caroca-pulleys", "cogiro", "planar-4", "multi-quadrotor-6"])
def test_the_curvature_is_that_of_the_lengths(program, name):
    """The second derivative of the lengths, by differences over small displacements and turns."""
    robot, rows, h = load(name), 5, 1e-4
    carriers, lengths, weights, poses = cases(robot, rows, 12)
    lengths += 0.3
    found = run(program, robot, (carriers, lengths, weights, poses))[0]
    dynamics, steps = dynamics_of(robot), h * np.eye(6) * robot.dof_mask
    for row in range(rows):
        factors = (dynamics.cable_lengths(poses[row], carriers[row]) - lengths[row]) * weights**2

        def weighted(step, row=row, factors=factors):
            return factors @ dynamics.cable_lengths(points.moved(poses[row], step), carriers[row])

        expected = np.zeros((6, 6))
        for j, a in enumerate(steps):
            for k, b in enumerate(steps):
                expected[j, k] = weighted(a + b) - weighted(a - b) - weighted(b - a) + weighted(-a - b)
        expected = expected[np.tril_indices(6)] / (4 * h * h)
        np.testing.assert_allclose(found[row], expected, atol=2e-6 * np.abs(expected).max())


def test_arrays_that_do_not_fit_are_refused():
    robot = load("cogiro")
    given = [record_of(robot), *cases(robot, 3, 2)]
    given[4:4] = [robot.dof_mask, np.array(0.0)]  # before the poses
    results = np.empty((3, 8)), np.empty(3)
    pose_from_lengths(*given, *results)
    for place in range(1, len(given)):
        wrong = [array if i != place else np.append(array, 0.0) for i, array in enumerate(given)]
        with pytest.raises(ValueError, match="rows of the sizes that fit it"):
            pose_from_lengths(*wrong, *results)


@pytest.mark.parametrize("name", ["caroca-pulleys", "cogiro", "planar-4", "multi-quadrotor-6"])
def test_one_pose_has_the_bits_of_a_row(name):
    robot = load(name)
    carriers, lengths, weights, starts = cases(robot, 4, 7)
    record, sigma = record_of(robot), 1 / weights
    poses, errors, steps, covariances = starts.copy(), np.empty((4, robot.m)), np.empty(4), np.empty((4, 6, 6))
    pose_from_lengths(record, carriers, lengths, 1 / sigma, robot.dof_mask, np.array(0.0), poses, errors, steps)
    pose_covariance(record, carriers, 1 / sigma, poses, covariances)
    for row in range(4):
        pose, residuals, covariance = starts[row].copy(), np.empty(robot.m), np.empty((6, 6))
        given = [record, carriers[row], lengths[row], sigma, pose, residuals, covariance]
        assert one_pose_from_lengths(*given) is bool(steps[row] > 0)
        for one, of_rows in zip(given[4:], (poses[row], errors[row] * sigma, covariances[row]), strict=True):
            np.testing.assert_array_equal(one, of_rows)
    for place in range(1, len(given)):
        wrong = [array if i != place else np.append(array, 0.0) for i, array in enumerate(given)]
        with pytest.raises(ValueError, match="rows of the sizes that fit it"):
            one_pose_from_lengths(*wrong)
