"""Mistakes of users: each is named by the file's robot and corrected; a sound log draws no remark."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.estimation.calibration import Measurements, calibrate, corrected, mistake
from towline.estimation.calibration.correction import correction_of
from towline.estimation.calibration.file_errors import loose
from towline.estimation.logs.clocks import realigned
from towline.models import Dynamics, load, points
from towline.solvers import solve_batch

from .recorded import motion, quaternions
from .robots_as_built import as_built, moved_anchors, random_poses
from .user_recordings import FRAME, PLATFORM, lengths_at, robot_file
from .warm import towline

ROBOTS = ("cogiro", "caroca-pulleys", "nist-robocrane", "wang-flying", "the-cable-robot-simulator", "ipanema-1")
NONE = ([0, 0, 0], Rotation.identity())


def a_log(name, seed=0, count=80, share=0.25, turn=0.4):
    """Robot, poses and readings of a robot whose anchors are 2 cm or 0.5 % off."""
    robot, draw = load(name), np.random.default_rng(seed)
    room = share * np.ptp(robot.home_anchors, axis=0)
    length = np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean()
    poses = random_poses(robot, count, draw, (*np.maximum(room, 0.3 * room.max()), turn, turn, turn))
    lengths = Dynamics(moved_anchors(robot, draw, min(0.02, 0.005 * length))).cable_lengths(poses)
    noise = draw.normal(0, min(1e-3, 2e-4 * length), lengths.shape)
    return robot, poses, lengths + noise - draw.normal(0, 0.05, robot.m)


def seen(poses, frame=NONE, body=NONE):
    """Poses as a motion capture sees them, whose frame has the pose `frame` in {G}, of a body B with X = T seen B."""
    (t, T), (b, B) = frame, body
    turned = T.inv() * Rotation.from_euler("xyz", poses[:, 3:]) * B.inv()
    place = T.inv().apply(poses[:, :3] - t) - turned.apply(np.asarray(b, dtype=float))
    return np.hstack([place, points.angles(turned.as_matrix())])


def mistakes(robot, poses, y):
    """28 wrong logs by name: poses and readings."""
    whole, scale = Rotation.from_euler("xyz", poses[:, 3:]), np.array([1e3] * 3 + [1] * 3)
    of, degrees = (
        (lambda R: np.hstack([poses[:, :3], points.angles(R.as_matrix())])),
        np.array([1] * 3 + [180 / np.pi] * 3),
    )
    exchanged, one = y.copy(), y.copy()
    exchanged[:, [0, 1]] = y[:, [1, 0]]
    one[:, 1] *= -1
    axes = {"z": Rotation.from_euler("z", 90, degrees=True), "x": Rotation.from_euler("x", 90, degrees=True)}
    any_turn = Rotation.from_euler("zyx", [133, 5, 3], degrees=True)
    body = Rotation.from_euler("zyx", [70, 20, -30], degrees=True)
    size = robot.length
    return {
        "two cables exchanged": (poses, exchanged),
        "cables shifted": (poses, np.roll(y, 1, axis=1)),
        "cables reversed": (poses, y[:, ::-1]),
        "sign of a cable": (poses, one),
        "sign of all cables": (poses, -y),
        "lengths in millimetres": (poses, 1e3 * y),
        "lengths in centimetres": (poses, 100 * y),
        "lengths in inches": (poses, y / 0.0254),
        "angles of a drum": (poses, y / 0.06),
        "metres said to be millimetres": (poses, 1e-3 * y),
        "positions in millimetres": (scale * poses, y),
        "positions in centimetres": (scale ** (2 / 3) * poses, y),
        "all in millimetres": (scale * poses, 1e3 * y),
        "degrees as radians": (degrees * poses, y),
        "radians as degrees": (poses / degrees, y),
        "inverse orientation": (of(whole.inv()), y),
        "quaternion w first": (of(Rotation.from_quat(whole.as_quat()[:, [3, 0, 1, 2]])), y),
        "intrinsic angles": (np.hstack([poses[:, :3], whole.as_euler("XYZ")]), y),
        "yaw first": (poses[:, [0, 1, 2, 5, 4, 3]], y),
        "rotation vector": (np.hstack([poses[:, :3], whole.as_rotvec()]), y),
        "frame turned": (seen(poses, ([1, 2, -0.5], axes["z"])), y),
        "frame anywhere": (seen(poses, ([1, 2, -0.5], any_turn)), y),
        "y upwards": (seen(poses, ([0, 0, 0], axes["x"]), ([0, 0, 0], axes["x"].inv())), y),
        "markers off": (seen(poses, body=([0.5 * size, 0.3 * size, 0.4 * size], NONE[1])), y),
        "markers turned": (seen(poses, body=([0.1, 0.05, 0.2], body)), y),
        "sign of x": (poses * [-1, 1, 1, 1, 1, 1], y),
        "y and z exchanged": (poses[:, [0, 2, 1, 3, 4, 5]], y),
        "angles of drums, degrees as radians": (degrees * poses, y / 0.06),
    }


@pytest.mark.parametrize("name", ROBOTS[:5])  # ipanema-1 is like cogiro
def test_mistakes_are_named_and_mended(name):
    """Each mistake with one of the robots."""
    robot, poses, y = a_log(name)
    length = np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean()
    for number, (what, (given, lengths)) in enumerate(mistakes(robot, poses, y).items()):
        if (number + ROBOTS.index(name)) % 5:
            continue
        found = mistake(robot, Measurements(lengths, given))
        assert found is not None, what
        assert found.text.isprintable()
        assert found.severe or what.startswith("markers"), what
        assert found.corrected is not None, (what, found.text)
        assert np.abs(found.corrected.poses - poses)[:, :3].max() < 0.03 * length, (what, found.text)
        apart = points.rotations(found.corrected.poses[:, 3:]) - points.rotations(poses[:, 3:])
        assert np.abs(apart).max() < 0.15, (what, found.text)
        # The factor of a drum is estimated, from anchors of the file.
        np.testing.assert_allclose(found.corrected.lengths, y, rtol=0.02 if "drum" in what else 1e-9, err_msg=what)
        assert mistake(robot, found.corrected) is None, what


def test_sound_logs_draw_no_remark():
    """Anchors, scales and offsets off, outliers, a slip, motions and single poses: 16 logs of eight robots."""
    names = (*ROBOTS, "acrobot", "planar-4")
    for k in range(16):
        robot, draw = load(names[k % len(names)]), np.random.default_rng(k)
        length = np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean()
        share, turn = draw.uniform(0.08, 0.3), draw.uniform(0.02, 0.4)
        size = share * np.ptp(robot.home_anchors, axis=0)
        size = (*np.maximum(size, 0.3 * size.max()), turn, turn, turn)
        smooth = k % 3 == 0
        poses = motion(robot, np.linspace(0, 40, 300), size) if smooth else random_poses(robot, 60, draw, size)
        built = moved_anchors(robot, draw, draw.uniform(0, 0.02) * length)
        y = Dynamics(built).cable_lengths(poses) * (1 + draw.normal(0, 0.003, robot.m)) - draw.normal(0, 0.1, robot.m)
        y += draw.normal(0, 1e-3, y.shape)
        if k % 4 == 1:
            y[draw.random(y.shape) < 0.02] += 0.2
        if k % 5 == 2:
            y[len(y) // 2 :, 0] += 0.05
        found = mistake(robot, Measurements(y, poses + draw.normal(0, 5e-4, poses.shape) * robot.dof_mask))
        assert found is None, (k, robot.name, found)


def test_angles_of_drums_in_another_frame():
    robot, poses, y = a_log("cogiro")
    frame = ([1, 2, -0.5], Rotation.from_euler("zyx", [133, 5, 3], degrees=True))
    found = mistake(robot, Measurements(y / 0.06, seen(poses, frame)))
    assert found.text.startswith(
        "the lengths look like multiples of 0.06 m, such as a drum's angles, and the poses seem"
    )
    np.testing.assert_allclose(found.corrected.lengths, y, rtol=1e-3)
    np.testing.assert_allclose(found.corrected.poses[:, :3], poses[:, :3], atol=0.1)


def test_two_mistakes_at_once():
    robot, poses, y = a_log("cogiro", 1)
    given = poses * [1e3, 1e3, 1e3, 1, 1, 1]
    measurements, texts = corrected(robot, Measurements(1e3 * y[:, ::-1], given))
    assert len(texts) in (1, 2)
    np.testing.assert_allclose(measurements.poses, poses, atol=1e-9)
    np.testing.assert_allclose(measurements.lengths, y, atol=1e-9)


@pytest.mark.parametrize("name", ["cogiro", "the-cable-robot-simulator"])
def test_the_clock_of_poses_is_aligned_again(name):
    """It runs 0.02 % fast, which poses in a wrong frame did not show: 6 ms of error at both ends of the log."""
    robot, draw = load(name), np.random.default_rng(2)
    true, times = moved_anchors(robot, draw), np.arange(0, 60, 0.04)
    size = np.repeat([0.1 * robot.length, 0.15], 3)
    rates, phases = draw.uniform(1, 3, (2, 6)), draw.uniform(0, 6, (2, 6))

    def motion(t):
        return robot.home + 0.5 * size * np.sin(rates[:, None] * t[:, None] + phases[:, None]).sum(axis=0)

    y = Dynamics(true).cable_lengths(motion(times)) + draw.normal(0, 3e-4, (len(times), robot.m)) - 0.05
    poses = motion(times + 0.004 - 2e-4 * (times - 30)) + draw.normal(0, 2e-4, (len(times), 6))
    found, clock = realigned(robot, Measurements(y, poses, times=times))
    assert clock.rate - 1 == pytest.approx(2e-4, abs=4e-5)
    assert clock.offset == pytest.approx(-0.004 - 2e-4 * 30, abs=1e-3)
    assert len(found) >= len(times) - 4
    before, after = (
        np.std(Dynamics(true).cable_lengths(one.poses) - one.lengths) for one in (Measurements(y, poses), found)
    )
    assert after < 5e-4 < 8e-4 < before


def test_poses_that_are_aligned_again_keep_their_noise():
    """They are interpolated, not smoothed once more: with less noise in poses, forces would seem to stretch less."""
    robot, draw, times = load("cogiro"), np.random.default_rng(2), np.arange(0, 40, 0.04)
    rates, phases = draw.uniform(1, 3, 6), draw.uniform(0, 6, 6)

    def motion(t):
        return robot.home + 0.1 * np.sin(rates * t[:, None] + phases)

    noise = draw.normal(0, 1e-3, (len(times), 6))
    measured = Measurements(Dynamics(robot).cable_lengths(motion(times)), motion(times + 0.04) + noise, times=times)
    found, _ = realigned(robot, measured)  # by one sample, so each pose is that of the sample before
    left = found.poses - motion(found.times)
    assert np.std(left) == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize(
    ("name", "mirror", "frame"), [("cogiro", "xzy", 0), ("caroca-pulleys", "yxz", 0), ("cogiro", "xyz", 1)]
)
def test_left_handed_axes(name, mirror, frame):
    """As of game engines: the mirror image of a symmetric robot looks like the robot with its cables reversed."""
    robot, poses, y = a_log(name)
    M = np.eye(3)[["xyz".index(axis) for axis in mirror]] if mirror != "xyz" else np.diag([1, -1, 1])
    anywhere = ([1, 2, -0.5], Rotation.from_euler("zyx", [133, 5, 3], degrees=True)) if frame else NONE
    given = seen(np.hstack([poses[:, :3] @ M.T, points.angles(M @ points.rotations(poses[:, 3:]) @ M.T)]), anywhere)
    found = mistake(robot, Measurements(y, given))
    assert "left-handed" in found.text
    apart = points.rotations(found.corrected.poses[:, 3:]) - points.rotations(poses[:, 3:])
    assert np.abs(apart).max() < (0.15 if frame else 1e-9)
    assert np.abs(found.corrected.poses - poses)[:, :3].max() < (0.03 * robot.length if frame else 1e-9)
    np.testing.assert_array_equal(found.corrected.lengths, y)


@pytest.mark.parametrize("order", ["YXZ", "ZXY", "yzx"])
def test_angles_in_the_order_of_their_axes(order):
    """As many programs write them: the first column is the first angle, about whichever axis."""
    robot, poses, y = a_log("cogiro")
    turned = Rotation.from_matrix(points.rotations(poses[:, 3:]))
    fixed, texts = corrected(robot, Measurements(y, np.hstack([poses[:, :3], turned.as_euler(order)])))
    assert len(texts) == 1
    assert texts[0].startswith("the angles look like")
    np.testing.assert_allclose(points.rotations(fixed.poses[:, 3:]), turned.as_matrix(), atol=1e-9)


def test_equally_probable_errors_are_not_mended():
    robot, poses, y = a_log("cogiro", turn=0.15)
    turned = Rotation.from_euler("xyz", poses[:, 3:])
    log = Measurements(y, np.hstack([poses[:, :3], points.angles(turned.inv().as_matrix())]))
    found = mistake(robot, log)
    if found is not None and found.corrected is None:
        with pytest.raises(InputError, match="must have one probable error that is known, got: "):
            corrected(robot, log)


def test_cables_that_are_slack_at_first_hide_no_mistake():
    """The platform stands on the ground, where readings are larger; displaced anchors would make up for that."""
    robot, poses, y = a_log("ipanema-1")
    poses[:5], y[:5] = poses[0], y[0] + 0.1
    for what in ("y upwards", "intrinsic angles"):
        given, lengths = mistakes(robot, poses, y)[what]
        found = mistake(robot, Measurements(lengths, given)).corrected
        apart = points.rotations(found.poses[:, 3:]) - points.rotations(poses[:, 3:])
        assert np.abs(apart).max() < 0.1, what


@pytest.mark.parametrize(("times", "error"), [(1, True), (0.2, False)])
def test_a_body_off_is_an_error_if_it_is_far_off(times, error):
    robot, poses, y = a_log("cogiro")
    off = mistakes(robot, poses, y)["markers off"][0]
    off[:, :3] = poses[:, :3] + times * (off[:, :3] - poses[:, :3])
    result = calibrate(robot, Measurements(y, off), outliers=False)
    assert bool(result.doubt) is error
    assert ("DO NOT USE" if error else "CHECK THE LOG: the poses seem to belong to a body") in result.report()
    assert result.to_dict()["doubt" if error else "hint"].count("the poses seem to belong to a body")


@pytest.mark.parametrize(
    ("world", "body", "order"),
    [(0, 0, "xyz"), (0, 35, "xyz"), (90, 0, "XYZ")],
    ids=["sound", "body", "world and angles"],
)
def test_frames_of_four_cables_that_sway(world, body, order, tmp_path):
    """Displaced ends of cables hide such frames, and a late clock does too; displaced ends alone are no error."""
    draw, times = np.random.default_rng(4), np.arange(0, 40, 0.05)
    robot = load(robot_file(tmp_path / "crane.yaml", FRAME, PLATFORM, [0, 0, 1, 0, 0, 0]))
    place = [0, 0, 1] + [0.8, 0.6, 0.3] * np.sin(times[:, None] * [0.55, 0.8, 0.43])
    turns = Rotation.from_euler("xyz", [0.12, 0.12, 0.06] * np.sin(times[:, None] * [1.1, 0.9, 0.7] + [0, 1, 2]))
    anchors = FRAME + draw.normal(0, 0.03 if body == world else 0.012, FRAME.shape)
    y = lengths_at(anchors, PLATFORM, place, turns.as_matrix()) + draw.normal(0, 5e-4, (len(times), 4)) - 0.1
    frame = np.array([0.4, -0.3, 0.0]) * (world > 0), Rotation.from_euler("z", world, degrees=True)
    off = np.array([0.03, -0.02, 0.1]) * (body > 0), Rotation.from_euler("z", body, degrees=True)
    poses = seen(np.hstack([place, turns.as_euler("xyz")]), frame, off)
    poses[:, 3:] = Rotation.from_euler("xyz", poses[:, 3:]).as_euler(order)
    found = mistake(robot, Measurements(y[:-1], poses[1:] if body else poses[:-1], times=times[:-1]))
    if body == world:
        assert found is None
        return
    assert found.severe
    fixed = Rotation.from_euler("xyz", found.corrected.poses[:, 3:])
    assert np.degrees((fixed * turns[body > 0 : len(times) - (not body)].inv()).magnitude()).max() < 8
    assert np.abs(found.corrected.poses[:, :3] - place[body > 0 : len(times) - (not body)]).max() < 0.08


@pytest.mark.parametrize(("turn", "where"), [([0, 0.2, 0], [0.05, 0, 0.1]), ([1, 2, -0.5], [3, 1, 0.2])])
def test_frames_of_planar_robots_bring_poses_into_their_plane(turn, where):
    robot, poses, y = a_log("planar-4", count=120)
    assert mistake(robot, Measurements(y, poses)) is None
    found = mistake(robot, Measurements(y, seen(poses, (where, Rotation.from_rotvec(turn)))))
    assert "measured in a frame" in found.text
    assert np.abs(found.corrected.poses - poses)[:, [1, 3, 5]].max() < 1e-3
    assert np.abs(found.corrected.poses - poses)[:, :3].max() < 0.06


def test_the_command_mends(tmp_path):
    robot, poses, y = a_log("cogiro", 2)
    for what, text in (
        ("frame anywhere", "the poses seem to be measured in a frame"),
        ("sign of a cable", "l1 seems to have"),
    ):
        given, lengths = mistakes(robot, poses, y)[what]
        Measurements(lengths, given).save(tmp_path / "log.nc")
        done = towline("calibrate", "cogiro", "log.nc", cwd=tmp_path, code=1)
        assert text in done.stderr
        assert done.stderr.endswith("; --fix corrects it\n")
        done = towline("calibrate", "cogiro", "log.nc", "--fix", "--json", "--out", "mine.yaml", cwd=tmp_path)
        told = json.loads(done.stdout)
        assert told["notes"][0].startswith(f"corrected: {text}")
        assert told["residual_after"] < 1.2e-3
        (tmp_path / "mine.yaml").unlink()


def test_standard_deviations_include_the_error_of_a_frame_that_was_found():
    """The file's anchors are 2 cm off, so the frame is too: taken as exact, errors would be 5 standard deviations."""
    z = []
    for seed in range(3):
        built = as_built(60, seed)
        lost = Rotation.from_euler("zyx", [80, 3, -5], degrees=True)
        fixed, texts = corrected("cogiro", Measurements(built.readings, seen(built.poses, ([1, -2, 0.5], lost))))
        result = calibrate("cogiro", fixed)
        assert len(texts) == 1
        assert result.free == ("anchors", "offsets", "frame")
        assert "include this error" in result.report()
        true = dict(zip(result.identifiable[:3], built.robot.anchors[0], strict=False))
        z += [(one.value - true[one.name]) / one.sigma for one in result.parameters if one.name in true]
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.6  # 9 numbers, nearly three of them independent
    assert "frame" in calibrate("cogiro", fixed, "auto").free


