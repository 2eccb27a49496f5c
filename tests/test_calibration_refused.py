"""What a calibration refuses to write: slips of a log, values that predict worse than the file; and clock offsets."""

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.estimation.calibration import Measurements, calibrate, explanations
from towline.estimation.calibration.plausibility import mistake
from towline.models import Dynamics, Robot, load, points

from .robots_as_built import as_built, moved_anchors, random_poses
from .warm import towline


def doubt(robot, measurements):
    found = mistake(robot, measurements)
    return None if found is None else found.text


MM = np.array([1e3, 1e3, 1e3, 1, 1, 1])


def of_rotation(poses, rotation):
    return np.hstack([poses[:, :3], points.angles(rotation.as_matrix())])


def slips(poses, readings):
    """Poses and readings as they are logged by mistake, and what is said of them."""
    m, turned = readings.shape[1], Rotation.from_euler("xyz", poses[:, 3:])
    exchanged = readings.copy()
    exchanged[:, [1, 4]] = readings[:, [4, 1]]
    quaternions, inner = turned.as_quat(), turned.as_euler("XYZ")
    of_w_first = of_rotation(poses, Rotation.from_quat(quaternions[:, [3, 0, 1, 2]]))
    shifted = ", ".join(f"l{(i + 1) % m}" for i in range(m))
    return {
        "exchanged": (poses, exchanged, "l1 and l4 look exchanged"),
        "shifted": (poses, np.roll(readings, 1, axis=1), f"the cables look like columns {shifted} of the log"),
        "lengths": (poses, 1e3 * readings, "the lengths look like millimetres read as metres"),
        "positions": (MM * poses, readings, "the positions look like millimetres read as metres"),
        "both": (MM * poses, 1e3 * readings, "lengths and positions look like millimetres read as metres"),
        "backwards": (poses, -readings, "the lengths seem to have the wrong sign"),
        "degrees": (poses * [1, 1, 1, *[180 / np.pi] * 3], readings, "the angles look like degrees read as radians"),
        "radians": (poses * [1, 1, 1, *[np.pi / 180] * 3], readings, "the angles look like radians read as degrees"),
        "inverse": (of_rotation(poses, turned.inv()), readings, "the orientations look inverted"),
        "w first": (of_w_first, readings, r"the quaternions look like (w, x, y, z) read as (x, y, z, w)"),
        "inner": (np.hstack([poses[:, :3], inner]), readings, "the angles look like roll, pitch, yaw about z, y, x"),
        "yaw first": (poses[:, [0, 1, 2, 5, 4, 3]], readings, "the angles look like yaw, pitch, roll about x, y, z"),
        "vector": (np.hstack([poses[:, :3], turned.as_rotvec()]), readings, "the angles look like a rotation vector"),
    }


def a_log(name, seed, turn=0.4):
    robot, draw = load(name), np.random.default_rng(seed)
    room = 0.25 * np.ptp(robot.home_anchors, axis=0)
    poses = random_poses(robot, 80, draw, (*room, turn, turn, turn))
    built = as_built(80, seed, name, poses=poses)
    return robot, poses, built.readings


def test_slips_of_a_log_are_named():
    robot, poses, readings = a_log("caroca-pulleys", 0)
    assert doubt(robot, Measurements(readings, poses)) is None
    for given, lengths, text in slips(poses, readings).values():
        said = doubt(robot, Measurements(lengths, given))
        assert said is not None
        assert said.startswith(text)
        assert said.isprintable()


def test_good_logs_raise_no_doubt():
    """Anchors and poses may be far from the file and from home, readings wrong, residuals systematic."""
    # More of them are in test_calibration_mistakes.py.
    for name in ("planar-4", "point-mass-3", "wang-flying"):
        robot, draw = load(name), np.random.default_rng(0)
        length = np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean()
        built = moved_anchors(robot, draw, 0.03 * length)
        poses = random_poses(robot, 60, draw, (*3 * [0.2 * length], 0.3, 0.3, 0.3))
        readings = Dynamics(built).cable_lengths(poses) + draw.normal(0, 1e-3, (60, robot.m))
        readings += 3e-3 * np.sin(3 * poses[:, :1] + np.arange(robot.m))
        readings[draw.random(readings.shape) < 0.03] += 0.2
        readings[30:, 0] += 0.05
        assert doubt(robot, Measurements(readings, poses)) is None
        assert doubt(robot, Measurements(readings)) is None


def test_a_slip_is_not_written(tmp_path):
    robot, poses, readings = a_log("cogiro", 1)
    given, lengths, text = slips(poses, readings)["exchanged"]
    log = Measurements(lengths, given)
    result = calibrate(robot, log)
    assert result.doubt == result.refused
    assert f"DO NOT USE THIS RESULT: {text}" in result.report()
    with pytest.raises(InputError, match=f"got one that is refused: {text}"):
        result.save(tmp_path / "robot.yaml")
    log.save(tmp_path / "log.nc")
    done = towline("calibrate", "cogiro", "log.nc", "--json", cwd=tmp_path, code=1)
    assert done.stderr.count("\n") == 1
    assert f"cogiro-calibrated.yaml is not written: {text}" in done.stderr
    told = json.loads(done.stdout)
    assert told["file"] is None
    assert told["refused"].startswith(text)
    assert [path.name for path in tmp_path.iterdir()] == ["log.nc"]


