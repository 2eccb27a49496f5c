"""Recordings of drum angles, of drones in north, east, down, and of locked winches, through the command line."""

import json
from contextlib import nullcontext

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Dynamics, InputError, load, read_measurements
from towline.estimation.calibration import Measurements, calibrate
from towline.estimation.calibration.correction import correction_of
from towline.estimation.calibration.plausibility import mistake
from towline.estimation.logs import read_log, recordings
from towline.estimation.logs.listing import listing
from towline.estimation.logs.measurements import measured_poses
from towline.estimation.logs.names import role, time_unit
from towline.estimation.logs.opening import from_csv

from . import user_recordings as user
from .warm import towline

RADIUS = np.array([0.05, 0.051, 0.049, 0.0495])  # [m] of the drums, about
TO_NED = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
FULL = 31.0  # [N] of thrust, recorded as 1


def drum_angles(folder):
    """Four cables and a motion capture, in one table, with angles of drums for lengths; the offsets."""
    _, offsets = user.four_cables(folder)
    robot = user.hanging_robot(folder)
    read = read_measurements(folder / "winches.csv", poses=folder / "mocap.csv", robot=robot)
    q = Rotation.from_euler("xyz", read.poses[:, 3:]).as_quat()
    header = ["t", *(f"l{i}" for i in range(4)), "x", "y", "z", "qx", "qy", "qz", "qw"]
    rows = np.column_stack([read.times, read.lengths / RADIUS, read.poses[:, :3], q])
    user.write(folder / "angles.csv", header, rows)
    return robot, offsets


def test_angles_of_drums_become_encoders(tmp_path):
    robot, _ = drum_angles(tmp_path)
    done = towline("calibrate", robot, "angles.csv", cwd=tmp_path, code=1)
    assert "such as a drum's angles" in done.stderr
    assert "Parameters" not in done.stdout  # which mean nothing
    told = json.loads(towline("calibrate", robot, "angles.csv", "--fix", "--json", cwd=tmp_path).stdout)
    assert "scales" in told["free"]
    assert told["residual_after"] < 1.5e-3
    scales = [cable.encoder.scale for cable in load(tmp_path / "hanging-calibrated.yaml").cables]
    np.testing.assert_allclose(scales, RADIUS, rtol=0.01)
    # The robot's file suits the log as it is, with which the file before is no model of the motion.
    assert "PASSED" in towline("simulate", "hanging-calibrated.yaml", "angles.csv", cwd=tmp_path).stdout
    failed = json.loads(towline("simulate", robot, "angles.csv", "--json", cwd=tmp_path, code=1).stdout)
    assert failed["explained_by"] == []
    said = towline("simulate", robot, "angles.csv", cwd=tmp_path, code=1).stdout
    assert "such as a drum's angles" in said
    assert "Parameters that may explain" not in said


@pytest.mark.parametrize("signs", [[-1, -1, -1, -1], [1, -1, 1, -1]])
def test_drums_that_turn_the_other_way(signs, tmp_path):
    """Nonsense was corrected instead: a frame tens of kilometres away."""
    robot, _ = drum_angles(tmp_path)
    head, *lines = (tmp_path / "angles.csv").read_text().splitlines()
    rows = np.array([line.split(",") for line in lines], dtype=float)
    rows[:, 1:5] *= signs
    user.write(tmp_path / "angles.csv", head.split(","), rows)
    towline("calibrate", robot, "angles.csv", "--fix", cwd=tmp_path)
    scales = [cable.encoder.scale for cable in load(tmp_path / "hanging-calibrated.yaml").cables]
    np.testing.assert_allclose(scales, RADIUS * signs, rtol=0.01)


@pytest.mark.parametrize(
    ("columns", "units"),
    [
        ([1, 0, 2, 3], RADIUS),
        ([1, 2, 3, 0], -RADIUS),
        ([0, 1, 2, 3], RADIUS / [1, 2, 1, 3]),  # two kinds of winches
        ([0, 1, 2, 3], np.full(4, 0.025)),  # nearly inches
        ([0, 1, 2, 3], np.array([1.0, 1e-3, 1, 1])),  # one amplifier in mm
    ],
)
def test_readings_of_any_size_and_order(columns, units, tmp_path):
    path, _ = drum_angles(tmp_path)
    robot, read = load(path), read_measurements(tmp_path / "angles.csv", robot=path)
    found = correction_of(robot, read.changed(lengths=(read.lengths * RADIUS / units)[:, np.argsort(columns)]))
    assert len(found.texts) == 1
    np.testing.assert_allclose([one.encoder.scale for one in found.robot.cables], units, rtol=0.017)
    np.testing.assert_allclose(found.measurements.lengths, read.lengths * RADIUS / units, rtol=1e-9)