def test_files_of_stadiums_may_be_wrong_by_metres():
    """The errors of a file follow from a log, up to this limit, as without frames (`undetermined`)."""
    assert loose(120.0, ("anchors", "offsets", "frame"), {}) == {"anchors": pytest.approx(3.6)}


@pytest.mark.parametrize("what", ["frame turned", "cables reversed"])
def test_mistakes_in_two_files_with_two_clocks(what, tmp_path):
    robot, times = load("cogiro"), np.arange(0, 40, 0.01)
    pose_times = np.arange(2, 36, 0.02)
    size = (2, 1.6, 0.8, 0.2, 0.2, 0.2)
    readings = Dynamics(robot).cable_lengths(motion(robot, times, size))
    readings += np.random.default_rng(0).normal(0, 1e-3, readings.shape) + 0.05
    poses = motion(robot, pose_times, size)
    given = mistakes(robot, poses, np.zeros((len(poses), 8)))[what][0]
    lengths = mistakes(robot, motion(robot, times, size), readings)[what][1]
    names = ",".join(["t", *(f"l{i}" for i in range(8))])
    np.savetxt(tmp_path / "l.csv", np.column_stack([times, lengths]), "%.12g", ",", header=names, comments="")
    columns = np.column_stack([7200 + (1 + 4e-5) * pose_times, given[:, :3], quaternions(given)])
    np.savetxt(tmp_path / "p.csv", columns, "%.12g", ",", header="t,x,y,z,qx,qy,qz,qw", comments="")
    files = ("calibrate", "cogiro", "l.csv", "--poses", "p.csv", "--free", "offsets,clock")
    towline(*files, cwd=tmp_path, code=1)
    done = towline(*files, "--fix", "--json", cwd=tmp_path)
    told = json.loads(done.stdout)
    assert float(told["notes"][0].split()[6]) == pytest.approx(7200, abs=1e-2)
    assert any(note.startswith("corrected: ") for note in told["notes"])
    assert told["residual_after"] < 3e-3