def test_lengths_in_millimetres_without_poses():
    robot, _, readings = a_log("cogiro", 2)
    result = calibrate(robot, Measurements(1e3 * readings))
    assert result.refused.startswith("the lengths look like millimetres read as metres: they change by")
    assert result.robot.m == robot.m


def test_what_predicts_worse_than_the_file_is_not_written(tmp_path):
    """The file is right: each parameter more predicts worse."""
    robot, draw = load("cogiro"), np.random.default_rng(0)
    readings = Dynamics(robot).cable_lengths(random_poses(robot, 60, draw)) + draw.normal(0, 0.02, (60, robot.m))
    poses = random_poses(robot, 60, np.random.default_rng(0))
    result = calibrate(
        robot, Measurements(readings, poses, sigma=0.02), ("anchors", "attachments", "offsets", "scales")
    )
    assert result.held_out.after > result.held_out.before
    assert result.held_out.best == ()
    assert "validation samples fit worse than with the file's robot" in result.refused
    assert "DO NOT USE THIS RESULT" in result.report()
    with pytest.raises(InputError, match="fit worse than with the file's robot"):
        result.save(tmp_path / "robot.yaml")
    automatic = calibrate(robot, Measurements(readings, poses, sigma=0.02), "auto")
    assert automatic.free == ()
    assert automatic.refused.startswith("the file predicts validation samples as well")
    assert "FILE CONFIRMED" in automatic.report()
    assert "DO NOT USE" not in automatic.report()
    np.testing.assert_array_equal(automatic.robot.anchors, robot.anchors)
    assert "the file as it is" in automatic.report()


def motion(robot, t):
    rates = [2.1, 1.7, 2.7, 1.9, 2.4, 1.3]
    return robot.home + [1, 0.8, 0.3, 0.1, 0.1, 0.15] * np.sin(np.outer(t, rates)) * np.exp(-t[:, None] / 40)


@pytest.mark.parametrize("clock", [0.0, -3.3])
def test_a_clock_is_found_where_there_are_times_and_poses(clock):
    """By default, and offsets of many seconds too; small ones are in test_calibration.py."""
    robot, times = load("cogiro"), 0.06 * np.arange(250)
    built = as_built(250, 3, poses=motion(robot, times + clock))
    seen = motion(robot, times) + np.random.default_rng(0).normal(0, 5e-4, (250, 6))
    sigma = {"lengths": 1e-3, "position": 5e-4, "rotation": 5e-4}
    result = calibrate(robot, Measurements(built.readings, seen, times=times, sigma=sigma), outliers=False)
    assert result.clock == pytest.approx(clock, abs=1e-3)
    known = np.array([one.sigma for one in result.parameters if "anchor" in one.name])
    assert (np.abs(result.robot.anchors - built.robot.anchors).ravel() < 5 * known).all()
    assert result.refused is None


def test_poses_at_rest_have_no_clock():
    """A log of single poses may have times: between them nothing is known."""
    built = as_built(80, 0)
    result = calibrate("cogiro", Measurements(built.readings, built.poses, times=5.0 * np.arange(80)))
    assert result.free == ("anchors", "offsets")
    assert result.residual_after < 1.1e-3


def test_corrections_beyond_the_prior_are_named():
    built = as_built(80, 0, anchors=1e-4)
    readings = built.readings.copy()
    readings[:, 3] -= 0.5  # of its offset
    result = calibrate("cogiro", Measurements(readings, built.poses), prior={"anchors": 1e-3, "offsets": 0.05})
    (name, sigmas), *rest = result.beyond_prior
    assert name == "cables[3].offset"
    assert sigmas == pytest.approx(10, rel=0.2)
    assert not rest
    assert f"beyond 5 sigmas of the prior: cables[3].offset ({sigmas:.1f})" in result.report()
    assert result.to_dict()["beyond_prior"] == [{"name": name, "sigmas": sigmas}]
    assert calibrate("cogiro", built.measurements()).beyond_prior == ()


def test_no_radius_is_negative(monkeypatch):
    """Readings of systematic errors want any radius: the set is no candidate then, and nothing raises."""
    monkeypatch.setattr("towline.estimation.calibration.run.mistake", lambda *_: None)  # of input errors there are none
    robot = load("caroca-pulleys")
    draw = np.random.default_rng(4)
    poses = random_poses(robot, 40, draw, (0.3, 0.3, 0.1, 0.05, 0.05, 0.05))
    readings = Dynamics(robot).cable_lengths(poses) + 0.1 * np.sin(9 * poses[:, :1] + np.arange(robot.m))
    log = Measurements(readings, poses)
    for free in ("auto", ("anchors", "attachments", "offsets", "radii")):
        result = calibrate(robot, log, free)
        assert (result.robot.pulley_radii > 0).all()
        assert result.report()


