"""Paths past obstacles before any program is solved: through holes, round walls; checked by distances of our own."""

from dataclasses import replace
from functools import partial
from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.optimize import linprog

from towline import InputError, tensions
from towline.benchmarks.scenes import APART, GATE, LENGTH, LOAD, QUADROTOR, TREES, forest, window
from towline.models import Robot, load
from towline.ocp import Planner, plan
from towline.ocp.global_path import global_path
from towline.ocp.global_path.at_rest import AtRest
from towline.ocp.global_path.clear_space import ClearSpace
from towline.ocp.global_path.global_path import find_global_path, with_clear_ends
from towline.ocp.global_path.space import Space
from towline.ocp.global_path.tree import guess_exceeds, is_open
from towline.ocp.nlp.guess import usual_guess
from towline.ocp.search.search import Search
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import Task

ROBOT = load("point-mass-3")
LINE = {"kind": "line", "start": [-0.6, 0, 1], "end": [0.6, 0, 1]}
KEPT = 0.05  # [m]
FAR = 4.0  # [m]
FINE = 4001  # places along a path of about 2 m: ten times finer than the trees check it


def box(low, high, **more):
    return {"kind": "box", "min": low, "max": high, "platform": KEPT, "cables": None, **more}


def wall(x, hole_low, hole_high, thickness=0.02):
    """Four boxes about a hole in (y, z)."""
    (y, z), (y_high, z_high) = hole_low, hole_high
    left, right = x - thickness / 2, x + thickness / 2
    return [
        box([left, -FAR, -FAR], [right, y, FAR]),
        box([left, y_high, -FAR], [right, FAR, FAR]),
        box([left, y, -FAR], [right, y_high, z]),
        box([left, y, z_high], [right, y_high, FAR]),
    ]


WALL_WITH_A_HOLE = wall(0.0, (0.3, 1.2), (0.6, 1.5))
CLOSED = wall(0.3, (0, 0), (1e-3, 1e-3))


def scenario_of(places, robot=ROBOT, **changes):
    task = {"path": LINE, "duration": 4, "steps": 20, "tube": {"position": "free"}, "limits": {"keep_out": places}}
    return lay_out(robot, Task.model_validate(task | changes))


def outside(place, points):
    """Euclidean distance of points (..., 3) from a box, zero inside."""
    low, high = np.array(place["min"]), np.array(place["max"])
    return np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=-1)


@pytest.fixture(scope="module")
def through_the_hole():
    path, message = find_global_path(scenario_of(WALL_WITH_A_HOLE))
    assert path is not None, message
    return path


def test_a_path_past_walls_is_clear_between_its_places_too(through_the_hole):
    scenario = scenario_of(WALL_WITH_A_HOLE)
    assert is_open(scenario)
    assert guess_exceeds(scenario, partial(usual_guess, scenario)) == "keep_out"
    platform, _ = through_the_hole.space.poses(through_the_hole.at(np.linspace(0, 1, FINE)))
    assert min(outside(place, platform[:, :3]).min() for place in WALL_WITH_A_HOLE) >= KEPT - 1e-6
    np.testing.assert_array_equal(platform[[0, -1], :3], [LINE["start"], LINE["end"]])
    directions = ROBOT.home_anchors - platform[:, None, :3]
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    tensions = np.linalg.solve(directions.swapaxes(1, 2), np.tile([0, 0, ROBOT.weight], (FINE, 1))[..., None])
    assert tensions.min() >= ROBOT.t_min.min()
    assert tensions.max() <= ROBOT.t_max.max()


