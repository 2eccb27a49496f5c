"""Forward kinematics: the pose comes back from its cable lengths, and its covariance is what noise makes of it."""

import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, ncx2

from towline import InputError, Robot, available, core, load, solve_batch
from towline.estimation.pose.estimate import gradient
from towline.estimation.pose.search import problem_of
from towline.estimation.pose.wrong_lengths import wrong_cables
from towline.models import branches, points, pose_from_lengths
from towline.models.dynamics import dynamics_of
from towline.models.record import record_of
from towline.statics.equilibria import descend, equilibria, rest_near, rests_near

from .framed import framed

FIVE = ["ipanema-1", "cogiro", "wang-flying", "caroca-pulleys", "nist-robocrane"]


def poses_of_workspace(robot, count, seed=0, tilt=20.0):
    """Return poses at which tensions inside the limits balance the weight, tilted by up to `tilt` degrees an axis."""
    rng, dynamics = np.random.default_rng(seed), dynamics_of(robot)
    low, high = robot.home_anchors.min(axis=0), robot.home_anchors.max(axis=0)
    if high[2] - low[2] < 0.2 * (high - low).max():
        low[2] = 2 * robot.home[2] - high[2]
    kept = []
    while sum(map(len, kept)) < count:
        poses = np.hstack([rng.uniform(low, high, (4000, 3)), np.radians(tilt) * rng.uniform(-1, 1, (4000, 3))])
        poses = np.where(robot.dof_mask > 0, poses + robot.home * (np.arange(6) > 2), robot.home)
        poses = poses[np.isfinite(dynamics.cable_lengths(poses)).all(axis=1)]
        mask = robot.dof_mask
        A = dynamics.wrench_matrix(poses) * mask[:, None]
        w = dynamics.required_wrench(poses, np.zeros(6), np.zeros(6)) * mask
        limits = np.tile(robot.t_min, (len(poses), 1)), np.tile(robot.t_max, (len(poses), 1))
        kept.append(poses[solve_batch(A, w, *limits, length=robot.length).feasible])
    return np.concatenate(kept)[:count]


def errors_of(estimate, poses):
    """Return displacements and rotation vectors in {G} from true poses to estimated ones, (N, 6)."""
    R, true = points.rotations(estimate.pose[:, 3:]), points.rotations(poses[:, 3:])
    turned = Rotation.from_matrix(R @ np.swapaxes(true, 1, 2)).as_rotvec()
    return np.hstack([estimate.pose[:, :3] - poses[:, :3], turned])


@pytest.mark.parametrize("name", FIVE)
def test_exact_lengths_give_the_pose_to_a_nanometre(name):
    robot = load(name)
    poses = poses_of_workspace(robot, 1000)
    lengths = dynamics_of(robot).cable_lengths(poses)
    near = poses + np.random.default_rng(1).normal(0, 2e-3, poses.shape)
    warm = pose_from_lengths(robot, lengths, near)
    # At a singular pose an error of 1e-8 m in x changes the lengths by its square, which is below rounding.
    regular = warm.sigmas.max(axis=1) < 1
    assert regular.mean() > 0.99
    assert np.abs(errors_of(warm, poses))[regular].max() < 1e-9
    cold = pose_from_lengths(robot, lengths)
    assert cold.converged.all()
    assert cold.residual.max() < 1e-9
    assert np.mean(np.abs(errors_of(cold, poses)).max(axis=1) < 1e-8) >= 0.995


def test_a_pose_that_another_one_hides_is_among_its_branches():
    """List all poses that share lengths: beyond its workspace most poses of nist-robocrane have others."""
    robot = load("nist-robocrane")
    rng = np.random.default_rng(5)
    for _ in range(8):
        pose = robot.home + rng.uniform(-1, 1, 6) * [0.4, 0.4, 0.3, 0.6, 0.6, 0.6]
        lengths = dynamics_of(robot).cable_lengths(pose)
        listed = branches(robot, lengths)
        assert any(np.abs(errors_of(PoseRow(one.pose), pose[None])).max() < 1e-7 for one in listed)
        assert all(np.abs(dynamics_of(robot).cable_lengths(one.pose) - lengths).max() < 1e-8 for one in listed)
        held = [one.taut for one in listed]
        assert held == sorted(held, reverse=True)


