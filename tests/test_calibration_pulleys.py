"""Calibration of robots whose cables run over pulleys that their files lack, against lengths from plain NumPy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from towline import Robot
from towline.estimation.calibration import Measurements, calibrate, missing_pulleys, mistake

from .framed import framed

CORNERS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
FLAT = np.array([[-1.5, 0, 0], [1.5, 0, 0], [1.5, 0, 2.2], [-1.5, 0, 2.2]])
ABOVE = np.column_stack([CORNERS * [1.8, 1.5], [2.5, 2.6, 2.4, 2.5]])
BOX = np.vstack([np.column_stack([CORNERS * [2.0, 1.6], np.full(4, height)]) for height in (2.5, 0.1)])
ON_BOX = np.vstack([np.column_stack([CORNERS * [0.2, 0.15], np.full(4, height)]) for height in (-0.12, 0.12)])
ROBOTS = {  # anchors, attachments, amplitudes of the motion, coordinates
    "planar": (FLAT, FLAT * 0.1 - [0, 0, 0.11], [0.8, 0, 0.5, 0, 0.15, 0], ["x", "z", "pitch"]),
    "point": (ABOVE, np.zeros((4, 3)), [1.0, 0.8, 0.5, 0, 0, 0], ["x", "y", "z"]),
    "box": (BOX, ON_BOX, [1.2, 0.9, 0.6, 0.15, 0.15, 0.2], ["x", "y", "z", "roll", "pitch", "yaw"]),
}


def over_pulleys(anchors, axis, radius, ends):
    """Lengths of cables to ends (N, m, 3): an arc in the plane of axis and end, then a tangent."""
    up = ((ends - anchors) * axis).sum(axis=2)
    beside = np.linalg.norm(ends - anchors - up[..., None] * axis, axis=2) - radius  # of the sheave's centre
    apart = np.hypot(beside, up)
    arc = np.pi - np.arctan2(up, beside) - np.arccos(radius / apart)
    return np.sqrt(apart**2 - radius**2) + radius * arc


def a_log(kind, seed, radius, axis=(0, 0, 1), count=600):
    """The robot's file, 60 s of a motion with poses known to 1 mm, and the true anchors and offsets (m, 4)."""
    draw, (anchors, attachments, moves, dof) = np.random.default_rng(seed), ROBOTS[kind]
    body = {"mass": 8.0, "inertia": [0.1, 0.1, 0.1, 0, 0, 0], "home": [0, 0, 1.1, 0, 0, 0], "dof": dof}
    file = framed(zip(anchors, attachments, strict=True), body)
    t, moves = 60 / count * np.arange(count), np.array(moves)
    waves = np.sin(np.multiply.outer(t, draw.uniform(0.3, 1.5, (4, 6))) + draw.uniform(0, 6, (4, 6))).sum(axis=1)
    poses = file.home + moves * waves / np.abs(waves).max(axis=0)
    built = anchors + draw.normal(0, 0.01, anchors.shape) * file.dof_mask[:3]
    turned = Rotation.from_euler("xyz", poses[:, 3:]).as_matrix()
    ends = poses[:, None, :3] + np.einsum("nij,mj->nmi", turned, attachments)
    offsets = draw.normal(0, 0.1, len(anchors))
    readings = over_pulleys(built, np.array(axis), radius, ends) - offsets + draw.normal(0, 1e-3, ends.shape[:2])
    seen = poses + draw.normal(0, 1e-3, poses.shape) * file.dof_mask
    log = Measurements(readings, seen, times=t, sigma={"lengths": 1e-3, "position": 1e-3, "rotation": 1e-3})
    return file, log, np.hstack([built, offsets[:, None]])


def surprise(result, truth):
    """Squares of the errors of anchors and offsets by their covariance, and the number of these."""
    known = [k for k, one in enumerate(result.parameters) if one.name.startswith("cables") and one.sigma < np.inf]
    at = [("x", "y", "z", "offset").index(result.parameters[k].name.split(".")[-1]) for k in known]
    cables = [int(result.parameters[k].name[7]) for k in known]
    error = np.array([result.parameters[k].value for k in known]) - truth[cables, at]
    return error @ np.linalg.solve(result.covariance[np.ix_(known, known)], error), len(known)


