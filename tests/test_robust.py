"""Margins for the robots of an uncertainty: derivatives, spread, factors, plans, and robots drawn to check these."""

import json
import re
from functools import cache

import numpy as np
import pytest

from towline import Dynamics, Planner, Robot, load, plan, time_along
from towline.base.errors import InputError
from towline.models import Uncertainty
from towline.models.mechanics import derivatives
from towline.ocp.search.uncertain_robots import too_uncertain
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task
from towline.statics.robust import _inverse, ellipsoid_factor, motion_factor, share_of_robots, spread

from .warm import towline

RNG = np.random.default_rng(5)


def known(name, sigma, **limits):
    """Return a robot whose anchors and attachments are known to `sigma` [m], each coordinate on its own."""
    data = load(name).model_dump(mode="json")
    for cable in data["cables"]:
        cable.update(limits)
    names = [
        f"cables[{i}].{part}.{a}"
        for i in range(len(data["cables"]))
        for part in ("anchor", "attachment")
        for a in "xyz"
    ]
    block = {"parameters": names, "covariance": np.diag([sigma**2] * len(names)).tolist()}
    return Robot.model_validate(data | {"uncertainty": block})


def places(robot, n=4):
    pose = robot.home + RNG.normal(size=(n, 6)) * 0.1
    return pose, robot.carrier_home + RNG.normal(size=(n, len(robot.carriers), 6)) * 0.1


@pytest.mark.parametrize("name", ["caroca-pulleys", "wang-flying", "planar-4"])
def test_derivatives_are_those_of_the_dynamics(name):
    """Against differences of the wrench matrix, with tilted platforms, carriers and, where it has some, pulleys."""
    robot = load(name)
    pose, carriers = places(robot)
    names = [f"cables[1].{part}.{axis}" for part in ("anchor", "attachment") for axis in "xyz"]
    names += ["cables[1].pulley.radius"] * (robot.cables[1].pulley is not None)
    found, cables = derivatives(robot, pose, carriers, names)
    assert (cables == 1).all()
    for column, name_ in enumerate(names):
        (value,) = robot.parameter_values([name_])
        ends = [
            Dynamics(robot.with_parameters({name_: value + h})).wrench_matrix(pose, carriers) for h in (1e-5, -1e-5)
        ]
        difference = (ends[0] - ends[1]) / 2e-5
        np.testing.assert_allclose(found[:, :, column], difference[:, :, 1], atol=1e-8)
        assert not np.delete(difference, 1, axis=2).any()


def test_spread_is_that_of_drawn_robots():
    """The squared changes of tensions due to independent errors add up to those of drawn robots."""
    robot = known("cogiro", 1e-3)
    pose = robot.home[None] + [0.5, 0.3, 0.2, 0.05, 0, 0.1]
    tensions = np.full((1, 8), 400.0) + 30 * np.arange(8)
    at_home = robot.carrier_home[None]
    w = Dynamics(robot).wrench_matrix(pose, at_home)[0] @ tensions[0]
    names = robot.uncertainty.parameters
    squares = np.zeros(8)
    for name, value in zip(names, robot.parameter_values(names), strict=True):
        ends = [
            Dynamics(robot.with_parameters({name: value + h})).wrench_matrix(pose, at_home)[0] for h in (1e-5, -1e-5)
        ]
        more, less = (np.linalg.lstsq(A, w - A @ tensions[0], rcond=None)[0] for A in ends)
        squares += ((more - less) / 2e-5 * 1e-3) ** 2
    np.testing.assert_allclose(np.sqrt(squares), spread(robot, pose, tensions)[0], rtol=1e-6)