class PoseRow:
    def __init__(self, pose):
        self.pose = pose[None]


@pytest.mark.parametrize(("name", "sigma"), [("cogiro", 1e-3), ("cogiro", 5e-3), ("ipanema-1", 1e-3), ("fast", 1e-3)])
def test_ninety_five_percent_ellipsoids_hold_as_many_poses(name, sigma):
    robot = load(name)
    poses = np.tile(poses_of_workspace(robot, 100, seed=2), (20, 1))
    noise = np.random.default_rng(3).normal(0, sigma, (len(poses), robot.m))
    estimate = pose_from_lengths(robot, dynamics_of(robot).cable_lengths(poses) + noise, poses, sigma=sigma)
    small = (estimate.sigmas[:, :3].max(axis=1) < 0.01) & (estimate.sigmas[:, 3:].max(axis=1) < np.radians(3))
    small &= estimate.conditioned
    assert small.mean() > 0.5
    errors = errors_of(estimate, poses)[small]
    distances = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(estimate.covariance[small]), errors)
    assert 0.93 <= np.mean(distances <= chi2.ppf(0.95, 6)) <= 0.97
    assert not (estimate.converged & estimate.consistent)[small][distances > chi2.ppf(1 - 1e-9, 6)].any()


def test_a_length_that_is_off_is_noticed_as_often_as_theory_predicts():
    """The test's power follows from the share of an error that no pose explains: a noncentral chi-square."""
    robot, sigma, off = load("ipanema-2"), 1e-3, 0.02
    poses = poses_of_workspace(robot, 2000, seed=4)
    rng = np.random.default_rng(5)
    lengths = dynamics_of(robot).cable_lengths(poses) + rng.normal(0, sigma, (len(poses), robot.m))
    sound = pose_from_lengths(robot, lengths, poses, sigma=sigma)
    assert 0.98 <= sound.consistent.mean() <= 1.0
    cable = rng.integers(0, robot.m, len(poses))
    lengths[np.arange(len(poses)), cable] += off
    estimate = pose_from_lengths(robot, lengths, poses, sigma=sigma)
    assert np.mean(~estimate.consistent) >= 0.99
    J = gradient(robot, poses, None)
    free = 1.0 - np.einsum("nij,njk,nik->ni", J, np.linalg.inv(np.swapaxes(J, 1, 2) @ J), J)
    unexplained = free[np.arange(len(poses)), cable] * (off / sigma) ** 2
    power = 1.0 - ncx2.cdf(chi2.ppf(0.99, robot.m - 6), robot.m - 6, unexplained)
    assert np.mean(~estimate.consistent) == pytest.approx(power.mean(), abs=0.005)
    certain = free[np.arange(len(poses)), cable] > 0.3
    assert np.mean(estimate.suspects().argmax(axis=1)[certain] == cable[certain]) > 0.75


@pytest.mark.parametrize("name", ["ipanema-2", "cogiro", "caroca-pulleys"])
def test_the_wrong_length_is_found_however_far_it_moves_the_pose(name):
    """By 0.5 m and more, where a linear test finds another cable for half of the errors."""
    robot = load(name)
    rng, home = np.random.default_rng(3), dynamics_of(robot).cable_lengths(robot.home)
    for cable in range(robot.m):
        lengths = home + rng.normal(0, 5e-4, robot.m)
        lengths[cable] += rng.uniform(0.5, 0.7) * rng.choice([-1, 1])
        found = pose_from_lengths(robot, lengths)
        assert not found.consistent
        assert cable in wrong_cables(found)


