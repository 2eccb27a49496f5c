"""Recordings as users have them, from other simulations, through the command line: what is found, and what is said."""

import json
import re

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from towline import InputError, Measurements, load, read_measurements
from towline.estimation.calibration import attitudes, calibrate
from towline.estimation.calibration.balance import needs_balance
from towline.estimation.calibration.enough import usual
from towline.estimation.calibration.geometry import length_of
from towline.estimation.calibration.plausibility import mistake
from towline.estimation.logs import read_log
from towline.estimation.logs.opening import from_csv

from . import user_recordings as user
from .warm import towline


def found(done):
    told = json.loads(done.stdout)
    return {one["name"]: (one["value"], one["sigma"]) for one in told["parameters"]}, told


def test_four_cables_with_a_motion_capture_of_another_clock(tmp_path):
    anchors, offsets = user.four_cables(tmp_path)
    robot = user.hanging_robot(tmp_path)
    files = (robot, "winches.csv", "--poses", "mocap.csv")
    values, told = found(towline("calibrate", *files, "--json", cwd=tmp_path))
    assert any("samples skipped because they repeat the time of the one before: 1" in note for note in told["notes"])
    clock = next(note for note in told["notes"] if "clock of the poses is" in note)
    assert float(clock.split(" is ")[1].split(" s ahead")[0]) + told["clock"] == pytest.approx(0.041, abs=2e-4)
    for i in range(4):
        for k, axis in enumerate("xyz"):
            value, sigma = values[f"cables[{i}].anchor.{axis}"]
            assert abs(value - anchors[i, k]) < 4 * sigma + 1e-4
            assert sigma < 5e-3
        assert abs(values[f"cables[{i}].offset"][0] - offsets[i]) < 4 * values[f"cables[{i}].offset"][1] + 1e-4
    # Poses by the calibrated robot, from the readings alone, are those of a slow motion.
    said = towline("simulate", "hanging-calibrated.yaml", *files[1:], cwd=tmp_path).stdout
    assert "PASSED" in said


def test_a_missing_reading_beside_the_file_of_a_motion_capture(tmp_path):
    user.four_cables(tmp_path)
    header, *rows = (tmp_path / "winches.csv").read_text().splitlines()
    rows[100] = rows[100].split(";")[0] + ";1800;;1900;2000"
    (tmp_path / "winches.csv").write_text("\n".join([header, *rows]) + "\n")
    files = {"poses": tmp_path / "mocap.csv", "robot": user.hanging_robot(tmp_path)}
    assert read_log(tmp_path / "winches.csv", **files).clock.offset == pytest.approx(0.041, abs=0.01)


def test_locked_winches_have_no_clock(tmp_path):
    user.locked(tmp_path)
    robot = user.hanging_robot(tmp_path)
    values, told = found(towline("calibrate", robot, "locked.csv", "--json", cwd=tmp_path))
    assert told["free"] == ["offsets"]
    for value, sigma in values.values():
        assert abs(value) < 4 * sigma + 1e-4
    said = towline("pose", robot, "--log", "locked.csv", cwd=tmp_path).stdout
    assert "lengths do not determine the pose: poses are those at rest" in said
    # Constant lengths show another frame, too.
    given, turn = read_measurements(tmp_path / "locked.csv", robot=robot), Rotation.from_euler("z", 40, degrees=True)
    turned = (turn * Rotation.from_euler("xyz", given.poses[:, 3:])).as_euler("xyz")
    moved = turn.apply(given.poses[:, :3]) + np.array([1, 0.4, -0.2])
    wrong = mistake(load(robot), given.changed(poses=np.hstack([moved, turned])))
    assert "measured in a frame that is turned by" in wrong.text
    np.testing.assert_allclose(wrong.corrected.poses[:, :3], given.poses[:, :3], atol=0.05)