def test_an_anchor_that_errs_along_its_cable_changes_nothing():
    robot = load("nist-robocrane")
    pose = robot.home[None]
    along = Dynamics(robot).wrench_matrix(robot.home)[:3, 0]
    names = [f"cables[0].anchor.{axis}" for axis in "xyz"]
    block = Uncertainty(parameters=names, covariance=(1e-4 * np.outer(along, along)).tolist())
    sigmas = spread(robot.model_copy(update={"uncertainty": block}), pose, np.full((1, 6), 100.0))
    assert sigmas.max() < 1e-9
    across = np.cross(along, [1.0, 0, 0])
    block = Uncertainty(parameters=names, covariance=(1e-4 * np.outer(across, across)).tolist())
    assert spread(robot.model_copy(update={"uncertainty": block}), pose, np.full((1, 6), 100.0)).max() > 0.01


def test_factors_of_known_cases():
    """One cable at rest: a normal variable; two alike: the same; a turn in the plane: the length of a vector of two."""
    still = np.tile([[[2.0, 0, 0]]], (50, 1, 1))
    assert motion_factor(still, 0.95) == pytest.approx(1.959964, abs=1e-6)
    both = np.tile(np.diag([3.0, 1.0])[None], (50, 1, 1))  # two cables, on their own
    assert motion_factor(both, 0.95) == pytest.approx(2.241403, abs=1e-6)  # of 97.5 %, both sides
    angles = np.linspace(0, np.pi, 200)
    turn = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]
    assert motion_factor(turn, 0.95) == pytest.approx(np.sqrt(-2 * np.log(0.05)), abs=1e-9)
    assert motion_factor(np.zeros((50, 2, 3)), 0.95) == 0.0
    names = [f"cables[0].anchor.{axis}" for axis in "xy"]
    plane = Uncertainty(parameters=names, covariance=[[1, 0.5], [0.5, 1]])
    assert ellipsoid_factor(plane, 0.95) == pytest.approx(np.sqrt(-2 * np.log(0.05)), abs=1e-9)


def test_the_factor_of_a_motion_holds_for_its_share():
    """Along smooth random curves of eight cables in 48 directions: never less than the share, and not much more."""
    times = np.linspace(0, 1, 400)[:, None, None]
    changes = sum(
        RNG.normal(size=(8, 48)) * np.cos(2 * np.pi * k * times + RNG.uniform(0, 6, (8, 48))) / 2**k for k in range(3)
    )
    units = (changes / np.linalg.norm(changes, axis=2, keepdims=True)).reshape(-1, 48)
    largest = np.concatenate([np.abs(units @ RNG.normal(size=(48, 1000))).max(axis=0) for _ in range(4)])
    for share in (0.8, 0.95):
        kept = (largest <= motion_factor(changes, share)).mean()
        assert share - 3 * np.sqrt(share * (1 - share) / largest.size) < kept < share + 0.6 * (1 - share)


NEAR_LIMIT = {
    "name": "high",
    "path": {"kind": "line", "start": [-1, 0.5, 2.65, 0, 0, 0], "end": [1, 0.5, 2.65, 0, 0, 0]},
    "duration": 3,
    "steps": 12,
    "tube": {"position": 0.5, "ends": "free"},
}


@cache
def high(sigma):
    """Plan cogiro as high as its cables can hold it with 500 N, for one robot and for 95 % of the robots."""
    robot = known("cogiro", sigma, t_max=500.0)
    return plan(robot, NEAR_LIMIT), plan(robot, NEAR_LIMIT, robust=0.95)


@pytest.mark.parametrize("sigma", [0.005, 0.02])
def test_a_plan_near_a_limit_holds_for_the_share_and_only_with_robust(sigma):
    exact, robust = high(sigma)
    assert exact.feasible
    assert exact.robust is None
    assert exact.share_of_robots(seed=7).share < 0.7
    assert robust.feasible, robust.reason
    assert robust.share_of_robots(count=400, seed=7).share >= 0.95
    margin = robust.robust
    assert margin.holds
    low = robust.scenario.robot.t_min + margin.reach
    assert (robust.audit.tensions >= low).all()
    assert (robust.audit.tensions <= robust.scenario.robot.t_max - margin.reach).all()
    assert robust.tension_max < exact.tension_max
    assert robust.scenario.robot == exact.scenario.robot