@pytest.mark.parametrize("free", [(), ("--free", "auto")])
def test_corrected_encoders_are_written_if_nothing_else_is_to_improve(free, tmp_path):
    user.four_cables(tmp_path)
    robot = load(path := user.hanging_robot(tmp_path))
    poses = read_measurements(tmp_path / "winches.csv", poses=tmp_path / "mocap.csv", robot=robot).poses
    lengths = user.lengths_at(
        user.FRAME, user.PLATFORM, poses[:, :3], Rotation.from_euler("xyz", poses[:, 3:]).as_matrix()
    )
    lengths += np.random.default_rng(0).normal(0, 3e-4, lengths.shape)
    header = [*(f"l{i}" for i in range(4)), *"xyz", "roll", "pitch", "yaw"]
    user.write(tmp_path / "mm.csv", header, np.hstack([1e3 * lengths, poses]))
    done = towline("calibrate", path, "mm.csv", "--fix", *free, "--out", "fixed.yaml", cwd=tmp_path)
    assert "only the encoders of the file are corrected" in done.stderr
    assert [cable.encoder.scale for cable in load(tmp_path / "fixed.yaml").cables] == [1e-3] * 4
    assert load(tmp_path / "fixed.yaml").anchors.tolist() == robot.anchors.tolist()
    # Without --fix, or where it has nothing to correct, no file is written.
    user.write(tmp_path / "m.csv", header, np.hstack([lengths, poses]))
    towline("calibrate", path, "m.csv", "--fix", "--free", "auto", "--out", "none.yaml", cwd=tmp_path, code=1)
    assert not (tmp_path / "none.yaml").exists()


def test_signs_and_units_become_encoders(tmp_path):
    user.four_cables(tmp_path)
    robot = load(user.hanging_robot(tmp_path))
    read = read_measurements(tmp_path / "winches.csv", poses=tmp_path / "mocap.csv", robot=robot)
    log = read.changed(lengths=1e3 * read.lengths * [1, -1, 1, 1])
    found = correction_of(robot, log)
    assert not found.counted  # millimetres are exact
    assert found.measurements is not log
    np.testing.assert_allclose(found.measurements.lengths, log.lengths)
    np.testing.assert_allclose([one.encoder.scale for one in found.robot.cables], [1e-3, -1e-3, 1e-3, 1e-3])


def test_a_fit_that_moves_an_anchor_by_decimetres_is_refused(tmp_path):
    """Readings of locked winches do not change, so hardly anything tells an anchor from an offset."""
    user.locked(tmp_path)
    robot = load(user.hanging_robot(tmp_path))
    first, *others = robot.cables
    first = first.model_copy(update={"anchor": tuple(np.add(first.anchor, [0, 0.3, 0]))})
    robot = robot.model_copy(update={"cables": (first, *others)}).save(tmp_path / "wrong.yaml")
    done = towline("calibrate", robot, "locked.csv", "--free", "anchors,offsets", cwd=tmp_path, code=1)
    assert "not written: the log does not determine cables[0].anchor.y" in done.stderr
    assert "Parameters" not in done.stdout


def test_constant_readings_in_any_unit_are_offsets(tmp_path):
    """Angles of drums that do not turn: slack cables, which inertia shows, are left out, and anchors remain."""
    user.locked(tmp_path)
    header, *rows = [line.split(",") for line in (tmp_path / "locked.csv").read_text().splitlines()]
    rows = [[row[0], *(str(float(v) / 0.05) for v in row[1:5]), *row[5:]] for row in rows]
    (tmp_path / "locked.csv").write_text("\n".join(",".join(row) for row in [header, *rows]))
    log = read_measurements(tmp_path / "locked.csv")
    found = calibrate(user.hanging_robot(tmp_path), log, free=("anchors", "offsets"))
    assert found.refused is None
    assert np.abs(found.robot.anchors - user.FRAME).max() < 0.01


