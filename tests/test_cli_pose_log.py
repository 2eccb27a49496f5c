"""`towline pose --log` through its entry point: encoders, covariance, wrong samples."""

import json

import numpy as np
import pytest
from scipy.stats import chi2

from towline import Dynamics, Measurements, load
from towline.estimation import poses_from_log
from towline.models import points

from .recorded import motion
from .warm import towline

NOISE = 1e-3


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """Cogiro with encoders: what its winches report are neither metres nor lengths."""
    folder = tmp_path_factory.mktemp("robot")
    data = load("cogiro").model_dump(mode="json")
    for i, cable in enumerate(data["cables"]):
        cable["encoder"] = {"offset": 0.2 + 0.03 * i, "scale": 0.05 + 0.001 * i}
    from towline import Robot

    return Robot.model_validate(data).save(folder / "robot.yaml")


def readings(robot, times, seed=0):
    loaded, draw = load(robot), np.random.default_rng(seed)
    lengths = Dynamics(loaded).cable_lengths(motion(loaded, times)) + draw.normal(0, NOISE, (len(times), 8))
    encoders = [cable.encoder for cable in loaded.cables]
    return (lengths - [one.offset for one in encoders]) / [one.scale for one in encoders]


def write(path, times, table):
    header = ",".join(["time [s]", *(f"winch_{i + 1}_position [m]" for i in range(8))])
    np.savetxt(path, np.column_stack([times, table]), "%.16g", ",", header=header, comments="")
    return path


def test_poses_of_a_log(robot, tmp_path):
    times = 1.7e9 + np.arange(0, 30, 0.01)  # counted from 1970
    table = readings(robot, times - 1.7e9)
    table[700, 3] += 0.02 / 0.053  # 20 mm
    table[1200:1210, 6] -= 0.03 / 0.056
    write(tmp_path / "log.csv", times, table)
    done = towline("pose", robot, "--log", "log.csv", "--figures", "here", "--json", cwd=tmp_path)
    told = json.loads(done.stdout)
    assert told["files"] == ["log-poses.csv", "here/consistency.png"]
    one, other = told["wrong"]
    assert (one["first"], one["last"], other["first"], other["last"]) == (700, 700, 1200, 1209)
    assert 3 in one["cables"]
    assert 6 in other["cables"]
    names = (tmp_path / "log-poses.csv").read_text().splitlines()[0].split(",")
    assert names[:7] == ["t [s]", *(f"{name} [m]" for name in "xyz"), "roll [rad]", "pitch [rad]", "yaw [rad]"]
    rows = np.loadtxt(tmp_path / "log-poses.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 0] - times, 0, atol=1e-6)
    expected = motion(load(robot), times - 1.7e9)
    sound = rows[:, names.index("fits [1]")] > 0
    assert (~sound).sum() == 11
    # The errors of position and rotation have the covariance that is written: chi-square with six degrees of freedom.
    turned = points.rotations(rows[:, 4:7]) @ np.swapaxes(points.rotations(expected[:, 3:]), 1, 2)
    small = np.stack(
        [turned[:, 2, 1] - turned[:, 1, 2], turned[:, 0, 2] - turned[:, 2, 0], turned[:, 1, 0] - turned[:, 0, 1]]
    )
    errors = np.hstack([rows[:, 1:4] - expected[:, :3], 0.5 * small.T])
    covariance = np.empty((len(rows), 6, 6))
    for column, (i, j) in enumerate(zip(*np.triu_indices(6), strict=True)):
        covariance[:, i, j] = covariance[:, j, i] = rows[:, 7 + column]
    squares = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariance), errors)[sound]
    assert 0.935 < (squares < chi2.ppf(0.95, 6)).mean() < 0.965


def test_wrong_samples_are_named(robot, tmp_path):
    times = np.arange(0, 10, 0.02)
    table = readings(robot, times)
    write(tmp_path / "sound.csv", times, table)
    done = towline("pose", robot, "--log", "sound.csv", cwd=tmp_path)
    assert "no pose fits" not in done.stdout
    assert "median sigma of x: 0.6" in done.stdout
    table[100:200, 2] += 0.05 / 0.052
    write(tmp_path / "slip.csv", times, table)
    done = towline("pose", robot, "--log", "slip.csv", cwd=tmp_path, code=1)
    assert "samples 100 to 199 (from 2 s): no pose fits; most likely the length of cables[2] is wrong" in done.stdout