def test_the_estimate_is_that_of_another_least_squares():
    """Minimise, with scipy, the same errors in other coordinates, with pulleys and unequal sigmas."""
    robot, sigma = load("caroca-pulleys"), np.linspace(0.5e-3, 3e-3, 8)
    dynamics, rng = dynamics_of(robot), np.random.default_rng(6)
    for pose in poses_of_workspace(robot, 5, seed=7):
        lengths = dynamics.cable_lengths(pose) + rng.normal(0, sigma)

        def weighted(q, lengths=lengths):
            return (dynamics.cable_lengths(q) - lengths) / sigma

        expected = least_squares(weighted, pose, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
        estimate = pose_from_lengths(robot, lengths, pose, sigma=sigma)
        np.testing.assert_allclose(estimate.pose, expected.x, atol=2e-7)
        np.testing.assert_allclose(estimate.residuals, expected.fun * sigma, atol=1e-8)


@pytest.mark.parametrize("name", ["caroca-pulleys", "cogiro", "planar-4"])
def test_the_gradient_is_that_of_the_lengths(name):
    robot = load(name)
    dynamics = dynamics_of(robot)
    pose = robot.home + 0.1 * np.array([1, -1, 0.5, 0.8, -0.5, 1]) * robot.dof_mask
    steps = 1e-6 * np.eye(6) * robot.dof_mask
    change = dynamics.cable_lengths(points.moved(pose, steps)) - dynamics.cable_lengths(points.moved(pose, -steps))
    np.testing.assert_allclose(gradient(robot, pose, None), change.T / 2e-6, atol=1e-8)


@pytest.mark.parametrize("name", available())
def test_a_pose_does_not_depend_on_those_beside_it(name):
    """Rows in lanes have the bits of one pose, though they take from one step to sixty."""
    robot, rng = load(name), np.random.default_rng(8)
    poses = robot.home + 0.1 * rng.uniform(-1, 1, (50, 6)) * robot.dof_mask
    carriers = robot.carrier_home + rng.normal(0, 0.05, (50, *robot.carrier_home.shape))
    lengths = dynamics_of(robot).cable_lengths(poses, carriers) + rng.normal(0, 1e-3, (50, robot.m))
    lengths[::7, 0] += 0.2
    starts, weights = poses + rng.normal(0, 0.1, (50, 6)) * robot.dof_mask, np.full(robot.m, 1e3)
    for places in (None, carriers):
        problem = problem_of(robot, places)
        together = problem.descend(lengths, weights, starts, 1e-3)
        for row in range(50):
            alone = np.array([row])
            one = problem.of(alone).descend(lengths[alone], weights, starts[alone], 1e-3)
            for mine, whole in zip(one, together, strict=True):
                np.testing.assert_array_equal(mine[0], whole[row])


@pytest.mark.parametrize("name", ["cogiro", "planar-4", "caroca-pulleys"])
def test_all_attitudes_come_back(name):
    """Attitudes all around, and pitches of 90 degrees, from the true pose and the lengths of the symbolic model."""
    robot, rng = load(name), np.random.default_rng(14)
    poses = np.tile(robot.home, (400, 1))
    poses[:, 3:] += robot.dof_mask[3:] * rng.uniform(-np.pi, np.pi, (400, 3))
    if robot.dof_mask.all():
        poses[:100, 4] = rng.choice([-np.pi / 2, np.pi / 2], 100)
    lengths = dynamics_of(robot).cable_lengths(poses)
    runs = np.isfinite(lengths).all(axis=1)
    assert runs.sum() > 200
    estimate = pose_from_lengths(robot, lengths[runs], poses[runs])
    sure = estimate.converged & estimate.conditioned
    assert sure.sum() > 200
    np.testing.assert_allclose(errors_of(estimate, poses[runs])[sure], 0, atol=1e-9)


def test_more_cables_than_the_core_has_room_for_are_refused():
    robot = load("cogiro")
    cables = [cable.model_dump() for cable in robot.cables]
    wide = Robot.model_validate(robot.model_dump() | {"cables": [*cables, *cables, *cables, *cables, cables[0]]})
    lengths = dynamics_of(wide).cable_lengths(wide.home)
    with pytest.raises(InputError, match=r"^robot 'cogiro' must have at most 32 cables, got 33$"):
        pose_from_lengths(wide, lengths)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_start_beyond_all_numbers_of_robots_is_refused(sign):
    robot = load("cogiro")
    with pytest.raises(InputError, match=r"^start must be numbers up to 1e\+09 \[m, rad\], got 1e\+300$"):
        pose_from_lengths(robot, dynamics_of(robot).cable_lengths(robot.home), start=np.full(6, sign * 1e300))


@settings(deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_a_pose_nearby_comes_back(shift):
    robot = load("cogiro")
    pose = robot.home + np.array(shift) * [2, 2, 1, 0.3, 0.3, 0.5]
    start = robot.home if np.abs(shift).max() < 0.3 else pose + 0.01
    estimate = pose_from_lengths(robot, dynamics_of(robot).cable_lengths(pose), start)
    np.testing.assert_allclose(estimate.pose, pose, atol=1e-9)
    assert estimate.converged
    assert estimate.consistent


def test_leading_dimensions_and_moved_carriers():
    robot = load("cogiro")
    rng = np.random.default_rng(9)
    poses = robot.home + rng.uniform(-0.2, 0.2, (3, 4, 6))
    carriers = rng.uniform(-0.3, 0.3, (4, 1, 6))
    lengths = dynamics_of(robot).cable_lengths(poses, carriers)
    estimate = pose_from_lengths(robot, lengths, robot.home, carriers)
    np.testing.assert_allclose(estimate.pose, poses, atol=1e-9)
    assert estimate.converged.shape == estimate.consistent.shape == estimate.conditioned.shape == (3, 4)
    assert estimate.covariance.shape == (3, 4, 6, 6)
    cold = pose_from_lengths(robot, lengths, carrier_pose=carriers)
    np.testing.assert_allclose(cold.pose, poses, atol=1e-9)
    one = pose_from_lengths(robot, lengths[1, 2], carrier_pose=carriers[2])
    np.testing.assert_allclose(one.pose, poses[1, 2], atol=1e-9)
    np.testing.assert_allclose(one.covariance, cold.covariance[1, 2], rtol=1e-6, atol=1e-15)
    empty = pose_from_lengths(robot, np.empty((0, 8)))
    assert empty.pose.shape == (0, 6)


def test_coordinates_that_cannot_move_stay_and_have_no_spread():
    robot = load("planar-4")
    pose = robot.home + [0.2, 0, 0.1, 0, 0.2, 0] * robot.dof_mask
    estimate = pose_from_lengths(robot, dynamics_of(robot).cable_lengths(pose))
    np.testing.assert_allclose(estimate.pose, pose, atol=1e-10)
    assert (estimate.sigmas[robot.dof_mask == 0] == 0).all()
    assert (estimate.sigmas[robot.dof_mask == 1] > 0).all()


@pytest.mark.parametrize(("name", "least"), [("fast", 12), ("multi-quadrotor-6", 10), ("point-mass-3", 2)])
def test_branches_are_found_on_both_sides_of_level_anchors(name, least):
    """With anchors in one plane a platform mirrored at it is far from the level one, though hardly ever held there."""
    robot = load(name)
    turn = np.array([0, 0, 0, 0.1, -0.2, 0.3]) * robot.dof_mask
    pose = robot.home + turn + np.array([0.1, -0.05, 0, 0, 0, 0]) * robot.length
    assert len(branches(robot, dynamics_of(robot).cable_lengths(pose))) >= least


def test_an_angle_beyond_a_quarter_turn_leaves_the_others_at_home():
    robot = load("planar-4")
    pose = robot.home + np.array([0.1, 0, 0, 0, 2.0, 0])
    lengths = dynamics_of(robot).cable_lengths(pose)
    np.testing.assert_allclose(pose_from_lengths(robot, lengths, pose + 0.01).pose, pose, atol=1e-9)
    platform = load("point-mass-3").platform.model_copy(update={"home": (0, 0, 1, 0.3, 2.0, 0.1)})
    point = load("point-mass-3").model_copy(update={"platform": platform})
    estimate = pose_from_lengths(point, dynamics_of(point).cable_lengths(point.home))
    np.testing.assert_array_equal(estimate.pose[3:], point.home[3:])


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9])
def test_upright_roll_and_yaw_are_those_of_one_attitude(pitch):
    """Return the attitude itself: where the nose points up only the difference of roll and yaw is known."""
    robot = load("ipanema-2")
    pose = np.array([0.1, 0.2, 3, 0.3, pitch, 0.7])
    lengths = dynamics_of(robot).cable_lengths(pose)
    estimate = pose_from_lengths(robot, lengths, pose + 1e-3)
    np.testing.assert_allclose(dynamics_of(robot).cable_lengths(estimate.pose), lengths, atol=1e-11)
    R = points.rotations(pose[3:])
    np.testing.assert_allclose(points.rotations(points.angles(R)), R, atol=1e-14)