def test_larger_errors_take_larger_margins():
    """To first order the reach is proportional to the errors, for about the same tensions."""
    small, large = (high(sigma)[1].robust for sigma in (0.005, 0.02))
    assert large.reach.max() / small.reach.max() == pytest.approx(4, rel=0.1)
    assert small.factor == pytest.approx(large.factor, rel=0.1)
    assert 2.5 < small.factor < ellipsoid_factor(high(0.005)[0].scenario.robot.uncertainty, 0.95) / 2


HOVER = {
    "name": "aside",
    "path": {"kind": "line", "start": [0, 0, -1, 0, 0, 0], "end": [0.13, 0.13, -0.87, 0, 0, 0]},
    "duration": 6,
}


def test_no_plan_is_an_answer(tmp_path):
    """Six cables have one solution: where the robots' tensions leave the limits, only another motion would do."""
    robot = known("wang-flying", 0.01)
    assert plan(robot, HOVER).feasible
    found = plan(robot, HOVER | {"robust": 0.95})
    assert found.status.value == "infeasible"
    (excess,) = found.audit.excess
    assert excess.limit == "tension"
    row = np.abs(found.audit.times - excess.time).argmin()
    sigmas = spread(robot, found.audit.motion.pose[[row]], found.audit.tensions[[row]])[0]
    missed = found.audit.tensions[row] - 1.6448536 * sigmas - robot.t_min  # the quantile 95 % of a single limit
    assert excess.value - excess.bound == pytest.approx(missed.min(), rel=1e-3)
    assert found.share_of_robots(seed=7).share < 0.9
    report = found.report()
    assert re.search(r"95 % of the robots +to first order, tensions do not always stay inside", report)
    assert found.to_dict()["robust"]["worst_violation"] > 0.1
    saved = found.save(tmp_path / "plan.nc")
    assert saved.exists()
    turned = plan(
        robot.model_copy(update={"uncertainty": known("wang-flying", 0.003).uncertainty}),
        HOVER | {"robust": 0.95, "tube": {"attitude": 0.3}, "steps": 24},
    )
    assert turned.feasible
    assert turned.share_of_robots(seed=7).share >= 0.95


def test_robots_without_tensions_for_the_share_are_proven():
    """Tensions of four cables in a plane lie on a line: none on it is far enough from all limits, or one is."""
    robot, share = known("planar-4", 0.01), 0.95
    pose, rows = robot.home + np.array([0.2, 0, 0.1, 0, 0, 0]), np.flatnonzero(robot.dof_mask)
    A = Dynamics(robot).wrench_matrix(pose, robot.carrier_home)[rows]
    w = Dynamics(robot).required_wrench(pose, np.zeros(6), np.zeros(6))[rows]
    line = np.linspace(-1, 1, 20_001)[:, None] * 2 * robot.t_max.max()
    tensions = np.linalg.pinv(A) @ w + line * np.linalg.svd(A)[2][-1]
    from_limits = np.minimum(tensions - robot.t_min, robot.t_max - tensions).min(axis=1)
    tensions = tensions[from_limits >= 0]
    sigmas = spread(robot, np.tile(pose, (len(tensions), 1)), tensions)
    # The largest errors, in units of 0.01 m, at which some tensions are 1.645 standard deviations from all limits.
    each = np.minimum(tensions - robot.t_min, robot.t_max - tensions) / (1.6448536 * sigmas)
    most = each.min(axis=1).max()
    task = read_task({"path": {"kind": "rest", "pose": pose.tolist()}, "duration": 0.5})
    for part in (0.99, 1.01):
        proven = too_uncertain(lay_out(known("planar-4", 0.01 * part * most), task), share)
        assert bool(proven) == (part > 1)


