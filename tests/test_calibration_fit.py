"""The fit reaches the minimum that MINPACK reaches, in about as many steps, or says that it did not."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

from towline.base.text import counted
from towline.estimation.calibration import (
    Measurements,
    calibrate,
    cross_validation,
    model as model_module,
    representative,
    starts,
)
from towline.estimation.calibration.autocorrelation import information_of
from towline.estimation.calibration.fit import fit
from towline.estimation.calibration.geometry import length_of
from towline.estimation.calibration.normal_equations import NormalEquations, curvature, metric
from towline.estimation.calibration.parameters import OF_CABLE
from towline.estimation.calibration.solving import model_of
from towline.estimation.logs.pose_track import PoseTrack
from towline.estimation.logs.smoothing import Polynomials
from towline.models import Dynamics, Robot, load
from towline.solvers import solve_batch

from .robots_as_built import as_built, moved_anchors

EACH = ("anchors", "attachments", "offsets", "scales")


def far_from_the_file(name, seed, moves, size, systematic=0.0):
    """A robot whose anchors are `size` [m] off, and poses along some coordinates alone."""
    draw, robot = np.random.default_rng(seed), load(name)
    built = moved_anchors(robot, draw, size)
    poses = robot.home + draw.uniform(-1, 1, (200, 6)) * moves * robot.dof_mask
    readings = Dynamics(built).cable_lengths(poses) - draw.normal(0, 0.05, robot.m)
    readings += systematic * np.sin(2 * poses[:, :1] + draw.uniform(0, 6, robot.m)) + draw.normal(
        0, 1e-3, readings.shape
    )
    return robot, Measurements(readings, poses)


def by_minpack(model):
    """Twice the cost of scipy's `lm`, from the same start, by the same residuals and derivatives."""
    varies, state, m = model.parameters.varies, model.begin(), model.robot.m

    def at(z):
        x = model.parameters.first.copy()
        x[varies] += z
        return state._replace(x=x)

    def derivatives(z):
        parts = model.linearised(at(z))[1]
        J = np.zeros((m, parts.cables.shape[1], model.parameters.count))
        for i in range(m):
            J[i, :, i * OF_CABLE : (i + 1) * OF_CABLE] = parts.cables[i]
        return J.reshape(-1, model.parameters.count)[:, varies]

    start = np.zeros(int(varies.sum()))
    return 2 * least_squares(lambda z: model.residuals(at(z)).readings.ravel(), start, derivatives, method="lm").cost


@pytest.mark.parametrize("free", [("anchors", "attachments", "offsets"), EACH])
@pytest.mark.parametrize("systematic", [0.0, 4e-3])
@pytest.mark.parametrize("seed", [3, 7])
def test_anchors_in_the_plane_of_motion(seed, systematic, free):
    """The derivative by how far an anchor is off the plane is nearly zero at first, and grows on the way."""
    robot, log = far_from_the_file("planar-4", seed, [0.3, 0, 0.3, 0, 0.2, 0], 0.7, systematic)
    model = model_of(robot, log, free, {})
    found = fit(model, model.begin(), length_of(robot))
    assert found.converged
    assert found.steps <= 130
    assert found.cost == pytest.approx(by_minpack(model), rel=1e-3)


@pytest.mark.parametrize(
    ("name", "moves"),
    [
        ("cogiro", [3, 1, 0.5, 0, 0, 0]),
        ("wang-flying", [0.5, 0.5, 0, 0, 0, 0]),
        ("wang-ctmrts-4", [0.5, 0.5, 0, 0, 0, 0]),
    ],
)
def test_poses_in_a_plane(name, moves):
    for seed in range(2):
        robot, log = far_from_the_file(name, seed, moves, 0.3)
        model = model_of(robot, log, ("anchors", "attachments", "offsets"), {})
        found = fit(model, model.begin(), length_of(robot))
        assert found.converged
        assert found.steps <= 130
        assert found.cost == pytest.approx(by_minpack(model), rel=1e-3)


def test_a_fit_that_is_not_finished_is_no_candidate(monkeypatch):
    built = as_built(60, 0)
    whole = calibrate("cogiro", built.measurements(), EACH, outliers=False)
    assert np.isfinite([one.left_out for one in whole.held_out.sets]).all()
    for module in (starts, cross_validation):
        monkeypatch.setattr(module, "fit", lambda *model, enough=0.0: fit(*model[:3], steps=2, enough=enough))
    cut = calibrate("cogiro", built.measurements(), EACH, outliers=False)
    assert not cut.converged
    assert "NOT CONVERGED" in cut.report()
    assert all(one.left_out == np.inf for one in cut.held_out.sets if "anchors" in one.free)


