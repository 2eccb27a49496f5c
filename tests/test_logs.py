"""Logs of every kind say the same; clocks of any offset and rate are aligned; hostile files are refused in one line."""

import json
import re
import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from towline import load
from towline.base.errors import InputError
from towline.estimation.logs import read_log, read_measurements, recordings
from towline.estimation.logs.mapping import fields_of
from towline.estimation.logs.names import role
from towline.estimation.logs.opening import from_csv
from towline.estimation.logs.recorded import TO_COMPARE
from towline.models import Dynamics, points

from .recorded import motion, quaternions, recorded, write_json_mcap, write_ros1_bag, write_ros2_bag, write_ros2_mcap
from .warm import towline

for package in ("mcap", "mcap_ros2", "rosbags"):
    pytest.importorskip(package, reason="the extra logs reads bags")

WRITERS = {
    "ros2.mcap": write_ros2_mcap,
    "json.mcap": write_json_mcap,
    "ros1.bag": write_ros1_bag,
    "bz2.bag": lambda path, *log: write_ros1_bag(path, *log, compression="BZ2"),
    "lz4.bag": lambda path, *log: write_ros1_bag(path, *log, compression="LZ4"),
    "ros2": write_ros2_bag,
}
BEGIN = 1.7e9  # [s], of a clock that counts from 1970


@pytest.fixture(scope="module")
def log():
    return recorded(begin=BEGIN, seconds=10)


@pytest.fixture(scope="module")
def files(log, tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    return {name: write(folder / name, *log) for name, write in WRITERS.items()}


def write_csv(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), "%.12g", ",", header=header, comments="")
    return path


@pytest.mark.parametrize("name", WRITERS)
def test_logs_of_every_kind_say_the_same(name, files, log):
    """Whatever the container, the poses are those written, and the lengths those of the robot at them."""
    read = read_log(files[name])
    measured = read.measurements
    _, _, pose_times, poses = log
    assert len(measured) == len(poses)
    assert read.begin == pytest.approx(BEGIN, abs=2)
    np.testing.assert_allclose(measured.times + read.begin, pose_times, atol=1e-6)
    np.testing.assert_allclose(measured.poses, poses, atol=1e-9)
    errors = Dynamics("cogiro").cable_lengths(poses) - measured.lengths
    assert np.abs(errors).max() < 6e-3  # noise of 1 mm
    assert errors.std() < 1.1e-3


def test_a_log_is_listed(files):
    done = towline("log", str(files["ros2.mcap"]), str(files["ros1.bag"]), "--json", code=1)
    told = json.loads(done.stdout)
    first, second = told["files"]
    assert (first["kind"], second["kind"]) == ("MCAP", "a bag of ROS 1")
    topics = {topic["topic"]: topic for topic in first["topics"]}
    assert topics["/winches"]["count"] == 1000
    assert topics["/winches"]["rate"] == pytest.approx(100, rel=1e-3)
    assert set(topics) == {"/winches", "/mocap/pose"}
    assert "must have one candidate for lengths" in told["problem"]
    done = towline("log", str(files["json.mcap"]))
    assert "/joints/joints[cable 1].position [m]" in done.stdout
    assert "pose from lengths          yes" in done.stdout


def test_gaps_are_listed(tmp_path):
    t = np.concatenate([np.arange(0, 1, 0.01), np.arange(3, 4, 0.01)])
    write_csv(tmp_path / "log.csv", "t,l1,l2,status", t, t, t, t)
    told = json.loads(towline("log", "log.csv", "--json", cwd=tmp_path).stdout)
    (topic,) = told["files"][0]["topics"]
    assert (topic["gaps"], topic["longest_gap"]) == (1, pytest.approx(2.01))
    assert told["uses"] == {
        "calibration with poses": "poses (or give another file with --poses)",
        "calibration without poses": None,
        "pose from lengths": None,
        "replay": TO_COMPARE,
    }