def test_locked_winches_and_poses_in_two_files(tmp_path):
    """Constant lengths show no clock, and need none; nor do they show which of anchors and offsets are wrong."""
    head = user.locked(tmp_path).read_text().splitlines()[0].split(",")
    table, robot = np.genfromtxt(tmp_path / "locked.csv", delimiter=",", skip_header=1), user.hanging_robot(tmp_path)
    user.write(tmp_path / "winches.csv", head[:5], table[:, :5])
    for ahead in (0.3, 1e6):
        seen = np.column_stack([table[:, 0] + ahead, table[:, 5:]])
        user.write(tmp_path / f"camera{ahead:g}.csv", [head[0], *head[5:]], seen, form="%.12g")
    read = read_measurements(tmp_path / "winches.csv", poses=tmp_path / "camera0.3.csv", robot=robot)
    np.testing.assert_allclose(read.poses[:, :3], 1e-3 * table[: len(read), 5:8], atol=1e-9)
    held = ("hold only if the file's offsets are exact", "of the file's anchors")
    for free, kept, why in (("anchors", "offsets", held[0]), ("offsets", "anchors", held[1])):
        result = calibrate(robot, read, [free])
        assert f"{why}; with --free anchors,offsets --prior {kept}=0.02 they include errors of 20 mm" in result.report()
    along = 1e-3 * length_of(load(robot))  # error of each coordinate of an anchor, so also of that along the cable
    np.testing.assert_allclose([one.sigma for one in result.parameters], along, rtol=0.05)
    with pytest.raises(InputError, match="lengths must change to align the clocks, got readings of locked winches"):
        read_measurements(tmp_path / "winches.csv", poses=tmp_path / "camera1e+06.csv", robot=robot)


def test_locked_winches_show_how_wrong_the_anchors_of_a_file_are(tmp_path):
    """The swing shows about how far anchors are off the file's: by more than files usually are, to a factor of 3."""
    robot = load(tmp_path / user.hanging_robot(tmp_path))
    read, size = read_measurements(user.locked(tmp_path), robot=robot), 0.015  # [m]
    for seed in range(3):
        moved = user.FRAME + np.random.default_rng(seed).normal(0, size, (4, 3))
        names = {f"cables[{i}].anchor.{axis}": moved[i, k] for i in range(4) for k, axis in enumerate("xyz")}
        result = calibrate(robot.with_parameters(names), read)
        assert "(as residuals show) of the file's anchors" in result.report()
        assert all(size / 3 < one.sigma < 3 * size for one in result.parameters)


def test_rests_with_an_ahrs_and_load_cells(tmp_path):
    robot, offsets = user.hanging_robot(tmp_path), np.array([0.06, 0.006, -0.02, -0.01])
    places = user.statics(tmp_path, offsets)
    said = towline("pose", robot, "--log", "statics.csv", cwd=tmp_path).stdout
    assert "times as large as stated" in said  # because of the offsets
    values, told = found(towline("calibrate", robot, "statics.csv", "--free", "offsets", "--json", cwd=tmp_path))
    assert any("treated as accurate to 0.5 deg" in note for note in told["notes"])
    for i in range(4):
        value, sigma = values[f"cables[{i}].offset"]
        assert abs(value - offsets[i]) < 4 * sigma
        assert sigma < 6e-3
    exact = "of the file's anchors; with --free anchors,offsets --prior anchors=0.02 they include errors of 20 mm"
    text = (tmp_path / robot).read_text()
    for uncertain in ("", "uncertainty: {parameters: ['cables[0].anchor.x'], covariance: [[1.0e-4]]}\n"):
        (tmp_path / "uncertain.yaml").write_text(text + uncertain)
        read = read_measurements(tmp_path / "statics.csv", robot=tmp_path / "uncertain.yaml")
        assert (exact in calibrate(tmp_path / "uncertain.yaml", read, ["offsets"]).report()) == (not uncertain)
    said = towline("pose", "hanging-calibrated.yaml", "--log", "statics.csv", cwd=tmp_path).stdout
    assert "times as large as stated" not in said
    poses = np.loadtxt(tmp_path / "statics-poses.csv", delimiter=",", skiprows=1)
    errors = np.linalg.norm(poses[:, :3] - places, axis=1)
    assert np.sqrt((errors**2).mean()) < 0.01


def test_a_planar_robot_with_a_drum_scale_and_positions_alone(tmp_path):
    robot, anchors = user.planar(tmp_path)
    said = towline("log", "planar.csv", "--robot", robot, cwd=tmp_path).stdout
    assert "ee_x [m], ee_z [m]" in said
    assert "(--robot)" in towline("log", "planar.csv", cwd=tmp_path, code=1).stdout
    assert "clock" in usual(load(robot), read_measurements(tmp_path / "planar.csv", robot=robot))
    free = "anchors,offsets,scales,clock"
    values, told = found(towline("calibrate", robot, "planar.csv", "--free", free, "--json", cwd=tmp_path))
    assert told["clock"] == pytest.approx(-0.034, abs=5e-4)
    assert told["noise"] < 3e-4
    for i in range(4):
        assert abs(values[f"cables[{i}].scale"][0] - 1.02) < 4 * values[f"cables[{i}].scale"][1] + 1e-4
        for k, axis in ((0, "x"), (2, "z")):
            value, sigma = values[f"cables[{i}].anchor.{axis}"]
            assert sigma is None  # the platform is always level: how its attachments are turned stays open
            assert abs(value - anchors[i, k]) < 4e-3
    assert any(all(f"cables[{i}].anchor" in one for i in range(4)) for one in told["not_identifiable"])
    wrong = towline("pose", robot, "--log", "planar.csv", cwd=tmp_path, code=1).stdout
    assert "no pose fits the lengths of any sample" in wrong