@pytest.mark.parametrize("seed", range(2))
def test_unknown_poses_take_few_steps(seed):
    """Poses follow the parameters through the curved valley of anchors and attachments."""
    readings = as_built(200, seed).readings
    result = calibrate("cogiro", Measurements(readings), ("anchors", "attachments", "offsets"), outliers=False)
    assert result.converged
    assert result._solved.fit.steps <= 15


def test_second_derivatives_of_lengths_by_poses():
    built = as_built(20, 0)
    model = model_of(load("cogiro"), Measurements(built.readings), ("anchors",), {})
    begin, h = model.begin(), 1e-6
    state = model.moved(begin, 0 * begin.x, np.tile([0.1, 0, 0, 0.3, -0.4, 0.5], (20, 1)))

    def gradient(at):
        residuals, derivatives = model.linearised(at)
        return np.einsum("mn,mni->ni", residuals.readings, derivatives.poses)

    residuals, derivatives = model.linearised(state)
    first = np.einsum("mni,mnj->nij", derivatives.poses, derivatives.poses)
    moves = h * np.repeat(np.eye(6)[:, None], 20, axis=1)  # (6, 20, 6)
    ends = [[gradient(model.moved(state, 0 * state.x, sign * move)) for sign in (1, -1)] for move in moves]
    numeric = np.stack([(after - before) / (2 * h) for after, before in ends], axis=2)
    found = first + curvature(residuals, derivatives)
    np.testing.assert_allclose(found, (numeric + np.swapaxes(numeric, 1, 2)) / 2, atol=1e-7 * np.abs(found).max())


@pytest.mark.parametrize("known", [True, False])
def test_a_log_in_parts_gives_the_same_result(monkeypatch, known):
    """With directions, known poses and a winch that slips in the middle; or with none of them."""
    robot, draw, times = load("cogiro"), np.random.default_rng(2), 0.5 * np.arange(60)
    poses = robot.home + [1, 0.8, 0.4, 0.1, 0.1, 0.2] * np.sin(np.outer(times, [1.1, 0.7, 0.9, 0.6, 0.8, 0.5]))
    built = as_built(60, 2, poses=poses)
    readings = built.readings.copy()
    readings[30:, 3] += 0.05 * known
    u = -np.swapaxes(Dynamics(robot).wrench_matrix(poses)[:, :3], 1, 2) + draw.normal(0, 0.01, (60, 8, 3))
    log = Measurements(readings)
    if known:
        log = Measurements(readings, poses, directions=u, sigma={"lengths": 1e-3, "directions": 0.01})
    prior = None if known else {"anchors": 0.02, "offsets": 0.05}
    whole = calibrate(robot, log, prior=prior)
    assert [(one.cable, one.sample) for one in whole.slips] == [(3, 30)] * known
    monkeypatch.setattr(model_module, "PART", 25)
    parts = calibrate(robot, log, prior=prior)
    assert [one.name for one in parts.parameters] == [one.name for one in whole.parameters]
    for name in ("value", "sigma"):
        one, other = ([getattr(parameter, name) for parameter in result.parameters] for result in (parts, whole))
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(parts.residuals, whole.residuals, atol=1e-7)
    assert parts.autocorrelation == pytest.approx(whole.autocorrelation, rel=1e-5)


def test_forces_in_parts_are_those_of_the_whole_log(monkeypatch):
    """Accelerations follow from all poses, so a part of the log has those of the whole one."""
    robot, draw, times = load("cogiro"), np.random.default_rng(3), 0.05 * np.arange(60)
    poses = robot.home + [1, 0.8, 0.4, 0.1, 0.1, 0.2] * np.sin(np.outer(times, [1.1, 0.7, 0.9, 0.6, 0.8, 0.5]))
    given = {"tensions": draw.uniform(500, 900, (60, 8)), "times": times, "sigma": {"position": 1e-3, "rotation": 1e-3}}
    u = -np.swapaxes(Dynamics(robot).wrench_matrix(poses)[:, :3], 1, 2) + draw.normal(0, 0.01, (60, 8, 3))
    log = Measurements(Dynamics(robot).cable_lengths(poses), poses, directions=u, **given)
    model = replace(model_of(robot, log, ("anchors", "clock", "mass", "com", "friction"), {}), ahead=0.02)
    state = model.begin()
    state.x[model.parameters.clock] = 0.02
    whole = NormalEquations.at(model, state, metric(model))
    monkeypatch.setattr(model_module, "PART", 17)
    parts = NormalEquations.at(model, state, metric(model))
    for name in ("cost", "S", "b", "Y", "y"):
        one, other = getattr(parts, name), getattr(whole, name)
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