def test_what_is_offered_to_robots_suffices_for_the_share():
    """Offered are what the line, the share or the errors must be; robots drawn apart from it agree."""
    robot = known("wang-flying", 0.0012)
    found = plan(robot, HOVER | {"duration": 1.0, "robust": 0.95})
    assert found.status.value == "not-found"
    offers = {offer.name: offer for offer in found.relaxations}
    assert offers.keys() == {"length of the line", "robust", "uncertainty"}
    for name, offer in offers.items():
        its = offer.plan
        assert its.feasible
        share = offer.possible if name == "robust" else 0.95
        assert its.scenario.task.robust == its.robust.share == share
        assert its.share_of_robots(count=60, seed=7).share >= share
        assert (its.scenario.robot == robot) == (name != "uncertainty")
    assert plan(robot, offers["robust"].plan.scenario.task).feasible
    less = offers["uncertainty"].plan.scenario.robot.uncertainty
    assert less.matrix == pytest.approx(offers["uncertainty"].possible ** 2 * robot.uncertainty.matrix)


def test_a_plan_that_is_infeasible_for_the_file_too_has_offers_for_robots():
    robot = known("cogiro", 0.02, t_max=500.0)
    line = {"kind": "line", "start": [-3, 0.5, 1.5, 0, 0, 0], "end": [3, 0.5, 1.5, 0, 0, 0]}
    (offer,) = plan(robot, {"path": line, "duration": 2.2, "robust": 0.95}).relaxations
    assert offer.name == "duration"
    assert offer.plan.feasible
    assert offer.plan.scenario.robot == robot
    assert offer.plan.share_of_robots(count=40, seed=7).share >= 0.95


@pytest.mark.parametrize("sigma", [0.02, 0.1])
def test_a_path_below_the_floor_has_a_shift_that_suffices_for_the_robots(sigma):
    """With errors of 0.1 m a path just above the floor is too far down for tightened limits."""
    robot = known("cogiro", sigma).model_copy(update={"floor": 1.0})
    line = {"kind": "line", "start": [-3, 0.5, 1.5, 0, 0, 0], "end": [3, 0.5, 0.95, 0, 0, 0]}
    (offer,) = plan(robot, {"path": line, "duration": 5, "robust": 0.95}).relaxations
    assert offer.name == "shift of the path"
    assert (offer.possible > 0.051) == (sigma > 0.05)
    assert plan(robot, offer.plan.scenario.task).feasible


LEGS = [[-2, 0.5, 1.5, 0, 0, 0], [2, 0.5, 1.5, 0, 0, 0]]
DWELLS = {"path": {"kind": "waypoints", "points": LEGS, "dwell": 0.1}}
PHASES = {
    "phases": [
        {"name": "over", "path": {"kind": "line", "start": LEGS[0], "end": LEGS[1]}, "duration": {"min": 0.5, "max": 4}}
    ]
}


@pytest.mark.parametrize("task", [DWELLS | {"duration": {"min": 0.5, "max": 4}, "objective": {"time": 1}}, PHASES])
def test_the_shortest_duration_is_that_of_the_share(task):
    """The shortest motion of the exact robot reaches the limits, so that others need a longer one."""
    robot = known("cogiro", 0.02, t_max=500.0)
    exact, found = plan(robot, task), plan(robot, task, robust=0.95)
    assert exact.feasible
    assert found.feasible, found.reason
    assert exact.duration < found.duration < 4
    assert found.share_of_robots(count=40, seed=7).share >= 0.95


def test_robots_whose_errors_are_too_large_for_a_fast_motion_take_longer():
    """Tightened by the spread of the exact robot's fastest motion, the limits leave no motion."""
    line = {"kind": "line", "start": LEGS[0], "end": LEGS[1]}
    task = {"path": line, "duration": {"min": 0.5, "max": 12}, "objective": {"time": 1}, "steps": 30}
    found = plan(known("cogiro", 0.08, t_max=500.0), task | {"tube": {"position": 0.1}}, robust=0.95)
    assert found.feasible, found.reason
    assert found.share_of_robots(count=40, seed=7).share >= 0.95


def test_robots_that_weigh_little_keep_their_limits_too():
    """The same robot with a millionth of all forces has the same answer."""
    data = known("wang-flying", 0.01).model_dump()
    for body in [data["platform"], *data["carriers"]]:
        for name in {"mass", "inertia"} & body.keys():
            body[name] = np.multiply(body[name], 1e-6).tolist()
    for cable in data["cables"]:
        for name in ("t_min", "t_max", "stiffness", "damping"):
            cable[name] = 1e-6 * cable[name] if cable[name] is not None else None
    robot = Robot.model_validate(data)
    assert plan(robot, HOVER).feasible
    assert plan(robot, HOVER | {"robust": 0.95}).status.value == "infeasible"


