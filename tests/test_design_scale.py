"""Designs of small robots as of large ones, and margins of poses out of reach."""

import numpy as np
import pytest

from towline import Dynamics, InputError, Robot, TensionProblem, design, load, read_requirements
from towline.layout import judgement
from towline.layout.evaluation import Evaluation, rows_of
from towline.layout.goal import goal_of
from towline.layout.judgement import reasons
from towline.layout.linear_programs import maximise, merit
from towline.layout.room import room_of
from towline.layout.variables import variables_of
from towline.solvers import certify

SIZE, FORCE = 1 / 200, 1 / 40  # a frame of 4 cm, of cables with at most 5 N


def shrunk(robot, size=SIZE, force=FORCE):
    """The robot with other units of length and force; accelerations, and so gravity, are the same."""
    data = robot.model_dump()
    platform = data["platform"]
    platform["mass"] *= force
    platform["inertia"] = [value * force * size**2 for value in platform["inertia"]]
    platform["com"] = [value * size for value in platform["com"]]
    platform["home"] = [*np.multiply(robot.home[:3], size), *robot.home[3:]]
    for cable in data["cables"]:
        for end in ("anchor", "attachment"):
            cable[end] = [value * size for value in cable[end]]
        for limit in ("t_min", "t_max"):
            cable[limit] *= force
    return Robot.model_validate(data)


def requirements_of(size, force, clearance=0.1):
    box = {"min": np.multiply([-1.5, -1.2, 2.2], size).tolist(), "max": np.multiply([1.5, 1.2, 3.8], size).tolist()}
    anchors = {"min": np.multiply([-5, -5, 0], size).tolist(), "max": np.multiply([5, 5, 5], size).tolist()}
    return read_requirements(
        {
            "free": [{"part": "anchor", "box": anchors}],
            "require": [{"box": box, "grid": [3, 3, 2]}],
            "margin": 40 * force,
            "clearance": clearance * size,
        }
    )


def searched(robot, size, force):
    """Return the merits of a random layout and of that found from it by linear programs, in `force`, and the latter."""
    requirements = requirements_of(size, force)
    variables, room = variables_of(robot, requirements), room_of(robot, requirements).with_spare(0.01)
    rows = rows_of(robot, requirements.require, [requirements.require[0].places()])
    evaluation, goal = Evaluation(variables, rows, room), goal_of(variables, requirements)
    y = np.random.default_rng(3).uniform(variables.low, variables.high)
    before = merit(evaluation, goal, y)[0]
    maximise(evaluation, goal, y, np.inf, programs=4)
    return np.array([before, merit(evaluation, goal, y)[0]]) / force, y / size


def test_a_search_finds_the_same_layout_at_any_scale():
    robot = load("ipanema-2")
    large, layout = searched(robot, 1.0, 1.0)
    small, other = searched(shrunk(robot), SIZE, FORCE)
    assert large[1] > large[0] + 1.0
    np.testing.assert_allclose(small, large, rtol=1e-4)
    np.testing.assert_allclose(other, layout, atol=1e-3)


def test_a_random_layout_of_a_micro_robot_is_no_local_optimum():
    robot, force = shrunk(load("ipanema-2"), SIZE, 1e-7), 1e-7
    requirements = requirements_of(SIZE, force)
    variables = variables_of(robot, requirements)
    rows = rows_of(robot, requirements.require, [requirements.require[0].places()])
    y = np.random.default_rng(3).uniform(variables.low, variables.high)
    assert not reasons(Evaluation(variables, rows), goal_of(variables, requirements), y).local_optimum


def test_winches_that_may_be_weaker_are_no_local_optimum():
    """The margin is four times as large as wanted, so that a lower t_max of all cables still keeps it."""
    robot, require = load("ipanema-2"), [{"box": {"min": [-1, -1, 2], "max": [1, 1, 3]}, "grid": [3, 3, 2]}]
    free = [{"part": "t_max", "range": {"min": 20, "max": 3000}}]
    requirements = read_requirements({"free": free, "require": require, "minimise": "t_max", "margin": 10})
    variables = variables_of(robot, requirements)
    evaluation = Evaluation(variables, rows_of(robot, requirements.require, [requirements.require[0].places()]))
    y = variables.of_robot()
    assert evaluation.margins(0.9 * y).min() > requirements.margin
    assert not reasons(evaluation, goal_of(variables, requirements), y).local_optimum


def test_the_least_accepted_margin_is_that_of_a_weak_robot():
    robot = shrunk(load("ipanema-2"), SIZE, 1e-3)  # 10 g
    variables_of(robot, requirements_of(SIZE, 1e-4))  # 4 mN, of 98 mN
    with pytest.raises(InputError, match=r"margin must be at least 0.000981 N"):
        variables_of(robot, requirements_of(SIZE, 1e-5))
    free = [{"part": "t_max", "range": {"min": 0.1, "max": 1}}]
    found = design(robot, free=free, require=[{"poses": [list(robot.home)]}], time_limit=0.1)
    assert found.requirements.margin == pytest.approx(0.1 * robot.weight)


def test_the_margin_of_a_layout_out_of_reach_is_the_largest_distance(monkeypatch):
    """Facets only bound such distances: the one pose that is judged must be the worst by the certificates of all."""
    robot, rng = load("ipanema-2"), np.random.default_rng(7)
    poses = robot.home + rng.uniform(-1, 1, (160, 6)) * [4, 3.5, 3, 0.3, 0.3, 0]
    free = [{"part": "t_max", "range": {"min": 50, "max": 60}}]
    (one,) = read_requirements({"free": free, "require": [{"poses": poses.tolist()}]}).require
    rows = rows_of(robot, (one,), [one.places()])
    scale = robot.wrench_scale
    problems = (
        TensionProblem(A * scale[:, None], w * scale, robot.t_min, robot.t_max)
        for A, w in zip(Dynamics(robot).wrench_matrix(rows.poses), rows.wrenches, strict=True)
    )
    monkeypatch.setattr(judgement, "_JUDGED", 1)
    proofs = [proof for proof in map(certify, problems) if proof is not None]
    assert len(proofs) > 100
    largest = max(proof.shortfall for proof in proofs)
    assert judgement.judged_margin(robot, robot.length, rows) == pytest.approx(-largest, rel=1e-6)