@pytest.mark.parametrize("groups", [("anchors", "offsets"), ("anchors", "offsets", "scales")], ids=["forces", "scales"])
def test_parts_with_and_without_poses_count_as_in_the_whole_log(monkeypatch, groups):
    """Poses of the second half alone are known: tensions then serve in both halves, and so does the open size."""
    robot, draw, times = load("cogiro"), np.random.default_rng(4), 0.05 * np.arange(120)
    poses = robot.home + [1, 0.8, 0.4, 0.1, 0.1, 0.2] * np.sin(np.outer(times, [1.1, 0.7, 0.9, 0.6, 0.8, 0.5]))
    dynamics, still = Dynamics(robot), np.zeros_like(poses)
    A, w = dynamics.wrench_matrix(poses), dynamics.required_wrench(poses, still, still)
    tensions = solve_batch(A, w, robot.t_min, robot.t_max, length=robot.length).tensions
    scales = np.linspace(1, 1.02, 8) if "scales" in groups else 1.0
    readings = scales * dynamics.cable_lengths(poses) + draw.normal(0, 1e-3, (120, 8))
    sigma = {"position": 1e-3, "rotation": 1e-3, "lengths": 1e-3}
    known = np.where(np.arange(120)[:, None] < 60, np.nan, poses)
    log = Measurements(readings, known, sigma=sigma, tensions=None if "scales" in groups else tensions)
    prior = {"anchors": 0.02, "offsets": 0.05} | ({"scales": 0.05} if "scales" in groups else {})
    whole = calibrate(robot, log, free=groups, prior=prior)
    monkeypatch.setattr(model_module, "PART", 50)
    parts = calibrate(robot, log, free=groups, prior=prior)
    for name in ("value", "sigma"):
        one, other = ([getattr(parameter, name) for parameter in result.parameters] for result in (parts, whole))
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-7)


def test_autocorrelation_is_the_same_in_parts(monkeypatch):
    """Tensions that grow threefold along a log: the scale of friction is that of the whole log, not of a part."""
    robot, draw, times = load("cogiro"), np.random.default_rng(5), 0.05 * np.arange(250)
    poses = robot.home + [1, 0.8, 0.4, 0.1, 0.1, 0.2] * np.sin(np.outer(times, [1.1, 0.7, 0.9, 0.6, 0.8, 0.5]))
    tensions = draw.uniform(500, 900, (250, 8)) * np.linspace(1, 3, 250)[:, None]
    sigma = {"position": 1e-3, "rotation": 1e-3}
    log = Measurements(Dynamics(robot).cable_lengths(poses), poses, times=times, tensions=tensions, sigma=sigma)
    model = model_of(robot, log, ("anchors", "clock", "mass", "com", "friction"), {})
    p = int(model.parameters.varies.sum())
    whole, factor, _ = information_of(model, model.begin(), np.eye(p), np.eye(p))
    monkeypatch.setattr(model_module, "PART", 60)
    parts, again, _ = information_of(model, model.begin(), np.eye(p), np.eye(p))
    assert factor > 2
    assert again == pytest.approx(factor, rel=1e-9)
    np.testing.assert_allclose(parts, whole, rtol=1e-6, atol=1e-9 * np.abs(whole).max())


def test_memory_of_a_long_log():
    """At most 0.75 kB a sample of eight cables: a million samples need 1 GB with the log and all that is imported."""
    robot, draw, times, count = load("cogiro"), np.random.default_rng(1), 1e-3 * np.arange(30_000), 30_000
    swing = np.outer([1.1, 0.7, 0.9, 0.6, 0.8, 0.5], [times, times + 0.02]).reshape(6, 2, count)
    poses, later = (robot.home + [1, 0.8, 0.4, 0.1, 0.1, 0.2] * np.sin(one.T) for one in swing.swapaxes(0, 1))
    lengths = Dynamics(robot).cable_lengths(later) + draw.normal(0, 1e-3, (count, robot.m))
    log = Measurements(lengths, poses, times=times)
    tracemalloc.start()
    found = calibrate(robot, log, free=("anchors", "offsets", "clock"))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.clock == pytest.approx(0.02, abs=1e-4)
    assert peak < 750 * count + 20e6  # of the derivatives of a part