ORDERS = {"exchanged": ([1, 0, *range(2, 8)], 1.0), "mm": (range(8), 1e3), "both": ([1, 0, *range(2, 8)], 1e3)}


@pytest.mark.parametrize("what", ORDERS)
def test_mistakes_with_cables_that_stretch_by_measured_tensions(what):
    """Cables of 20 kN stretch by up to 25 cm here, which looked like a scale of each cable, or hid the order."""
    (order, unit), rigid = ORDERS[what], load("cogiro")
    draw, times = np.random.default_rng(2), 0.1 * np.arange(300)
    cables = [cable.model_copy(update={"stiffness": 2e4}) for cable in rigid.cables]
    robot = rigid.model_copy(update={"cables": tuple(cables)})
    poses = motion(robot, times, (2, 1.2, 0.6, 0.1, 0.1, 0.1))
    A = Dynamics(robot).wrench_matrix(poses)
    w = Dynamics(robot).required_wrench(poses, 0 * poses, 0 * poses)
    least = robot.t_min * (1 + np.abs(np.sin(0.5 * times)))[:, None]
    tensions = solve_batch(A, w, least, robot.t_max, length=robot.length).tensions
    readings = Dynamics(robot).cable_lengths(poses) / (1 + tensions / 2e4) + draw.normal(0, 5e-4, tensions.shape)
    measured = tensions * (1 + draw.normal(0, 0.02, tensions.shape))
    sigma = {"lengths": 1e-3, "position": 1e-3, "rotation": 1e-3}
    log = Measurements(unit * readings[:, order], poses, times=times, tensions=measured[:, order], sigma=sigma)
    found = correction_of(robot, log)
    np.testing.assert_allclose(found.measurements.lengths * found.robot.encoders[:, 1], readings, atol=1e-9)
    np.testing.assert_allclose(found.measurements.tensions, measured, atol=1e-9)