def flight(folder, ned, load=True):
    """Two drones with a load in a table, in north, east, down as PX4 records them, or in {G}."""
    draw = np.random.default_rng(0)
    t, x, drones = user.team(12)
    columns, names = [np.round(4e6 + 1e6 * (t - t[0])) if ned else t], ["timestamp"]

    def add(name, values, axes):
        columns.append(values @ TO_NED.T if ned and len(axes) == 3 else values)
        names.extend(f"{name}_{axis}" for axis in axes)

    if load:
        add("load", x + draw.normal(0, 5e-4, x.shape), "xyz")
    for i, (p, R, thrust, q) in enumerate(drones):
        add(f"cf{i + 1}", p + draw.normal(0, 5e-4, p.shape), "xyz")
        R = TO_NED @ R @ np.diag([1, -1, -1]) if ned else R
        add(f"cf{i + 1}", Rotation.from_matrix(R).as_quat()[:, [3, 0, 1, 2]], ["qw", "qx", "qy", "qz"])
        add(f"cf{i + 1}", (thrust / (FULL if ned else 1))[:, None], ["thrust"])
        add(f"cf{i + 1}_dir", draw.normal(0, 0.005, q.shape) - q, "xyz")
    user.write(folder / "flight.csv", names, np.column_stack(columns), form="%.12g")
    return user.team_robot(folder)


@pytest.mark.parametrize("ned", [False, True])
def test_two_drones_in_north_east_down(ned, tmp_path):
    """Microseconds, w first, axes that point down, thrust from 0 to 1: lengths and mass are found as in {G}."""
    robot = flight(tmp_path, ned)
    done = json.loads(towline("log", "flight.csv", "--json", "--robot", robot, cwd=tmp_path).stdout)
    assert done["files"][0]["topics"][0]["rate"] == pytest.approx(100, rel=1e-3)
    options = ["--free", "offsets", "--json", "--sigma", "position=0.0005"]
    told = json.loads(towline("calibrate", robot, "flight.csv", *options, cwd=tmp_path).stdout)
    assert any("read as north, east, down" in note for note in told["notes"]) == ned
    for one, length in zip(told["parameters"], (0.82, 0.79), strict=True):
        assert one["value"] == pytest.approx(length - 0.8, abs=5e-4)
    if ned:
        (note, *_) = [note for note in told["notes"] if "are not used" in note]
        # The file's load is 50 g lighter than the real one.
        assert float(note.split("cf1_thrust [")[1].split(" N]")[0]) == pytest.approx(FULL, rel=0.06)
        assert note.count("cf2_thrust [") == 1
        (tmp_path / "map.yaml").write_text(f"thrusts: cf*_thrust [{FULL} N]\n")
    fields = ["--fields", "map.yaml"] if ned else []
    options[1] = "offsets,mass"
    told = json.loads(towline("calibrate", robot, "flight.csv", *options, *fields, cwd=tmp_path).stdout)
    (mass,) = [one["value"] for one in told["parameters"] if one["name"] == "mass"]
    assert mass == pytest.approx(0.4, rel=0.01)
    assert "PASSED" in towline("simulate", "team-calibrated.yaml", "flight.csv", *fields, cwd=tmp_path).stdout


def test_drones_in_north_east_down_without_the_load(tmp_path):
    """Carriers below the origin, and directions of the cables in the same frame: the load is where it was."""
    robot = flight(tmp_path, True, load=False)
    done = towline("pose", robot, "--log", "flight.csv", "--sigma", "lengths=0.05", "--json", cwd=tmp_path)
    assert any("carriers would be below the origin" in note for note in json.loads(done.stdout)["notes"])
    found = np.loadtxt(tmp_path / "flight-poses.csv", delimiter=",", skiprows=1)[:, 1:4]
    # The file's cables are 0.8 m long, the real ones 20 mm longer and 10 mm shorter.
    assert np.sqrt(((found - user.team(12)[1]) ** 2).sum(axis=1).mean()) < 0.02
    flight(tmp_path, False, load=False)
    notes = json.loads(towline("pose", robot, "--log", "flight.csv", "--json", cwd=tmp_path).stdout)["notes"]
    assert not any("north" in note for note in notes)