def test_pieces_are_clear_only_where_no_place_of_them_is_too_near():
    """Sheets with a distance of 4 mm about them, which is less than the steps of the check."""
    reserve = 0.004
    sheets = [box([x, -FAR, -FAR], [x + 1e-4, y, FAR], platform=0.0) for x, y in ((-0.1, 0.1), (0.1, 0.3))]
    space = Space(scenario_of(sheets))
    clear = ClearSpace(space, AtRest(space.scenario, space.size), reserve)
    rng = np.random.default_rng(3)
    counts = {True: 0, False: 0}
    for _ in range(200):
        points = rng.uniform([-0.4, -0.3, 0.9], [0.4, 0.6, 1.1], (3, 3))
        ends_clear = clear.rest(*space.poses(points[[0, -1]])).slack.min() >= reserve
        dense = np.concatenate([a + np.linspace(0, 1, 1501)[:, None] * (b - a) for a, b in pairwise(points)])
        nearest = min(outside(sheet, dense).min() for sheet in sheets)
        if not ends_clear or abs(nearest - reserve) < 1e-3:
            continue  # as the slope of the reserve and the finest pieces decide
        answer = clear.is_clear(points)
        counts[answer] += 1
        assert answer == (nearest > reserve)
    assert min(counts.values()) >= 20


def test_the_same_task_has_the_same_path(through_the_hole):
    again, _ = find_global_path(scenario_of(WALL_WITH_A_HOLE))
    assert again is not None
    np.testing.assert_array_equal(again.corners, through_the_hole.corners)


def test_a_path_is_as_short_as_its_corners_permit(through_the_hole):
    """Through the nearest corner of the hole; 15 % longer, since random shortcuts do not find the shortest path."""
    corner = np.array([0.0, 0.3 + KEPT, 1.2 + KEPT])
    shortest = sum(np.linalg.norm(corner - np.array(LINE[end])) for end in ("start", "end"))
    assert shortest - 0.02 <= through_the_hole.length <= 1.15 * shortest


def test_the_guess_is_checked_between_its_places():
    """A sheet that is thinner than the steps of the check, and in the middle of one of them, is in the way."""
    thin = [box([0.0102, -FAR, -FAR], [0.0103, FAR, FAR], platform=0.0)]
    aside = [box([0.1, 1, -FAR], [0.2, FAR, FAR])]
    for places, exceeded in ((thin, "keep_out"), (aside, "")):
        scenario = scenario_of(places)
        assert guess_exceeds(scenario, partial(usual_guess, scenario)) == exceeded


def test_no_way_through_ends_in_time():
    path, message = find_global_path(scenario_of(CLOSED), seconds=0.3)
    assert path is None
    assert "share of the time limit" in message
    planned = plan(ROBOT, scenario_of(CLOSED, time_limit=1.0, steps=10).task)
    assert not planned.feasible
    assert "no path found" in next(stage.message for stage in planned.stages if stage.name == "global path")


def test_an_end_that_is_blocked_has_no_path():
    path, message = find_global_path(scenario_of([box([0.5, -1, 0], [0.7, 1, 2])]))
    assert path is None
    assert "the end exceeds keep_out" in message


def test_only_motions_that_may_go_anywhere_have_global_paths():
    circle = {"kind": "circle", "centre": [0, 0, 1], "radius": 0.3, "rate": 1.0}
    assert not is_open(scenario_of([], tube={"position": 0.5}))
    assert not is_open(scenario_of([], tube={}))
    assert not is_open(scenario_of([], path=circle))
    assert not is_open(scenario_of([], tube={"position": "free", "ends": "free"}))