def test_the_pose_is_found_again_after_samples_that_no_pose_fits():
    """Wrong lengths for a while, alone and twice in a row, and a jump meanwhile: all others have their poses."""
    robot = load("cogiro")
    times = np.arange(120) * 0.05 + 9.0 * (np.arange(120) > 40)
    poses, wrong = motion(robot, times), np.zeros(120, dtype=bool)
    wrong[[*range(20, 60), 70, 80, 81, 119]] = True
    lengths = Dynamics(robot).cable_lengths(poses)
    lengths[wrong] = lengths[wrong][:, [1, 0, *range(2, 8)]]
    found = poses_from_log(robot, Measurements(lengths))
    np.testing.assert_array_equal(found.fits, ~wrong)
    np.testing.assert_allclose(found.estimate.pose[~wrong], poses[~wrong], atol=1e-7)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "one of --lengths and --log must be given, got none"),
        (("--log", "x.csv", "--lengths", "1 2"), "one of --lengths and --log must be given, got both"),
        (("--log", "x.csv", "--start", "1"), "--start must be left out with --log, got 1"),
        (("--lengths", "1 1 1 1 1 1 1 1", "--out", "x.csv"), "--out must be left out with --lengths, got x.csv"),
        (("--log", "none.csv"), "none.csv: no such file"),
        (("--log", "none.csv", "--out", "x.nc"), "--out must end in .csv"),
        (("--log", "none.csv", "--out", "none.csv"), "--out must be a file other than the log"),
    ],
)
def test_wrong_options(arguments, message, tmp_path):
    done = towline("pose", "cogiro", *arguments, cwd=tmp_path, code=2)
    assert done.stderr.count("\n") == 1
    assert message in done.stderr


@pytest.mark.parametrize("error", ["exchanged", "millimetres", "inverted"])
def test_an_input_error_of_a_log_with_poses_is_said_as_by_calibrate(robot, tmp_path, error):
    times = np.arange(0, 20, 0.05)
    table, poses = readings(robot, times), motion(load(robot), times)
    if error == "exchanged":
        table[:, [2, 5]] = table[:, [5, 2]]
    elif error == "inverted":
        poses[:, 3:] = points.angles(np.swapaxes(points.rotations(poses[:, 3:]), 1, 2))
    else:
        poses[:, :3] *= 1e3
    header = ["time", *(f"winch_{i + 1}_position" for i in range(8)), "x", "y", "z", "roll", "pitch", "yaw"]
    whole = np.column_stack([times, table, poses])
    np.savetxt(tmp_path / "log.csv", whole, "%.12g", ",", header=",".join(header), comments="")
    done = towline("pose", robot, "--log", "log.csv", "--json", cwd=tmp_path, code=1)
    doubt = json.loads(done.stdout)["doubt"]
    refused = json.loads(towline("calibrate", robot, "log.csv", "--json", cwd=tmp_path, code=1).stdout)["doubt"]
    assert refused in doubt
    assert doubt.endswith("; --fix corrects it")
    if error == "exchanged":
        told = json.loads(towline("pose", robot, "--log", "log.csv", "--fix", "--json", cwd=tmp_path).stdout)
        assert told["doubt"] is None
        assert told["notes"] == [f"corrected: {refused}"]
        rows = np.loadtxt(tmp_path / "log-poses.csv", delimiter=",", skiprows=1)
        assert np.abs(rows[:, 1:4] - poses[:, :3]).max() < 6 * NOISE
    assert {"exchanged": "l2 and l5 look exchanged", "inverted": "inverted", "millimetres": "millimetres"}[
        error
    ] in doubt
    if error == "inverted":
        text = towline("pose", robot, "--log", "log.csv", cwd=tmp_path, code=1).stdout
        assert doubt[:60] in " ".join(text.split())