NAMES = {
    "lengths": [
        "l0",
        "L3",
        "length_1",
        "cable_2",
        "Cable Length 4",
        "winch3/position",
        "/winch_7/length/data",
        "rope5",
        "drum_2",
        "length_actual_1",
        "l1_meas",
        "field.position0",
        "/cable_lengths/data.3",
        "tether_4_length",
        "rho_1",
        *("motor1_pos", "winch_position_2", "Axis1.ActPos", "angle_1", "payout_1", "w1_length"),
        *("MAIN.fbAxis[1].nIncr", "GVL.fLength1", "Winde 1 Länge", "Winde 1 Laenge"),
    ],
    "tensions": [
        "tension0",
        "f2",
        "force_3",
        "cable_tension_1",
        "load cell 2",
        "/cable3/tension",
        "tensions[2]",
        "/loadcell_1/wrench.force.z",
        "/winch_3/ft/wrench.force.z",
        "/force_sensor_2/data/force/z",
        *("lc1_kg", "lc2_fz", "Seilkraft 2"),
    ],
    "position": [
        *("x", "pos_y", "position.z", "/mocap/pose.position.x", "field.pose.position.y", "px", "translation.z"),
        *("x_gt", "actual_y", "ground_truth_z", "x_mocap", "tcp_x", "Global Angle:platform/TX"),
        *("position[2]", "PN", "drone1.pos_d", "east", "mocapX", "LocalX", "Mocap/Position(1)"),
        *("PlatformPosition_1", "stPose.rX", "Northing"),
    ],
    "quaternion": ["qx", "q_w", "quat_z", "/mocap/pose.orientation.w", "rotation.x", "orientation_y", "Mocap/Quat(4)"],
    "angles": ["roll", "Yaw", "/imu/pitch", "roll_gt", "pitch (degrees)", "ry_deg", "EulerX", "rpy[2]", "imu_roll"],
    "thrusts": ["thrust_1", "/uav2/thrust_estimate/data", "quad1.thrust_measured", "thrust_cmd", "ThO"],
    "thrust_vectors": ["thrust_x", "uav1/thrust.vector.y", "quad_2_thrust_z", "/uav1/thrust/wrench.force.z"],
    "time": [
        "t",
        "time",
        "timestamp",
        "%time",
        "header.stamp",
        "Time_Stamp",
        "__time",
        "t_sec",
        "sim_time",
        "time (milliseconds)",
        *("tout", "Zeit"),
    ],
    None: [
        "vx",
        "velocity.x",
        "yaw_rate",
        "linear.x",
        "lux",
        "status",
        "l",
        "temperature_1",
        "angular_velocity.z",
        "factual_x",
        *("Axis1.SetPos", "lc_status", "motor_current_1"),
    ],
}


def table(names):
    return from_csv(f"{','.join(names)}\n{','.join('1' for _ in names)}\n".encode(), "a.csv")


def test_axes_with_other_names():
    """North, east, down and position[0] to [2] are x, y, z; rx, ry, rz without rw are angles; eight are no position."""
    for names, turned in (
        (["PN", "PE", "PD"], ["Roll", "Pitch", "Yaw"]),
        (["Mocap/Position(1)", "Mocap/Position(2)", "Mocap/Position(3)"], ["phi", "theta", "psi"]),
        (["position[0]", "position[1]", "position[2]"], ["rx", "ry", "rz"]),
        (["east", "north", "up"], ["euler_x", "euler_y", "euler_z"]),
        (["Easting", "Northing", "Height"], ["stPose.rA", "stPose.rB", "stPose.rC"]),
        ([f"PlatformPosition_{i}" for i in "123"], ["roll", "pitch", "yaw"]),
    ):
        found = fields_of([table([*names, *turned])])
        assert [one.name for one in found.position] == names
        assert [one.name for one in found.orientation] == turned
    assert [one.name for one in fields_of([table(["lengths:1", "lengths:2"])]).lengths] == ["lengths:1", "lengths:2"]
    assert not fields_of([table(["l0", "core_pose.c"])]).orientation  # one name of three may mean anything
    assert not fields_of([table(["l0", "u", *(f"position[{i}]" for i in range(8))])]).position
    plane = fields_of([table(["ee_y", "ee_x", "theta"])], free="x z pitch")  # of a planar robot, in another plane
    assert [one.name for one in (*plane.position, *plane.orientation)] == ["ee_x", "ee_y", "theta"]


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, names in NAMES.items() for name in names])
def test_usual_names(kind, name):
    found = role(name)
    assert (found and found.role) == kind


def test_units_in_names_and_clocks_without_unit(log, tmp_path):
    times, readings, _, _ = log
    header = ",".join(["timestamp", *(f"cable_{i + 1}_length_mm" for i in range(8)), "state", "x_mm", "y_mm", "z_mm"])
    place = motion(load("cogiro"), times - BEGIN)[:, :3]
    rows = np.column_stack([times * 1e9, 1e3 * readings, 1e3 * place])
    lines = [",".join([*(f"{v:.17g}" for v in row[:9]), "ok", *(f"{v:.9g}" for v in row[9:])]) for row in rows]
    (tmp_path / "log.csv").write_text("\n".join([header, *lines]))
    read = read_log(tmp_path / "log.csv")
    np.testing.assert_allclose(read.measurements.times, times - times[0], atol=1e-6)
    np.testing.assert_allclose(read.measurements.lengths, readings, rtol=1e-9)
    np.testing.assert_allclose(read.measurements.poses[:, :3], place, rtol=1e-6)