def test_a_pose_that_only_the_exact_robot_can_hold_is_no_plan_for_others():
    """Six cables of equal geometry span five directions at home: other robots need a wrench there, however small."""
    robot = known("wang-ctmrts-6", 0.005)
    rest = {"path": {"kind": "rest", "pose": robot.home.tolist()}, "duration": 0.5}
    exact = plan(robot, rest)
    assert exact.feasible
    assert exact.share_of_robots(count=50).share < 0.5
    found = plan(robot, rest, robust=0.95)
    assert found.status.value == "infeasible"
    assert "since the cables hardly resist some direction" in str(found.audit.excess[0])


def test_the_command_plans_for_robots(tmp_path):
    known("cogiro", 0.01).save(tmp_path / "mine.yaml")
    task = {"path": {"kind": "rest", "pose": [0, 0, 2, 0, 0, 0]}, "duration": 0.5}
    (tmp_path / "rest.yaml").write_text(json.dumps(task))
    done = towline("plan", "mine.yaml", "rest.yaml", "--robust", "0.9", "--json", cwd=tmp_path)
    printed = json.loads(done.stdout)
    assert printed["feasible"]
    assert printed["robust"]["share"] == 0.9
    assert len(printed["robust"]["reach"]) == 8
    done = towline("plan", "cogiro", "rest.yaml", "--robust", "0.9", cwd=tmp_path, code=2)
    assert "robust must be left out, because the file of robot 'cogiro' has no uncertainty" in done.stderr


def test_what_robust_does_not_go_with():
    rest = {"path": {"kind": "rest", "pose": [0, 0, -1, 0, 0, 0]}, "duration": 0.5, "robust": 0.95}
    robot = known("wang-flying", 0.01)
    box = {"min": [-1, 0, 0], "max": [1, 0, 0]}
    for name, task, message in (
        ("wang-flying", rest | {"wind": box}, "wind must be one velocity"),
        ("point-mass-3", rest | {"robust": 1.0}, r"robust must be less than 1, got 1\.0"),
        ("wang-ctmrts", rest, "robust must be left out for a robot with fewer cables than degrees of freedom"),
    ):
        with pytest.raises(InputError, match=message):
            plan(known(name, 0.01), task)
    for share in (1.5, 0, float("nan"), "0.95", True):
        with pytest.raises(InputError, match="robust must be a number from 1e-09 to 1"):
            plan(robot, HOVER, robust=share)
    with pytest.raises(InputError, match="robust must be left out to time a path"):
        time_along(robot, HOVER | {"robust": 0.95})
    planner = Planner(known("wang-flying", 1e-5), rest)
    assert planner.plan().feasible
    with pytest.raises(InputError, match="robust must be left out to replan"):
        planner.replan({}, 0.1)
    with pytest.raises(InputError, match="robust must be left out if the robot's file has no uncertainty"):
        spread(load("cogiro"), np.zeros((1, 6)), np.ones((1, 8)))
    with pytest.raises(InputError, match=r"wrench must be an array of shape \(1, 6\) of finite numbers"):
        share_of_robots(robot, robot.home[None], np.zeros(6))


def test_what_cables_do_not_span_takes_huge_tensions():
    """Other robots need wrenches there: an inverse that leaves them out would call everything certain."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(2, 3, 5))
    A[1, 2] = A[1, 0] + A[1, 1]
    regular, singular = _inverse(A)
    np.testing.assert_allclose(A[0] @ regular, np.eye(3), atol=1e-12)
    assert np.isfinite(singular).all()
    assert np.abs(singular @ [1, 1, -1]).max() > 1e8
    np.testing.assert_allclose(A[1] @ singular @ A[1], A[1], atol=1e-5)