def test_positions_alone_show_scales_of_drums_and_wrong_readings(tmp_path):
    """Unknown angles leave the size of the robot known, and so do a few missing positions."""
    robot, _ = user.planar(tmp_path, 12)
    read = read_measurements(tmp_path / "planar.csv", robot=robot)
    lengths, poses = read.lengths.copy(), read.poses.copy()
    lengths[100, 1] += 0.05
    poses[30:33] = np.nan
    result = calibrate(robot, read.changed(lengths=lengths, poses=poses))
    assert [(one.cable, one.sample) for one in result.outliers] == [(1, 100)]
    assert "scales" in result.free
    scales = [one for one in result.parameters if one.name.endswith(".scale")]
    assert all(abs(one.value - 1.02) < 4 * one.sigma for one in scales)
    assert max(one.sigma for one in scales) < 2e-3
    assert "anchors are" not in result.report()  # farther apart or closer together than in the file


def test_load_cells_do_not_make_a_calibration_by_positions_one_of_forces(tmp_path):
    """Four lengths tell how a planar platform of known position is turned; a few missing positions change nothing."""
    robot, _ = user.planar(tmp_path, 3)
    read = read_measurements(tmp_path / "planar.csv", robot=robot)
    poses, most, tensions = read.poses.copy(), read.poses.copy(), np.full(read.lengths.shape, 50.0)
    poses[30:33], most[:31] = np.nan, np.nan
    for known, wanted in ((read.poses, False), (poses, False), (most, True)):
        assert needs_balance(load(robot), read.changed(poses=known, tensions=tensions)) == wanted


def test_positions_alone_have_input_errors_too(tmp_path):
    robot, _ = user.planar(tmp_path)
    text = (tmp_path / "planar.csv").read_text()
    (tmp_path / "swapped.csv").write_text(text.replace("cable_len_0,cable_len_1", "cable_len_1,cable_len_0"))
    found = mistake(load(robot), read_measurements(tmp_path / "swapped.csv", robot=robot))
    assert "l0 and l1 look exchanged" in found.text
    assert found.severe


