"""Designs with the lowest cost, and with the largest boxes of positions."""

from itertools import product

import numpy as np
import pytest
import yaml

from towline import Dynamics, InputError, Robot, TensionProblem, design, load, read_requirements
from towline.cli.new import TEMPLATES
from towline.layout import growth, search
from towline.layout.evaluation import Evaluation, rows_of
from towline.layout.goal import goal_of
from towline.layout.linear_programs import maximise
from towline.layout.variables import variables_of
from towline.solvers import capacity_margin

ROBOT = load("ipanema-2")
BOX = {"min": [-1.0, -0.8, 2.0], "max": [1.0, 0.8, 3.0]}
POINTS = [
    {"part": part, "box": {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}}
    for part, points in (("anchor", ROBOT.anchors), ("attachment", ROBOT.attachments))
]
CHEAP = {"minimise": "cost", "prices": {"cable": 10.0, "t_max": 0.5}, "margin": 10.0, "time_limit": 1.0}
REQUIRE = [{"box": BOX, "grid": [3, 3, 3]}]


# For anchors and attachments: in the frame, and as far as the platform extends.
LOW, HIGH = ([-4, -3, 1], [-0.75, -0.125, 0.25]), ([4, 3, 5], [0.75, 0.125, 0.75])


@pytest.fixture(scope="module", autouse=True)
def _few_audited():
    """The worst of 3000 random poses is nearly that of 100 000, which take far longer."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "AUDITED", 3_000)
        yield


def corners(size=1.0):
    """Corners of the box, larger by a factor about its centre, as poses (8, 6)."""
    low, high = np.array(BOX["min"]), np.array(BOX["max"])
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    poses = np.zeros((8, 6))
    poses[:, :3] = (low + high) / 2 + size * signs * (high - low) / 2
    return poses


def least_margin(robot, poses, length=ROBOT.length):
    scale = np.repeat([1.0, 1.0 / length], 3)
    w = scale * Dynamics(robot).required_wrench(poses[0], np.zeros(6), np.zeros(6))
    matrices = scale[:, None] * Dynamics(robot).wrench_matrix(poses)
    return min(capacity_margin(TensionProblem(A, w, robot.t_min, robot.t_max)).value for A in matrices)


def cost(robot):
    """The longest length of a cable in a box is at a corner, because a norm is convex."""
    lengths = np.linalg.norm(corners()[:, None, :3] + robot.attachments - robot.anchors, axis=2)
    return 10.0 * lengths.max(axis=0).sum() + 0.5 * robot.t_max.sum()


def test_a_cheap_robot_costs_what_its_cables_and_winches_do():
    winches = {"part": "t_max", "range": {"min": 20, "max": 5000}}
    found = design(ROBOT, requirements={"free": [*POINTS, winches], "require": REQUIRE, **CHEAP})
    assert found.feasible
    assert found.cost == pytest.approx(cost(found.robot), rel=1e-12)
    assert found.cost_before == pytest.approx(cost(ROBOT), rel=1e-12)
    assert found.cost < 0.8 * found.cost_before
    assert least_margin(found.robot, corners()) >= 10.0
    assert f"cost {found.cost:.4g}" in found.report().splitlines()[0]
    assert "cost -" in found.report()


def test_no_layout_nearby_is_cheaper():
    """From the robot's own layout linear programs end where none of 3000 neighbours keeps the margin for less."""
    data = {"free": POINTS, "require": REQUIRE, **CHEAP, "prices": {"cable": 1.0}}
    requirements = read_requirements(data)
    variables = variables_of(ROBOT, requirements)
    evaluation = Evaluation(variables, rows_of(ROBOT, requirements.require, [requirements.require[0].places()]))
    goal, y, rng = goal_of(variables, requirements), variables.of_robot(), np.random.default_rng(0)
    first = evaluation.outcome(y, goal)
    maximise(evaluation, goal, y, np.inf)
    last = evaluation.outcome(y, goal)
    assert last.cable < 0.9 * first.cable
    assert last.margin >= 10.0
    for size in (1e-4, 1e-2):
        for _ in range(1500):
            z = np.clip(y + size * rng.standard_normal(y.size), variables.low, variables.high)
            near = evaluation.outcome(z, goal)
            assert near.margin < last.margin or near.cable > 0.999 * last.cable


