"""Paths at a steady speed: what is kept, by positions and times alone; and G-code as slicers write it."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from towline import Dynamics, InputError, load, plan, read_task, time_along
from towline.models.parsing import parse_yaml, to_yaml
from towline.ocp.tasks.paths import FeedPath
from towline.ocp.tasks.task import Task


def facade(width, height, pitch):
    levels = np.arange(0, height + 1e-9, pitch)
    lines = [[(0.0, 0.0, z), (width, 0.0, z)][:: 1 if k % 2 == 0 else -1] for k, z in enumerate(levels)]
    return [point for line in lines for point in line]


def moved(path, count=200_001):
    """Times, positions, and velocities and accelerations as differences of the positions."""
    times = np.linspace(0, path.natural_duration, count)
    motion = path.at(times, path.natural_duration)
    return times, motion, motion.pose[:, :3]


def passes(position, points, within):
    """Whether positions come near to all points, one after the other."""
    at = 0
    for point in points:
        near = np.linalg.norm(position[at:] - point, axis=1) <= within
        if not near.any():
            return False
        at += int(np.argmax(near))
    return True


@pytest.mark.parametrize(("tolerance", "slowest"), [(0.002, 0.155), (0.005, 0.245), (0.0075, 0.299)])
def test_a_facade_is_painted_at_its_feed(tolerance, slowest):
    points = facade(6.0, 4.0, 0.2)
    path = FeedPath(kind="feed", points=points, feed=0.3, acceleration=5, tolerance=tolerance)
    times, motion, position = moved(path, 400_001)
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) / times[1]
    assert np.mean(speed > 0.98 * 0.3) > 0.99
    assert speed.max() < 0.3 * (1 + 1e-6)
    inner = speed[(times[1:] > 0.1) & (times[1:] < times[-1] - 0.1)]
    assert inner.min() == pytest.approx(slowest, rel=0.01)
    assert np.linalg.norm(motion.acceleration[:, :3], axis=1).max() <= 5 * (1 + 1e-4)
    assert passes(position, points, tolerance * (1 + 1e-3) + 0.3 * times[1])


corner = st.tuples(*[st.floats(-1, 1, allow_nan=False, width=32)] * 3)


@settings(max_examples=60, deadline=None)
@given(
    points=st.lists(corner, min_size=2, max_size=8),
    feed=st.floats(0.01, 3),
    acceleration=st.floats(0.1, 20),
    tolerance=st.sampled_from([0.0, 1e-4, 1e-3, 0.02, 1.0]),
)
def test_speed_acceleration_and_tolerance_are_kept(points, feed, acceleration, tolerance):
    points = [points[0], *(b for a, b in pairwise(points) if np.linalg.norm(np.subtract(a, b)) > 1e-3)]
    if len(points) < 2 or any(np.linalg.norm(np.subtract(a, b)) < 1e-3 for a, b in pairwise(points)):
        return
    path = FeedPath(kind="feed", points=points, feed=feed, acceleration=acceleration, tolerance=tolerance)
    times, motion, position = moved(path, 20_001)
    assert np.isfinite(position).all()
    np.testing.assert_allclose(position[[0, -1]], [points[0], points[-1]], atol=1e-9)
    speed = np.linalg.norm(motion.velocity[:, :3], axis=1)
    assert speed.max() <= feed * (1 + 1e-6)
    assert np.linalg.norm(motion.acceleration[:, :3], axis=1).max() <= acceleration * (1 + 2e-3)
    # The velocity is that of the positions, but where the acceleration jumps within an interval.
    steps = np.diff(position, axis=0) / times[1]
    means = (motion.velocity[1:, :3] + motion.velocity[:-1, :3]) / 2
    assert np.abs(steps - means).max() <= acceleration * times[1]
    assert passes(position, points, tolerance * (1 + 1e-3) + speed.max() * times[1] + 1e-9)


def test_a_straight_line_is_a_trapezium():
    path = FeedPath(kind="feed", points=[(0, 0, 0), (2, 0, 0)], feed=0.5, acceleration=1)
    assert path.natural_duration == pytest.approx(2 / 0.5 + 0.5 / 1)
    short = FeedPath(kind="feed", points=[(0, 0, 0), (0.01, 0, 0)], feed=0.5, acceleration=1)
    assert short.natural_duration == pytest.approx(2 * np.sqrt(0.01 / 1))


def test_chords_of_a_circle_are_taken_at_the_feed():
    angle = np.linspace(0, 2 * np.pi, 61)
    points = np.c_[0.4 * np.cos(angle), 0.4 * np.sin(angle), 0 * angle]
    path = FeedPath(kind="feed", points=points.tolist(), feed=0.1, acceleration=1)
    _, motion, position = moved(path)
    speed = np.linalg.norm(motion.velocity[:, :3], axis=1)
    assert np.mean(speed > 0.098) > 0.99
    assert np.abs(np.linalg.norm(position, axis=1) - 0.4).max() < 1e-3


def test_it_stops_where_it_dwells_and_where_it_turns_back():
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 0, 0)]
    path = FeedPath(kind="feed", points=points, feed=0.5, acceleration=2, dwell=[0, 0.7, 0, 0.2])
    times, motion, position = moved(path)
    still = np.linalg.norm(motion.velocity, axis=1) < 1e-9
    at_second = still & (np.linalg.norm(position - points[1], axis=1) < 1e-9) & (times < times[-1] / 2)
    assert np.ptp(times[at_second]) == pytest.approx(0.7, abs=2 * times[1])
    assert np.linalg.norm(position - points[2], axis=1).min() < 1e-4
    assert path.natural_duration == pytest.approx(3 * (2 + 0.25) + 0.9)


def test_each_line_has_its_feed():
    path = FeedPath(kind="feed", points=[(0, 0, 0), (1, 0, 0), (2, 0, 0)], feeds=[0.2, 0.4], acceleration=10)
    _, motion, position = moved(path)
    first = position[:, 0] < 1 - 1e-3
    assert motion.velocity[first, 0].max() == pytest.approx(0.2)
    assert motion.velocity[~first, 0].max() == pytest.approx(0.4)


def test_a_robot_paints_a_facade_and_its_report_says_how_steadily():
    robot = load("ipanema-1")
    points = [(x - 0.5, 0.0, z + 0.6) for x, _, z in facade(1.0, 0.4, 0.1)]
    task = {"path": {"kind": "feed", "points": points, "feed": 0.2, "acceleration": 2, "tolerance": 0.002}}
    found = plan(robot, task)
    assert found.feasible
    assert found.duration == pytest.approx(found.scenario.task.path.natural_duration)
    speed = np.linalg.norm(found.audit.motion.velocity[:, :3], axis=1)
    share = np.mean(np.abs(speed - 0.2) < 0.02 * 0.2)
    row = dict(found._facts())["feed"]
    assert f"within 2 % for {100 * share:.1f}"[:18] in row
    assert plan(robot, found.scenario.task).feasible


@pytest.mark.parametrize(("duration", "message"), [(2, "duration must be at least"), (9, "duration must be at most")])
def test_its_duration_is_its_own(duration, message):
    """With a shorter one it was cut off at its feed, and the plan was feasible."""
    path = {"kind": "feed", "points": [[0, 0, 1], [1, 0, 1]], "feed": 0.2, "acceleration": 1}
    assert plan("cogiro", {"path": path, "duration": 1 / 0.2 + 0.2}).feasible
    with pytest.raises(InputError, match=message):
        plan("cogiro", {"path": path, "duration": duration})
    with pytest.raises(InputError, match=r"duration must be 5\.2 s, where the times of path end"):
        plan("cogiro", {"path": {"kind": "sequence", "parts": [{"path": path, "duration": duration}]}})


def test_a_feed_has_no_fastest_law():
    path = {"kind": "feed", "points": [[0, 0, 1], [1, 0, 1]], "feed": 0.2, "acceleration": 1}
    with pytest.raises(InputError, match=r"path\.kind must not be feed to time a path"):
        time_along("cogiro", {"path": path})


SLICED = """; generated by a slicer
M73 P0 R12
M104 S200 ; heat
G21 ; millimetres
G90
M83
G28 ; home all axes
G1 Z0.200 F1200.000
G92 E0
G1 X100 Y100 E5 F3000
G1 X200 Y100 E9.5 F1800
G3 X200 Y200 I0 J50 E12
G1 X100 Y200 E15
G2 X100 Y100 R-60
M117 done at last
G92 X0
G1 X10
G0 Z10
M84
G28 X0 Y0
"""


def test_a_slicers_file_is_planned_as_it_comes(tmp_path):
    (tmp_path / "part.gcode").write_text(SLICED)
    (tmp_path / "task.yaml").write_text("path: {kind: feed, points: part.gcode, acceleration: 1, tolerance: 0.0005}\n")
    path = read_task(tmp_path / "task.yaml").path
    points = np.array(path.points)[:, :3]
    np.testing.assert_allclose(points[0], [0.1, 0.1, 2e-4])
    np.testing.assert_allclose(points[-2:], [[0.11, 0.1, 2e-4], [0.11, 0.1, 0.01]], atol=1e-12)
    right = points[(points[:, 0] > 0.2 + 1e-9)]
    assert np.abs(np.linalg.norm(right[:, :2] - [0.2, 0.15], axis=1) - 0.05).max() < 1e-9
    assert right[:, 0].max() > 0.2499  # the right half, counter-clockwise
    clockwise = points[len(right) + 4 : -2]  # the longer way round, about a centre at the right
    centre = [0.1 + np.sqrt(0.06**2 - 0.05**2), 0.15]
    assert np.abs(np.linalg.norm(clockwise[:, :2] - centre, axis=1) - 0.06).max() < 1e-9
    assert clockwise[:, 0].max() > centre[0] + 0.0599
    assert set(path.ignored) == {"E", "G28", "M104", "M117", "M73", "M83", "M84"}
    np.testing.assert_allclose(path.feeds, 0.03)
    _, motion, _ = moved(path)
    assert np.linalg.norm(motion.velocity, axis=1).max() <= 0.03 * (1 + 1e-6)


MILLED = """%
O1001 (Klötze)
N10 G90 G94 G17 G91.1
N15 G21
N20 G53 G0 Z0.
N25 T1 M6
N35 G54
N45 G0 X0. Y0. S5000 M3
N50 G43 Z600. H1
G64 P0.01
N55 G1 X100. F600. M8
G4 P2
N60 G18
N65 G3 X110. Z590. K-10.
N70 G19 G2 Y10. Z600. R10.
N75 G53 G0 Z0.
M30
%
"""
PRINTED = """M104 S200
G91
G1 Z5 F600 ; before homing
G90
G28
N1 G4 P500*71
START_PRINT BED=60
EXCLUDE_OBJECT NAME=a
M0 Click to continue
G1 X0 Y0 Z600 F1200
G4 P500
G0 X100
M204 P800
G1 X100 Y100 E5 F600
G4
G4 S1
G1 X0
"""


def path_of_file(name, folder):
    (folder / "task.yaml").write_text(f"path: {{kind: feed, points: {name}, acceleration: 1}}\n")
    return read_task(folder / "task.yaml").path


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_a_mills_file_has_lines_with_moves_and_switches_and_arcs_in_all_planes(encoding, tmp_path):
    (tmp_path / "part.nc").write_text(MILLED, encoding=encoding)
    path = path_of_file("part.nc", tmp_path)
    points = np.array(path.points)[:, :3] * 1000
    np.testing.assert_allclose(points[:2], [[0, 0, 600], [100, 0, 600]], atol=1e-9)
    np.testing.assert_allclose(points[-1], [110, 10, 600], atol=1e-9)
    corner = int(np.argmin(np.linalg.norm(points - [110, 0, 590], axis=1)))
    about_y, about_x = points[1 : corner + 1] - [100, 0, 590], points[corner:] - [110, 10, 590]
    np.testing.assert_allclose(np.linalg.norm(about_y, axis=1), 10, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(about_x, axis=1), 10, atol=1e-9)
    assert (np.cross(about_y[:-1], about_y[1:])[:, 1] > 0).all(), "G3 turns about +y"
    assert (np.cross(about_x[:-1], about_x[1:])[:, 0] < 0).all(), "G2 turns about -x"
    assert path.dwell[:3] == (0, 2, 0)
    assert set(path.ignored) == {"G17", "G43", "G53", "G54", "G64", "G91.1", "G94", "H", "M3", "M6", "M8", "S", "T"}


@pytest.mark.parametrize("kind", ["feed, acceleration: 1", "waypoints"])
def test_the_zero_of_a_file_is_where_the_task_says(kind, tmp_path):
    (tmp_path / "part.ngc").write_text("G21\nG0 X1 Y2 Z3\nG1 X11 F60")
    task = f"path: {{kind: {kind}, points: part.ngc, origin: ORIGIN}}\n"
    (tmp_path / "task.yaml").write_text(task.replace("ORIGIN", "[0.5, -1, 2]"))
    path = read_task(tmp_path / "task.yaml").path
    np.testing.assert_allclose(np.array(path.points)[:, :3], [[0.501, -0.998, 2.003], [0.511, -0.998, 2.003]])
    assert read_task({"path": path.model_dump()}).path == path, "a saved task is not moved again"
    for wrong in ("[1, 2]", ".inf", "[a, 0, 0]"):
        (tmp_path / "task.yaml").write_text(task.replace("ORIGIN", wrong))
        with pytest.raises(InputError, match="origin must be three numbers"):
            read_task(tmp_path / "task.yaml")
    with pytest.raises(InputError, match="origin must be left out unless points is the name of a file"):
        read_task({"path": path.model_dump() | {"origin": [0, 0, 1]}})


def test_a_task_of_thousands_of_points_is_read_back_from_its_plan():
    """Its text has more values than a file that a user writes may have."""
    turns = np.linspace(0, 60, 8000)
    points = np.stack([np.cos(turns), np.sin(turns), 1 + turns / 100], axis=1).tolist()
    task = read_task({"path": {"kind": "feed", "points": points, "feed": 0.1, "acceleration": 1}})
    assert parse_yaml(to_yaml(task), Task, "task") == task


def test_a_printers_file_has_the_units_of_its_firmware(tmp_path):
    (tmp_path / "part.gcode").write_text(PRINTED)
    path = path_of_file("part.gcode", tmp_path)
    np.testing.assert_allclose(
        np.array(path.points)[:, :3] * 1000, [[0, 0, 600], [100, 0, 600], [100, 100, 600], [0, 100, 600]]
    )
    np.testing.assert_allclose(path.feeds, [0.02, 0.01, 0.01])
    assert path.dwell == (0.5, 0, 1, 0)
    assert set(path.ignored) == {"E", "EXCLUDE_OBJECT", "G28", "M0", "M104", "M204", "START_PRINT"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("G21\nG1 X0 Y0 Z0 F60\nG2 X10 Y0 I1 J1", "line 3: I and J must lead to a centre"),
        ("G21\nG1 X0 Y0 Z0 F60\nG2 X10 Y0 R1", "line 3: R must be a radius that reaches"),
        ("G21\nG1 X0 Y0 Z0 F60\nG1 X10 I3", "line 3: the words I, J and R must follow G2 or G3"),
        ("G21\nG1 X0 Y0 Z0 F60\nG28\nG1 X10", "line 4: no move must follow G28"),
        ("G21\nG81\n", "line 2: must be G0 to G4"),
        ("G21 G18\nG1 X0 Y0 Z0 F60\nG2 X10 I5 J0", "line 3: an arc must have I and J, or R"),
        ("G21\nG1 X0 Y0 Z0 F60\nG55\nG1 X10", "line 3: G55 must not change the coordinates within a path"),
        ("G21\nG10 L2 P1 X5\nG1 X0 Y0 Z0 F60", "line 2: G10 must be without L"),
        ("G21\nG1 X0 Y0 Z0 F60\nM98 P1000\nG1 X10", "line 3: M98 must be left out: programs that are called"),
        ("G21\nG1 X0 Y0 Z0 F60\nG53 G0 Z0\nG1 X10", "line 4: no move must follow G53"),
        ("G21\nG1 X0 Y0 Z0 F60\nG1 X", "line 3: must be G0 to G4.*got 'X'"),
        ("G21\nG1 X0 Y0 Z0\nG1 X5", "line 3: G1 must have a feed F"),
        ("G21\nM104 S200\n", "two points or more, got 0"),
    ],
)
def test_wrong_programs_are_one_line(text, message, tmp_path):
    (tmp_path / "a.gcode").write_text(text)
    (tmp_path / "task.yaml").write_text("path: {kind: feed, points: a.gcode, acceleration: 1}\n")
    with pytest.raises(InputError, match=message) as caught:
        read_task(tmp_path / "task.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "feed must be given once"),
        ({"feed": 1, "feeds": [1]}, "feed must be given once"),
        ({"feeds": [1, 2]}, "feeds must have one number for each of the 1 lines, got 2"),
        ({"feed": 0}, "feed"),
        ({"feed": 1, "acceleration": 0}, "acceleration"),
        ({"feed": 1, "dwell": [1]}, "dwell must have one number for each of the 2 points"),
        ({"feed": 1e-6}, r"feed must be more than 1.* m/s on .* m, got 1e-06 m/s"),
        ({"feed": 1, "points": [[0, 0, 0], [0, 0, 0]]}, r"points\[1\] must differ from points\[0\]"),
        ({"feed": 1, "points": [[0, 0, 0], [0, 0, 1, 0, 0, 1]]}, r"points\[1\] must have the attitude"),
    ],
)
def test_wrong_keys_are_one_line(keys, message):
    path = {"kind": "feed", "points": [[0, 0, 1], [1, 0, 1]], "acceleration": 1} | keys
    with pytest.raises(InputError, match=message):
        plan(load("cogiro"), {"path": path})


@pytest.mark.parametrize("robot", ["multi-quadrotor-3", "multi-quadrotor-6"])
def test_a_team_whose_thrust_cannot_jump_is_told_so_at_once(robot):
    """The force on a carrier jumps with the platform's acceleration: across its thrust axis, which turns steadily."""
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0.3]]
    feed = {"kind": "feed", "points": points, "feed": 0.5, "acceleration": 1, "tolerance": 0.05}
    phases = {"phases": [{"name": "paint", "path": feed}]}
    for task in ({"path": feed}, phases):
        with pytest.raises(InputError, match="must be waypoints or samples if the planner") as refused:
            plan(robot, {**task, "base": {"kind": "free"}})
        assert "\n" not in str(refused.value)