@pytest.mark.parametrize("precise", [1, 4])
def test_a_search_bears_sigmas_that_differ_by_a_million(precise):
    robot = load("cogiro")
    poses = poses_of_workspace(robot, 300, seed=13)
    sigma = np.where(np.arange(8) < precise, 1e-9, 1e-3)
    estimate = pose_from_lengths(robot, dynamics_of(robot).cable_lengths(poses), sigma=sigma)
    assert estimate.consistent.mean() > 0.99
    assert np.mean(np.abs(errors_of(estimate, poses)).max(axis=1) < 1e-6) > 0.99


def test_a_pose_that_hardly_fits_still_makes_another_one_ambiguous():
    """One true pose in a hundred is refused by the test at 1 %; another that fits is then not the only one."""
    robot, sigma = load("caroca"), 5e-3
    poses = poses_of_workspace(robot, 10_000, seed=14)
    noise = np.random.default_rng(15).normal(0, sigma, (len(poses), robot.m))
    lengths = dynamics_of(robot).cable_lengths(poses) + noise
    found, true = pose_from_lengths(robot, lengths, sigma=sigma), pose_from_lengths(robot, lengths, poses, sigma=sigma)
    other = np.abs(errors_of(found, true.pose)).max(axis=1) > 0.02
    assert other.sum() > 10
    assert np.sum(other & found.consistent & ~found.ambiguous) <= 1


