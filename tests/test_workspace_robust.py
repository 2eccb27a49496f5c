"""Workspaces for the robots of an uncertainty: accepted poses hold for drawn robots, conditions take the share."""

import json

import numpy as np
import pytest

from towline import Dynamics, load, sample
from towline.base.errors import InputError
from towline.statics.robust import ellipsoid_factor, share_of_robots
from towline.workspace import (
    Dynamic,
    ExistsPlacement,
    ForceBalance,
    Lengths,
    Places,
    StaticEquilibrium,
    WrenchClosure,
    WrenchFeasible,
    condition_from,
)

from .test_robust import known
from .warm import towline


def poses_of(result, robot, most=400):
    positions = result["position"].values[:most]
    return np.hstack([positions, np.tile(robot.home[3:], (len(positions), 1))])


def rest(robot, poses):
    return Dynamics(robot).required_wrench(poses, np.zeros(6), np.zeros(6))


@pytest.mark.parametrize(("name", "sigma", "limits"), [("cogiro", 0.02, {"t_max": 500.0}), ("wang-flying", 0.005, {})])
def test_accepted_poses_hold_for_drawn_robots(name, sigma, limits):
    robot = known(name, sigma, **limits)
    exact = sample(robot, StaticEquilibrium(), samples=12_000)
    robust = sample(robot, StaticEquilibrium(), samples=12_000, robust=0.95)
    assert 0.3 < robust.attrs["accepted"] / exact.attrs["accepted"] < 0.8
    assert json.loads(robust.attrs["condition"])["robust"] == 0.95
    shares = []
    for result in (exact, robust):
        poses = poses_of(result, robot)
        shares.append(share_of_robots(robot, poses, rest(robot, poses), count=100).share)
    assert shares[0] < 0.2  # some pose is so near to the boundary that the robot at hand decides
    assert shares[1] >= 0.95
    # A robot with as many cables as needed has one solution: robust means that it is that far inside its limits.
    if robot.m == 6:
        places = Places.at_home(robot, poses_of(exact, robot))
        expected = inside_by_the_reach(robot, places)
        assert (StaticEquilibrium(robust=0.95).holds(robot, places) == expected).all()
        assert 0.3 < expected.mean() < 0.8


def inside_by_the_reach(robot, places):
    """Compute it pose by pose from differences of wrench matrices, without the module's derivatives."""
    names, factor = robot.uncertainty.parameters, ellipsoid_factor(robot.uncertainty, 0.95)
    A = Dynamics(robot).wrench_matrix(places.pose, places.carriers)
    w = rest(robot, places.pose)
    tensions = np.linalg.solve(A, w[..., None])[..., 0]
    variance = np.zeros_like(tensions)
    for name, value, sigma in zip(names, robot.parameter_values(names), robot.uncertainty.sigmas, strict=True):
        moved = Dynamics(robot.with_parameters({name: value + 1e-6})).wrench_matrix(places.pose, places.carriers)
        variance += (sigma * (np.linalg.solve(moved, w[..., None])[..., 0] - tensions) / 1e-6) ** 2
    reach = factor * np.sqrt(variance)
    return ((tensions - reach >= robot.t_min) & (tensions + reach <= robot.t_max)).all(axis=1)


def test_every_condition_about_tension_limits_takes_it():
    robot = known("cogiro", 0.01, t_max=400.0)
    push = ((-50, -50, -50, 0, 0, 0), (50, 50, 50, 0, 0, 0))
    poses = np.tile(robot.home, (600, 1))
    poses[:, :3] += np.random.default_rng(1).uniform(-1, 1, (600, 3)) * [4, 3, 1.5]
    places = Places.at_home(robot, poses)
    for condition in (
        StaticEquilibrium(),
        WrenchFeasible(box=push),
        Dynamic(accelerations=[[1, 0, 0, 0, 0, 0], [-1, 0, 0, 0, 0, 0]]),
        ForceBalance(),
        ExistsPlacement(condition=StaticEquilibrium(), turn=0.05, tries=4),
    ):
        changed = condition.for_robots(0.95)
        assert condition_from(json.loads(changed.model_dump_json())) == changed
        exact, robust = condition.holds(robot, places), changed.holds(robot, places)
        assert not (robust & ~exact).any()
        assert 0 < robust.sum() < exact.sum(), condition.kind
        if not isinstance(condition, Dynamic):
            np.testing.assert_array_equal(changed.shortfall(robot, places) == 0, robust)
    both = (StaticEquilibrium() & Lengths(max=9)) | WrenchClosure()
    text = both.for_robots(0.9).model_dump_json()
    assert text.count('"robust":0.9') == 1
    assert condition_from(json.loads(text)) == both.for_robots(0.9)


def test_wrench_feasible_for_robots_is_so_for_each_of_its_wrenches():
    """Draw wrenches inside a convex set whose corners decide: they hold for each drawn robot."""
    robot = known("cogiro", 0.01, t_max=600.0)
    low, high = np.array([-40, -40, -40, 0, 0, 0]), np.array([40, 40, 40, 0, 0, 0])
    condition = WrenchFeasible(box=(tuple(low), tuple(high)), robust=0.95)
    poses = np.tile(robot.home, (500, 1))
    poses[:, :3] += np.random.default_rng(1).uniform(-1, 1, (500, 3)) * [3, 3, 1]
    held = poses[condition.holds(robot, Places.at_home(robot, poses))]
    assert 20 < len(held) < 400
    wrenches = rest(robot, held) - np.random.default_rng(2).uniform(low, high, (len(held), 6))
    assert share_of_robots(robot, held, wrenches, count=100).share >= 0.95


def test_wrong_shares_and_robots_are_one_line(tmp_path):
    robot = known("cogiro", 0.01)
    for share in (0, 1, 95, "much", True, float("nan")):
        with pytest.raises(InputError, match="robust must be a number from 1e-09 to 1"):
            sample(robot, StaticEquilibrium(), samples=20, robust=share)
    with pytest.raises(InputError, match=r"robust must be left out if the robot's file has no uncertainty"):
        sample(load("cogiro"), StaticEquilibrium(), samples=20, robust=0.95)
    with pytest.raises(InputError, match=r"robust must be None for a condition without tension limits, got 0\.95"):
        sample(robot, Lengths(max=9) & WrenchClosure(), samples=20, robust=0.95)
    with pytest.raises(InputError, match=r"robust must be left out for 3 cables and 6 wrench rows"):
        sample(known("wang-ctmrts", 0.01), StaticEquilibrium(), samples=20, robust=0.95)
    with pytest.raises(InputError, match=r"robust must be less than 1, got 2"):
        StaticEquilibrium(robust=2)
    robot.save(tmp_path / "mine.yaml")
    done = towline("workspace", "mine.yaml", "--robust", "0.95", "--samples", "2000", "--json", cwd=tmp_path)
    printed = json.loads(done.stdout)
    assert json.loads(printed["condition"]) == {"kind": "static-equilibrium", "robust": 0.95}
    assert 0 < printed["accepted"] < 2000
