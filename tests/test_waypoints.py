"""Paths through points: legs stay where they must, by properties that hold for any list, and by other derivations."""

import time
from itertools import pairwise, permutations

import numpy as np
import pytest
from scipy.interpolate import PPoly, make_interp_spline
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from towline import load, plan, read_task
from towline.base.errors import InputError
from towline.ocp.tasks.paths import LinePath, WaypointPath
from towline.ocp.warnings.positions import leaves_its_points

LISTS = 60
SHARES = np.linspace(0.0, 1.0, 2001)


def random_points(seed):
    """Pick and place, zig-zag, nearly equal points or a walk: 3 to 30 poses, (n, 6), with attitudes in half of them."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 31))
    if seed % 4 == 0:
        up, places = rng.uniform(0.02, 0.5), rng.uniform(-3, 3, (max(n // 3, 1) + 1, 2))
        places = [[*place, 1.0] for place in places]
        points = [places[0]]
        for before, after in pairwise(places):
            points += [[*before[:2], 1 + up], [*after[:2], 1 + up], after]
        points = np.array(points[:30])
    elif seed % 4 == 1:
        k = np.arange(n)
        points = np.stack([k * rng.uniform(0.05, 0.5), k % 2 * rng.uniform(0.1, 2), np.ones(n)], axis=1)
    elif seed % 4 == 2:
        points = rng.uniform(-2, 2, (n, 3))
        for i in rng.integers(0, n - 1, max(n // 4, 1)):
            points[i + 1] = points[i] + rng.normal(size=3) * 10.0 ** rng.uniform(-9, -2)
    else:
        points = np.cumsum(rng.normal(size=(n, 3)) * rng.choice([0.05, 0.3, 1.0], (n, 1)), axis=0)
    angles = np.zeros_like(points)
    if seed // 4 % 2:
        angles = rng.uniform(-1, 1, points.shape) * [0.4, 0.4, np.pi]
    return np.hstack([points, angles])


def path_of(points, **more):
    return WaypointPath(kind="waypoints", points=tuple(map(tuple, np.asarray(points).tolist())), **more)


def from_legs(place, points):
    """Distance of places (n, 3) from the polygon through points (k, 3)."""
    start, along = points[:-1], np.diff(points, axis=0)
    offset = place[:, None] - start
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    share = np.clip((offset * along).sum(axis=2) / square, 0, 1)
    return np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1)


def sqrt_spline(points):
    """The spline of degree 5 from rest to rest with knots by sqrt(chord), written down again."""
    points = points.copy()
    points[:, 3:] = np.unwrap(points[:, 3:], axis=0)
    parts = np.sqrt(np.linalg.norm(np.diff(points, axis=0), axis=1))
    rest = [(1, np.zeros(6)), (2, np.zeros(6))]
    return make_interp_spline(np.append(0, np.cumsum(parts)) / parts.sum(), points, k=5, bc_type=(rest, rest))


def peaks_of(pose, velocity, acceleration):
    """Largest linear and angular acceleration of motions at SHARES; the latter by differences of angular velocities."""
    (roll, pitch, _), rates = pose[:, 3:].T, velocity[:, 3:]
    omega = [
        rates[:, 0] - np.sin(pitch) * rates[:, 2],
        np.cos(roll) * rates[:, 1] + np.sin(roll) * np.cos(pitch) * rates[:, 2],
        -np.sin(roll) * rates[:, 1] + np.cos(roll) * np.cos(pitch) * rates[:, 2],
    ]
    angular = np.gradient(np.array(omega), SHARES, axis=1)
    return np.linalg.norm(acceleration[:, :3], axis=1).max(), np.linalg.norm(angular, axis=0).max()


def test_no_list_of_points_leaves_its_box_or_its_legs():
    peaks, turning, costs = [], [], []
    for seed in range(LISTS):
        points = random_points(seed)
        begun = time.process_time()
        path = path_of(points)
        motion = path.at(SHARES[::2], 1.0)
        took = time.process_time() - begun
        box = np.ptp(points[:, :3], axis=0)
        place = motion.pose[:, :3]
        tolerance = 1e-12 * np.linalg.norm(box)
        assert (place >= points[:, :3].min(axis=0) - tolerance).all(), seed
        assert (place <= points[:, :3].max(axis=0) + tolerance).all(), seed
        # The default blend is 1 % of the span, of rotations too.
        first = Rotation.from_euler("ZYX", points[0, :2:-1]).inv()
        turned = (first * Rotation.from_euler("ZYX", points[:, :2:-1])).magnitude().max()
        blend = 0.01 * np.hypot(np.linalg.norm(box), turned)
        assert from_legs(place, points[:, :3]).max() <= blend + tolerance, seed
        assert np.linalg.norm(path.missed(1.0)[:, :3], axis=1).max() <= blend + tolerance, seed
        assert path.outside().max() <= tolerance, seed
        begun = time.process_time()
        spline = [sqrt_spline(points)(SHARES, k) for k in range(3)]
        costs.append(took / (time.process_time() - begun))
        rest = path_of(points, blend=0)
        each = [peaks_of(*spline), *(peaks_of(*of.at(SHARES, 1.0)) for of in (path, rest))]
        peaks.append([linear / np.linalg.norm(box) for linear, _ in each])
        if points[:, 3:].any():
            turning.append([[angular, np.hypot(linear, angular)] for linear, angular in each])
    spline, legs, rest = np.median(peaks, axis=0)
    assert legs <= spline
    assert legs < 0.85 * rest
    # Where attitudes change, angular accelerations, and both together: a radian counts as a metre.
    spline, legs, _ = np.median(turning, axis=0)
    assert (legs < 0.9 * spline).all()
    assert np.median(costs) < 40  # of what SciPy takes for a spline through the points: 13, as measured


@pytest.mark.parametrize("seed", range(12))
def test_smoother_legs_stay_as_near_and_their_snap_does_not_jump(seed):
    points = random_points(seed)[:8]
    path, duration = path_of(points, timing="smoother"), 10.0
    motion, box = path.at(np.linspace(0, duration, 4001), duration), np.ptp(points[:, :3], axis=0)
    place, tolerance = motion.pose[:, :3], 1e-12 * np.linalg.norm(box)
    assert (place >= points[:, :3].min(axis=0) - tolerance).all()
    assert (place <= points[:, :3].max(axis=0) + tolerance).all()
    first = Rotation.from_euler("ZYX", points[0, :2:-1]).inv()
    turned = (first * Rotation.from_euler("ZYX", points[:, :2:-1])).magnitude().max()
    assert from_legs(place, points[:, :3]).max() <= 0.01 * np.hypot(np.linalg.norm(box), turned) + tolerance

    def largest_jump(timing, step):
        """The largest change of the snap from one step to the next."""
        times = np.arange(0, duration + step / 2, step)
        acceleration = path_of(points, timing=timing).at(times, duration).acceleration[:, :3]
        return np.linalg.norm(np.diff(acceleration, 3, axis=0), axis=1).max() / step**2

    if seed % 4 == 2:
        return  # with legs that are over within a step
    assert largest_jump("smoother", 5e-4) < 0.6 * largest_jump("smoother", 1e-3)  # in proportion to the step
    assert largest_jump(None, 5e-4) > 0.6 * largest_jump(None, 1e-3)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("blend", [None, 0.0, 0.3])
@pytest.mark.parametrize("timing", [None, "smoother"])
def test_derivatives_of_legs_by_differences(seed, blend, timing):
    points = random_points(seed)[:6]
    path, step, duration = path_of(points, blend=blend, timing=timing), 1e-4, 20.0
    times = np.linspace(0.01, duration - 0.01, 301)
    before, at, after = (path.at(times + shift, duration) for shift in (-step, 0, step))
    scale = 1 + np.abs(at.acceleration).max()
    np.testing.assert_allclose(at.velocity, (after.pose - before.pose) / (2 * step), atol=1e-4 * scale)
    np.testing.assert_allclose(at.acceleration, (after.velocity - before.velocity) / (2 * step), atol=2e-3 * scale)
    ends = path.at(np.array([0.0, duration]), duration)
    np.testing.assert_allclose(ends.velocity, 0, atol=1e-9)
    np.testing.assert_allclose(ends.acceleration, 0, atol=1e-9)
    np.testing.assert_allclose(ends.pose[:, :3], points[[0, -1], :3], atol=1e-12)


def way_of_a_leg():
    """The way of a leg by exact integrals of its acceleration: even, but for smooth steps at ends and middle."""
    ends, step, even = [0.0, 0.1, 0.4, 0.6, 0.9, 1.0], np.array([-2.0, 3.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])
    up, across = step / [1e-3, 1e-2, 0.1, 1], step / [8e-3, 4e-2, 0.2, 1]
    acceleration = PPoly(np.array([up, even, even - 2 * across, -even, -even + up]).T, ends)
    way = acceleration.antiderivative(2)
    return lambda s: way(s) / way(1.0)


def test_a_leg_moves_from_rest_to_rest_by_its_law():
    points, times = [[0, 1, 2, 0, 0, 0], [1, -1, 3, 0, 0, 0]], np.linspace(0, 3, 301)
    motion = path_of(points).at(times, 3.0)
    places = np.outer(way_of_a_leg()(times / 3), np.subtract(points[1], points[0])) + points[0]
    np.testing.assert_allclose(motion.pose, places, atol=1e-12)
    np.testing.assert_allclose(motion.velocity[[0, -1]], 0, atol=1e-12)
    np.testing.assert_allclose(np.gradient(motion.acceleration, times, axis=0)[[0, -1]], 0, atol=0.5)
    line = LinePath(kind="line", start=tuple(points[0][:3]), end=tuple(points[1][:3])).at(times, 3.0)
    peak, of_line = (np.linalg.norm(each.acceleration, axis=1).max() for each in (motion, line))
    assert 4 / 9 * np.sqrt(6) < peak < 0.67 * of_line  # no law accelerates less than 4 ways per squared duration


def test_attitudes_turn_as_scipys_rotations_do():
    """Angles by composed exponentials; rates and their derivatives by differences of rotation matrices."""
    rng = np.random.default_rng(7)
    points = np.hstack([rng.uniform(-1, 1, (5, 3)), rng.uniform(-1, 1, (5, 3)) * [0.5, 0.5, np.pi]])
    path, duration = path_of(points, blend=0.2), 10.0
    given = Rotation.from_euler("ZYX", points[:, :2:-1])
    turns = (given[:-1].inv() * given[1:]).as_rotvec()
    way = way_of_a_leg()
    legs = path._legs
    last = legs._last * legs.scale(duration)
    start = legs.knots(duration)[:-1] - legs._early * last
    times, step = np.linspace(0.05, 9.95, 200), 1e-4

    def attitude(instant):
        s = np.clip((instant - start) / last, 0, 1)
        turned = given[0]
        for share, turn in zip(way(s), turns, strict=True):
            turned = turned * Rotation.from_rotvec(share * turn)
        return turned

    motion = path.at(times, duration)
    for k, instant in enumerate(times):
        before, at, after = (attitude(instant + shift) for shift in (-step, 0, step))
        mine = Rotation.from_euler("ZYX", motion.pose[k, :2:-1])
        assert (mine.inv() * at).magnitude() < 1e-9
        # Euler angles of scipy, made continuous, and their differences.
        angles = np.unwrap(np.array([each.as_euler("ZYX")[::-1] for each in (before, at, after)]), axis=0)
        np.testing.assert_allclose(motion.velocity[k, 3:], (angles[2] - angles[0]) / (2 * step), atol=1e-5)
        second = (angles[2] - 2 * angles[1] + angles[0]) / step**2
        np.testing.assert_allclose(motion.acceleration[k, 3:], second, atol=1e-3)
    assert np.abs(np.diff(motion.pose[:, 3:], axis=0)).max() < 1.0  # no full turns


def test_yaw_takes_the_short_way():
    path = path_of([[0, 0, 1, 0, 0, 3.1], [1, 0, 1, 0, 0, -3.1], [2, 0, 1, 0, 0, -3.0]])
    yaw = path.at(np.linspace(0, 5, 501), 5.0).pose[:, 5]
    assert (np.diff(yaw) >= 0).all()
    assert yaw[0] == pytest.approx(3.1)
    assert yaw[-1] == pytest.approx(2 * np.pi - 3.0)
    half = path_of([[0, 0, 1, 0, 0, -np.pi / 2], [1, 0, 1, 0, 0, np.pi / 2]])
    assert half.at(np.array([2.5]), 5.0).pose[0, 5] == pytest.approx(0, abs=1e-9)


def test_motions_asked_for_again_are_the_same_and_their_own():
    path = WaypointPath(kind="waypoints", points=((0, 0, 1), (2, 0, 1, 0, 0, 1), (2, 2, 2, 0.2, 0, 2)))
    for last, count in 2 * ((6.0, 50), (7.0, 50), (6.0, 51)):
        times = np.linspace(0, last, count)
        alone = path.at(np.append(times, last), last)
        for part, other in zip(path.at(times, last), alone, strict=True):
            np.testing.assert_array_equal(part, other[:-1])
            part += 1.0


def test_times_and_dwells_are_kept():
    points = [[0, 0, 1, 0, 0, 0], [1, 0, 1, 0, 0, 0.3], [1, 1, 1, 0, 0, 0.3], [0, 1, 1, 0, 0, 0]]
    timed = path_of(points, times=(0, 1, 3, 4), dwell=(0, 0, 0.5, 0.25), blend=0)
    assert timed.natural_duration == 4.25
    for point, instants in zip(points, [[0], [1], [3, 3.2, 3.5], [4, 4.25]], strict=True):
        motion = timed.at(np.array(instants, dtype=float), 4.25)
        np.testing.assert_allclose(motion.pose, np.tile(point, (len(instants), 1)), atol=1e-12)
        np.testing.assert_allclose(motion.velocity, 0, atol=1e-12)
    blended = path_of(points, times=(0, 1, 3, 4), blend=0.02)
    assert np.linalg.norm(blended.missed(4.0)[:, :3], axis=1).max() <= 0.02
    assert np.linalg.norm(blended.at(np.array([1.0, 3.0]), 4.0).velocity, axis=1).min() > 0.05
    dwelling = path_of(points, dwell=(0.5, 0, 1.5, 0))
    start = dwelling.at(np.array([0.0, 0.49]), 8.0)
    np.testing.assert_allclose(start.pose, [points[0]] * 2, atol=1e-12)
    arrival = dwelling.knots(8.0)[2]
    np.testing.assert_allclose(dwelling.at(arrival + np.array([0, 0.7, 1.5]), 8.0).pose, [points[2]] * 3, atol=1e-9)
    # What is left of the duration is that of the motion without dwells.
    assert dwelling.knots(8.0)[1] - 0.5 == pytest.approx(path_of(points, dwell=(0, 0, 1e-9, 0)).knots(6.0)[1])


@pytest.mark.parametrize("shape", ["legs", "spline"])
def test_shares_of_the_duration_change_the_times_and_not_the_way(shape):
    """With those that a path has by default it is the same; with others its legs, only faster and slower."""
    path = WaypointPath(kind="waypoints", points=[[0, 0, 1], [1, 0, 1], [1, 2, 1], [0, 2, 2]], shape=shape)
    own = WaypointPath(**{**path.model_dump(), "shares": path.knots(1.0).tolist()})
    times = np.linspace(0, 3, 301)
    for mine, its in zip(path.at(times, 3.0), own.at(times, 3.0), strict=True):
        np.testing.assert_allclose(mine, its, atol=1e-9)
    other = WaypointPath(**{**path.model_dump(), "shares": [0, 0.2, 0.7, 1]})
    np.testing.assert_allclose(other.knots(3.0), [0, 0.6, 2.1, 3])
    pose, velocity, acceleration = other.at(times, 3.0)
    if shape == "legs":
        np.testing.assert_allclose(other.missed(3.0), path.missed(3.0), atol=0.01)
        assert KDTree(path.at(np.linspace(0, 3, 9001), 3.0).pose).query(pose)[0].max() < 2e-3
    np.testing.assert_allclose(np.gradient(pose, times, axis=0)[2:-2], velocity[2:-2], atol=0.02)
    np.testing.assert_allclose(np.gradient(velocity, times, axis=0)[2:-2], acceleration[2:-2], atol=0.3)


def test_a_low_lift_stays_low():
    """A lift of 5 cm, a move of 2 m, a lowering of 5 cm, with nothing but points and a duration."""
    points = [[-1, 0, 2], [-1, 0, 2.05], [1, 0, 2.05], [1, 0, 2]]
    found = plan(load("cogiro"), {"path": {"kind": "waypoints", "points": points}, "duration": 8})
    assert found.feasible, found.report()
    place = found.audit.motion.pose[:, :3]
    assert place.min(axis=0) == pytest.approx([-1, 0, 2], abs=1e-12)
    assert place.max(axis=0) == pytest.approx([1, 0, 2.05], abs=1e-12)
    assert np.linalg.norm(found.audit.motion.acceleration[:, :3], axis=1).max() < 0.4
    assert "warning" not in found.report()
    spline = {"kind": "waypoints", "points": points, "shape": "spline"}
    high = plan(load("cogiro"), {"path": spline, "duration": 8})
    assert "the path leaves the box of its points by up to" in high.report()
    assert "along z; the shape legs stays inside" in high.report()
    assert high.audit.motion.pose[:, 2].max() > 2.1


def test_a_spline_that_leaves_the_box_of_its_points_by_micrometres_has_no_warning():
    """A figure eight of 0.4 x 0.2 m through 41 points: its largest y lies between two of them."""
    turns = np.linspace(0, 2 * np.pi, 41)
    points = [[0.2 * np.sin(turn), 0.1 * np.sin(2 * turn), 2] for turn in turns]
    path = path_of(points, shape="spline")
    assert 1e-6 < path.outside().max() < 1e-5
    assert leaves_its_points(path) == []


def test_splines_go_through_their_points_from_rest_to_rest():
    points = random_points(3)
    path = path_of(points, shape="spline")
    motion = path.at(path.knots(5.0), 5.0)
    np.testing.assert_allclose(motion.pose[:, :3], points[:, :3], atol=1e-9)
    np.testing.assert_allclose(motion.velocity[[0, -1]], 0, atol=1e-9)
    np.testing.assert_allclose(motion.acceleration[[0, -1]], 0, atol=1e-7)
    np.testing.assert_allclose(path.at(SHARES, 1.0).pose, sqrt_spline(points)(SHARES), atol=1e-9)


CSV = "x [mm]; y[cm]; z [m]; yaw [deg]; t [s]\n# a comment\n0;0;1;0;0\n\n500;10;1.5;90;2\n1000;0;1;180;3\n"
GCODE = """%
N10 G21 G90 (millimetres)
G0 X0 Y0 Z1000
G1 X500 F6000 ; 5 s
G4 P1.5
G91 Z-100
G1 Z-100
G90 G20 Z30 F100
M30
"""


def test_points_come_from_files_beside_the_task(tmp_path):
    (tmp_path / "tour.csv").write_text("\ufeff" + CSV)
    (tmp_path / "task.yaml").write_text("path: {kind: waypoints, points: tour.csv}\n")
    path = read_task(tmp_path / "task.yaml").path
    np.testing.assert_allclose(
        path.points, [[0, 0, 1, 0, 0, 0], [0.5, 0.1, 1.5, 0, 0, np.pi / 2], [1, 0, 1, 0, 0, np.pi]], atol=1e-12
    )
    assert path.times == (0, 2, 3)
    (tmp_path / "tour.gcode").write_text(GCODE)
    (tmp_path / "task.yaml").write_text("path: {kind: waypoints, points: tour.gcode}\n")
    path = read_task(tmp_path / "task.yaml").path
    heights = [1, 1, 0.9, 0.8, 30 * 0.0254]
    np.testing.assert_allclose(np.array(path.points)[:, 2], heights, atol=1e-12)
    np.testing.assert_allclose(np.array(path.points)[1:, 0], 0.5, atol=1e-12)
    assert path.dwell == (0, 1.5, 0, 0, 0)
    np.testing.assert_allclose(np.diff(path.times), [5, 2.5, 1, (0.8 - 0.762) / (100 * 0.0254 / 60)], atol=1e-9)


def test_one_dwell_is_that_of_every_point():
    points = [[0, 0, 1], [1, 0, 1], [1, 1, 1]]
    for kind, keys in (("waypoints", {}), ("feed", {"feed": 1, "acceleration": 2})):
        path = {"kind": kind, "points": points, **keys}
        one, each = (read_task({"path": {**path, "dwell": dwell}}).path for dwell in (0.5, [0.5] * 3))
        assert one == each


WRONG = {
    "unit missing": ("a.csv", CSV.replace("z [m]", "z"), "a.csv: the unit of z must be one of m, .*got ''"),
    "unit unknown": ("a.csv", CSV.replace("[deg]", "[turns]"), "the unit of yaw must be one of rad, .*got 'turns'"),
    "no z": ("a.csv", "x [m],y [m]\n0,0\n1,1\n", r"a.csv: column z is missing, such as 'z \[m\]'"),
    "word": ("a.csv", CSV.replace("500", "half"), r"a.csv: line 5, column x \[mm\] must be a number, got 'half'"),
    "infinite": ("a.csv", CSV.replace("500", "inf"), r"line 5, column x \[mm\] must be a number, got 'inf'"),
    "short row": ("a.csv", CSV.replace("500;", ""), "line 5 must have 5 values like the header, got 4"),
    "time back": ("a.csv", CSV.replace(";3\n", ";1\n"), "line 6, column t must increase, got 1 s after 2 s"),
    "late start": ("a.csv", CSV.replace(";0;0\n", ";0;1\n"), "line 3, column t must start at 0 s, got 1 s"),
    "one line": ("a.csv", "x [m],y [m],z [m]\n0,0,0\n", "a header and two points or more, got 1"),
    "ending": ("a.txt", CSV, "points must be a list, or a file whose name ends in one of .csv, .*got 'a.txt'"),
    "NetCDF": ("a.nc", "CDF\x01", "a.nc must be G-code or CSV, got NetCDF"),
    "no unit": ("a.ngc", "G0 X0 Y0 Z0", "a.ngc, line 1: the unit must be given before, by G20 .inches. or G21"),
    "arc": ("a.ngc", GCODE.replace("G91 Z", "G2 Z"), "line 6: an arc must have I and J, or R"),
    "rotary": ("a.ngc", GCODE.replace("X500", "A90"), "line 4: must be G0 to .*got A90"),
    "macro": ("a.ngc", GCODE.replace("X500", "X#1"), "line 4: must be G0 to .*got 'X#1 F6000'"),
    "first": ("a.ngc", "G21\nG0 X0 Z1\nG91 G0 Y2", "line 3: the first move must name X, Y and Z"),
    "no feed": ("a.ngc", "G21 G0 X0 Y0 Z1\nG1 X5", "line 2: G1 must have a feed F"),
    "dwell first": ("a.ngc", "G21\nG4 P1", "line 2: G4 must follow a move"),
    "after the end": ("a.ngc", GCODE + "G0 X1", "line 10: nothing must follow the end"),
    "no file": ("", "", "b.csv: no such file"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_files_are_one_line(case, tmp_path):
    name, text, message = WRONG[case]
    if name:
        (tmp_path / name).write_text(text)
    (tmp_path / "task.yaml").write_text(f"path: {{kind: waypoints, points: {name or 'b.csv'}}}\nduration: 3\n")
    with pytest.raises(InputError, match=message) as caught:
        read_task(tmp_path / "task.yaml")
    assert "\n" not in str(caught.value)


REFUSED = {
    "smooth": (
        {"timing": "smooth"},
        "'timing' must be 'smoother' or left out of waypoints, got 'smooth': write 'shape: spline'",
    ),
    "uniform": (
        {"timing": "uniform"},
        "'timing' must be 'smoother' or left out of waypoints, got 'uniform': write nothing",
    ),
    "capital": ({"timing": "Smoother"}, "path.timing must be 'smoother', got 'Smoother'"),
    "timing of a spline": ({"timing": "smoother", "shape": "spline"}, "timing must be left out with the shape spline"),
    "near": (
        {"shape": "spline", "points": [[0, 0, 1], [1, 0, 1], [1, 0, 1.0000001], [0, 2, 1]]},
        r"points\[2\] must be",
    ),
    "dwell": ({"dwell": [1]}, "dwell must have one number for each of the 3 points, got 1"),
    "dwell of another kind": ({"dwell": {"min": 1}}, r"dwell must be a number \[s\] or a list of one for each point"),
    "long dwell": ({"dwell": [1, 2, 1]}, "duration must be more than the 4 s for which path dwells, got 2 s"),
    "dwell past times": ({"dwell": [1, 0, 0], "times": [0, 1, 2]}, r"dwell\[0\] must be less than the 1 s"),
    "spline that dwells": ({"shape": "spline", "dwell": [0, 1, 0]}, "dwell must be left out with the shape spline"),
    "shares and times": ({"shares": [0, 0.5, 1], "times": [0, 1, 2]}, "times must be left out with shares"),
    "few shares": ({"shares": [0, 1]}, "shares must have one number for each of the 3 points, got 2"),
    "shares back": ({"shares": [0, 0, 1]}, r"shares must increase, got shares\[1\] = 0 after 0"),
    "late shares": ({"shares": [0.1, 0.5, 1]}, "shares must start at 0, got 0.1"),
    "shares of more": ({"shares": [0, 0.5, 1.1]}, "shares must end at 1, got 1.1"),
    "nan share": ({"shares": [0, float("nan"), 1]}, r"path.shares\[1\]"),
    "gimbal": ({"points": [[0, 0, 1], [0, 1, 1, 0, 1.57, 0]]}, r"points\[0\] to points\[1\] must keep the pitch"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_waypoints_are_one_line(case):
    keys, message = REFUSED[case]
    path = {"kind": "waypoints", "points": [[0, 0, 1], [1, 0, 1], [1, 1, 1]], **keys}
    with pytest.raises(InputError, match=message) as caught:
        plan(load("cogiro"), {"path": path, "duration": 2})
    assert "\n" not in str(caught.value)


def test_exact_waypoints_are_passed_beside_legs():
    """Legs pass their points at the blend; the platform goes through them, if the tube reaches that far."""
    path = {"kind": "waypoints", "points": [[0, 0, 1], [0.3, 0, 1.1], [0.5, 0.2, 1.1], [0.5, 0.4, 1]], "blend": 0.02}
    task = {"path": path, "duration": 4, "steps": 40}
    with pytest.raises(
        InputError, match=r"tube.position must be at least 0.0.* m, the distance at which the legs pass points\[1\]"
    ):
        plan(load("ipanema-1"), {**task, "tube": {"position": 0.001, "waypoints": "exact"}})
    found = plan(load("ipanema-1"), {**task, "tube": {"position": 0.05, "ends": "exact", "waypoints": "exact"}})
    assert found.feasible, found.report()
    knots = found.scenario.task.path.knots(4.0)
    place, _ = found.scenario.motion(knots, found.deviation)
    np.testing.assert_allclose(place.pose[:, :3], path["points"], atol=1e-6)
    assert found.tracking_error_max > 0.001


@pytest.mark.parametrize("count", [0, 1, 2, 5, 7])
def test_a_free_order_is_the_shortest_of_all(count):
    rng = np.random.default_rng(count)
    points = np.hstack(
        [rng.uniform(-1, 1, (count + 2, 3)), np.zeros((count + 2, 2)), rng.uniform(-3, 3, (count + 2, 1))]
    )
    dwell = np.arange(count + 2.0)
    path = WaypointPath(kind="waypoints", points=points.tolist(), order="free", dwell=dwell.tolist())

    def length(order):
        steps = np.diff(points[list(order)], axis=0)
        steps[:, 3:] = (steps[:, 3:] + np.pi) % (2 * np.pi) - np.pi
        return np.linalg.norm(steps, axis=1).sum()

    found = [int(seconds) for seconds in path.dwell]
    np.testing.assert_array_equal(np.array(path.points), points[found])
    assert found[0] == 0
    assert found[-1] == count + 1
    shortest = min(length([0, *inner, count + 1]) for inner in permutations(range(1, count + 1)))
    assert length(found) == pytest.approx(shortest, rel=1e-12)
    assert WaypointPath.model_validate(path.model_dump()) == path


def test_a_free_order_stays_when_it_is_read_again():
    """A closed path is as long backwards."""
    points = [[0, 0, 1], [2, 1, 1.5], [-2, -1, 1.2], [2, -1, 1], [-2, 1, 1.5], [0, 0, 1]]
    once = WaypointPath(kind="waypoints", points=points, order="free")
    assert WaypointPath.model_validate(once.model_dump()) == once
    assert once.points[0] == once.points[-1]


def test_a_free_order_of_many_points_or_with_times_is_refused():
    points = [[k, 0, 1] for k in range(15)]
    with pytest.raises(InputError, match=r"'given' for more than 12 points between the .* last, got 13"):
        read_task({"path": {"kind": "waypoints", "points": points, "order": "free"}, "duration": 3})
    with pytest.raises(InputError, match="order must be 'given' with times"):
        read_task({"path": {"kind": "waypoints", "points": points[:3], "times": [0, 1, 2], "order": "free"}})


def test_a_path_is_continuous_by_s_where_corners_begin_and_end():
    """Right beside the beginning of a corner the path was 0.4 um off, much more than it moves there."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        path = WaypointPath(kind="waypoints", points=[(*point, 0, 0, 0) for point in rng.uniform(-2, 2, (6, 3))])
        edges = path._legs.bends().ravel()
        s = np.clip(edges[:, None] + np.append(0.0, 10.0 ** np.arange(-12, -5)), 0.0, 1.0)
        pose, rate, _ = path.by_fraction(s.ravel())
        moved = np.linalg.norm(np.diff(pose.reshape(*s.shape, 6), axis=1), axis=2)
        fastest = np.linalg.norm(rate, axis=1).reshape(s.shape).max(axis=1, keepdims=True)
        assert (moved <= 1.01 * fastest * np.abs(np.diff(s, axis=1)) + 1e-12).all()