def test_missing_readings_and_a_table_of_two_sensors(tmp_path):
    """Readings that failed are left out; lengths and poses in different lines are interpolated."""
    robot, _ = user.planar(tmp_path, 12)
    head, *lines = (tmp_path / "planar.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines]
    rows[17][2] = ""
    rows[40][1:5] = ["nan"] * 4
    (tmp_path / "gaps.csv").write_text("\n".join([head, *(",".join(row) for row in rows)]))
    said = towline("calibrate", robot, "gaps.csv", "--free", "offsets,scales,clock", cwd=tmp_path).stdout
    assert "samples skipped because lengths or tensions are missing: 2" in said
    joined = []
    for row in rows:
        joined += [[*row[:5], "", ""], [f"{float(row[0]) + 0.004:.6g}", "", "", "", "", *row[5:]]]
    (tmp_path / "joined.csv").write_text("\n".join([head, *(",".join(row) for row in joined)]))
    read = read_measurements(tmp_path / "joined.csv", robot=robot)
    assert len(read) > 0.95 * len(rows)
    result = calibrate(load(robot), read, ["anchors", "offsets", "scales", "clock"])
    assert result.clock == pytest.approx(-0.034 + 0.004, abs=2e-3)
    assert result.noise < 4e-4


def test_headers_of_motion_capture_and_units_below_names(tmp_path):
    """The export of a motion capture system: bodies, markers and axes in lines above each other."""
    text = (
        "Format Version,1.23,Take Name,Take 1,Capture Frame Rate,100\n\n"
        ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker\n"
        ',Name,platform,platform,platform,platform,platform,platform,platform,"platform:1","platform:1","platform:1"\n'
        ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Position,Position,Position\n"
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z\n"
    )
    rows = [[k, 0.01 * k, 0, 0, 0.6, 0.8, 1 + 0.1 * k, 2, 3, 9, 9, 9] for k in range(200)]
    (tmp_path / "take.csv").write_text(text + "\n".join(",".join(map(str, row)) for row in rows) + "\n")
    said = towline("log", "take.csv", cwd=tmp_path, code=1).stdout  # it has no lengths
    assert "Rigid Body/platform/Position/X [m]" in said
    assert "Rigid Body/platform/Rotation/W [1]" in said
    assert "100 Hz" in said
    (tmp_path / "units.csv").write_text("time;l1;l2\ns;mm;mm\n0;1500;1600\n0.1;1510;1590\n")
    log = read_measurements(tmp_path / "units.csv")
    np.testing.assert_allclose(log.lengths, [[1.5, 1.6], [1.51, 1.59]])
    np.testing.assert_allclose(log.times, [0, 0.1])
    (tmp_path / "bad.csv").write_text(text + "0,0.0,0,0,0.6,0.8,1,2,3,9,9,9\n1,0.01,much,0,0.6,0.8,1,2,3,9,9,9\n")
    wrong = towline("log", "bad.csv", cwd=tmp_path, code=2)
    assert "line 8, column Rigid Body/platform/Rotation/X must be a number, got 'much'" in wrong.stderr


@pytest.mark.parametrize("what", ["sound", "north", "mount", "w first"])
def test_frames_of_an_ahrs(what, tmp_path):
    """Its world looks north, it is mounted on its side, or its quaternions begin with w."""
    robot, offsets = user.hanging_robot(tmp_path), np.array([0.02, 0.006, -0.02, -0.01])
    places = user.statics(tmp_path, offsets)
    head, *lines = (tmp_path / "statics.csv").read_text().splitlines()
    rows = np.array([line.split(",") for line in lines], dtype=float)
    turn = Rotation.from_euler("xyz", rows[:, 4:7], degrees=True)
    if what == "north":
        turn = Rotation.from_euler("z", 70, degrees=True) * turn
    elif what == "mount":
        turn = turn * Rotation.from_euler("y", 90, degrees=True)
    quaternions = turn.as_quat()[:, [3, 0, 1, 2]] if what == "w first" else turn.as_quat()
    header = [*head.split(",")[:4], "qx", "qy", "qz", "qw", *head.split(",")[7:]]
    user.write(tmp_path / "ahrs.csv", header, np.hstack([rows[:, :4], quaternions, rows[:, 7:]]))
    said = towline("pose", robot, "--log", "ahrs.csv", cwd=tmp_path).stdout
    expected = {
        "sound": "",
        "north": "the world of the orientations looks turned by 70",
        "mount": "the sensor of the orientations looks turned by ",
        "w first": "(w, x, y, z) read as (x, y, z, w)",
    }
    assert ("corrected" in said) == (what != "sound")
    assert expected[what] in said
    poses = np.loadtxt(tmp_path / "ahrs-poses.csv", delimiter=",", skiprows=1)
    assert np.sqrt(((poses[:, :3] - places) ** 2).sum(axis=1).mean()) < 0.06  # the offsets are not known here
    if what != "north":
        return
    assert mistake(load(robot), read_measurements(tmp_path / "ahrs.csv", robot=robot)).severe
    fixed, _ = found(towline("calibrate", robot, "ahrs.csv", "--free", "offsets", "--fix", "--json", cwd=tmp_path))
    for i in range(4):
        value, sigma = fixed[f"cables[{i}].offset"]
        assert abs(value - offsets[i]) < 4 * sigma + 5e-3


@pytest.mark.parametrize("heading", [0, 10])
def test_offsets_turn_a_small_platform_as_another_heading_does(heading, tmp_path):
    """Offsets and the CoM explain orientations that are right; otherwise the fit finds the heading."""
    offsets = np.array([0.05, -0.04, 0.03, 0.06])
    robot = load(user.hanging_robot(tmp_path))
    user.statics(tmp_path, offsets)
    given = read_measurements(tmp_path / "statics.csv", robot=robot, sigma={"lengths": 1e-3, "rotation": 0.009})
    turned = Rotation.from_euler("z", heading, degrees=True) * Rotation.from_euler("xyz", given.poses[:, 3:])
    found = mistake(robot, given.changed(poses=np.hstack([given.poses[:, :3], turned.as_euler("xyz")])))
    if heading == 0:
        assert found is None
        return
    assert "about (0, 0, -1)" in found.text
    error = (
        Rotation.from_euler("xyz", found.corrected.poses[:, 3:]) * Rotation.from_euler("xyz", given.poses[:, 3:]).inv()
    )
    assert np.degrees(error.magnitude()).max() < 1.0


def test_offsets_hide_how_an_ahrs_is_mounted(tmp_path):
    """Offsets of 0.1 m turn a facade robot by 10 degrees, as far as it turns itself; a fit finds the mounting."""
    draw = np.random.default_rng(4)
    corners = np.array([[7.0, 5], [-7, 5], [-7, -5], [7, -5]])
    ends = np.array([[*(xy * by), z] for xy in corners for by, z in ((1, 0.3), (1, 6), (0.09, 0.3), (0.09, -0.3))])
    ends = ends.reshape(4, 2, 2, 3)  # corner, anchors or attachments, low or high
    anchors, attachments = ends[:, 0].reshape(8, 3), ends[:, 1].reshape(8, 3)
    robot = load(user.robot_file(tmp_path / "facade.yaml", anchors, attachments, (0, 0, 2.8, 0, 0, 0), mass=60.0))
    places, turns = draw.uniform([-4, -2.5, 1.5], [4, 2.5, 4.2], (25, 3)), draw.normal(0, 0.12, (25, 3))
    lengths = user.lengths_at(anchors, attachments, places, user.turned(turns)) - draw.uniform(-0.1, 0.1, 8)
    mounted = Rotation.from_euler("xyz", [0, 15, 90], degrees=True)
    seen = Rotation.from_rotvec(draw.normal(0, 0.009, (25, 3))) * Rotation.from_rotvec(turns) * mounted
    poses = np.hstack([np.full((25, 3), np.nan), seen.as_euler("xyz")])
    given = Measurements(lengths, poses, sigma={"lengths": 1e-3, "rotation": 0.009})
    found = mistake(robot, given)
    assert "the sensor of the orientations looks turned by" in found.text
    left = Rotation.from_euler("xyz", found.corrected.poses[:, 3:]) * Rotation.from_rotvec(turns).inv()
    assert np.degrees(left.mean().magnitude()) < 1.0
    assert mistake(robot, found.corrected) is None


def test_an_ahrs_is_slightly_askew_and_the_com_is_elsewhere(tmp_path):
    """Eight cables with tensions, offsets of 0.1 m and a CoM 50 mm off: the sensor is turned by 5.4 degrees."""
    draw, com = np.random.default_rng(4), [0.04, -0.03, 0.0]
    corners = np.array([[2.2, 1.8, 3], [-2.2, 1.8, 3], [-2.2, -1.8, 3], [2.2, -1.8, 3]])
    anchors = np.repeat(corners, 2, axis=0) + draw.normal(0, 0.04, (8, 3))
    signs = [[1, -1, 1], [-1, 1, -1], [-1, -1, 1], [1, 1, -1], [-1, 1, 1], [1, -1, -1], [1, 1, 1], [-1, -1, -1]]
    attachments = np.array(signs) * [0.22, 0.18, 0.12]
    robot = load(user.robot_file(tmp_path / "eight.yaml", anchors, attachments, (0, 0, 1.2, 0, 0, 0), mass=40.0))
    places, turns = draw.uniform([-0.8, -0.6, 0.8], [0.8, 0.6, 1.5], (16, 3)), draw.normal(0, 0.06, (16, 3))
    pulls, weight = np.zeros((16, 8)), np.array([0, 0, -40 * 9.81])
    for k, (place, turn) in enumerate(zip(places, user.turned(turns), strict=True)):
        arms = attachments @ turn.T
        lines = anchors - place - arms
        lines /= np.linalg.norm(lines, axis=1)[:, None]
        W = np.hstack([lines, np.cross(arms, lines)]).T
        pulls[k] = lsq_linear(W, -np.concatenate([weight, np.cross(turn @ com, weight)]), (20, 2000), "bvls").x
    lengths = user.lengths_at(anchors, attachments, places, user.turned(turns)) - draw.uniform(-0.1, 0.1, 8)
    askew = Rotation.from_euler("xyz", [3, -4, 2], degrees=True)
    seen = Rotation.from_rotvec(draw.normal(0, 0.007, (16, 3))) * Rotation.from_rotvec(turns) * askew
    poses = np.hstack([np.full((16, 3), np.nan), seen.as_euler("xyz")])
    sigma = {"lengths": 1e-3, "rotation": 0.007, "tensions": 0.02}
    pulls *= 1 + draw.normal(0, 0.02, (16, 8))
    found = mistake(robot, Measurements(lengths, poses, tensions=pulls, sigma=sigma))
    assert "the sensor of the orientations looks turned by" in found.text
    left = Rotation.from_euler("xyz", found.corrected.poses[:, 3:]) * Rotation.from_rotvec(turns).inv()
    assert np.degrees(left.mean().magnitude()) < 1.5


def test_without_a_fit_only_clear_differences_of_orientations_are_errors(tmp_path, monkeypatch):
    """A heading that is off by 4 degrees leaves half of the differences: offsets may do as much, nothing decides."""

    def no_fit(*given):
        raise InputError("too few samples")

    robot = load(user.hanging_robot(tmp_path))
    user.statics(tmp_path, np.array([0.05, -0.04, 0.03, 0.06]))
    given = read_measurements(tmp_path / "statics.csv", robot=robot)
    monkeypatch.setattr(attitudes, "_fitted", no_fit)
    for heading, clear in ((4, False), (25, True)):
        turned = Rotation.from_euler("z", heading, degrees=True) * Rotation.from_euler("xyz", given.poses[:, 3:])
        poses = np.hstack([given.poses[:, :3], turned.as_euler("xyz")])
        assert (attitudes.misread_attitudes(robot, given.changed(poses=poses)) is not None) == clear


def test_a_motion_capture_that_repeats_the_last_pose(tmp_path):
    """It has lost the platform for a second, in a file with the names RX, RY, RZ, RW for quaternions."""
    anchors, _ = user.four_cables(tmp_path)
    robot = user.hanging_robot(tmp_path)
    _, *lines = (tmp_path / "mocap.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines if ",," not in line]
    for row in rows[401:500]:
        row[1:] = rows[400][1:]
    rows = [[*row[:4], *row[5:], row[4]] for row in rows]  # w last
    user.write(tmp_path / "mocap.csv", ["time_s", "TX", "TY", "TZ", "RX", "RY", "RZ", "RW"], rows)
    files = (robot, "winches.csv", "--poses", "mocap.csv")
    values, told = found(towline("calibrate", *files, "--json", cwd=tmp_path))
    said = "positions skipped because they repeat the previous one until the platform jumps: 99"
    assert any(said in note for note in told["notes"])
    for i in range(4):
        for k, axis in enumerate("xyz"):
            value, sigma = values[f"cables[{i}].anchor.{axis}"]
            assert abs(value - anchors[i, k]) < 4 * sigma + 1e-4


@pytest.mark.parametrize("offsets", [(0.0, 0.0), (0.4, -0.28), (7200.013, -0.02)])
def test_a_file_for_each_computer(offsets, tmp_path):
    """Load and drones in three files with the same columns and clocks of their own: distances show the offsets."""
    robot, draw = user.team_robot(tmp_path), np.random.default_rng(0)
    t, x, drones = user.team()
    load = np.column_stack([user.EPOCH + t, x + draw.normal(0, 5e-4, x.shape)])
    user.write(tmp_path / "load.csv", ["stamp", *"xyz"], load, form="%.14g")
    for i, (p, R, thrust, q) in enumerate(drones):
        named = ["thrust"] if i else [f"thrust_{axis}" for axis in "xyz"]  # a number or a vector in {G}
        pull = thrust if i else thrust[:, None] * R[:, :, 2]
        header = ["stamp", *"xyz", *(f"q{axis}" for axis in "xyzw"), *named, *(f"dir_{axis}" for axis in "xyz")]
        seen, turned = p + draw.normal(0, 5e-4, p.shape), Rotation.from_matrix(R).as_quat()
        table = np.column_stack([user.EPOCH + t + offsets[i], seen, turned, pull, -q])[100 + 50 * i : -200]
        user.write(tmp_path / f"cf{i + 1}.csv", header, table, form="%.14g")
    files = ("load.csv", "cf1.csv", "cf2.csv")
    told = json.loads(towline("calibrate", robot, *files, "--free", "offsets,mass", "--json", cwd=tmp_path).stdout)
    found = {one["name"]: one["value"] for one in told["parameters"]}
    assert found["mass"] == pytest.approx(0.4, rel=5e-3)
    for i, length in enumerate((0.82, 0.79)):
        assert found[f"cables[{i}].offset"] == pytest.approx(length - 0.8, abs=2e-4)
        (said,) = [note for note in told["notes"] if f"clock of cf{i + 1}" in note] or [None]
        assert (said is not None) == (abs(offsets[i]) > 0)
        if said:
            size, way = re.search(r"is ([\d.]+) s (ahead|behind)", said).groups()
            assert float(size) * (1 if way == "ahead" else -1) == pytest.approx(offsets[i], abs=2e-3)
    assert "thrusts of cf1 are vectors: their sizes are used, along the z axes of the bodies" in told["notes"]
    if abs(offsets[0]) > 1:
        logs = [part for file in files for part in ("--log", file)]
        assert "no pose fits" not in towline("pose", robot, *logs, cwd=tmp_path).stdout


@pytest.mark.parametrize(("frame", "sign"), [("world", -1), ("carrier", 1)])
def test_a_file_for_each_drone_without_the_load(frame, sign, tmp_path):
    """Directions of its cable show where the load was by the clock of the first drone, in whichever frame they are."""
    robot, draw, (t, _, drones) = user.team_robot(tmp_path), np.random.default_rng(3), user.team(8)
    directions = user.directions_of(drones, frame, sign)
    header = ["stamp", *"xyz", *(f"q{axis}" for axis in "xyzw"), *(f"dir_{axis}" for axis in "xyz")]
    for i, (p, R, *_) in enumerate(drones):
        seen, turned = p + draw.normal(0, 5e-4, p.shape), Rotation.from_matrix(R).as_quat()
        table = np.column_stack([user.EPOCH + t + (0.0, 7200.35)[i], seen, turned, directions[:, i]])
        user.write(tmp_path / f"cf{i + 1}.csv", header, table, form="%.14g")
    read = read_log([tmp_path / "cf1.csv", tmp_path / "cf2.csv"], {"directions": 0.01}, robot=tmp_path / robot)
    (said,) = [note for note in read.notes if "clock" in note]
    assert float(re.search(r"clock of cf2 is ([\d.]+) s ahead of that of cf1", said)[1]) == pytest.approx(
        7200.35, abs=6e-3
    )
    result = calibrate(tmp_path / robot, read.measurements, ["offsets"])
    for one, true in zip(result.parameters, (0.02, -0.01), strict=True):
        assert abs(one.correction - true) < 4 * one.sigma < 5e-3
    for i in range(2):
        path = tmp_path / f"cf{i + 1}.csv"
        table = np.genfromtxt(path, delimiter=",", skip_header=1)[:, :8]
        user.write(path, [*header[:8]], table, form="%.14g")
    with pytest.raises(InputError, match="must have positions of the platform or directions of the cables"):
        read_log([tmp_path / "cf1.csv", tmp_path / "cf2.csv"], robot=tmp_path / robot)


@pytest.mark.parametrize("world", ["up", "down"])
def test_clocks_of_drones_that_record_north_east_down(world, tmp_path):
    """A rigid load that turns under three drones: body axes that point down move the ends of its cables."""
    robot, draw, t = load("multi-quadrotor-3"), np.random.default_rng(0), np.arange(0, 20, 0.02)
    place = np.column_stack([np.sin(0.9 * t), 0.7 * np.sin(1.2 * t), 0.3 * np.sin(0.7 * t)])
    turn = Rotation.from_euler("xyz", np.column_stack([0.1 * np.sin(t), 0.1 * np.sin(1.3 * t), 0.5 * np.sin(0.4 * t)]))
    tracks = {"load": (0.0, place, turn)}
    for i, ahead in enumerate((3.2, -7.7, 5.1)):
        q = robot.carrier_home[i, :3] - robot.attachments[i] + 0.3 * np.sin(np.outer(t, [0.5, 0.8, 0.6]) + i)
        line = robot.cables[i].length * q / np.linalg.norm(q, axis=1)[:, None]
        level = Rotation.from_euler("z", 0.2 * np.sin(0.3 * t[:, None] + i))
        tracks[f"quad{i + 1}"] = ahead, place + turn.apply(robot.attachments[i]) + line, level
    ned, down = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]), Rotation.from_matrix(np.diag([1.0, -1, -1]))
    for name, (ahead, p, R) in tracks.items():
        if world == "down":
            p, R = p @ ned, Rotation.from_matrix(ned) * R * down
        table = np.column_stack([user.EPOCH + t + ahead, p + draw.normal(0, 5e-4, p.shape), R.as_quat()])
        user.write(tmp_path / f"{name}.csv", ["stamp", *"xyz", *(f"q{axis}" for axis in "xyzw")], table, form="%.14g")
    notes = read_log([tmp_path / f"{name}.csv" for name in tracks], robot=robot).notes
    for name, (ahead, *_) in list(tracks.items())[1:]:
        (said,) = [note for note in notes if f"clock of {name}" in note]
        assert float(re.search(r"is ([\d.]+) s", said)[1]) == pytest.approx(abs(ahead), abs=3e-3)