def test_six_cables_at_random_hardly_hide_a_pose():
    """The estimate is the true pose, or it is ambiguous: the search met others that fit."""
    rng, angle = np.random.default_rng(10), 2 * np.pi * np.arange(6) / 6
    high = np.array([3, 1, 3, 0, 3, 2])
    anchors = np.stack([4 * np.cos(angle), 4 * np.sin(angle), high], axis=1) + rng.uniform(-0.5, 0.5, (6, 3))
    robot = suspended(anchors.tolist(), (rng.uniform(-1, 1, (6, 3)) * [0.6, 0.6, 0.4]).tolist(), home=[0] * 6)
    poses = poses_of_workspace(robot, 1000, seed=16)
    estimate = pose_from_lengths(robot, dynamics_of(robot).cable_lengths(poses))
    wrong = np.abs(errors_of(estimate, poses)).max(axis=1) > 1e-6
    assert np.mean(wrong & ~estimate.ambiguous) < 0.002


def suspended(anchors, attachments, **platform):
    """Return a platform of 2 kg under cables from a frame."""
    body = {"mass": 2, "inertia": [0.1, 0.1, 0.1, 0, 0, 0], **platform}
    return framed(zip(anchors, attachments, strict=True), body)


def test_fewer_cables_give_the_rest_and_its_spread():
    """The covariance is that of rests whose lengths are drawn at random, and the pose that of the energy's minimum."""
    robot = load("multi-quadrotor-4")
    lengths = dynamics_of(robot).cable_lengths(robot.home) + np.array([0.01, -0.02, 0.0, 0.015])
    estimate = pose_from_lengths(robot, lengths)
    assert estimate.by_gravity
    assert estimate.determined
    assert estimate.consistent
    expected = equilibria(robot, lengths)[0]
    np.testing.assert_allclose(estimate.pose, expected.pose, atol=1e-6)
    draws = lengths + np.random.default_rng(1).normal(0, 1e-4, (400, robot.m))
    rests = pose_from_lengths(robot, draws, estimate.pose, sigma=1e-4)
    assert rests.converged.all()
    spread = np.cov(errors_of(rests, np.tile(estimate.pose, (400, 1))).T)
    at = pose_from_lengths(robot, lengths, sigma=1e-4).covariance
    np.testing.assert_allclose(np.sqrt(np.diag(at)), np.sqrt(np.diag(spread)), rtol=0.12)