def test_a_layout_is_never_worse_than_the_robots_own():
    """A grid of one pose says nothing of the rest of the box: linear programs spoil the margin there.

    The robot's own margin is least between two corners of the box, so corners alone would not compare the worst.
    """
    wide = {"min": [-2.5, -1.5, 1.5], "max": [2.5, 1.5, 4.0]}
    free = [{**each, "box": {"min": low, "max": high}} for each, low, high in zip(POINTS, LOW, HIGH, strict=True)]
    found = design(ROBOT, free, [{"box": wide, "grid": [1, 1, 1]}], time_limit=0.3)
    poses = np.zeros((27, 6))
    poses[:, :3] = list(product(*np.linspace(wide["min"], wide["max"], 3).T))
    assert least_margin(found.robot, poses) >= least_margin(ROBOT, poses) - 1e-6


def test_more_freedom_needs_no_stronger_winches(monkeypatch):
    """The margin that moved anchors lose in audits is restored, so free anchors need no stronger winches."""
    monkeypatch.setattr(search, "_SEARCHING", 0.0)  # from the robot's own layout alone
    text = (TEMPLATES / "frame.yaml").read_text().replace("$name", "crane")
    robot = Robot.model_validate(yaml.safe_load(text))
    anchors = {"min": robot.anchors.min(axis=0).tolist(), "max": robot.anchors.max(axis=0).tolist()}
    winches = {"part": "t_max", "range": {"min": 50, "max": 5000}}
    box = {"min": [-1.2, -0.9, 0.3], "max": [1.2, 0.9, 1.5]}
    needed = []
    for free in ([winches], [winches, {"part": "anchor", "box": anchors}]):
        data = {"free": free, "require": [{"box": box, "grid": [3, 3, 2]}], "minimise": "t_max", "margin": 10.0}
        requirements = read_requirements({**data, "time_limit": 60.0})
        variables = variables_of(robot, requirements)
        found = variables.robot_at(search.search(variables, requirements, lambda what, share, margin: None).y)
        places = requirements.require[0].places((2, 2, 2))
        assert least_margin(found, places, robot.length) >= 10.0
        needed.append(found.t_max.mean())
    assert needed[1] < 0.9 * needed[0] < 0.9 * robot.t_max.mean()


def test_slopes_of_the_longest_cables_are_those_of_differences():
    requirements = read_requirements({"free": POINTS, "require": REQUIRE, **CHEAP, "prices": {"cable": 1.0}})
    variables = variables_of(ROBOT, requirements)
    evaluation = Evaluation(variables, rows_of(ROBOT, requirements.require, [requirements.require[0].places()]))
    y = np.random.default_rng(1).uniform(variables.low, variables.high)
    slopes, cables = evaluation.longest_slopes(y)
    longest = slopes.value.reshape(-1, ROBOT.m)[0]
    by_variables = slopes.by_variables.reshape(-1, ROBOT.m, y.size)[0]
    assert cables[: ROBOT.m].tolist() == list(range(ROBOT.m))
    for k in range(y.size):
        step = 1e-6 * np.eye(y.size)[k]
        change = evaluation.lengths(y + step).max(axis=0) - evaluation.lengths(y - step).max(axis=0)
        assert np.allclose(by_variables[:, k], change / 2e-6, atol=1e-8)
    assert np.allclose(longest, evaluation.lengths(y).max(axis=0), atol=0)