def test_tensions_of_load_cells_that_are_negative(tmp_path):
    """A load cell that is mounted upside down measures compression."""
    robot = user.hanging_robot(tmp_path)
    user.statics(tmp_path, np.zeros(4))
    head, *lines = (tmp_path / "statics.csv").read_text().splitlines()
    rows = np.array([line.split(",") for line in lines], dtype=float)
    expected = read_measurements(tmp_path / "statics.csv", robot=robot).tensions
    rows[:, 7:] *= -1
    user.write(tmp_path / "negative.csv", head.split(","), rows)
    np.testing.assert_allclose(read_measurements(tmp_path / "negative.csv", robot=robot).tensions, expected)
    told = json.loads(towline("pose", robot, "--log", "negative.csv", "--json", cwd=tmp_path).stdout)
    assert any("read with the other sign" in note for note in told["notes"])


def test_an_ahrs_in_north_east_down(tmp_path):
    robot, offsets = user.hanging_robot(tmp_path), np.array([0.02, 0.006, -0.02, -0.01])  # [m]
    user.statics(tmp_path, offsets)
    head, *lines = (tmp_path / "statics.csv").read_text().splitlines()
    rows = np.array([line.split(",") for line in lines], dtype=float)
    turn = TO_NED @ Rotation.from_euler("xyz", rows[:, 4:7], degrees=True).as_matrix() @ np.diag([1.0, -1, -1])
    rows[:, 4:7] = Rotation.from_matrix(turn).as_euler("xyz", degrees=True)
    user.write(tmp_path / "ned.csv", head.replace("_deg", "").split(","), rows)  # degrees, though nothing says so
    options = ("--free", "offsets", "--fix", "--json")
    told = json.loads(towline("calibrate", robot, "ned.csv", *options, cwd=tmp_path).stdout)
    assert any("degrees read as radians, in axes north, east, down" in note for note in told["notes"])
    for one, offset in zip(told["parameters"], offsets, strict=True):
        assert abs(one["value"] - offset) < 4 * one["sigma"] + 5e-3


def test_an_ahrs_in_north_east_down_with_another_heading(tmp_path):
    """Quaternions w first as q0 to q3, load cells in grams, magnetic north 37 deg off, and an unknown CoM."""
    robot, offsets = user.hanging_robot(tmp_path), np.array([0.03, -0.02, 0.01, -0.03])
    user.statics(tmp_path, offsets)
    _, *lines = (tmp_path / "statics.csv").read_text().splitlines()
    rows = np.array([line.split(",") for line in lines], dtype=float)
    turn = Rotation.from_euler("z", 37, degrees=True) * Rotation.from_euler("xyz", rows[:, 4:7], degrees=True)
    q = Rotation.from_matrix(TO_NED @ turn.as_matrix() @ np.diag([1.0, -1, -1])).as_quat()[:, [3, 0, 1, 2]]
    names = [*(f"L{i} [cm]" for i in (1, 2, 3, 4)), *(f"q{i}" for i in range(4)), *(f"F{i} [g]" for i in (1, 2, 3, 4))]
    path = user.write(tmp_path / "ned.csv", names, np.hstack([100 * rows[:, :4], q, 1e3 * rows[:, 7:]]))
    robot.write_text(robot.read_text().replace("com: [0.01,", "com: [-0.02,"))
    built = load(robot)
    read = read_measurements(path, robot=built)
    np.testing.assert_allclose(read.tensions, user.KGF * rows[:, 7:], rtol=1e-8)
    found = mistake(built, read.only(slice(0, None, 2)))
    assert "north, east, down" in found.text
    seen = Rotation.from_matrix(measured_poses(built, found.corrected)[1])
    apart = seen.inv() * Rotation.from_euler("xyz", rows[::2, 4:7], degrees=True)
    assert np.degrees(apart.mean().magnitude()) < 2


