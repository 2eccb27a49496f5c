"""The robot as built: parameters from lengths and poses, their uncertainty, and what is left open."""

import time
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.sparse import lil_matrix
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.estimation.calibration import Measurements, calibrate, next_poses
from towline.estimation.calibration.clock import begin_with_clock, winds
from towline.estimation.calibration.cross_validation import compare
from towline.estimation.calibration.enough import usual
from towline.estimation.calibration.geometry import length_of
from towline.estimation.calibration.model import Model, State
from towline.estimation.calibration.normal_equations import metric
from towline.estimation.calibration.parameters import OF_CABLE, Parameters
from towline.estimation.calibration.solving import model_of, solve
from towline.estimation.logs.pose_track import PoseTrack
from towline.models import Dynamics, Robot, load, points
from towline.models.cables.pulley import exit_points
from towline.models.files import as_robot
from towline.models.rotation import rotation

from .framed import framed
from .robots_as_built import NOISE, as_built, random_poses, rigidly_aligned

ANCHORS = ("anchors",)
BOTH = ("anchors", "attachments")
ALL_THREE = ("anchors", "attachments", "offsets")


def poses_of(robot, lengths, starts):
    """Poses by another solver and the robot's own kinematics, pose by pose."""
    dynamics = Dynamics(robot)
    return np.array(
        [
            least_squares(lambda q, own=own: dynamics.cable_lengths(q) - own, start, x_scale=0.1).x
            for own, start in zip(lengths, starts, strict=True)
        ]
    )


def position_error(calibration, built, draw, aligned=False):
    """Root mean square error of positions [m] that the calibrated robot computes from lengths never measured before."""
    poses = random_poses(built.robot, 15, draw)
    readings = Dynamics(built.robot).cable_lengths(poses) - built.offsets
    found = poses_of(calibration.robot, calibration.lengths(readings), poses)[:, :3]
    if aligned:
        found = rigidly_aligned(found, poses[:, :3])
    return np.sqrt(((found - poses[:, :3]) ** 2).sum(axis=1).mean())


