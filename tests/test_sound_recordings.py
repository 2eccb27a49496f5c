"""Recordings that look like others with an error are read as they are."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.estimation.calibration import Measurements, mistake
from towline.estimation.logs import read_log
from towline.estimation.logs.encoders import unrolled
from towline.estimation.logs.mapping import fields_of
from towline.estimation.logs.names import time_unit
from towline.estimation.logs.recorded import read_recorded
from towline.estimation.logs.recording import Recording, Topic
from towline.models import Dynamics, load

from . import user_recordings as user
from .recorded import motion
from .robots_as_built import moved_anchors
from .test_recordings_in_other_units import FULL, flight

BESIDE = {"load_z": 0.35, "cf1_z": 0.05, "cf2_z": 0.05}  # [m]: a high load on the ground between its drones


def test_vehicles_with_masts_are_below_their_load(tmp_path):
    """Their frames are on the ground, and their anchors 3 m above."""
    carriers = [
        f"{{name: car{i + 1}, kind: mobile, home: [{x}, {y}, 0, 0, 0, 0], reach: {{min: [-2, -2, 0], max: [2, 2, 0]}}, "
        "speed_max: 1, acceleration_max: 1}"
        for i, (x, y) in enumerate(user.CORNERS)
    ]
    masts, home = np.tile([0.0, 0, 3], (4, 1)), [0, 0, 1.2, 0, 0, 0]
    robot = user.robot_file(tmp_path / "masts.yaml", masts, user.PLATFORM, home, carriers=carriers)
    t = np.arange(0, 5, 0.05)
    place = np.column_stack([0.3 * np.sin(t), 0.3 * np.cos(t), np.full_like(t, 1.2)])
    names, columns = (
        ["t", *(f"load_{axis}" for axis in "xyz"), "roll", "pitch", "yaw"],
        [t, place, np.zeros((len(t), 3))],
    )
    for i, (x, y) in enumerate(user.CORNERS):
        car = np.column_stack([x + 0.1 * np.sin(t), y + 0 * t, 0 * t])
        columns += [car, np.linalg.norm(place + user.PLATFORM[i] - car - masts[i], axis=1)]
        names += [*(f"car{i + 1}_{axis}" for axis in "xyz"), f"l{i + 1}"]
    read = read_log(user.write(tmp_path / "log.csv", names, np.column_stack(columns)), robot=robot)
    assert read.ned is None
    np.testing.assert_allclose(read.measurements.poses[:, :3], place, atol=1e-9)


@pytest.mark.parametrize("ned", [False, True])
def test_a_load_on_the_ground_beside_its_drones(ned, tmp_path):
    """Most of the recording is before the flight, with drones below the centre of the load."""
    robot = flight(tmp_path, ned)
    head, *lines = (tmp_path / "flight.csv").read_text().splitlines()
    kept = [i for i, name in enumerate(head.split(",")) if "dir" not in name]  # cables are slack on the ground
    names = [head.split(",")[i] for i in kept]
    flown = np.array([line.split(",") for line in lines], dtype=float)[:, kept]
    before = np.repeat(flown[:1], 2 * len(flown), axis=0)
    before[:, 0] += (flown[1, 0] - flown[0, 0]) * np.arange(len(before))
    flown[:, 0] += before[-1, 0] + flown[1, 0] - 2 * flown[0, 0]
    for name, height in BESIDE.items():
        before[:, names.index(name)] = (-height if ned else height) + 1e-4 * np.sin(np.arange(len(before)))
    log = user.write(tmp_path / "all.csv", names, np.vstack([before, flown]), form="%.12g")
    read = read_log(log, robot=robot)
    assert (read.ned is not None) == ned
    heights = read.measurements.carrier_poses[:, :, 2] - read.measurements.poses[:, None, 2]
    assert heights[-len(flown) // 2 :].min() > 0.4


def test_a_load_without_a_rotation_does_not_turn_with_north_east_down(tmp_path):
    robot = flight(tmp_path, ned=True)
    found = read_recorded(robot, tmp_path / "flight.csv")
    np.testing.assert_array_equal(found.pose[:, 3:], 0.0)
    _, x, drones = user.team(12)
    np.testing.assert_allclose(found.pose[:, :3], x, atol=5e-3)
    for i, (_, R, _, _) in enumerate(drones):
        turned = Rotation.from_euler("xyz", found.carrier_pose[:, i, 3:]) * Rotation.from_matrix(R).inv()
        assert turned.magnitude().max() < 1e-3


@pytest.mark.parametrize(
    ("factors", "kept", "unit"),
    [((1, 1), 2, FULL), ((1, 1), 1, FULL), ((-1, -1), 2, -FULL), ((1, 0), 2, FULL), ((0, 0), 2, 0)],
)
def test_the_suggested_unit_of_thrusts(factors, kept, unit, tmp_path):
    """Also of one drone alone, with an axis that points down, and without what tells nothing."""
    robot = flight(tmp_path, ned=True)
    head, *lines = (tmp_path / "flight.csv").read_text().splitlines()
    names, values = head.split(","), np.array([line.split(",") for line in lines], dtype=float)
    for i, factor in enumerate(factors):
        values[:, names.index(f"cf{i + 1}_thrust")] *= factor
    used = [i for i, name in enumerate(names) if kept == 2 or not name.startswith("cf2")]
    user.write(tmp_path / "log.csv", [names[i] for i in used], values[:, used], form="%.12g")
    notes = [note for note in read_log(tmp_path / "log.csv", robot=robot).notes if "are not used" in note]
    assert len(notes) == kept
    suggested = [float(note.split('"cf1_thrust [')[1].split(" N]")[0]) for note in notes if "thrusts: [" in note]
    assert len(suggested) == sum(factor != 0 for factor in factors[:kept])
    np.testing.assert_allclose(suggested, unit, rtol=0.1)


def test_joints_that_wind_cables_rather_than_others():
    """Both kinds are in one message, with as many joints."""
    joints = ["winch_1", "winch_2", "pulley_1_joint", "pulley_2_joint"]
    fields = {f"position[{joint}]": "" for joint in joints}
    topic = Topic("/joint_states", "sensor_msgs/msg/JointState", 5, np.arange(5.0), fields, lambda names: None)
    found = fields_of([Recording("a.mcap", "MCAP", {topic.name: topic})], m=2)
    assert [one.name for one in found.lengths] == list(fields)[:2]


@pytest.mark.parametrize(("step", "unit"), [(1000, "us"), (1e6, "ns"), (500, "ms"), (100, "ms"), (4000, "us")])
def test_loops_of_1_khz_count_microseconds_or_nanoseconds(step, unit, tmp_path):
    times = 12_345_000 + step * np.arange(50)
    assert time_unit(2.6e14 + np.round(step) * np.arange(50)) == unit  # nanoseconds of a computer that is on for days
    assert time_unit(times) == unit
    log = user.write(tmp_path / "log.csv", ["t", "l0"], np.column_stack([times, np.ones(50)]))
    (note,) = read_log(log).notes
    assert f"t is read in {unit}" in note


def test_one_wrong_reading_is_no_counter_that_begins_again():
    """Neither of a size of its own nor near 1024 counts; a counter that is at its end for a while is one."""
    t = np.arange(200)
    smooth = np.column_stack([2 + 0.1 * np.sin(0.1 * t), 3 + 0.1 * np.cos(0.1 * t)])
    for size in (1.6, 1000.0):
        wrong = smooth.copy()
        wrong[[40, 90], 0] += size
        found, rolled = unrolled(wrong)
        assert not rolled
        np.testing.assert_array_equal(found, wrong)
    counter = 1024 + 3 * np.sin(0.1 * t) + np.random.default_rng(0).normal(0, 0.5, 200)
    assert (np.diff(np.flatnonzero(np.abs(np.diff(counter % 1024)) > 900)) == 1).any()  # forth and back at once
    found, rolled = unrolled((counter % 1024)[:, None])
    assert rolled
    np.testing.assert_allclose(np.diff(found[:, 0]), np.diff(counter), atol=1e-9)


def sound_log(name, share, turn=0.002, noise=2e-3, seconds=30):
    """A robot whose anchors are 1 mm off, poses of a small motion with noise of angles [rad], and lengths."""
    robot, draw = load(name), np.random.default_rng(0)
    size = np.repeat([share * robot.length, turn], [3, 3])
    poses = motion(robot, np.linspace(0, seconds, 300), size)
    lengths = Dynamics(moved_anchors(robot, draw, 1e-3)).cable_lengths(poses)
    lengths += draw.normal(0, 3e-4, lengths.shape)
    return robot, poses + np.repeat([3e-4, noise], [3, 3]) * draw.normal(size=poses.shape) * robot.dof_mask, lengths


@pytest.mark.parametrize("name", ["cogiro", "planar-4"])
def test_noise_of_angles_of_a_platform_that_hardly_turns_is_no_other_unit(name):
    """Degrees instead of radians, as other frames, would make it smaller; degrees of a platform that turns do, too."""
    robot, poses, lengths = sound_log(name, share=0.2, noise=4e-3)
    assert mistake(robot, Measurements(lengths, poses)) is None
    robot, poses, lengths = sound_log(name, share=0.2, turn=0.15, noise=1e-3)
    found = mistake(robot, Measurements(lengths, poses * np.repeat([1, 180 / np.pi], [3, 3])))
    assert "degrees read as radians" in found.text
    np.testing.assert_allclose(found.corrected.poses, poses, atol=1e-9)


def test_a_slip_is_no_mistake_of_the_log_and_hides_none():
    """It is larger than the motion."""
    robot, poses, lengths = sound_log("cogiro", share=0.03, noise=1e-4)
    lengths[90:, 0] += 0.1 * robot.length
    assert mistake(robot, Measurements(lengths, poses)) is None
    found = mistake(robot, Measurements(lengths[:, [1, 0, *range(2, 8)]], poses))
    assert found is not None
    assert found.text.startswith("l0 and l1 look exchanged")


@pytest.mark.parametrize(("share", "turn", "every"), [(0.1, 0.3, 1), (1.2, 0.5, 10)])
def test_angles_that_were_not_recorded_are_no_other_units(share, turn, every):
    """Displaced anchors of a robot that moves for hundreds of metres, or a scale of each cable, would explain them."""
    robot, poses, lengths = sound_log("planar-4", turn=turn, share=share, seconds=3)
    assert mistake(robot, Measurements(lengths[::every], poses[::every, :3])) is None