def test_of_an_oversampled_log_some_samples_are_used(monkeypatch):
    """They show clock, anchors, a slip and a wrong reading; motions that are hardly sampled need all."""
    monkeypatch.setattr(representative, "MANY", 600)
    monkeypatch.setattr(representative, "BLOCKS", 5)
    draw, count = np.random.default_rng(3), 6_000
    robot, times = load("cogiro"), 0.01 * np.arange(count)
    built, home = moved_anchors(robot, draw, 0.02), robot.home

    def poses(at):
        swing = np.sin(np.outer(at, [1.1, 0.7, 0.9, 0.6, 0.8, 0.5]) + np.arange(6))
        return home + [3, 2, 0.8, 0.1, 0.1, 0.3] * swing

    lengths = Dynamics(built).cable_lengths(poses(times + 0.017)) + draw.normal(0, 1e-3, (count, robot.m))
    lengths[4_000:, 5] += 0.04
    measured = poses(times) + draw.normal(0, 5e-4, (count, 6))
    log = Measurements(lengths, measured, times=times, sigma={"lengths": 1e-3, "position": 5e-4, "rotation": 5e-4})
    samples = representative.representative(robot, log)
    assert np.ptp(np.diff(samples)) == 0
    assert 600 <= len(samples) <= 1200
    lengths[samples[100], 2] += 0.2
    found = calibrate(robot, log.changed(lengths=lengths))
    (slip,) = found.slips
    assert slip.cable == 5
    assert 0 <= slip.sample - 4_000 < 3 * samples[1]
    assert slip.size == pytest.approx(-0.04, abs=2e-3)
    assert f"cables[5].slip at sample {slip.sample}" in [one.name for one in found.parameters]
    earlier = f"(or up to {counted(samples[1] - 1, 'sample')} earlier, which were not used)"
    assert f"from sample {slip.sample} on {earlier} it is" in found.report()
    assert (2, samples[100]) in {(one.cable, one.sample) for one in found.outliers}
    assert found.clock == pytest.approx(0.017, abs=1e-3)
    names = [one.name for one in found.parameters]
    at = [i for i, name in enumerate(names) if ".anchor." in name]
    error = built.anchors.ravel() - [found.parameters[i].value for i in at]
    assert error @ np.linalg.solve(found.covariance[np.ix_(at, at)], error) < chi2.ppf(0.999, len(at))
    assert f"from {len(samples)} samples of a longer log" in found.report()
    shaken = log.changed(poses=measured + 0.01 * np.sin(0.25 * np.arange(count))[:, None])
    assert representative.representative(robot, shaken) is None
    lost = np.arange(count) % 97 == 5  # as of a camera, while cables are of constant length
    gaps = shaken.changed(poses=np.where(lost[:, None], np.nan, shaken.poses), lengths=np.full_like(lengths, 5.0))
    assert representative.representative(robot, gaps) is None
    swings = 0.1 * np.sin(times) * (times > 33) * (times < 43)
    rests = gaps.changed(poses=np.where(lost, np.nan, swings)[:, None] * np.ones(6))
    assert {3_500, 4_100} <= set(representative._blocks(rests))


def test_a_slip_in_a_pause_is_seen_from_the_first_sample_after_it():
    """The last sample before it shows nothing: due to the clock offset, its pose is inside the pause."""
    draw, robot = np.random.default_rng(3), load("cogiro")
    times = 0.05 * np.arange(400) + 20 * (np.arange(400) >= 200)

    def poses(at):
        return robot.home + [3, 2, 0.8, 0.1, 0.1, 0.3] * np.sin(np.outer(at, [1.1, 0.7, 0.9, 0.6, 0.8, 0.5]))

    lengths = Dynamics(robot).cable_lengths(poses(times + 0.02)) + draw.normal(0, 1e-3, (400, robot.m))
    lengths[200:, 5] += 0.04
    measured = poses(times) + draw.normal(0, 5e-4, (400, 6))
    log = Measurements(lengths, measured, times=times, sigma={"lengths": 1e-3, "position": 5e-4, "rotation": 5e-4})
    (slip,) = calibrate(robot, log).slips
    assert (slip.cable, slip.sample) == (5, 200)