def test_a_map_names_fields(log, tmp_path):
    times, readings, _, poses = log
    write_ros2_mcap(tmp_path / "log.mcap", *log)
    (tmp_path / "map.yaml").write_text("lengths: /winches/position[*] [mm]\npose: /mocap/pose\n")
    measured = read_measurements(tmp_path / "log.mcap", fields=tmp_path / "map.yaml")
    np.testing.assert_allclose(measured.poses, poses, atol=1e-9)
    assert np.abs(1e3 * measured.lengths - Dynamics("cogiro").cable_lengths(poses)).max() < 6e-3
    header = "clock,a,b,c,d,e,f,g,h,px,py,pz,w,i,j,k"
    turned = quaternions(motion(load("cogiro"), times - BEGIN))
    place = motion(load("cogiro"), times - BEGIN)[:, :3]
    write_csv(tmp_path / "log.csv", header, 1e6 * times, readings, 100 * place, turned[:, [3, 0, 1, 2]])
    names = ", ".join("abcdefgh")
    (tmp_path / "map.yaml").write_text(
        f"time: clock [us]\nlengths: [{names}]\nposition: ['px [cm]', 'py [cm]', 'pz [cm]']\n"
        "orientation: [i, j, k, w]\n"
    )
    measured = read_measurements(tmp_path / "log.csv", fields=tmp_path / "map.yaml")
    np.testing.assert_allclose(measured.times, times - times[0], atol=1e-5)
    np.testing.assert_allclose(measured.poses, motion(load("cogiro"), times - BEGIN), atol=1e-8)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("length: a", "length is not a known key, did you mean .lengths."),
        ("lengths: /winch/position[*]", "map: lengths must name fields of the log, got /winch/position"),
        ("lengths: l1 [N]", "the unit of l1 must be one of m, dm, cm, .* got 'N'"),
        ("position: [l1, l2]", "map: position must name 3 fields, got 2"),
        ("pose: /mocap", "map: pose must name a topic or a structure of the log, got /mocap; the log has the table"),
        ("- 1", "mapping"),
    ],
)
def test_wrong_maps(text, message, tmp_path):
    write_csv(tmp_path / "log.csv", "l1,l2", np.ones((3, 2)))
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_measurements(tmp_path / "log.csv", fields=tmp_path / "map.yaml")
    assert str(caught.value).isprintable()


@settings(max_examples=12, deadline=None)
@given(
    offset=st.floats(-1e5, 1e5),
    ppm=st.floats(-200, 200),
    rates=st.sampled_from([(0.01, 0.02), (0.01, 0.01), (0.03, 0.005), (0.02, 0.033)]),
    mixed=st.booleans(),
    seed=st.integers(0, 99),
)
def test_two_clocks_are_aligned(offset, ppm, rates, mixed, seed, tmp_path_factory):
    """Whatever the offset, the drift, the rates, the offsets of the winches and the order of the cables."""
    folder, robot, draw = tmp_path_factory.mktemp("clocks"), load("cogiro"), np.random.default_rng(seed)
    times = np.arange(0, 30, rates[0])
    pose_times = np.arange(4, 50, rates[1]) if seed % 2 else np.arange(-8, 25, rates[1])
    readings = Dynamics(robot).cable_lengths(motion(robot, times)) - draw.normal(0, 0.5, 8)
    readings += draw.normal(0, 1e-3, readings.shape)
    if mixed:
        readings = -1e3 * readings[:, draw.permutation(8)]
    poses = motion(robot, pose_times) + draw.normal(0, 3e-4, (len(pose_times), 6))
    clock = offset + (1 + 1e-6 * ppm) * pose_times
    lengths = write_csv(folder / "l.csv", "t," + ",".join(f"l{i}" for i in range(8)), times, readings)
    mocap = write_csv(folder / "p.csv", "t,x,y,z,qx,qy,qz,qw", clock, poses[:, :3], quaternions(poses))
    read = read_log(lengths, poses=mocap, robot=robot)
    expected = motion(robot, read.measurements.times)
    assert np.abs(read.measurements.poses[:, :3] - expected[:, :3]).max() < 4e-3  # 1 ms at 2.4 m/s, and noise
    late = (read.measurements.poses - expected)[:, 0] @ np.gradient(expected[:, 0], read.measurements.times)
    late /= np.sum(np.gradient(expected[:, 0], read.measurements.times) ** 2)
    assert abs(late) < 2e-4
    (note,) = [note for note in read.notes if "clock" in note]
    assert note.startswith("the clock of the poses is")