def test_a_path_is_searched_for_where_no_program_finds_a_motion_from_a_shifted_one(monkeypatch, through_the_hole):
    """The coarse program that starts from the shifted motion is made to fail: no finer one is solved from there."""
    solve, failed = Search.solve, []

    def failing(self, name, *arguments, **named):
        outcome = solve(self, name, *arguments, **named)
        fails = name == "coarse program" and not failed
        failed.extend([name] * fails)
        return replace(outcome, success=False, message="Infeasible_Problem_Detected") if fails else outcome

    monkeypatch.setattr(Search, "solve", failing)
    shifted = lambda scenario: lambda nodes: through_the_hole.guess(scenario).at(nodes)  # noqa: E731
    monkeypatch.setattr(global_path, "formation_guess", shifted)
    planned = plan(ROBOT, scenario_of(WALL_WITH_A_HOLE, steps=60).task)
    assert planned.feasible, planned.report()
    stages = [(stage.name.split(",")[0], stage.message) for stage in planned.stages]
    first, second = (i for i, (name, _) in enumerate(stages) if name == "global path")
    assert "a shifted or turned one keeps all limits" in stages[first][1]
    assert "a path of" in stages[second][1]
    assert "nonlinear program" not in [name for name, _ in stages[:second]]
    assert "nonlinear program" in [name for name, _ in stages[second:]]
    positions = planned.audit.motion.pose[:, :3]
    assert min(outside(place, positions).min() for place in WALL_WITH_A_HOLE) >= KEPT - 1e-5


def test_a_plan_goes_through_the_hole_and_is_planned_again_from_the_last_result():
    planner = Planner(ROBOT, scenario_of(WALL_WITH_A_HOLE).task)
    first, second = planner.plan(), planner.plan()
    assert first.feasible, first.report()
    positions = first.audit.motion.pose[:, :3]
    assert min(outside(place, positions).min() for place in WALL_WITH_A_HOLE) >= KEPT - 1e-5
    assert second.feasible
    assert "global path" in [stage.name for stage in first.stages]
    assert [stage.name.split(",")[0] for stage in second.stages] == ["ends and path", "nonlinear program", "audit"]
    assert second.iterations <= 10
    assert second.objective == pytest.approx(first.objective, rel=1e-3)
    np.testing.assert_allclose(second.deviation.q, first.deviation.at(second.deviation.nodes).q, atol=0.01)


@pytest.mark.parametrize(("scene", "posts"), [(window(2), GATE), (forest(3), TREES)], ids=["gate-2", "trees-3"])
def test_teams_squeeze_turn_and_slide_between_posts(scene, posts):
    robot, task = scene
    path, message = find_global_path(lay_out(robot, Task.model_validate(task)))
    assert path is not None, message
    platform, carriers = path.space.poses(path.at(np.linspace(0, 1, FINE)))
    blocks = [
        {"min": [x - size / 2, y - size / 2, -1.5], "max": [x + size / 2, y + size / 2, 1.5]} for x, y, size in posts
    ]
    for place in blocks:
        assert outside(place, carriers[..., :3]).min() >= QUADROTOR - 1e-6
        assert outside(place, platform[:, :3]).min() >= LOAD - 1e-6
    cables = carriers[..., :3] - platform[:, None, :3]
    np.testing.assert_allclose(np.linalg.norm(cables, axis=2), LENGTH, atol=1e-12)
    for i, j in combinations(range(len(robot.carriers)), 2):
        assert np.linalg.norm(carriers[:, i, :3] - carriers[:, j, :3], axis=1).min() >= APART - 1e-6
    if len(robot.carriers) == 2:
        assert np.abs(cables.sum(axis=1)[:, :2]).max() < 1e-3  # equal pulls: the load hangs still


def past_a_pillar(half=1.35, **base):
    """Three quadrotors at home stand in the zone of a pillar at the start, and at the end; see `ZONE`."""
    line = {"kind": "line", "start": [-half, 0, 0], "end": [half, 0, 0]}
    pillar = {"kind": "capsule", "start": [0, 0, -5], "end": [0, 0, 7], "radius": 0.15}
    kept = {"carriers": 0.3, "platform": 0.0, "cables": 0.0}
    task = {"path": line, "tube": {"position": "free", "attitude": 0.4, "ends": "rest"}, "duration": 5.6}
    task |= {"base": {"kind": "free", **base}, "limits": {"keep_out": [pillar | kept]}}
    return lay_out(load("multi-quadrotor-3"), Task.model_validate(task))


ZONE = 0.45  # [m]: of quadrotors, from the pillar's axis