@pytest.mark.parametrize(
    ("kind", "radius", "axis"),
    [("planar", 0.05, (0, 0, 1)), ("point", 0.02, (0, 0, 1)), ("point", 0.05, (1, 0, 0)), ("box", 0.08, (0, 0, -1))],
)
def test_standard_deviations_include_pulleys_that_the_file_lacks(kind, radius, axis):
    """Anchors without pulleys fit the log to its noise, and are wrong by more than the radius."""
    file, log, truth = a_log(kind, 1, radius, axis, count=1500 if kind == "planar" else 600)
    result = calibrate(file, log)
    assert np.abs(result.robot.anchors - truth[:, :3]).max() > radius
    (way, found), *_ = result.missing_pulleys.radii.items()
    assert way in {(0, 0, 1): ("z",), (1, 0, 0): ("x",), (0, 0, -1): ("-z",)}[axis]
    assert found == pytest.approx(radius, rel=0.2)
    squares, count = surprise(result, truth)
    assert squares < chi2.ppf(0.999, count)
    assert "which the file lacks" in result.report()
    assert not [way for way in missing_pulleys._with_pulleys(file) if kind == "planar" and way.endswith("y")]
    # Axes that are less likely add little, although their radii could be larger.
    sigmas = [one.sigma for one in result.parameters if ".anchor." in one.name and one.sigma < np.inf]
    assert max(sigmas) < 1.3 * np.abs(result.robot.anchors - truth[:, :3]).max()


def test_pulleys_above_and_below_have_axes_of_their_own(monkeypatch):
    """Winches halfway up, from which cables go up to some pulleys, and down to others; some samples show that."""
    monkeypatch.setattr(missing_pulleys, "MOST_SAMPLES", 200)
    file, log, truth = a_log("box", 2, 0.06, np.repeat([[0, 0, 1], [0, 0, -1]], 4, axis=0))
    result = calibrate(file, log)
    (way, found), *_ = result.missing_pulleys.radii.items()
    assert way == "away from the platform along z"
    assert found == pytest.approx(0.06, rel=0.2)
    squares, count = surprise(result, truth)
    assert squares < chi2.ppf(0.999, count)


def test_standard_deviations_include_pulleys_of_several_radii():
    file, log, truth = a_log("planar", 1, np.array([0.04, 0.05, 0.06, 0.05]))
    squares, count = surprise(calibrate(file, log), truth)
    assert squares < chi2.ppf(0.999, count)


@pytest.mark.parametrize("kind", ROBOTS)
def test_a_sound_log_shows_no_pulleys(kind):
    for seed in range(2):
        file, log, truth = a_log(kind, seed, 0.0)
        result = calibrate(file, log)
        assert result.missing_pulleys is None
        assert "pulleys" not in result.report()
        squares, count = surprise(result, truth)
        assert squares < chi2.ppf(0.999, count)


def test_anchors_of_the_file_count_once_when_their_prior_is_given():
    """Errors of the file that look like pulleys are unlikely by chance, unless such errors are said to be usual."""
    file, log, _ = a_log("planar", 1, 0.05)
    _, sound, truth = a_log("planar", 1, 0.0)
    displaced = calibrate(file, log).robot.anchors - truth[:, :3]
    anchors = truth[:, :3] - displaced + np.random.default_rng(0).normal(0, 1e-3, displaced.shape) * [1, 0, 1]
    cables = [{**one, "anchor": at} for one, at in zip(file.model_dump()["cables"], anchors.tolist(), strict=True)]
    file = Robot.model_validate({**file.model_dump(mode="json"), "cables": cables})
    assert "z" in calibrate(file, sound).missing_pulleys.radii
    assert calibrate(file, sound, prior={"anchors": 0.2}).missing_pulleys is None