@pytest.mark.parametrize("stamps", [[2.0], [2.0 + 0.01 * k for k in range(20)], [np.nan]])
def test_a_clock_that_was_set_late_and_a_missing_time(stamps, tmp_path):
    """A drone stamps its first samples from boot on, which is decades before the others."""
    robot, (t, x, drones) = user.team_robot(tmp_path), user.team()
    user.write(tmp_path / "load.csv", ["stamp", *"xyz"], np.column_stack([user.EPOCH + t, x]), form="%.14g")
    for i, (p, *_) in enumerate(drones):
        table = np.column_stack([user.EPOCH + t + 0.4 * i, p])
        if i == 1 and np.isfinite(stamps[0]):
            table[: len(stamps), 0] = stamps
        elif i == 1:
            table[-1, 0] = np.nan
        user.write(tmp_path / f"cf{i + 1}.csv", ["stamp", *"xyz"], table, form="%.14g")
    files = [tmp_path / name for name in ("load.csv", "cf1.csv", "cf2.csv")]
    if np.isnan(stamps[0]):
        with pytest.raises(InputError, match=r"times must increase from sample to sample, got .* and then nan s at"):
            read_log(files, robot=tmp_path / robot)
        return
    read = read_log(files, robot=tmp_path / robot)
    (said,) = [note for note in read.notes if "clock" in note]
    assert float(re.search(r"clock of cf2 is ([\d.]+) s ahead", said)[1]) == pytest.approx(0.4, abs=1e-3)
    apart = np.linalg.norm(read.measurements.carrier_poses[:, :, :3] - read.measurements.poses[:, None, :3], axis=2)
    np.testing.assert_allclose(apart, np.broadcast_to([0.82, 0.79], apart.shape), atol=1e-3)


