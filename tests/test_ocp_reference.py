"""Fast motions in a tube: the reference from which they deviate has the fastest time law, smoothed."""

import numpy as np
import pytest

from towline import load, plan, time_along
from towline.base.errors import InputError
from towline.ocp import MotionStatus
from towline.ocp.tasks.paths import TimedPath, WaypointPath

LINE = {"kind": "line", "start": [-2, -1, 1], "end": [2, 1, 2]}
FAST = {"duration": {"min": 0.2, "max": 20}, "objective": {"time": 0.01, "jerk": 1e4}, "steps": 40}
CORNER = ((0.0, 0.0, 1.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1.5, 0.0, 0.0, 0.0), (2.0, -1.0, 1.0, 0.0, 0.0, 0.0))


def _law(smoothing=None):
    """Return straight legs with a law of piecewise constant d2s/dt2 that rests at the corner."""
    along = WaypointPath(kind="waypoints", points=CORNER, blend=0)
    corner = float(along.places[1])
    s = (0.0, corner / 3, corner, (1 + corner) / 2, 1.0)
    return TimedPath(kind="timed", along=along, s=s, speeds=(0.0, 0.6, 0.0, 0.4, 0.0), smoothing=smoothing)


def test_a_smoothed_law_is_the_mean_over_the_window():
    """Where the law does not rest within the window: by the trapezoid rule over many instants."""
    window, law, mean = 0.08, _law(), _law(0.08)
    for time in np.linspace(window, law.times[2] - 1e-6, 7):
        instants = np.linspace(time - window, time, 4001)
        s, speed, _ = law.law(instants)
        values = [np.trapezoid(part, instants) / window for part in (s, speed)]
        np.testing.assert_allclose([part[0] for part in mean.law(np.array([time]))[:2]], values, atol=1e-6)


@pytest.mark.parametrize("slower", [1.0, 1.7])
def test_a_smoothed_motion_rests_at_corners_and_does_not_jump(slower):
    path = _law(0.08)
    duration = slower * path.least
    assert path.least == pytest.approx(_law().least + 2 * 0.08)  # it waits at the corner and at the end
    times = np.linspace(0.0, duration, 200_001)
    pose, velocity, acceleration = path.at(times, duration)
    h = times[1]
    np.testing.assert_allclose(np.diff(pose, axis=0) / h, (velocity[1:] + velocity[:-1]) / 2, atol=1e-6)
    assert np.abs(np.diff(acceleration, axis=0)).max() < 1e-3 * np.abs(acceleration).max()
    _, stops, points = path.stations(duration)
    for part, expected in zip(path.at(stops, duration), (points, 0.0, 0.0), strict=True):
        np.testing.assert_allclose(part, np.broadcast_to(expected, part.shape), atol=1e-9)


def test_a_smoothing_of_no_time_is_one_line():
    with pytest.raises(InputError, match="smoothing") as refused:
        plan("cogiro", {"path": _law().model_dump() | {"smoothing": 0.0}, "duration": 3})
    assert "\n" not in str(refused.value)


def test_a_tube_of_centimetres_costs_little_of_the_fastest_law():
    """Smooth legs would take 1.4 times as long: their peak of acceleration is 1.9 times that of a constant one."""
    robot = load("cogiro")
    law = time_along(robot, {"path": LINE})
    found = plan(robot, {"path": LINE, "tube": {"position": 0.05}} | FAST)
    assert found.feasible
    assert found.duration < 1.2 * law.duration
    start, end = (np.array(LINE[key]) for key in ("start", "end"))
    along = (end - start) / np.linalg.norm(end - start)
    off = found.audit.motion.pose[:, :3] - start
    assert np.linalg.norm(off - np.outer(off @ along, along), axis=1).max() < 0.05 + 1e-6
    again = plan(robot, {"path": LINE, "tube": {"position": 0.05}} | FAST, start=found)
    assert again.feasible
    assert again.duration < 1.02 * found.duration


def test_a_motion_that_may_start_with_an_acceleration_is_never_slower_than_the_fastest_law():
    """A tube of a millimetre, in which the program's 40 steps cannot follow that law."""
    robot = load("cogiro")
    law = time_along(robot, {"path": LINE})
    found = plan(robot, {"path": LINE, "tube": {"position": 0.001, "ends": "exact"}} | FAST)
    assert found.feasible
    assert found.duration <= law.duration * (1 + 1e-9)
    assert found.duration == law.duration or found.deviation is not None


def test_exact_points_are_passed_and_not_later_than_at_fixed_shares():
    task = {"tube": {"position": 0.1, "waypoints": "exact"}} | FAST
    points = [[-1, 0, 1], [0, 1, 1.5], [2, 0, 1]]
    free = plan("cogiro", {"path": {"kind": "waypoints", "points": points}} | task)
    even = plan("cogiro", {"path": {"kind": "waypoints", "points": points, "shares": [0, 0.5, 1]}} | task)
    assert free.status is even.status is MotionStatus.FEASIBLE
    assert free.duration < even.duration
    for point in points:
        assert np.linalg.norm(free.audit.motion.pose[:, :3] - point, axis=1).min() < 5e-3  # between its instants
    assert free.waypoint_distance is not None
    assert free.waypoint_distance.position.distance < 1e-5


def test_a_limit_on_the_jerk_of_cables_is_kept_in_a_tube():
    """The jerk of a smoothed law would jump between the nodes; third differences of the lengths are the judge."""
    robot, most = load("point-mass-3"), 30.0
    line = {"kind": "line", "start": [-0.4, 0, 0.8], "end": [0.5, 0.2, 1.2]}
    limited = {"limits": {"cable_jerk": most}, "objective": {"time": 0.1}, "duration": {"min": 0.2, "max": 9}}
    found = plan(robot, {"path": line, "tube": {"position": 0.1}} | limited)
    assert found.feasible
    assert found.duration < 2.5  # not the longest duration, at which the smooth law keeps the limit
    position = found.trajectory["pose"].values[:, :3]
    lengths = np.linalg.norm(np.array([cable.anchor for cable in robot.cables]) - position[:, None], axis=2)
    assert np.abs(np.diff(lengths, 3, axis=0) / found.trajectory["time"].values[1] ** 3).max() < 1.05 * most