def test_the_command_takes_two_files(tmp_path):
    times, readings, pose_times, poses = recorded(seconds=60, seed=3)
    clock = 7200 + (1 + 40e-6) * pose_times
    write_csv(tmp_path / "l.csv", "t," + ",".join(f"l{i}" for i in range(8)), times, readings + 0.1)
    write_csv(tmp_path / "p.csv", "t [s],x,y,z,qx,qy,qz,qw", clock, poses[:, :3], quaternions(poses))
    done = towline("calibrate", "cogiro", "l.csv", "--poses", "p.csv", "--free", "offsets", "--json", cwd=tmp_path)
    told = json.loads(done.stdout)
    ahead, ppm = re.match(r"the clock of the poses is ([\d.]+) s ahead, ([\d.]+) ppm fast", told["notes"][0]).groups()
    assert float(ahead) == pytest.approx(7200, abs=1e-3)
    assert float(ppm) == pytest.approx(40, abs=2)
    assert told["residual_after"] < 1.1e-3
    for parameter in told["parameters"]:
        assert parameter["value"] == pytest.approx(-0.1, abs=1e-3)
    done = towline("calibrate", "cogiro", "p.csv", cwd=tmp_path, code=2)
    assert "must have columns l0, l1, ... of lengths, got t, x, y" in done.stderr


def test_files_of_other_motions_are_refused(tmp_path):
    times, readings, pose_times, poses = recorded(seconds=20)
    poses = load("cogiro").home + np.random.default_rng(0).normal(0, 1, poses.shape)
    write_csv(tmp_path / "l.csv", "t," + ",".join(f"l{i}" for i in range(8)), times, readings)
    write_csv(tmp_path / "p.csv", "t,x,y,z,roll,pitch,yaw", pose_times, poses)
    with pytest.raises(InputError, match=r"lengths and poses must be of one motion, got poses that leave \d+ % of it"):
        read_log(tmp_path / "l.csv", poses=tmp_path / "p.csv", robot="cogiro")
    with pytest.raises(InputError, match="robot must be given to align the clocks"):
        read_log(tmp_path / "l.csv", poses=tmp_path / "p.csv")


def test_a_recording_that_was_cut_is_read_as_far_as_it_goes(files, log, tmp_path):
    content = files["json.mcap"].read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) * 2 // 3])
    (one,) = recordings(tmp_path / "cut.mcap")
    assert one.notes == ["the end of the file is missing: everything before it is read"]
    assert 0 < one.topics["/joints"].count <= 2000


@pytest.mark.parametrize("kind", ["zstd", "lz4"])
def test_bombs_are_refused(kind, tmp_path):
    """Files of some kB that would fill gigabytes when they are unpacked."""
    import lz4.frame
    import zstandard
    from mcap.data_stream import RecordBuilder
    from mcap.records import Chunk

    build = RecordBuilder()
    packed = {"zstd": zstandard, "lz4": lz4.frame}[kind].compress(bytes(300_000_000))
    Chunk(kind, packed, 0, 0, 0, 300_000_000).write(build)
    (tmp_path / "bomb.mcap").write_bytes(b"\x89MCAP0\r\n" + build.end())
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="must have at most 64 MB in a chunk, got more"):
            recordings(tmp_path / "bomb.mcap")
        assert tracemalloc.get_traced_memory()[1] < 200e6
    finally:
        tracemalloc.stop()


def refusal(path):
    try:
        read_log(path)
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", ["ros2.mcap", "json.mcap", "ros1.bag", "bz2.bag", "ros2", "log.csv", "log.nc"])
def test_mutated_files_are_read_or_refused_in_one_line(name, tmp_path):
    """Bytes are changed, cut out or doubled: whatever happens takes no time and no memory, and is said in one line."""
    times, readings, pose_times, poses = recorded(seconds=3.5)
    if name in WRITERS:
        path = WRITERS[name](tmp_path / name, times, readings, pose_times, poses)
        path = next(path.glob("*.db3")) if path.is_dir() else path
    elif name == "log.csv":
        path = write_csv(tmp_path / name, "t [s]," + ",".join(f"l{i} [m]" for i in range(8)), times, readings)
    else:
        from towline import Measurements

        path = Measurements(readings, motion(load("cogiro"), times), times=times).save(tmp_path / name)
    content, draw, refused = path.read_bytes(), np.random.default_rng(7), 0
    start = time.process_time()
    tracemalloc.start()
    for _ in range(30):
        data = bytearray(content)
        for _ in range(draw.integers(1, 12)):
            at, size = int(draw.integers(len(data) - 8)), int(draw.integers(1, 9))
            at = at % 3000 if draw.random() < 0.3 else at
            if (what := draw.integers(4)) == 0:
                data[at : at + size] = draw.bytes(size)
            elif what == 1:
                del data[at : at + size]
            elif what == 2:
                data[at:at] = data[at : at + size]
            else:
                data[at : at + size] = b"\xff" * size
        path.write_bytes(bytes(data))
        line = refusal(path)
        refused += bool(line)
        assert not line or (line.startswith(str(path)) and line.isprintable() and len(line) < 700)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 400e6
    assert refused > 5
    assert time.process_time() - start < 25


