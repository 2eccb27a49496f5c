"""`towline pose` through its entry point."""

import json

import numpy as np
import pytest

from towline import Dynamics, load

from .warm import towline as run


def text(values):
    return " ".join(f"{value:.12g}" for value in values)


def test_the_pose_comes_back():
    pose = [1.0, 0.5, 2.0, 0.1, 0.0, 0.2]
    lengths = Dynamics("cogiro").cable_lengths(pose)
    done = run("pose", "cogiro", "--lengths", text(lengths), "--json")
    printed = json.loads(done.stdout)
    np.testing.assert_allclose(printed["pose"], pose, atol=1e-9)
    assert printed["converged"]
    assert printed["consistent"]
    assert printed["others"] == []
    assert np.shape(printed["covariance"]) == (6, 6)
    shown = run("pose", "cogiro", "--lengths", text(lengths), "--start", text(pose), "--sigma", "0.002").stdout
    assert "a pose fits the lengths" in shown
    assert "1.32 mm" in shown  # twice the sigma of x for 1 mm


def test_other_poses_are_listed_and_those_that_cannot_be_held():
    robot = load("nist-robocrane")
    done = run("pose", robot.name, "--lengths", text(Dynamics(robot).cable_lengths(robot.home)))
    assert done.stdout.count("Also fits") >= 3
    assert "at which the cables cannot hold the platform at rest" in done.stdout


def test_lengths_that_no_pose_has_give_one():
    robot = load("cogiro")
    lengths = Dynamics(robot).cable_lengths(robot.home) + 0.5 * np.eye(8)[3]
    done = run("pose", "cogiro", "--lengths", text(lengths), code=1)
    assert "NO POSE FITS THE LENGTHS" in done.stdout
    assert "A wrong length of cables[3] explains this." in done.stdout
    done = run("pose", "cogiro", "--lengths", text(lengths - 0.5 * np.eye(8)[6] + 0.3 * np.eye(8)[1]), code=1)
    assert "No single wrong length explains this." in done.stdout


def test_three_cables_hang_and_too_short_ones_do_not():
    done = run("pose", "wang-ctmrts", "--lengths", "1.2 1.2 1.2", "--json")
    assert json.loads(done.stdout)["by_gravity"]
    done = run("pose", "wang-ctmrts", "--lengths", "0.1 0.1 0.1", code=1)
    assert "NO EQUILIBRIUM WITH THESE LENGTHS" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--lengths", "8 8 8"], "--lengths must be 8 finite numbers, got '8 8 8'"),
        (["--lengths", text([*[8] * 7, -1])], "lengths must be numbers > 0 [m], got -1"),
        (["--lengths", text([8] * 8), "--sigma", "0"], "sigma must be"),
        (["--lengths", text([8] * 8), "--sigma", "1 2"], "--sigma must be 8 finite numbers"),
        (["--lengths", text([8] * 8), "--start", "1 2"], "--start must be 6 finite numbers"),
        ([], "one of --lengths and --log must be given"),
    ],
)
def test_wrong_input_is_one_line(arguments, message):
    done = run("pose", "cogiro", *arguments, code=2)
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