def test_formations_that_are_free_at_the_ends_start_clear():
    scenario = past_a_pillar()
    usual = load("multi-quadrotor-3").carrier_home[:, :2] + [-1.35, 0]
    assert np.linalg.norm(usual, axis=1).min() < ZONE
    path, message = find_global_path(scenario)
    assert path is not None, message
    platform, carriers = path.space.poses(path.at(np.linspace(0, 1, FINE)))
    assert np.linalg.norm(carriers[..., :2], axis=2).min() >= ZONE - 1e-6
    np.testing.assert_allclose(platform[[0, -1], :3], [[-1.35, 0, 0], [1.35, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(platform[[0, -1], 3:5], 0.0, atol=1e-12)  # it may turn about the vertical alone


def test_a_platform_turns_at_its_ends_where_its_attitude_is_free():
    """A ball below an attachment of a level platform: a little roll or pitch lifts that, position and yaw do not."""
    robot = load("ipanema-1")
    start, end = (robot.home + np.r_[x, np.zeros(5)] for x in (-0.3, 0.3))
    corner = start[:3] + robot.attachments[robot.attachments[:, 2].argmin()]
    ball = {"kind": "sphere", "centre": (corner - [0, 0, 0.115]).tolist(), "radius": 0.1, "cables": None}
    task = {
        "path": {"kind": "line", "start": start.tolist(), "end": end.tolist()},
        "duration": 3.0,
        "tube": {"position": "free", "attitude": 0.3},
        "limits": {"keep_out": [ball | {"platform": 0.02}]},
    }
    path, message = find_global_path(lay_out(robot, Task.model_validate(task)))
    assert path is not None, message
    platform, _ = path.space.poses(path.at(np.array([0.0, 1.0])))
    np.testing.assert_allclose(platform[:, :3], [start[:3], end[:3]], atol=1e-12)
    assert np.abs(platform[0, 3:5]).max() > 1e-3


@pytest.mark.parametrize("ends", ["exact", "periodic"])
def test_formations_that_are_given_at_the_ends_stay(ends):
    space = Space(past_a_pillar(ends=ends))
    np.testing.assert_array_equal(with_clear_ends(space, AtRest(space.scenario, space.size), 0.05).ends, space.ends)


def test_formations_keep_the_balance_of_a_load():
    """Any linear map of the horizontal offsets keeps the sum of the horizontal pulls at zero: six quadrotors."""
    robot, task = window(6)
    space = Space(lay_out(robot, Task.model_validate(task)))
    rng = np.random.default_rng(1)
    samples = np.array([space.sample(rng) for _ in range(200)])
    platform, carriers = space.poses(samples)
    cables = carriers[..., :3] - platform[:, None, :3]
    np.testing.assert_allclose(np.linalg.norm(cables, axis=2), LENGTH, atol=1e-12)
    flat = space.offsets[:, :2]
    weights = np.linalg.lstsq(np.vstack([flat.T, np.ones(6)]), [0, 0, 1], rcond=None)[0]  # of balanced pulls
    unclipped = np.linalg.norm(cables[..., :2], axis=2).max(axis=1) < 0.96 * LENGTH
    assert unclipped.sum() > 50
    np.testing.assert_allclose((weights @ cables[unclipped])[:, :2], 0, atol=1e-12)


def test_a_load_all_the_way_hangs_on_a_path_as_the_weight_of_a_heavier_platform_does():
    def laid(robot, more):
        return lay_out(robot, Task.model_validate({"steps": 20, "tube": {"position": "free"}} | more))

    carry = {"name": "carry", "duration": 2, "path": LINE, "load": {"mass": 7, "com": [0, 0, 0]}}
    heavy = ROBOT.model_copy(update={"platform": ROBOT.platform.model_copy(update={"mass": ROBOT.platform.mass + 7})})
    ours, theirs = laid(ROBOT, {"phases": [carry]}), laid(heavy, {"path": LINE, "duration": 2})
    poses = np.zeros((300, 6))
    poses[:, :3] = np.random.default_rng(0).uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 2.5], (300, 3))
    frame = np.zeros((300, len(ROBOT.carriers), 6))
    kept, others = (AtRest(each, 1.0, spare=0.0)(poses, frame) for each in (ours, theirs))
    assert 0 < (others.worst == -1).sum() < 300
    np.testing.assert_array_equal(kept.slack, others.slack)
    assert is_open(ours)


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_quadrotor_at_rest_needs_a_thrust_that_carries_itself_and_the_platform(share):
    data = load("wang-flying-quadrotor").model_dump()
    (quadrotor,) = data["carriers"]
    quadrotor["thrust_max"] = share * 9.81 * (quadrotor["mass"] + data["platform"]["mass"])
    robot = Robot.model_validate(data)
    path = {"kind": "line", "start": robot.home.tolist(), "end": (robot.home + np.eye(6)[0]).tolist()}
    scenario = scenario_of([], robot, path=path, tube={}, base={"kind": "free", "ends": "rest"})
    kept = AtRest(scenario, 1.0, spare=0.0)(robot.home[None], robot.carrier_home[None])
    names = [limit.name for limit in scenario.limits]
    assert (names[kept.worst[0]] == "thrust") == (share < 1)
    assert kept.slack[0] == pytest.approx(min(1 - 1 / share, 0.0), abs=1e-6)


@pytest.mark.parametrize("name", ["cogiro", "ipanema-1"])
def test_tensions_at_rest_are_found_wherever_a_linear_program_finds_some(name):
    """Those of least norm seldom fit ipanema-1: the ones nearest to the middle of the limits, or the solver, decide."""
    robot = load(name)
    rng, n = np.random.default_rng(5), 60
    moves = np.hstack(
        [rng.uniform(-0.35, 0.35, (n, 3)) * np.ptp(robot.home_anchors, axis=0), rng.uniform(-0.5, 0.5, (n, 3))]
    )
    end = robot.home + np.eye(6)[0]
    path = {"kind": "line", "start": robot.home.tolist(), "end": end.tolist()}
    poses, scenario = robot.home + moves, scenario_of([], robot, path=path)
    kept = AtRest(scenario, 1.0, spare=0.0)(poses, np.zeros((n, len(robot.carriers), 6)))
    moments = robot.wrench_scale[:, None]
    exist = [
        linprog(
            np.zeros(robot.m),
            A_eq=moments * scenario.dynamics.wrench_matrix(pose),
            b_eq=robot.wrench_scale * [0, 0, robot.weight, 0, 0, 0],
            bounds=np.transpose(scenario.bounds()),
        ).success
        for pose in poses
    ]
    assert 2 < sum(exist) < n
    np.testing.assert_array_equal(kept.worst != -1, exist)


def test_places_on_the_axis_of_a_swivelling_pulley_are_not_tried():
    # There the pulley has no direction, and a point mass is often sampled there: at the edge of the anchors' box.
    pulley = {"pulley": {"radius": 0.05, "axis": [0, 0, 1]}}
    robot = type(ROBOT).model_validate(
        ROBOT.model_dump() | {"cables": [cable.model_dump() | pulley for cable in ROBOT.cables]}
    )
    rest = AtRest(scenario_of(WALL_WITH_A_HOLE, robot), 1.0)
    poses = np.array([[-0.4, 0, 1, 0, 0, 0], [*robot.home_anchors[0] - [0, 0, 1], 0, 0, 0]])
    kept = rest(poses, np.zeros((2, len(robot.carriers), 6)))
    assert kept.slack[0] > 0 > kept.slack[1]
    for place in (poses[1], [*robot.home_anchors[0] - [0.05, 0, 0.01], 0, 0, 0]):
        with pytest.raises(InputError, match=r"off the axis and outside the sheave .* cable 1 is not"):
            tensions(robot, place)