def test_angles_and_orientations_alone(tmp_path):
    """An AHRS measures no position."""
    robot = load("cogiro")
    poses = motion(robot, np.arange(0, 5, 0.1))
    lengths = Dynamics(robot).cable_lengths(poses)
    header = ",".join([*(f"l{i}" for i in range(8)), "roll [deg]", "pitch [deg]", "yaw [deg]"])
    write_csv(tmp_path / "log.csv", header, lengths, np.degrees(poses[:, 3:]))
    measured = read_measurements(tmp_path / "log.csv")
    assert np.isnan(measured.poses[:, :3]).all()
    np.testing.assert_allclose(points.rotations(measured.poses[:, 3:]), points.rotations(poses[:, 3:]), atol=1e-9)


@pytest.mark.parametrize("ending", [".db3", ".bag", ".mcap", ".nc"])
def test_a_damaged_beginning_is_not_taken_for_a_table(ending, tmp_path):
    (tmp_path / f"log{ending}").write_bytes(b"SQXite format 3\0" + bytes(100))
    with pytest.raises(InputError, match=f"must begin as {ending} files do, got other bytes"):
        read_measurements(tmp_path / f"log{ending}")


def test_plans_and_simulations_are_written_as_mcap(tmp_path):
    """What is written is read back: poses and lengths of the robot; cables end where the robot's do."""
    from mcap.reader import make_reader

    (tmp_path / "lift.yaml").write_text(
        "name: lift\npath: {kind: line, start: [0, 0, 1], end: [0.3, 0.2, 1.3]}\nduration: 1\n"
    )
    done = towline("plan", "ipanema-1", "lift.yaml", "--out", "lift.mcap", cwd=tmp_path)
    towline("plan", "ipanema-1", "lift.yaml", "--out", "lift.nc", cwd=tmp_path)
    done = towline("simulate", "ipanema-1", "lift.nc", "--out", "run.mcap", cwd=tmp_path)
    robot = load("ipanema-1")
    (tmp_path / "map.yaml").write_text("lengths: /cables/joints[*].position\npose: /pose\n")
    for name, rate in (("lift.mcap", 100), ("run.mcap", 1000)):
        read = read_measurements(tmp_path / name, fields=tmp_path / "map.yaml")
        assert np.median(np.diff(read.times)) == pytest.approx(1 / rate, rel=1e-3)
        np.testing.assert_allclose(read.poses[0], [0, 0, 1, 0, 0, 0], atol=1e-3)
        np.testing.assert_allclose(read.poses[-1, :3], [0.3, 0.2, 1.3], atol=5e-3)
        np.testing.assert_allclose(read.lengths, Dynamics(robot).cable_lengths(read.poses), atol=1e-3)
        with (tmp_path / name).open("rb") as file:
            messages = [
                (schema.name, json.loads(message.data)) for schema, _, message in make_reader(file).iter_messages()
            ]
        kinds = {kind for kind, _ in messages}
        assert kinds == {
            f"foxglove.{kind}" for kind in ("FrameTransforms", "PoseInFrame", "JointStates", "SceneUpdate")
        }
        scene = next(message for kind, message in messages if kind == "foxglove.SceneUpdate")
        (lines,) = scene["entities"][0]["lines"]
        ends = np.array([[point[axis] for axis in "xyz"] for point in lines["points"]]).reshape(-1, 2, 3)
        np.testing.assert_allclose(ends[:, 0], robot.home_anchors)
        np.testing.assert_allclose(ends[:, 1], points.attachments(robot, read.poses[0]), atol=1e-6)
    done = towline("plan", "ipanema-1", "lift.yaml", "--out", "lift.bag", cwd=tmp_path, code=2)
    assert "--out must end in .nc or .mcap" in done.stderr