def test_what_the_lengths_leave_open_is_undetermined():
    """One cable lets the platform turn about the vertical: the rest is one of a family."""
    robot = suspended([[0, 0, 3]], [[0, 0, 0.2]], home=[0, 0, 1.5, 0, 0, 0])
    estimate = pose_from_lengths(robot, [1.0])
    np.testing.assert_allclose(estimate.pose[:3], [0, 0, 1.8], atol=1e-7)
    assert estimate.converged
    assert not estimate.determined
    assert not estimate.conditioned
    np.testing.assert_array_equal(np.isinf(estimate.sigmas), [False] * 5 + [True])
    np.testing.assert_allclose(estimate.sigmas[:3], [0, 0, 1e-3], atol=1e-9)
    with pytest.raises(InputError, match="gravity must not be zero if the lengths do not determine the pose"):
        pose_from_lengths(robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)}), [1.0])


def test_parallel_cables_leave_it_to_gravity():
    """Six vertical cables fix no horizontal motion to first order; a shorter one tilts the platform."""
    robot = load("wang-ctmrts-6")
    lengths = np.full(6, 1.2)
    estimate = pose_from_lengths(robot, lengths)
    assert estimate.by_gravity
    assert estimate.determined
    np.testing.assert_allclose(estimate.pose[:2], robot.home_anchors[:, :2].mean(axis=0), atol=1e-6)
    assert not pose_from_lengths(robot, np.full(6, 0.1)).consistent
    alone = pose_from_lengths(robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)}), lengths, estimate.pose)
    np.testing.assert_array_equal(np.isinf(alone.sigmas), [True, True, False, True, True, True])  # x with ry, y with rx
    rise = robot.home_anchors[:, 2] - alone.pose[2] - robot.attachments[:, 2]  # of level cables: all have the same
    np.testing.assert_allclose(alone.sigmas[2], 1e-3 / (rise.mean() / 1.2 * np.sqrt(6)), rtol=1e-6)


def test_a_nearly_singular_geometry_is_reported():
    """A platform of 5 cm under cables of 10 m turns by degrees for millimetres, and its lengths are not linear then."""
    robot = load("cogiro")
    cables = [c.model_copy(update={"attachment": tuple(0.05 * np.array(c.attachment))}) for c in robot.cables]
    robot = robot.model_copy(update={"cables": tuple(cables)})
    poses = np.tile(robot.home, (1000, 1))
    lengths, rng = dynamics_of(robot).cable_lengths(robot.home), np.random.default_rng(11)
    held = {}
    for sigma in (1e-4, 2e-2):
        noise = rng.normal(0, sigma, (len(poses), robot.m))
        estimate = pose_from_lengths(robot, lengths + noise, poses, sigma=sigma)
        exact = pose_from_lengths(robot, lengths, robot.home, sigma=sigma)
        errors = errors_of(estimate, poses)
        distances = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(exact.covariance), errors)
        held[sigma] = np.mean(distances <= chi2.ppf(0.95, 6))
        assert exact.conditioned == (sigma == 1e-4)
    assert 0.93 <= held[1e-4] <= 0.97
    assert held[2e-2] < 0.9


def test_a_single_estimate_takes_microseconds():
    """Loosely, against what a slow machine does; `benchmarks.batches` has the ratios."""
    robot = load("cogiro")
    lengths, start = dynamics_of(robot).cable_lengths(robot.home), robot.home + 1e-3
    pose_from_lengths(robot, lengths, start)
    begin = time.process_time()
    for _ in range(200):
        pose_from_lengths(robot, lengths, start)
    assert time.process_time() - begin < 0.2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lengths": [1, 2, 3]}, r"lengths must have the shape \(..., 8\)"),
        ({"lengths": np.full(8, -1.0)}, "lengths must be numbers > 0"),
        ({"lengths": np.full(8, np.nan)}, "lengths must be finite"),
        ({"lengths": [8, 8, 8, 8, 8, 8, 8, 2e9]}, r"lengths must be numbers up to 1e\+09 \[m\], got 2e\+09"),
        ({"start": np.zeros(5)}, "start must have the shape"),
        ({"sigma": 0}, "sigma must be numbers > 0"),
        ({"sigma": [1e-3, 1e-3]}, r"sigma must be of shape \(8,\), or a single number, got shape \(2,\)"),
        ({"start": np.zeros((2, 6)), "lengths": np.full((3, 8), 8.0)}, "leading dimensions"),
    ],
)
def test_wrong_input_is_one_line(change, message):
    arguments = {"lengths": np.full(8, 8.0), **change}
    with pytest.raises(InputError, match=message) as error:
        pose_from_lengths("cogiro", **arguments)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["caroca-pulleys", "cogiro", "ipanema-1"])