def test_long_rests_hide_neither_a_motion_nor_how_fast_it_is():
    """Of 2000 s, the robot moves for 20 s in one part: slowly, or too fast for every second sample."""
    draw, robot, times = np.random.default_rng(4), load("planar-4"), 0.01 * np.arange(200_000)
    moves = (times > 911) & (times < 931)
    spacings = []
    for rate in (1.0, 20.0):
        swing = 0.1 * moves[:, None] * np.sin(rate * np.outer(times, [0.5, 0.7, 0.9, 1.1]))
        lengths = 3 + swing + draw.normal(0, 3e-4, (200_000, 4))
        log = Measurements(lengths, times=times, sigma={"lengths": 3e-4})
        assert moves[representative._blocks(log)].sum() > 1800
        spacings.append(representative._spacing(robot, log))
    assert spacings == [2, 1]
    # Readings at half of the rate, interpolated at the times of another computer, vary little from one to the next.
    lengths = 3 + 0.1 * np.sin(np.outer(times, [0.5, 0.7, 0.9, 1.1])) + draw.normal(0, 3e-4, (200_000, 4))
    lengths[1:-1:2] = (lengths[:-2:2] + lengths[2::2]) / 2
    assert representative._spacing(robot, Measurements(lengths, times=times, sigma={"lengths": 3e-4})) == 2


def test_poses_between_samples_have_the_variance_of_poses_at_samples():
    """Otherwise the offset of a clock would be wrong by up to half a sample, where poses vary least."""
    draw, times = np.random.default_rng(0), 0.01 * np.arange(4_000)
    noise = draw.normal(0, 1e-3, (4_000, 3)) + np.sin(times)[:, None]
    track = PoseTrack(times, noise, np.tile(np.eye(3), (4_000, 1, 1)), np.ones(4_000, dtype=bool), None)
    at, between = (np.var(track.at(clock)[0][:-1] - np.sin(times[:-1] + clock)[:, None]) for clock in (0.0, 0.005))
    assert between == pytest.approx(at, rel=0.004)
    assert at < 0.3e-6


def test_no_parabola_extends_over_a_pause():
    """The last two samples are too few for parabolas of their own."""
    t = np.concatenate([0.1 * np.arange(30), 50 + 0.1 * np.arange(20), [90.0, 90.1]])
    values = np.where(t < 10, t**2, 7 - 3 * (t - 50) ** 2)[:, None]
    fitted = Polynomials(t, 9).fitted(values)
    np.testing.assert_allclose(fitted.bends[:50, 0], np.where(t < 10, 2.0, -6.0)[:50], rtol=1e-6)
    assert np.isfinite(fitted.bends).all()


def test_a_large_robot_is_known_as_well_as_its_log_tells():
    """Files of stadiums are wrong by decimetres: along a cable the log knows more, though only to 0.1 m."""
    data, draw = load("point-mass-3").model_dump(mode="json"), np.random.default_rng(5)
    data["platform"]["home"] = [0, 0, 60, 0, 0, 0]
    data["cables"] = [{**cable, "anchor": [60 * x for x in cable["anchor"]]} for cable in data["cables"]]
    robot = Robot.model_validate(data)
    built, offsets = moved_anchors(robot, draw, 0.5), draw.normal(0, 0.5, robot.m)
    poses = robot.home + draw.uniform(-1, 1, (60, 6)) * [60, 60, 30, 0, 0, 0]
    readings = Dynamics(built).cable_lengths(poses) - offsets + draw.normal(0, 0.02, (60, robot.m))
    known = calibrate(robot, Measurements(readings, poses, sigma=0.02), outliers=False).robot
    names, covariance = list(known.uncertainty.parameters), np.array(known.uncertainty.covariance)
    truth = [offsets[int(name[7])] if "offset" in name else built.parameter_values([name])[0] for name in names]
    error = known.parameter_values(names) - truth
    assert 0.08 < np.sqrt(np.diag(covariance)).max() < 0.3
    assert error @ np.linalg.solve(covariance, error) < chi2.ppf(0.999, len(error)), error