def test_a_first_row_of_data_may_begin_with_an_empty_cell():
    """As in a CSV of PlotJuggler, where each row has the values of one topic: it was taken for more names."""
    names = ["length_1 [m]", "length_2 [m]", "time [s]", "x [m]", "z [m]"]
    numbers = np.random.default_rng(3).uniform(0.1, 2, (6, 5))
    numbers[::2, :2], numbers[1::2, 3:] = np.nan, np.nan
    rows = ["", *(",".join("" if np.isnan(value) else repr(float(value)) for value in row) for row in numbers)]
    for above in ("", "a recording\n", "# of today\n"):
        table = from_csv((above + ",".join(names) + "\n".join(rows) + "\n").encode(), "topics.csv").topics[""]
        assert list(table.fields) == [name.split()[0] for name in names]
        np.testing.assert_array_equal(table.read(list(table.fields)).values, numbers)
    numbered = ",,1,1\nframe,time [s],x [m],z [m]\n0,0.1,1.5,2\n1,0.2,1.6,2\n"  # markers above names are no data
    table = from_csv(numbered.encode(), "markers.csv").topics[""]
    assert list(table.fields) == ["frame", "time", "1/x", "1/z"]


def test_auto_finds_that_cables_lie_in_layers_on_their_drums(tmp_path):
    """The radius of a drum grows with the cable on it; without `build-up` scales and offsets made up for it."""
    draw, path = np.random.default_rng(3), user.planar(tmp_path, 2)[0]
    robot = load(path)
    t = np.arange(0, 40, 0.2)
    place = np.column_stack([1.45 + 0.9 * np.sin(1.1 * t), 0 * t, 1.1 + 0.65 * np.sin(1.37 * t + 0.4)])
    turned = Rotation.from_euler("y", 0.1 * np.sin(0.9 * t)[:, None])
    ends = [np.array([getattr(cable, end) for cable in robot.cables]) for end in ("anchor", "attachment")]
    wound, offsets = 0.004, draw.normal(0, 0.02, 4)
    lengths = user.lengths_at(*ends, place, turned.as_matrix())
    readings = (np.sqrt(1.02**2 + 4 * wound * (lengths - offsets)) - 1.02) / (2 * wound)
    readings += draw.normal(0, 5e-4, readings.shape)
    measured = Measurements(readings, place, turned.as_quat())
    found = calibrate(robot, measured, free="auto")
    assert found.free == ("anchors", "offsets", "scales", "build-up")
    assert found.noise < 6e-4
    np.testing.assert_allclose([cable.encoder.build_up for cable in found.robot.cables], wound, atol=4e-4)