def test_steps_converge_where_errors_are_large(name):
    """Poses are minima by differences, and Newton's steps reach them from nearby; Gauss and Newton's take over ten."""
    robot, rng = load(name), np.random.default_rng(12)
    dynamics, weights = dynamics_of(robot), np.full(robot.m, 1e3)
    lengths = dynamics.cable_lengths(robot.home + 0.1 * rng.uniform(-1, 1, (20, 6)) * robot.dof_mask)
    lengths += 0.5 * robot.length * rng.normal(size=lengths.shape)
    poses, _, ended = problem_of(robot).descend(lengths, weights, np.tile(robot.home, (20, 1)), 1e-3)
    assert ended.sum() >= 15
    lengths, poses = lengths[ended], poses[ended]
    starts, errors, steps = poses.copy(), np.empty_like(lengths), np.empty(len(poses))
    starts[:, :3] += 2e-4 * robot.length
    core.pose_from_lengths(
        record_of(robot), robot.carrier_home, lengths, weights, robot.dof_mask, np.array(0.0), starts, errors, steps
    )
    assert np.median(steps[steps > 0]) <= 5
    shifts = np.vstack([np.eye(6), -np.eye(6)]) * 1e-3 * robot.dof_mask
    around = dynamics.cable_lengths(points.moved(poses[:, None], shifts)) - lengths[:, None]
    cost = np.sum((dynamics.cable_lengths(poses) - lengths) ** 2, axis=-1)
    assert (np.sum(around**2, axis=-1) >= cost[:, None] * (1 - 1e-12)).all()


def test_poses_above_the_anchors_cannot_be_held():
    """Six cables that only pull hold a weight below their anchors, not above them."""
    robot = load("nist-robocrane")
    listed = branches(robot, dynamics_of(robot).cable_lengths(robot.home))
    above = [one for one in listed if one.pose[2] > robot.home_anchors[:, 2].max()]
    assert above
    assert not any(one.taut for one in above)
    assert listed[0].taut
    np.testing.assert_allclose(listed[0].pose, robot.home, atol=1e-9)


def test_rests_take_a_few_newton_steps(monkeypatch):
    """With the right derivative eight steps suffice, where the search by energy is not available."""
    robot = load("multi-quadrotor-4")
    lengths = dynamics_of(robot).cable_lengths(robot.home) + np.array([0.02, -0.03, 0.0, 0.02])
    expected = pose_from_lengths(robot, lengths)
    monkeypatch.setattr(sys.modules[rests_near.__module__], "NEWTON", 8)
    monkeypatch.setattr(sys.modules[rests_near.__module__], "descend", lambda *_: None)
    start = expected.pose + np.array([0.01, -0.01, 0.01, 0.05, -0.04, 0.03])
    quick = pose_from_lengths(robot, lengths, start)
    assert quick.converged
    np.testing.assert_allclose(quick.pose, expected.pose, atol=1e-8)


def test_newton_finds_the_rests_of_least_energy_with_slack_cables(monkeypatch):
    """A load rests on three of four cables if one is too long: many at once, as one by one by the energy."""
    robot, rng = load("multi-quadrotor-4"), np.random.default_rng(2)
    carriers = np.tile(robot.carrier_home, (200, 1, 1))
    carriers[:, :, :3] += 0.2 * rng.normal(size=(200, 4, 3))
    starts = robot.home + np.repeat([0.2, 0.05], 3) * rng.normal(size=(200, 6))
    lengths = dynamics_of(robot).cable_lengths(robot.home + 0.02 * rng.normal(size=(200, 6)), carriers)
    lengths[np.arange(200), rng.integers(4, size=200)] += np.abs(0.2 * rng.normal(size=200))
    alone = [descend(robot, starts[row], carriers[row], lengths[row]) for row in range(0, 200, 10)]
    monkeypatch.setattr(sys.modules[rests_near.__module__], "descend", lambda *_: None)
    rests, found = rests_near(robot, lengths, starts, carriers)
    assert found.mean() > 0.95
    assert (~rests.taut[found]).any(axis=1).mean() > 0.3
    assert (rests.lengths - lengths)[found].max() < 1e-8
    for row, one in zip(range(0, 200, 10), alone, strict=True):
        if found[row] and one is not None:
            np.testing.assert_allclose(rests.energy[row], one.energy, atol=1e-5)