@pytest.mark.parametrize("name", ["cogiro", "ipanema-1", "the-cable-robot-simulator"])
@pytest.mark.parametrize("seed", range(2))
def test_conventions_of_angles_that_cannot_be_told_apart(name, seed):
    """Turns of 0.15 rad tell little: what is said has the truth in it, or the log fits as well as it is."""
    robot, poses, readings = a_log(name, seed, turn=0.15)
    for case in ("inverse", "inner", "yaw first", "vector"):
        given, lengths, text = slips(poses, readings)[case]
        log = Measurements(lengths, given)
        said = doubt(robot, log)
        if said is not None:
            assert text.removeprefix("the angles look ") in said or "which cannot be determined" in said
            continue
        fitted = calibrate(robot, log, ("anchors", "attachments", "offsets"), outliers=False)
        assert fitted.noise < 1.1 * fitted.stated_sigma


def test_a_good_log_is_read_in_one_way(monkeypatch):
    """The check costs little where lengths and poses agree as well as was stated."""
    robot, poses, readings = a_log("cogiro", 0)
    monkeypatch.setattr(explanations, "interpretations", None)
    assert doubt(robot, Measurements(readings, poses)) is None


def test_save_names_its_argument():
    built = as_built(60, 0)
    with pytest.raises(InputError, match="path must be a path, got 3"):
        calibrate("cogiro", built.measurements()).save(path=3)


@pytest.mark.parametrize(("share", "refused"), [(0.2, False), (0.4, True)])
def test_a_fit_that_leaves_out_much_is_refused(share, refused):
    """Offsets of 0.1 m, with readings of which many are off by 30 to 100 mm."""
    robot, draw = load("planar-4"), np.random.default_rng(0)
    poses, moves = np.tile(robot.home, (150, 1)), np.flatnonzero(robot.dof_mask)
    poses[:, moves] += draw.uniform(-0.3, 0.3, (150, len(moves))) * np.where(moves < 3, 1, 0.3)
    lengths = Dynamics(robot).cable_lengths(poses) + draw.normal(0.1, 1e-3, (150, 4))
    wrong = draw.uniform(0.03, 0.1, lengths.shape) * draw.choice([-1, 1], lengths.shape)
    lengths += np.where(draw.random(lengths.shape) < share, wrong, 0)
    said = calibrate(robot, Measurements(lengths, poses), ["offsets"]).refused
    if refused:
        assert "% of the readings do not fit the others" in said
    else:
        assert said is None


def a_log_about_two_places(seed, wave=0.0):
    """Robot, log, and the true anchors and offsets (16,); the file's anchors have errors of 20 mm.

    About two places only, offsets look like anchors. `wave` [m] is the size of errors that repeat with the pose.
    """
    data, draw = load("point-mass-3").model_dump(mode="json"), np.random.default_rng(seed)
    corners = [[3, 2, 3], [-3, 2, 3.2], [-3, -2, 3], [3, -2, 2.8]]
    data["cables"] = [{**data["cables"][0], "anchor": corner} for corner in corners]
    robot, anchors = Robot.model_validate(data), corners + draw.normal(0, 0.02, (4, 3))
    offsets, middles = draw.normal(0, 0.3, 4), draw.uniform(-0.5, 0.5, (2, 1, 3))
    moved = (middles + draw.normal(0, 0.02, (2, 80, 3))).reshape(-1, 3)
    poses = np.hstack([robot.home[:3] + moved, np.tile(robot.home[3:], (160, 1))])
    lengths = np.linalg.norm(poses[:, None, :3] - anchors, axis=2) + draw.normal(0, 1e-3, (160, 4))
    lengths += wave * np.sin(60 * moved @ [[1, 0, 0.3, 0.5], [0, 1, 0.5, 0.2], [0.2, 0.4, 1, 0.6]])
    return robot, Measurements(lengths - offsets, poses, sigma=1e-3), np.hstack([anchors, offsets[:, None]]).ravel()


def test_what_a_log_does_not_tell_is_as_uncertain_as_the_file():
    """The file's values were kept along these directions, without any variance: anchors were 0.24 m off."""
    squares = []
    for seed in range(6):
        robot, log, truth = a_log_about_two_places(seed)
        found = calibrate(robot, log, ("anchors", "offsets"))
        error = np.array([one.value for one in found.parameters]) - truth
        squares.append(error @ np.linalg.solve(found.covariance, error))
        assert np.abs(error).max() < 0.08  # four standard deviations of the file's anchors
        assert "are assumed to be wrong by" in found.report()
    assert np.mean(squares) < 2 * len(truth)


def test_ends_that_the_file_knows_better_are_not_written():
    found = calibrate(*a_log_about_two_places(0, wave=8e-3)[:2], ("anchors", "offsets"))
    assert re.search(r"anchor.. would have a standard deviation of \d+ mm, and in the file it has", found.refused)