def test_the_take_of_a_motion_capture_in_mm_with_y_up(tmp_path):
    """Millimetres are stated above all names, and the label of the rows is part of the name of the times."""
    draw, s = np.random.default_rng(3), np.arange(0, 6, 0.05)
    places = np.array([0, 0, 1.2]) + np.array([0.8, 0.6, 0.3]) * np.sin(np.outer(s, [1.1, 0.8, 0.6]))
    turns = Rotation.from_rotvec(0.3 * np.sin(np.outer(s, [0.7, 1.2, 0.9])))
    y = user.lengths_at(user.FRAME, user.PLATFORM, places, turns.as_matrix()) + draw.normal(0, 5e-4, (len(s), 4))
    user.write(tmp_path / "winches.csv", ["tick_ms", "l1", "l2", "l3", "l4"], np.column_stack([5e4 + 1e3 * s, y]))
    up = Rotation.from_matrix([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # from z up to y up
    q = (up * turns * up.inv()).as_quat()
    rows = np.column_stack([np.arange(len(s)), s, q, 1e3 * up.apply(places)])
    above = [
        "Format Version,1.23,Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global",
        *(f",{name}" + f",{value}" * 7 for name, value in (("Type", "Rigid Body"), ("Name", "platform"), ("ID", "1"))),
        ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position",
    ]
    user.write(tmp_path / "take.csv", ["Frame", "Time (Seconds)", *"XYZWXYZ"], rows)
    (tmp_path / "take.csv").write_text("\n".join(above) + "\n" + (tmp_path / "take.csv").read_text())
    robot = load(user.hanging_robot(tmp_path))
    read = read_measurements(tmp_path / "winches.csv", poses=tmp_path / "take.csv", robot=robot)
    found = mistake(robot, read)
    assert "measured in axes of which y points up, with their x along x of {G}" in found.text
    position, rotation, _ = measured_poses(robot, found.corrected)
    assert len(position) > 100
    np.testing.assert_allclose(position, places[: len(position)], atol=1e-9)
    np.testing.assert_allclose(rotation, turns[: len(position)].as_matrix(), atol=1e-9)


def test_the_angle_of_a_planar_robot_with_z_down(tmp_path):
    """It is the only one, whatever its name; a scale of 2 % hides neither the sign of z nor that of the angle."""
    robot, _ = user.planar(tmp_path)
    built, t = load(robot), np.arange(0, 12, 0.05)
    attachments, turns = np.array(built.attachments) * 3, 0.15 * np.sin(0.9 * t)
    ends = {f"cables[{i}].attachment.{axis}": attachments[i, k] for i in range(4) for k, axis in ((0, "x"), (2, "z"))}
    built = built.with_parameters(ends)
    places = np.column_stack([1.45 + 0.8 * np.sin(1.1 * t), 0 * t, 1.1 + 0.55 * np.sin(1.37 * t + 0.4)])
    rotation = Rotation.from_rotvec(np.outer(turns, [0, 1, 0])).as_matrix()
    y = user.lengths_at(built.anchors, attachments, places, rotation) / 1.02
    rows = np.column_stack([t, y, places[:, 0], -places[:, 2], np.degrees(turns)])
    path = user.write(tmp_path / "log.csv", ["t", "l1", "l2", "l3", "l4", "x", "z", "heading [deg]"], rows)
    found = mistake(built, read_measurements(path, robot=built))
    assert found.text.startswith("z of the positions seems to have the wrong sign")
    np.testing.assert_allclose(
        found.corrected.poses[:, [0, 2, 4]], np.column_stack([places[:, [0, 2]], turns]), atol=1e-9
    )


def test_names_of_joints_and_of_px4():
    found = role("/joint_states/position[winch_2_joint]")
    assert (found.role, found.which) == ("lengths", "2")
    assert [role(f"vehicle_attitude/q[{i}]").which for i in range(4)] == ["w", "x", "y", "z"]
    assert (role("TimeUS").role, role("TimeUS").unit) == ("time", "us")
    assert role("dir_x").role == "directions"
    assert [role(f"q{i}").which for i in range(4)] == ["w", "x", "y", "z"]
    assert {role(name).role for name in ("tick_ms", "clock", "Type/Name/ID/Time (Seconds)")} == {"time"}
    assert role("theta_deg") == ("angles", "pitch", "#", "deg")
    assert [role(f"F1_{unit}").unit for unit in ("g", "gf", "kg", "lbf")] == ["g", "gf", "kg", "lbf"]
    assert [role(name).unit for name in ("millis", "micros", "sensor/nanoseconds", "t_ms")] == ["ms", "us", "ns", "ms"]


@pytest.mark.parametrize(("step", "unit"), [(10_000, "us"), (1e7, "ns"), (200, "ms"), (0.01, "s"), (3, "s")])
def test_units_of_times_since_the_start(step, unit):
    assert time_unit(12_345_000 + step * np.arange(50)) == unit


def test_many_small_steps_are_milliseconds_if_seconds_would_be_hours():
    """100 Hz for 10 s; an hour with 400 samples and one at 10 Hz are in seconds."""
    assert time_unit(10 * np.arange(1000)) == "ms"
    assert time_unit(10 * np.arange(400)) == time_unit(np.arange(3600)) == time_unit(0.1 * np.arange(36_000)) == "s"


def test_the_title_of_a_sheet_is_no_part_of_the_names(tmp_path):
    (tmp_path / "log.csv").write_text("Run 12;;\ntime_usec;l1 [cm];X [m]\n0;101,5;1,5\n100000;102;1,6\n")
    topic = from_csv((tmp_path / "log.csv").read_bytes(), "log.csv").topics[""]
    assert list(topic.fields) == ["time_usec", "l1", "X"]
    assert (role("time_usec").unit, role("time_boot_ms").unit, role("X").role) == ("us", "ms", "position")


def test_lines_without_a_value_are_listed(tmp_path):
    (tmp_path / "log.csv").write_text("t,l1,l2\n0,1,1\n0.1,,1\n0.2,1,1\n")
    told = json.loads(towline("log", "log.csv", "--json", code=1, cwd=tmp_path).stdout)
    assert told["files"][0]["topics"][0]["empty"] == {"lengths": 1}
    assert "lines with missing lengths: 1" in towline("log", "log.csv", code=1, cwd=tmp_path).stdout


@pytest.mark.parametrize(
    ("rows", "missing"),
    [
        ("0,1,1\n0.1,,1\n0.2,1,1\n", "lengths in 1 of 3 lines"),
        ("0,1,1\n0.1,,\n0.2,1,1\n", None),  # a line of another sensor
        ("0,1,1\n0.1,,1\n0.2,1,1\n0.3,1,1\n0.4,1,1\n", None),
        ("0,,1\n0.1,,1\n0.2,1,\n", "lengths in 3 of 3 lines"),
    ],
)
def test_a_table_is_of_use_as_far_as_it_can_be_read(tmp_path, rows, missing):
    """More than a fifth of the lines lack some of the lengths: `read_measurements` refuses the table."""
    (tmp_path / "log.csv").write_text("t,l1,l2\n" + rows)
    assert listing(recordings(tmp_path / "log.csv"))["uses"]["calibration without poses"] == missing
    with nullcontext() if missing is None else pytest.raises(InputError, match="must be a finite number"):
        read_measurements(tmp_path / "log.csv")


@pytest.mark.parametrize("turn", [0.002, 0.2])
def test_attachments_of_a_platform_that_hardly_turns(turn):
    """Cables that stretch in proportion to the small pitch look like displaced attachments; `auto` keeps the file's."""
    robot, draw = load("planar-4"), np.random.default_rng(0)
    t = np.arange(0, 20, 0.05)
    poses = np.tile(robot.home, (len(t), 1))
    poses[:, 0] += 0.4 * np.sin(0.7 * t)
    poses[:, 2] += 0.3 * np.sin(1.1 * t)
    poses[:, 4] = turn * np.sin(2.3 * t)
    anchors = draw.normal(0, 0.01, (robot.m, 3)) * [1, 0, 1]
    names = [f"cables[{i}].anchor.{axis}" for i in range(robot.m) for axis in "xyz"]
    values = robot.parameter_values(names) + anchors.ravel()
    true = robot.with_parameters(dict(zip(names, values.tolist(), strict=True)))
    lengths = Dynamics(true).cable_lengths(poses)
    stretched = lengths * (1 - 0.5 * np.minimum(turn, 0.002) * np.sin(2.3 * t)[:, None] * [1, -1, 1, -1])
    log = Measurements(stretched + draw.normal(0, 1e-3, lengths.shape), poses, times=t)
    found = calibrate(robot, log, "auto")
    assert ("attachments" in found.free) <= (turn > 0.1)
    assert np.abs(found.robot.attachments - robot.attachments).max() < 0.01
    assert np.abs(found.robot.anchors - true.anchors)[:, [0, 2]].max() < 0.01
    free = ("anchors", "attachments", "offsets")
    assert ("leave them out" in calibrate(robot, log, free).report()) == (turn < 0.1)


def test_decimal_commas_and_a_map_for_one_of_two_files(tmp_path):
    """Semicolons, decimal commas, names and a time that only the map knows; the other file has usual ones."""
    robot, (anchors, _) = user.hanging_robot(tmp_path), user.four_cables(tmp_path)
    head, *lines = (tmp_path / "winches.csv").read_text().splitlines()
    names = ["Uhr", *(f"Seil {i + 1} [mm]" for i in range(head.count(";")))]
    rows = [line.split(";") for line in lines]
    rows = [[f"{(int(row[0]) - user.EPOCH * 10**9) / 1e6:.3f}", *row[1:]] for row in rows]
    text = [";".join(names), *(";".join(row).replace(".", ",") for row in rows)]
    (tmp_path / "winden.csv").write_text("\n".join(text), encoding="utf-8-sig")
    (tmp_path / "map.yaml").write_text("lengths: Seil *\n")
    files = ("winden.csv", "mocap.csv", "--fields", "map.yaml")
    failed = towline("calibrate", robot, *files, cwd=tmp_path, code=2).stderr
    assert "must have times, got none for Seil 1; a map (--fields) may name them" in failed
    (tmp_path / "map.yaml").write_text("lengths: Seil *\ntime: Uhr [ms]\n")
    told = json.loads(towline("calibrate", robot, *files, "--json", cwd=tmp_path).stdout)
    assert told["residual_after"] < 7e-4  # of 0.5 mm in lengths and 0.3 mm in positions
    found = {one["name"]: one for one in told["parameters"]}
    for i, axis in np.ndindex(4, 3):
        one = found[f"cables[{i}].anchor.{'xyz'[axis]}"]
        assert abs(one["value"] - anchors[i, axis]) < 4.5 * one["sigma"]
    (tmp_path / "map.yaml").write_text("lengths: Seil *\n")
    (note,) = read_log(tmp_path / "winden.csv", fields=tmp_path / "map.yaml").notes
    assert note.startswith("Uhr rises as a time does")


def test_attitudes_of_drones_in_degrees(tmp_path):
    """ArduPilot writes north, east, down and throttle without units; the suggested map gives the throttle one."""
    t, x, drones = user.team(12)
    ned, frd = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]), np.diag([1, -1, -1.0])
    names, columns = ["TimeUS"], [np.round(1e6 * t)]
    for i, (p, R, thrust, _) in enumerate(drones):
        names += [f"cf{i + 1}.{name}" for name in ("PN", "PE", "PD", "Roll", "Pitch", "Yaw", "ThO")]
        columns += [*(ned @ p.T), *Rotation.from_matrix(ned @ R @ frd).as_euler("xyz", degrees=True).T, thrust / FULL]
    names, columns = [*names, "load.PN", "load.PE", "load.PD"], [*columns, *(ned @ x.T)]
    user.write(tmp_path / "log.csv", names, np.column_stack(columns), form="%.12g")
    robot = user.team_robot(tmp_path)
    notes = read_log(tmp_path / "log.csv", robot=robot).notes
    assert sum("read in degrees" in note for note in notes) == 2
    (suggested, _) = (note.split("'")[1] for note in notes if "are not used" in note)
    (tmp_path / "map.yaml").write_text(suggested.replace(suggested.split("[")[2].split(" N")[0], str(FULL)))
    read = read_log(tmp_path / "log.csv", robot=robot, fields=tmp_path / "map.yaml")
    pull = np.linalg.norm(0.4 * (np.gradient(np.gradient(x, t, axis=0), t, axis=0) + user.GRAVITY), axis=1)
    both = sum(tension[:, None] * q for tension, (*_, q) in zip(read.measurements.tensions.T, drones, strict=True))
    assert np.median(np.abs(np.linalg.norm(both, axis=1) / pull - 1)) < 0.01