def test_a_platform_on_a_table_follows_its_lengths():
    """Gravity along the locked axis pulls no cable taut, but at the start its two cables would be 65 mm too long."""
    data = load("planar-4").model_dump(mode="json")
    robot = Robot.model_validate(data | {"gravity": [0, -9.81, 0], "cables": data["cables"][:2]})
    lengths = 1.05 * dynamics_of(robot).cable_lengths(robot.home)
    found = pose_from_lengths(robot, lengths, robot.home)
    assert found.converged
    assert np.isinf(found.sigmas[[0, 2, 4]]).all()
    np.testing.assert_allclose(dynamics_of(robot).cable_lengths(found.pose), lengths, atol=1e-9)


def test_newton_does_not_stay_where_a_load_would_tip_over():
    """Its CoM a metre above the attachments: the level pose is in balance, but the platform hangs below."""
    data = load("multi-quadrotor-4").model_dump()
    robot = Robot.model_validate(data | {"platform": data["platform"] | {"com": (0.0, 0.0, 1.0)}})
    lengths = dynamics_of(robot).cable_lengths(robot.home)
    rest = rest_near(robot, lengths, robot.home, robot.carrier_home)
    level = robot.weight * (robot.home[2] + 1.0)
    assert rest.energy < level - 0.1 * robot.weight


def test_newton_knows_that_a_load_on_one_point_turns_freely():
    data = load("multi-quadrotor-4").model_dump()
    cables = [cable | {"attachment": (0.0, 0.0, 0.1)} for cable in data["cables"]]
    robot = Robot.model_validate(data | {"cables": cables})
    lengths = dynamics_of(robot).cable_lengths(robot.home)
    held = rest_near(load("multi-quadrotor-4"), lengths, robot.home, robot.carrier_home)
    assert rest_near(robot, lengths, robot.home, robot.carrier_home).neutral
    assert held is None or not held.neutral


@pytest.mark.parametrize(("name", "most"), [("cogiro", 3.3), ("ipanema-1", 6.0)])
def test_noise_costs_few_steps(name, most):
    """About the home of ipanema-1 the matrix of Gauss and Newton alone takes ten steps."""
    robot, rng, count = load(name), np.random.default_rng(13), 400
    poses = robot.home + 0.1 * robot.length * rng.uniform(-1, 1, (count, 6))
    lengths = dynamics_of(robot).cable_lengths(poses) + rng.normal(0, 1e-3, (count, robot.m))
    starts, errors, steps = poses + rng.normal(0, 1e-3, poses.shape), np.empty_like(lengths), np.empty(count)
    given = record_of(robot), robot.carrier_home, lengths, np.full(robot.m, 1e3), robot.dof_mask, np.array(0.0)
    core.pose_from_lengths(*given, starts, errors, steps)
    assert steps.all()
    assert steps.mean() < most


def test_a_pose_that_cannot_be_held_is_another_one_all_the_same():
    """The CoM of the file may be wrong: a pose with the same lengths is named, though cables cannot hold it."""
    robot = load("nist-robocrane")
    poses, met = poses_of_workspace(robot, 40, seed=3), 0
    estimate = pose_from_lengths(robot, dynamics_of(robot).cable_lengths(poses))
    for pose, lengths, ambiguous in zip(
        estimate.pose, dynamics_of(robot).cable_lengths(poses), estimate.ambiguous, strict=True
    ):
        others = [
            one for one in branches(robot, lengths) if np.abs(one.pose[:3] - pose[:3]).max() > 0.02 * robot.length
        ]
        loose = [one for one in others if not one.taut]
        # Those near home are met without a doubt.
        if others == loose and any(np.abs(one.pose[3:]).max() < 0.6 for one in loose):
            np.testing.assert_allclose(dynamics_of(robot).cable_lengths(loose[0].pose), lengths, atol=1e-8)
            assert ambiguous
            met += 1
    assert met >= 3