def test_a_phase_begins_and_ends_at_its_feed_unless_the_ground_is_next():
    """The tensions on both sides of the joint are those of their own accelerations: they balance the wrench."""
    feed = {"kind": "feed", "points": [[0, 0, 1], [0, 0, 1.5], [1, 1, 1.5]], "feed": 0.6, "acceleration": 2}
    down = {"name": "down", "duration": 2, "path": {"kind": "line", "start": [0, 0, 2], "end": [0, 0, 1]}}
    found = plan("cogiro", {"phases": [down, {"name": "paint", "path": feed}]})
    assert found.feasible
    instants = found.audit.times
    rows = np.flatnonzero(np.abs(instants - 2.0) < 2.5e-3)
    rise = found.audit.motion.acceleration[rows, 2]
    assert {round(float(value), 1) for value in rise} == {0.0, 2.0}
    A = Dynamics(load("cogiro")).wrench_matrix(found.audit.motion.pose[rows])
    lift = (A @ found.audit.tensions[rows][..., None])[:, 2, 0]
    np.testing.assert_allclose(lift, load("cogiro").platform.mass * (9.81 + rise), rtol=1e-9)
    on_ground = {"name": "pick", "duration": 0.5, "ground": {}}
    with pytest.raises(InputError, match="must begin with the acceleration"):
        plan("cogiro", {"phases": [down, on_ground, {"name": "paint", "path": feed}]})