def test_lengths_alone_of_a_large_robot_are_believed_as_far_as_they_tell():
    """A fit without poses may go tens of metres along directions that hardly change a length, and these bend."""
    data, draw = load("point-mass-3").model_dump(mode="json"), np.random.default_rng(0)
    data["platform"]["home"] = [0, 0, 15, 0, 0, 0]
    corners = [[100, 65, 45], [-100, 65, 45], [-100, -65, 45], [100, -65, 45]]
    data["cables"] = [{**data["cables"][0], "anchor": corner} for corner in corners]
    robot = Robot.model_validate(data)
    built, offsets = moved_anchors(robot, draw, 0.3), draw.normal(0, 0.3, robot.m)
    poses = robot.home + draw.uniform(-1, 1, (120, 6)) * [50, 30, 12, 0, 0, 0]
    readings = Dynamics(built).cable_lengths(poses) - offsets + draw.normal(0, 0.02, (120, robot.m))
    found = calibrate(robot, Measurements(readings, sigma=0.02), outliers=False)
    truth = np.hstack([built.anchors, offsets[:, None]]).ravel()
    error = np.array([one.value for one in found.parameters]) - truth
    values, vectors = np.linalg.eigh(found.covariance)
    known = values > 1e-12 * values[-1]
    assert known.sum() >= 4
    assert (error @ vectors[:, known]) ** 2 @ (1 / values[known]) < chi2.ppf(0.999, known.sum()), error
    assert np.abs(error).max() < 1.5  # of files that are wrong by 0.3 m, one standard deviation


def test_ends_of_cables_stay_in_the_plane_of_a_planar_robot():
    """Lengths do not tell the side to which an end is out of its plane, so errors of the model must not move it."""
    robot, log = far_from_the_file("planar-4", 3, [0.3, 0, 0.3, 0, 0.2, 0], 0.02)
    seen = log.poses + np.random.default_rng(3).normal(0, 5e-4, log.poses.shape) * [0, 1, 0, 0, 0, 0]
    wrong = log.changed(lengths=log.lengths * [1.0, 1.01, 0.99, 1.0], poses=seen)
    result = calibrate(robot, wrong, ("anchors", "offsets"), {"anchors": 0.03})
    ends = [one for one in result.parameters if one.name.endswith("anchor.y")]
    assert result.converged
    assert [one.correction for one in ends] == [0.0] * 4
    np.testing.assert_allclose([one.sigma for one in ends], 0.03, rtol=1e-6)


def test_errors_that_repeat_with_the_lengths_make_anchors_as_uncertain_as_they_are():
    """Waves of 2 mm along each cable, as of layers on a drum: more samples would not average them."""
    built = as_built(600, 0, noise=5e-4)
    waves = 2e-3 * np.sin(Dynamics(built.robot).cable_lengths(built.poses) * 2 * np.pi / 3 + np.arange(8))
    mixed = np.random.default_rng(0).permutation(600)
    for errors, known in ((waves, True), (waves[mixed], False)):
        log = Measurements(built.readings + errors, built.poses, sigma={"lengths": 5e-4})
        result = calibrate("cogiro", log, outliers=False)
        off = (result.robot.anchors - built.robot.anchors).ravel()
        own = [k for k, one in enumerate(result.parameters) if ".anchor." in one.name]
        squares = off @ np.linalg.solve(result.covariance[np.ix_(own, own)], off) / len(own)
        assert 0.2 < squares < 1.8
        assert (result.repeating is not None) == known
        if result.repeating:
            assert "repeat with the lengths of the cables" in result.report()
            assert 1e-3 < result.repeating.sigma * result.residual_after < 2.5e-3


def test_scales_that_explain_errors_that_repeat_are_estimated_too():
    """Drums 2 % larger than stated: without scales, anchors would be centimetres off; a sound log needs none."""
    built = as_built(200, 3, noise=5e-4)
    sound = calibrate("cogiro", Measurements(built.readings, built.poses), outliers=False)
    assert sound.free == ("anchors", "offsets")
    result = calibrate("cogiro", Measurements(built.readings / 1.02, built.poses), outliers=False)
    assert result.free == ("anchors", "offsets", "scales")
    assert np.abs(result.robot.anchors - built.robot.anchors).max() < 4e-3
    scales = np.array([one.value for one in result.parameters if one.name.endswith("scale")])
    np.testing.assert_allclose(scales, 1.02, atol=5e-4)


def test_offsets_are_as_uncertain_as_the_anchors_that_are_kept():
    """Ends of cables that a file has wrong by its usual 5 mm spoil offsets, which more samples do not tell."""
    squares = []
    for seed in range(10):
        built = as_built(12, seed, noise=1e-4, anchors=5e-3)
        result = calibrate("cogiro", Measurements(built.readings, built.poses), ["offsets"], outliers=False)
        off = np.array([one.value for one in result.parameters]) - built.offsets
        squares.append(off @ np.linalg.solve(result.covariance, off) / len(off))
    assert 0.6 < np.mean(squares) < 1.5