def test_the_size_of_the_boxes_of_a_given_layout_is_that_of_a_bisection():
    """With every point at its place, by the margins on the faces of the boxes."""
    fixed = [{"part": "anchor", "cables": [1], "box": {"min": list(ROBOT.anchors[0]), "max": list(ROBOT.anchors[0])}}]
    options = {"maximise": "volume", "margin": 5.0, "time_limit": 0.6}
    found = design(ROBOT, fixed, [{"box": BOX, "grid": [3, 3, 3]}], **options)
    shares = np.array([p for p in product(np.linspace(-1, 1, 5), repeat=3) if max(map(abs, p)) == 1.0])
    centre, half = corners()[:, :3].mean(axis=0), np.ptp(corners()[:, :3], axis=0) / 2
    low, high = 1.0, 3.0
    while high - low > 5e-3:
        middle = (low + high) / 2
        poses = np.hstack([centre + middle * shares * half, np.zeros_like(shares)])
        low, high = (middle, high) if least_margin(ROBOT, poses) >= 5.0 else (low, middle)
    assert found.feasible
    assert 0.98 * high <= found.size <= 1.005 * high
    assert 0.98 * high <= found.size_before <= 1.005 * high


def test_a_layout_for_the_largest_boxes_keeps_the_margin_in_them():
    options = {"maximise": "volume", "margin": 10.0, "time_limit": 1.2}
    found = design(ROBOT, POINTS, REQUIRE, **options)
    assert found.feasible
    assert found.size > 1.1 * found.size_before
    box = found.requirements.require[0].box
    assert np.allclose(box.max, corners(found.size)[-1, :3], atol=1e-12)
    rng, poses = np.random.default_rng(7), np.zeros((300, 6))
    poses[:, :3] = rng.uniform(box.min, box.max, (300, 3))
    assert least_margin(found.robot, np.concatenate([corners(found.size), poses])) >= 10.0
    report = found.report()
    assert f"boxes {found.size:.2f} times as long, wide and high as required" in report
    assert found.to_dict()["size"] == found.size


@pytest.mark.parametrize("call", [0, 3])
def test_an_interrupted_search_for_the_largest_boxes_keeps_the_best(call):
    """Wherever it is: in the first search, which is for boxes that the layout may not hold, or in a later one."""
    calls = []

    def progress(what, share, margin):
        calls.append(what)
        if len(calls) == call + 1:
            raise KeyboardInterrupt

    options = {"maximise": "volume", "margin": 10.0, "time_limit": 5.0}  # enough for all calls on a busy processor
    found = design(ROBOT, POINTS, REQUIRE, progress=progress, **options)
    assert found.stopped
    assert found.feasible
    assert found.size >= 1.0
    assert len(calls) <= call + 8  # no search begins again


def test_an_interrupt_between_two_searches_keeps_the_best(monkeypatch):
    sizes = []

    def largest(holds, least):
        sizes.append(least)
        if len(sizes) == 2:
            raise KeyboardInterrupt
        return its(holds, least)

    its = growth._largest
    monkeypatch.setattr(growth, "_largest", largest)
    monkeypatch.setattr(growth, "_ROUNDS", 200)  # of which the first is short, however busy the processor is
    found = design(ROBOT, POINTS, REQUIRE, maximise="volume", margin=10.0, time_limit=60.0)
    assert found.stopped
    assert found.feasible


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"minimise": "cost"}, "prices must be given for minimise: cost"),
        ({"prices": {"cable": 1}}, "prices must be left out without minimise: cost"),
        ({"minimise": "cost", "prices": {"t_max": 1}}, "one above 0 of something that is free"),
        ({"minimise": "cost", "prices": {"cable": -1}}, "cable"),
        ({"minimise": "cost", "prices": {"cable": float("nan")}}, "cable"),
        ({"maximise": "volume", "minimise": "cost", "prices": {"cable": 1}}, "maximise must be left out with minimise"),
        ({"maximise": "volume", "require": [{"poses": [[0, 0, 2, 0, 0, 0]]}]}, "box with an extent"),
        ({"maximise": "volume", "free": [{"part": "attachment", "pairing": True}]}, "margin with a pairing"),
        (
            {"minimise": "cost", "prices": {"cable": 1}, "free": [{"part": "attachment", "pairing": True}]},
            "minimise must be left out with a pairing",
        ),
    ],
)
def test_objectives_that_lack_something_are_refused_in_one_line(change, names):
    with pytest.raises(InputError, match=names) as error:
        design(ROBOT, requirements={"free": POINTS, "require": REQUIRE, **change})
    assert len(str(error.value).splitlines()) == 1