def test_cable_speeds_in_a_wrong_frame_show_no_clock():
    """Poses with y upwards look at the beginning as the platform moves 18 s later, but the log has one clock."""
    robot, draw, times = load("cogiro"), np.random.default_rng(0), np.arange(0, 30, 0.1)
    later = motion(robot, times - 18.5)  # as it is seen at the beginning
    up = Rotation.from_euler("x", 90, degrees=True)
    begin = seen(motion(robot, times), (NONE[0], up.inv()), (NONE[0], up))
    share = np.clip((times - 11.5) / 7, 0, 1)[:, None]
    poses = begin + share**2 * (3 - 2 * share) * (later - begin)
    y = Dynamics(moved_anchors(robot, draw)).cable_lengths(poses) + draw.normal(0, 1e-3, (len(times), robot.m))
    found = mistake(robot, Measurements(y, seen(poses, (NONE[0], up), (NONE[0], up.inv())), times=times))
    assert found is not None
    assert "in axes of which y points up" in found.text
    np.testing.assert_allclose(found.corrected.poses, poses, atol=1e-9)


@pytest.mark.parametrize("heading", [0, 35])
def test_the_order_of_cables_beside_an_ahrs(heading):
    """Without positions, lengths at the measured orientations show it, in any heading and with any offsets."""
    robot, poses, y = a_log("cogiro", 3, count=30)
    turn = Rotation.from_euler("z", heading, degrees=True)
    seen_turned = turn * Rotation.from_euler("xyz", poses[:, 3:])
    attitudes = np.hstack([np.full((30, 3), np.nan), points.angles(seen_turned.as_matrix())])
    columns, sigma = [3, 0, 5, 1, 7, 2, 4, 6], {"lengths": 2e-3, "rotation": 5e-3}
    if not heading:
        assert mistake(robot, Measurements(y, attitudes, sigma=sigma)) is None
    found = mistake(robot, Measurements(y[:, columns], attitudes, sigma=sigma))
    order = np.argsort(columns)
    assert found.text.startswith(f"the cables look like columns {', '.join(f'l{j}' for j in order)} of the log")
    assert ("the world of the orientations looks turned" in found.text) == bool(heading)
    np.testing.assert_array_equal(found.corrected.lengths, y)
    left = Rotation.from_euler("xyz", found.corrected.poses[:, 3:]) * Rotation.from_euler("xyz", poses[:, 3:]).inv()
    assert np.degrees(left.magnitude()).max() < 2