@pytest.mark.parametrize("name", ["cogiro", "caroca-pulleys", "planar-4", "point-mass-3"])
def test_derivatives_are_those_of_casadi(name):
    """By anchors, attachments and poses exactly; by radii, scales and slips against differences."""
    robot, draw = load(name), np.random.default_rng(1)
    pose = random_poses(robot, 1, draw, 0.2)
    readings = Dynamics(robot).cable_lengths(pose) + draw.normal(0, 0.1, (1, robot.m))
    groups = ("anchors", "attachments", "offsets", "scales", "radii")
    model = Model(Parameters(robot, groups, ((1, 0),)), Measurements(readings), {}, np.ones((robot.m, 1)), pose)
    state = model.begin()
    _, derivatives = model.linearised(state)
    A, B = ca.SX.sym("A", 3, robot.m), ca.SX.sym("B", 3, robot.m)
    shift, turn = ca.SX.sym("shift", 3), ca.SX.sym("turn", 3)
    placed = pose[0, :3] + shift + (ca.DM.eye(3) + ca.skew(turn)) @ rotation(ca.DM(pose[0, 3:])) @ B
    lengths = exit_points(A, ca.DM(robot.pulley_axes.T), robot.pulley_radii, placed).lengths
    of = [ca.vec(A), ca.vec(B), ca.vertcat(shift, turn)]
    jacobian = ca.Function("j", of, [ca.jacobian(lengths, each) for each in of])
    by_anchor, by_attachment, by_pose = (
        NOISE * np.array(part) for part in jacobian(robot.anchors.ravel(), robot.attachments.ravel(), np.zeros(6))
    )
    for i in range(robot.m):
        own = slice(3 * i, 3 * i + 3)
        np.testing.assert_allclose(NOISE**2 * derivatives.cables[i, 0, :3], by_anchor[i, own], atol=1e-12)
        np.testing.assert_allclose(NOISE**2 * derivatives.cables[i, 0, 3:6], by_attachment[i, own], atol=1e-12)
        np.testing.assert_allclose(NOISE**2 * derivatives.poses[i, 0], by_pose[i], atol=1e-12)
    for column in np.flatnonzero(model.parameters.varies):
        steps = [state._replace(x=state.x + sign * 1e-6 * np.eye(len(state.x))[column]) for sign in (1, -1)]
        more, less = (model.residuals(step).readings[:, 0] for step in steps)
        expected = np.zeros(robot.m)
        if column > model.parameters.clock:
            expected = derivatives.others[:, 0, 0]  # the slip
        else:
            expected[column // OF_CABLE] = derivatives.cables[column // OF_CABLE, 0, column % OF_CABLE]
        np.testing.assert_allclose((more - less) / 2e-6, expected, atol=2e-4)


@pytest.mark.parametrize(("count", "accuracy"), [(60, 1e-3), (200, 0.5e-3)])
def test_known_poses_calibrate_anchors_and_offsets(count, accuracy):
    errors = []
    for seed in range(5):
        built = as_built(count, seed)
        result = calibrate("cogiro", built.measurements())
        assert result.converged
        assert result.residual_after < 1.05e-3 < 0.02 < result.residual_before
        errors.append(position_error(result, built, np.random.default_rng(seed)))
    assert np.median(errors) < accuracy


def test_unknown_poses_are_found_with_the_parameters():
    errors, own = [], []
    for seed in range(5):
        built = as_built(200, seed)
        result = calibrate("cogiro", built.measurements(known=False), prior={"anchors": 0.02, "offsets": 0.05})
        errors.append(position_error(result, built, np.random.default_rng(seed), aligned=True))
        found = rigidly_aligned(result.poses[:, :3], built.poses[:, :3])
        own.append(np.sqrt(((found - built.poses[:, :3]) ** 2).sum(axis=1).mean()))
    assert np.median(errors) < 3e-3
    assert np.median(own) < 4e-3


@pytest.mark.parametrize("known", [True, False])
def test_standard_deviations_hold(known):
    """The squares of the errors, by the covariance, are distributed as chi^2: their mean is 1, a few per cent apart."""
    squares, count = 0.0, 0
    prior = None if known else {"anchors": 0.02, "offsets": 0.05}
    for seed in range(20):
        built = as_built(40, seed)
        result = calibrate("cogiro", built.measurements(known), prior=prior, outliers=False)
        true = np.hstack([built.robot.anchors, built.offsets[:, None]]).ravel()
        error = np.array([one.value for one in result.parameters]) - true
        squares += error @ np.linalg.solve(result.covariance, error)
        count += len(error)
    assert squares / count == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize(
    ("free", "known", "gauges"),
    [
        (ANCHORS, True, 0),
        (BOTH, True, 0),
        (ALL_THREE, True, 0),
        (ANCHORS, False, 6),
        (BOTH, False, 12),
        (ALL_THREE, False, 12),
    ],
)
def test_gauges_are_counted_and_named(free, known, gauges):
    built = as_built(80, 0, noise=NOISE / 4, offsets=0.05 if "offsets" in free else 0.0)
    result = calibrate("cogiro", built.measurements(known, sigma=NOISE / 4), free)
    assert result.converged
    assert len(result.not_identifiable) == gauges
    expected = [f"all anchors together {how} {axis} of {{G}}" for how in ("along", "about") for axis in "xyz"]
    if gauges == 12:
        expected += [
            f"all attachments together {how} {axis} of the platform" for how in ("along", "about") for axis in "xyz"
        ]
    assert list(result.not_identifiable) == expected[:gauges]
    # What is left open changes as little as possible: no part of the correction lies along a gauge.
    if gauges:
        moved = result.robot.anchors - load("cogiro").anchors
        assert np.abs(moved.mean(axis=0)).max() < 1e-6
        arms = load("cogiro").anchors - load("cogiro").anchors.mean(axis=0)
        assert np.abs(np.cross(arms, moved).sum(axis=0)).max() < 0.05 * np.abs(np.cross(arms, moved)).sum(axis=0).max()
        assert not any(name.startswith("cables[0].anchor") for name in result.identifiable)
    else:
        assert len(result.identifiable) == len(result.parameters)


def test_pulleys_break_gauges_and_scales_add_one():
    """Swivel axes are fixed in {G}: of the turns only that about them is left. Without a scale nothing has a size."""
    poses = random_poses(load("caroca-pulleys"), 80, np.random.default_rng(0), 0.25)
    built = as_built(80, 0, "caroca-pulleys", noise=1e-5, offsets=0.0, poses=poses)
    result = calibrate("caroca-pulleys", built.measurements(known=False, sigma=1e-5), ANCHORS)
    assert [text for text in result.not_identifiable if "about" in text] == ["all anchors together about z of {G}"]
    assert len(result.not_identifiable) == 4
    result = calibrate("cogiro", as_built(80, 0).measurements(known=False), (*ALL_THREE, "scales"))
    assert len(result.not_identifiable) == 13
    assert result.not_identifiable[-1].startswith("the overall scale")


def test_a_point_mass_does_not_tell_anchors_from_attachments():
    robot = load("point-mass-3")
    poses = random_poses(robot, 50, np.random.default_rng(0), 0.7)
    built = as_built(50, 0, "point-mass-3", poses=poses)
    result = calibrate(robot, Measurements(built.readings, poses[:, :3]), ("anchors", "attachments", "offsets"))
    together = [
        f"cables[{i}].anchor and cables[{i}].attachment together along {axis}" for i in range(3) for axis in "xyz"
    ]
    assert list(result.not_identifiable) == together
    assert set(result.identifiable) == {f"cables[{i}].offset" for i in range(3)}


def test_locked_cables_leave_scale_and_offset_open():
    """A platform that swings on cables of constant length: their readings never change."""
    ends = [([2 * x, 2 * y, 7], [x, y, 0.1]) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    robot = framed(ends, {"mass": 2, "inertia": [0.1, 0.1, 0.1, 0, 0, 0], "home": [0, 0, 0, 0, 0, 0]})
    t = np.linspace(0, 20, 1000)
    poses = np.zeros((1000, 6))
    poses[:, 0], poses[:, 1] = 0.8 * np.sin(1.2 * t), 0.6 * np.sin(1.1 * t + 1)
    poses[:, 3:] = 0.2 * np.sin(np.outer(t, [1.3, 0.9, 0.7]))
    # No other pose has these lengths: each cable's is made constant by its own reading.
    readings = Dynamics(robot).cable_lengths(poses) * 0 + 6.5
    truth = Dynamics(robot).cable_lengths(poses)
    result = calibrate(robot, Measurements(readings, poses, sigma=0.2), ("offsets", "scales"))
    assert [text.split(" with ") for text in result.not_identifiable]
    assert all(
        {f"cables[{i}].offset", f"cables[{i}].scale"} == set(text.removesuffix(" together").split(", "))
        for i, text in enumerate(sorted(result.not_identifiable))
    )
    np.testing.assert_allclose(result.lengths(readings[0]), truth.mean(axis=0), atol=1e-6)
    # Nor do they show a clock offset if they only change in a pause.
    late = np.arange(1000) >= 500
    wound = Measurements(readings + 0.5 * late[:, None], poses, times=t + late)
    assert usual(as_robot(robot), wound) == ("anchors", "offsets")
    assert "clock" in usual(as_robot(robot), wound.changed(lengths=truth))
    # Computers that receive ten samples at once may give them times a millisecond apart.
    count = np.arange(1000)
    at = 0.1 * (count // 10) + 0.001 * (count % 10)
    assert winds(Measurements(6.5 + 0.3 * np.sin(at)[:, None] * np.ones(robot.m), times=at))


def test_the_schur_complement_finds_what_a_sparse_solver_finds():
    """Same minimum as scipy's sparse trust region, with all poses among its unknowns, in a small part of its time."""
    robot, count = load("cogiro"), 12
    built = as_built(count, 0)
    prior = {"anchors": 0.02, "offsets": 0.05}
    measurements = built.measurements(known=False)
    start = time.process_time()
    result = calibrate(robot, measurements, prior=prior, outliers=False)
    own = time.process_time() - start
    model = replace(result._solved.model, start=built.poses + 0.01)
    varies = model.parameters.varies
    p = int(varies.sum())

    def state(z):
        x = model.parameters.first.copy()
        x[varies] += z[:p]
        q = z[p:].reshape(count, 6)
        return State(x, q[:, :3], Rotation.from_rotvec(q[:, 3:]).as_matrix(), np.zeros((count, 0)))

    def residuals(z):
        own = model.residuals(state(z))
        return np.concatenate([own.readings.ravel(), own.parameters[varies]])

    pattern = lil_matrix((8 * count + p, p + 6 * count), dtype=int)
    for i in range(8):
        for k in range(count):
            pattern[i * count + k, 4 * i : 4 * i + 4] = 1
            pattern[i * count + k, p + 6 * k : p + 6 * k + 6] = 1
    pattern[8 * count :, :p] = np.eye(p, dtype=int)
    start = time.process_time()
    other = least_squares(residuals, np.zeros(p + 6 * count), jac_sparsity=pattern, x_scale="jac", ftol=1e-10)
    theirs = time.process_time() - start
    assert 2 * other.cost == pytest.approx(result._solved.fit.cost, rel=1e-5)
    np.testing.assert_allclose([one.correction for one in result.parameters], other.x[:p], atol=5e-4)
    assert theirs > 5 * own


def test_200_poses_with_all_parameters_take_less_than_a_fifth_of_a_second():
    robot, built = load("cogiro"), as_built(200, 0)
    for known in (True, False):
        for _ in range(4):  # the fastest is meant, because other tests may use the same processors
            start = time.thread_time()
            result = calibrate(robot, built.measurements(known), (*ALL_THREE, "scales"))
            took = time.thread_time() - start
            assert result.converged
            if took < 0.2:
                break
        assert took < 0.2


def test_measured_poses_have_errors_of_their_own():
    """Stated as such, they do not become errors of the parameters, whose standard deviations know of them."""
    built, draw = as_built(100, 0), np.random.default_rng(5)
    noisy = built.poses + draw.normal(0, [[5e-3] * 3 + [5e-3] * 3], built.poses.shape)
    stated = Measurements(built.readings, noisy, sigma={"lengths": 1e-3, "position": 5e-3, "rotation": 5e-3})
    result = calibrate("cogiro", stated)
    assert result.noise == pytest.approx(1e-3, rel=0.1)
    assert np.abs(result.poses - built.poses).std() < 0.8 * np.abs(noisy - built.poses).std()
    true = np.hstack([built.robot.anchors, built.offsets[:, None]]).ravel()
    error = np.array([one.value for one in result.parameters]) - true
    assert error @ np.linalg.solve(result.covariance, error) / len(error) == pytest.approx(1, abs=0.5)
    unstated = calibrate("cogiro", Measurements(built.readings, noisy), outliers=False)
    assert unstated.noise > 4e-3  # and the sigmas grow accordingly
    assert "not by the 1 mm assumed" in unstated.report()


def test_some_poses_may_be_unknown():
    built = as_built(60, 2)
    poses = built.poses.copy()
    poses[10:] = np.nan
    result = calibrate("cogiro", Measurements(built.readings, poses))
    few = calibrate("cogiro", Measurements(built.readings[:10], poses[:10]))
    assert not result.not_identifiable
    np.testing.assert_allclose(result.poses[10:, :3], built.poses[10:, :3], atol=0.02)
    assert sum(one.sigma**2 for one in result.parameters) < 0.5 * sum(one.sigma**2 for one in few.parameters)


def test_information_is_the_inverse_of_the_covariance():
    """In metres, of what is identifiable, noise three times the stated one included."""
    built = as_built(100, 0, noise=3 * NOISE)
    result = calibrate("cogiro", built.measurements(), outliers=False)
    assert result.noise == pytest.approx(3 * NOISE, rel=0.1)
    assert len(result.identifiable) == len(result.parameters)
    np.testing.assert_allclose(result.information @ result.covariance, np.eye(len(result.parameters)), atol=1e-6)


def test_a_clock_offset_is_found():
    robot, draw = load("cogiro"), np.random.default_rng(0)
    times = np.arange(0, 8, 0.04) + draw.uniform(-0.003, 0.003, 200)

    def motion(t):
        return robot.home + np.array([1, 0.8, 0.3, 0.1, 0.1, 0.15]) * np.sin(
            np.outer(t, [2.1, 1.7, 2.7, 1.9, 2.4, 1.3])
        )

    built = as_built(200, 3, poses=motion(times + 0.034))
    seen = motion(times) + draw.normal(0, 5e-4, (200, 6))
    log = Measurements(built.readings, seen, times=times, sigma={"lengths": 1e-3, "position": 5e-4, "rotation": 5e-4})
    result = calibrate(robot, log, ("anchors", "offsets", "clock"))
    assert result.clock == pytest.approx(0.034, abs=1e-3)
    assert result.residual_after < 1.5e-3
    assert calibrate(robot, log).clock == pytest.approx(0.034, abs=1e-3)
    assert calibrate(robot, log, "auto").clock == pytest.approx(0.034, abs=1e-3)


def test_a_scale_becomes_a_length_by_that_of_its_cable():
    """And by a thousandth of the longest where readings are nearly 0 all along."""
    robot, sizes = load("cogiro"), np.array([1e-6, 2, 3, 4, 5, 6, 7, 8])
    readings = np.array([[0.8], [1.2]]) * sizes
    model = Model(Parameters(robot, ("scales",)), Measurements(readings), {}, np.ones((robot.m, 2)))
    of_scales = metric(model)[: OF_CABLE * robot.m].reshape(robot.m, OF_CABLE)[:, 7]
    rms = np.sqrt((readings**2).mean(axis=0))
    np.testing.assert_allclose(of_scales, [1e-3 * rms[-1], *rms[1:]])


def test_a_track_covers_the_time_from_its_first_to_its_last_pose():
    times = np.arange(8) / 10
    track = PoseTrack(times, np.zeros((8, 3)), np.tile(np.eye(3), (8, 1, 1)), np.ones(8, bool))
    for clock, inside in ((0.0, range(8)), (0.05, range(7)), (-0.05, range(1, 8)), (0.31, range(4)), (-0.8, [])):
        assert np.flatnonzero(track.inside(clock)).tolist() == list(inside)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_clock_offset_is_looked_for_where_residuals_are_small_on_average(seed):
    """Slow and noisy: residuals hardly depend on it, but offsets at which few readings are left are no better."""
    robot, draw, times = load("cogiro"), np.random.default_rng(seed), 0.05 * np.arange(400)

    def motion(t):
        return robot.home + [1, 0.8, 0.3, 0.1, 0.1, 0.15] * np.sin(np.outer(t, [0.21, 0.17, 0.27, 0.19, 0.24, 0.13]))

    built = as_built(400, seed, poses=motion(times + 0.034), noise=0.02)
    seen = motion(times) + draw.normal(0, 5e-4, (400, 6))
    log = Measurements(built.readings, seen, times=times, sigma={"lengths": 1e-3, "position": 5e-4, "rotation": 5e-4})
    model = model_of(robot, log, ("anchors", "offsets", "clock"), {})
    start = begin_with_clock(model, length_of(robot)).x[model.parameters.clock]
    assert start == pytest.approx(0.034, abs=0.045)


def test_neighbours_that_are_alike_make_parameters_less_certain():
    """An error of the model over time: the same residuals tell less than independent ones of their size."""
    built = as_built(2000, 1, noise=1e-4)
    drift = 5e-3 * np.sin(np.arange(2000)[:, None] * np.linspace(0.01, 0.02, 8) + np.arange(8))
    smooth = calibrate("cogiro", Measurements(built.readings + drift, built.poses))
    mixed = np.random.default_rng(0).permutation(2000)
    independent = calibrate("cogiro", Measurements(built.readings + drift[mixed], built.poses))
    assert smooth.noise == pytest.approx(independent.noise, rel=0.02)
    assert smooth.noise > 3e-3
    assert independent.autocorrelation == 1
    assert not smooth.slips
    assert not independent.slips


@pytest.mark.parametrize("stated", [{"lengths": 1e-3}, {"lengths": 1e-3, "position": 5e-4, "rotation": 1e-3}])
def test_noise_of_smoothed_poses_does_not_make_a_model_incomplete(stated):
    """They are only as uncertain as readings with independent errors that are as large, or less."""
    draw, times = np.random.default_rng(2), 0.02 * np.arange(1200)
    swing = np.sin(np.outer(times, [1.1, 0.7, 0.9, 0.6, 0.8, 0.5]))
    poses = load("cogiro").home + [1, 0.8, 0.3, 0.1, 0.1, 0.15] * swing
    built = as_built(0, 3, poses=poses)
    noisy = poses + draw.normal(0, 1, poses.shape) * [*[5e-4] * 3, *[1e-3] * 3]
    found = calibrate("cogiro", Measurements(built.readings, noisy, times=times, sigma=stated))
    assert "clock" in found.free
    assert "model is incomplete" not in str(found.report)
    if "position" in stated:
        assert found.noise < 0.9e-3  # smoothed poses have less noise than stated
        assert found.autocorrelation < 1.2
    else:
        assert 1 < found.autocorrelation < 3


def test_readings_taken_four_times_are_as_good_as_one():
    """The covariance is four times that of independent readings, known from 25 blocks in 32 directions."""
    ratios = []
    for seed in range(6):
        built = as_built(400, seed)
        again = Measurements(np.repeat(built.readings, 4, axis=0), np.repeat(built.poses, 4, axis=0))
        ratios.append(calibrate("cogiro", again, outliers=False).autocorrelation)
    assert np.mean(ratios) == pytest.approx(4, rel=0.045)


def test_left_out_samples_decide_whether_parameters_help():
    """With unknown poses and few samples many parameters fit better and predict worse."""
    built = as_built(72, 0, offsets=0.0)
    few = calibrate("cogiro", built.measurements(known=False), (*ALL_THREE, "scales"), {"scales": 1.0}, outliers=False)
    left = {one.free: one for one in few.held_out.sets}
    most = left["anchors", "attachments", "offsets", "scales"]
    assert most.fitted < left[ANCHORS].fitted
    assert most.left_out > 1.5 * left[ANCHORS].left_out
    assert set(few.held_out.best) < set(few.free)
    assert "do not help" in few.report()
    known = calibrate("cogiro", as_built(60, 0).measurements(), outliers=False).held_out
    assert known.after < 1.5e-3 < 0.02 < known.before
    assert known.best == ("anchors", "offsets")


def test_halves_with_too_few_readings_predict_nothing():
    """Three samples of eight cables do not determine 32 parameters; the six of both halves do."""
    solved = solve(load("cogiro"), as_built(6, 0).measurements(), ("anchors", "offsets"), {}, False)
    assert solved.model.parameters.varies.sum() == 32
    left = {one.free: one.left_out for one in compare(solved, ("anchors", "offsets"), {}).sets}
    assert left["anchors", "offsets"] == np.inf
    assert np.isfinite([left["offsets",], left[ANCHORS]]).all()


def test_one_sample_leaves_nothing_to_confirm_the_result():
    result = calibrate("cogiro", as_built(1, 7).measurements(), free=("offsets",))
    assert result.held_out.after == np.inf
    assert "half of the samples are too few" in result.report()


def test_the_report_lists_the_largest_changes_of_lengths():
    """A scale that is off by 0.2 % makes more of a cable's length than anchors that moved by millimetres."""
    built = as_built(100, 0, anchors=2e-3, noise=1e-4, offsets=0.0)
    readings = built.readings.copy()
    readings[:, 4] /= 1.002
    result = calibrate("cogiro", Measurements(readings, built.poses), ("anchors", "scales"), outliers=False)
    report = result.report()
    assert "cables[4].scale" in report
    assert "with no larger changes" in report
    changes = {one.name: abs(one.correction) for one in result.parameters if one.unit == "m"}
    listed = [name in report for name in changes]
    assert min(np.array(list(changes.values()))[listed]) > max(np.array(list(changes.values()))[np.invert(listed)])


def test_auto_takes_what_helps():
    assert calibrate("cogiro", as_built(100, 0).measurements(), "auto").free == ("anchors", "offsets")
    assert calibrate("cogiro", as_built(100, 0, anchors=0.0).measurements(), "auto").free == ("offsets",)


@pytest.mark.parametrize("known", [True, False])
def test_wrong_readings_and_slips_are_found(known):
    built = as_built(200 if known else 130, 0)
    readings = built.readings.copy()
    readings[17, 3] += 0.4
    readings[44, 0] -= 0.05
    readings[120:, 5] -= 0.02 * known  # with unknown poses: test_calibration_unknown_poses.py
    wrong = Measurements(readings, built.poses if known else None)
    result = calibrate("cogiro", wrong)
    assert {(one.cable, one.sample) for one in result.outliers} == {(3, 17), (0, 44)}
    errors = {one.cable: one.error for one in result.outliers}
    assert errors[3] == pytest.approx(0.4, abs=0.06)
    assert errors[0] == pytest.approx(-0.05, abs=0.02)
    assert [(slip.cable, slip.sample) for slip in result.slips] == [(5, 120)] * known
    for slip in result.slips:
        assert slip.size == pytest.approx(0.02, abs=4 * slip.sigma)
        assert slip.sigma < 1e-3
    clean = calibrate("cogiro", built.measurements(known))
    assert not clean.outliers
    assert not clean.slips
    assert result.residual_after == pytest.approx(clean.residual_after, rel=0.05)
    report = result.report()
    assert ("cables[5] slipped on its winch: from sample 120" in report) == known
    assert "cables[3] at sample 17" in report


@pytest.mark.parametrize("seed", [5, 6])
def test_more_noise_than_stated_is_no_slip(seed):
    """Compare residuals with noise of which unknown poses absorb most: they are small beside it."""
    result = calibrate("cogiro", as_built(200, seed, noise=3 * NOISE, offsets=0.0).measurements(known=False), ANCHORS)
    assert result.noise == pytest.approx(3 * NOISE, rel=0.1)
    assert not result.slips
    assert not result.outliers


def test_chosen_poses_tell_more_than_random_ones():
    robot = load("cogiro")
    draw = np.random.default_rng(0)
    candidates = random_poses(robot, 300, draw)

    def spread(poses):
        lengths = Dynamics(robot).cable_lengths(poses)
        return np.linalg.slogdet(calibrate(robot, Measurements(lengths, poses)).covariance)[1]

    chosen = next_poses(robot, candidates, count=15)
    assert all((pose == candidates).all(axis=1).any() for pose in chosen)
    random = [spread(candidates[draw.choice(300, 15, replace=False)]) for _ in range(5)]
    assert spread(chosen) < min(random) - 5
    first = candidates[:12]
    so_far = calibrate(robot, Measurements(Dynamics(robot).cable_lengths(first), first))
    more = next_poses(so_far, candidates, count=5)
    assert spread(np.vstack([first, more])) < min(
        spread(np.vstack([first, candidates[draw.choice(300, 5)]])) for _ in range(5)
    )
    default = next_poses(robot, count=3)  # poses at which the robot can rest
    assert default.shape == (3, 6)


def test_tensions_lengthen_cables_with_a_stiffness():
    """Readings are of the cable without strain: with t / (E A) of 1 per mille it is 8 mm shorter than the distance."""
    data = load("cogiro").model_dump(mode="json")
    for cable in data["cables"]:
        cable["stiffness"] = 1e6
    robot = Robot.model_validate(data)
    draw = np.random.default_rng(0)
    poses = random_poses(robot, 40, draw)
    tensions = draw.uniform(200, 2000, (40, 8))
    readings = Dynamics(robot).cable_lengths(poses) / (1 + tensions / 1e6)
    result = calibrate(robot, Measurements(readings, poses, tensions=tensions))
    assert result.residual_after < 1e-9
    assert max(abs(one.correction) for one in result.parameters) < 1e-9
    assert calibrate(robot, Measurements(readings, poses)).residual_after > 1e-3


def test_a_calibrated_robot_is_a_robot_file(tmp_path):
    built = as_built(60, 0)
    result = calibrate("cogiro", built.measurements())
    robot = load(result.save(tmp_path / "as-built.yaml"))
    assert robot == result.robot
    np.testing.assert_allclose(robot.anchors, built.robot.anchors, atol=0.03)
    assert [cable.encoder.offset for cable in robot.cables] == pytest.approx(built.offsets, abs=0.03)
    known = {one.name.replace("offset", "encoder.offset"): one.sigma for one in result.parameters}
    assert robot.uncertainty.parameters == tuple(known)
    np.testing.assert_allclose(robot.uncertainty.sigmas, list(known.values()), rtol=1e-6)
    # Its own encoders explain the readings: nothing is left to correct.
    again = calibrate(robot, built.measurements())
    assert again.residual_before == pytest.approx(result.residual_after, rel=1e-6)
    assert max(abs(one.correction) for one in again.parameters) < 1e-6
    np.testing.assert_allclose(again.lengths(built.readings), built.readings + [c.encoder.offset for c in robot.cables])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"free": ("anchor",)}, "free must be 'auto' or some of anchors, attachments, .*, got 'anchor'"),
        ({"free": ()}, r"free must be 'auto' or some of .*, got \(\)"),
        ({"free": ("radii",)}, "free must not have radii for robot cogiro, which has no pulleys"),
        ({"prior": {"scales": 0.1}}, "prior must only have keys that are in free, anchors, offsets, got 'scales'"),
        ({"prior": {"anchors": 0}}, "prior.anchors must be a number from 1e-09 to 1000, got 0"),
        ({"free": ("clock",)}, "measurements.times must be given to estimate a clock offset, got none"),
        ({"outliers": 1}, "outliers must be True or False, got 1"),
        ({"robot": "ipanema-1"}, ".*"),
    ],
)
def test_wrong_arguments(arguments, message):
    measurements = as_built(20, 0).measurements()
    if "robot" in arguments:
        arguments = {"robot": "point-mass-3"}
        message = "measurements.lengths must have a column for each of the 3 cables of point-mass-3, got 8"
    with pytest.raises(InputError, match=message):
        calibrate(**{"robot": "cogiro", "measurements": measurements, **arguments})


def test_too_few_samples_are_refused():
    an = "an equation for each of the 32 parameters"
    with pytest.raises(InputError, match=rf"{an} .*, got 24 from 3 samples of 8 cables"):
        calibrate("cogiro", as_built(3, 0).measurements())
    with pytest.raises(InputError, match=rf"{an} .*, got 20 from 10 samples of 8 cables with 10 unknown poses"):
        calibrate("cogiro", as_built(10, 0).measurements(known=False))
    assert calibrate("cogiro", as_built(3, 0).measurements(), prior={"anchors": 0.02, "offsets": 0.05}).converged


def test_rotations_and_points_agree():
    angles = np.random.default_rng(0).uniform(-1.5, 1.5, (50, 3))
    R = points.rotations(angles)
    np.testing.assert_allclose(points.angles(R), angles, atol=1e-12)