@pytest.mark.parametrize("spread", [0.01, 0.03])
def test_pulleys_that_a_log_does_not_show_widen_its_standard_deviations(spread):
    """Errors of the file hide pulleys: on average over robots, errors must be as large as stated, with and without."""
    draw, shares = np.random.default_rng(7), []
    for seed, radius in enumerate((0.0, 0.02)):
        file, log, truth = a_log("planar", seed, radius)
        anchors = truth[:, :3] + draw.normal(0, spread, (4, 3)) * [1, 0, 1]
        cables = zip(file.model_dump()["cables"], anchors.tolist(), strict=True)
        data = {**file.model_dump(mode="json"), "cables": [{**one, "anchor": at} for one, at in cables]}
        squares, count = surprise(calibrate(Robot.model_validate(data), log), truth)
        shares.append(squares / count)
    assert 0.05 < np.mean(shares) < 4


@pytest.mark.parametrize("kind", ["point", "box"])
def test_pulleys_that_a_log_excludes_do_not_widen_standard_deviations(kind):
    """Where residuals show radii of a few millimetres, a sound log is as accurate as if pulleys were known to lack."""
    pulley = {"radius": 1e-6, "axis": [0, 0, 1]}
    file, log, _ = a_log(kind, 0, 0.0)
    cables = [{**one, "pulley": pulley} for one in file.model_dump(mode="json")["cables"]]
    known = Robot.model_validate({**file.model_dump(mode="json"), "cables": cables})
    sigmas, least = ([one.sigma for one in calibrate(of, log).parameters] for of in (file, known))
    np.testing.assert_array_less(sigmas, 1.1 * np.array(least))


def test_limits_contain_95_percent_of_errors_with_and_without_pulleys():
    """Errors of variance 1, of which a share has pulleys, too: few, or so many that nearly all limits are wide."""
    draw, added = np.random.default_rng(0), np.array([0.0, 1.0, 30.0, 1e4])
    for share in (0.01, 0.04, 0.2, 0.9):
        errors = draw.normal(0, np.where(draw.random((400_000, 1)) < share, np.sqrt(1 + added), 1.0))
        within = np.abs(errors) < 1.96 * np.sqrt(missing_pulleys._widened(share, added))
        np.testing.assert_allclose(within.mean(axis=0), 0.95, atol=2e-3)


def test_anchors_that_are_displaced_together_hide_no_pulleys():
    """Poses in a frame 0.5 m off: residuals of a planar robot hardly show a radius, but its anchors do."""
    file, log, _ = a_log("planar", 1, 0.05)
    result = calibrate(file, log.changed(poses=log.poses + np.array([0.4, 0, -0.3, 0, 0, 0])))
    assert result.missing_pulleys.radii["z"] == pytest.approx(0.05, rel=0.2)


def test_a_planar_robot_turns_about_no_other_axis():
    """Readings over pulleys and a noisy angle agree better with no angle at all, but no convention can mean that."""
    anchors = np.array([[0, 0, 0.75], [1, 0, 0.75], [1, 0, 0], [0, 0, 0]])
    attachments = 0.03 * np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]])
    body = {"mass": 8.0, "inertia": [0.1, 0.1, 0.1, 0, 0, 0], "home": [0.5, 0, 0.37, 0, 0, 0]}
    file = framed(zip(anchors, attachments, strict=True), {**body, "dof": ["x", "z", "pitch"]})
    draw, t, moves = np.random.default_rng(17), 0.02 * np.arange(3000), []
    for sizes in ([0.25, 0, 0.13], [0, 0.12, 0]):
        waves = t[:, None, None] * draw.uniform(0.3, 1.4, (3, 3)) + draw.uniform(0, 6.28, (3, 3))
        waves = np.sin(waves).sum(axis=1)
        moves.append(waves / np.abs(waves).max(axis=0) * sizes)
    poses = file.home + np.hstack(moves)
    turned = Rotation.from_euler("xyz", poses[:, 3:]).as_matrix()
    ends = poses[:, None, :3] + np.einsum("nij,mj->nmi", turned, attachments)
    built = anchors + draw.normal(0, 4e-3, (4, 3)) * [1, 0, 1]
    readings = over_pulleys(built, np.array([0, 0, 1.0]), 0.02, ends) - draw.normal(0, 0.1, 4)
    readings += draw.normal(0, 5e-4, readings.shape)
    seen = poses + draw.normal(0, 1, poses.shape) * [5e-4, 0, 5e-4, 0, 5e-3, 0]
    assert mistake(file, Measurements(readings, seen, times=t)) is None
