"""Floor and walls of a robot's file in simulations: free fall and lines say when and how far a platform is beyond."""

import numpy as np
import pytest

from towline import load, simulate
from towline.simulation.flights import summary

COGIRO = load("cogiro")
CUT = 0.2  # [s]
FALLS = {"events": [f"cut {cable} at {CUT}" for cable in range(1, COGIRO.m + 1)], "duration": 0.9, "tolerance": 100.0}
BODY = {"kind": "box", "min": [-0.2, -0.2, -0.6], "max": [0.2, 0.2, 0]}  # down to -0.6 m


def with_room(**keys):
    data = COGIRO.model_dump()
    body = keys.pop("body", None)
    data["platform"] |= {} if body is None else {"body": body}
    return type(COGIRO).model_validate(data | keys)


@pytest.mark.parametrize(("body", "low"), [(None, None), (BODY, -0.6)], ids=["attachments", "body"])
def test_a_platform_that_falls_is_below_the_floor_when_free_fall_takes_it_there(body, low):
    robot, floor = with_room(floor=0.3, body=body), 0.3
    points = [robot.platform.com, *robot.attachments] if low is None else [[0, 0, low]]
    height = robot.home[2] + np.min(np.array(points)[:, 2]) - floor
    run = simulate(robot, robot.home, **FALLS)
    (event,) = (event for event in run.to_dict()["events"] if event["kind"] == "room")
    assert event["at_s"] == pytest.approx(CUT + np.sqrt(2 * height / 9.81), abs=3e-3)
    assert event["what"].startswith("the platform went below the floor")
    deep = 9.81 / 2 * (run.times[-1] - CUT) ** 2 - height
    assert run.outside.max() == pytest.approx(deep, rel=0.02)
    (failure,) = run.failures
    assert failure == f"the platform was {run.outside.max():.4g} m below the floor at t = 0.899 s"
    runs = simulate(robot, robot.home, runs=2, **FALLS)
    np.testing.assert_allclose(runs["outside"], run.outside.max())
    assert summary(runs)["failed"] == {"error": 0, "tension": 0, "slack": 0, "room": 2, "diverged": 0}
    assert summary(runs)["passed"] == 0


def test_a_fall_below_the_usual_floor_is_reported_for_a_file_without_one():
    """It fails nothing, since nobody has said that there is a floor; nor where {G} lies above the robot."""
    run = simulate(COGIRO, COGIRO.home, **FALLS)
    assert run.passed
    lowest = COGIRO.home[2] + min(0.0, COGIRO.attachments[:, 2].min())
    (event,) = (event for event in run.to_dict()["events"] if event["kind"] == "room")
    assert event["at_s"] == pytest.approx(CUT + np.sqrt(2 * lowest / 9.81), abs=3e-3)
    assert "below z = 0 of {G}, where the floor usually is" in run.report()
    data = COGIRO.model_dump()
    data["carriers"][0]["home"] = (COGIRO.carrier_home[0] - [0, 0, 20.0, 0, 0, 0]).tolist()
    data["platform"]["home"] = (COGIRO.home - [0, 0, 20.0, 0, 0, 0]).tolist()
    below = type(COGIRO).model_validate(data)
    assert "below z" not in simulate(below, below.home, **FALLS).report()


@pytest.mark.parametrize("axis", [0, 1])
def test_a_platform_that_goes_through_a_wall_fails(axis):
    """The line ends 0.2 m beyond the side of the room that its outermost attachment passes."""
    end = COGIRO.home[:3] + 0.5 * np.eye(3)[axis]
    side = end[axis] + COGIRO.attachments[:, axis].max() - 0.2
    most = [50.0, 50.0, 50.0]
    most[axis] = side
    robot = with_room(workspace_box={"min": [-50, -50, 0], "max": most})
    line = {"kind": "line", "start": COGIRO.home[:3].tolist(), "end": end.tolist()}
    run = simulate(robot, line, duration=2)
    (failure,) = run.failures
    assert failure.startswith("the platform was 0.2 m beyond the largest " + "xy"[axis] + " of the room")
    assert run.error.max() < 5e-3
    assert simulate(with_room(workspace_box={"min": [-50, -50, 0], "max": [50] * 3}), line, duration=2).passed
