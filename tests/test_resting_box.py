"""The box of positions at which a platform can rest: the largest of a grid, inside what statics allow, and cheap."""

from itertools import product

import numpy as np
import pytest

from towline.models import Dynamics, Robot, load
from towline.models.diagnosis import diagnose
from towline.solvers import solve
from towline.statics.distribution import pose_problem
from towline.workspace.resting_box import largest_box, resting_box

from .framed import framed


def camera(home, t_max=1e4, **platform):
    """A point mass of 1 kg below the corners of a square of 2 m, 3 m above the floor."""
    ends = [((x, y, 3), (0, 0, 0)) for x, y in product((-1, 1), repeat=2)]
    return framed(ends, {"mass": 1, "dof": ["x", "y", "z"], "home": home, **platform}, t_max=t_max)


def test_a_point_mass_rests_anywhere_between_its_anchors():
    """Cables that never push hold it where it is below their square, and strong ones almost everywhere there."""
    box = resting_box(camera([0.2, 0.1, 1.5, 0, 0, 0]))
    assert (box.low[:2] >= -1).all()
    assert (box.high[:2] <= 1).all()
    assert box.low == pytest.approx([-1, -1, 0], abs=1e-9)
    assert box.high[:2] == pytest.approx([1, 1])
    assert 2.5 < box.high[2] < 3


def test_weak_cables_hold_it_only_low():
    """In the middle each of four cables carries a quarter of the weight: t sin(angle) = m g / 4 bounds the height."""
    most = 5.0
    box = resting_box(camera([0, 0, 1, 0, 0, 0], most))
    sine = 9.81 / 4 / most
    highest = 3 - np.sqrt(2) * sine / np.sqrt(1 - sine**2)
    assert 1 < box.high[2] <= highest + 1e-9


def test_where_home_is_too_high_the_box_is_about_the_nearest_sample():
    robot = camera([0, 0, 2.9, 0, 0, 0], 5)
    assert not solve(pose_problem(Dynamics(robot), robot.home)).feasible
    box = resting_box(robot)
    assert box.centre[:2] == pytest.approx([0, 0], abs=1e-12)
    assert box.low[2] <= box.centre[2] <= box.high[2] < 2.9


@pytest.mark.parametrize(
    ("body", "below", "beside"),
    [
        (None, 0.0, 0.0),  # a point
        ({"kind": "box", "min": [-0.1, -0.3, -0.4], "max": [0.1, 0.3, 0]}, 0.4, 0.3),  # its yaw turns y to x
        ({"kind": "capsule", "start": [0, 0, 0], "end": [0, 0, -0.2], "radius": 0.15}, 0.35, 0.15),
    ],
)
def test_all_of_it_is_above_the_floor_and_in_the_room_with_the_body(body, below, beside):
    data = camera([0, 0, 1.5, 0, 0, np.pi / 2], body=body).model_dump() | {"floor": 0.25}
    box = resting_box(Robot.model_validate(data | {"workspace_box": {"min": [-0.5, -2, 0], "max": [5, 2, 2.5]}}))
    assert box.low[2] == pytest.approx(0.25 + below)
    assert box.low[0] == pytest.approx(-0.5 + beside)
    assert box.high[2] <= 2.5 + 1e-9
    assert (box.resting[:, 2] >= 0.25 + below - 1e-6).all()


@pytest.mark.parametrize("name", ["cogiro", "planar-4", "wang-flying", "the-cable-robot-simulator"])
def test_the_scalar_solver_finds_tensions_at_the_corners(name):
    robot = load(name)
    box, dynamics = resting_box(robot), Dynamics(robot)
    pose = robot.home.copy()
    assert (box.low <= pose[:3]).all()
    assert (pose[:3] <= box.high).all()
    for corner in product(*np.transpose([box.low, box.high])):
        pose[:3] = corner
        assert solve(pose_problem(dynamics, pose)).feasible, corner


def test_a_team_with_cables_of_fixed_length_moves_along():
    """Its formation moves as a whole: anywhere if it flies, by its reach if its carriers have one."""
    flying = load("multi-quadrotor-3")
    assert (resting_box(flying).low == -np.inf).all()
    data = flying.model_dump(mode="json")
    kept = ("name", "home")
    data["carriers"] = [
        {**{key: carrier[key] for key in kept}, "kind": "mobile", "speed_max": 1, "acceleration_max": 1}
        for carrier in data["carriers"]
    ]
    for carrier, half in zip(data["carriers"], (0.5, 0.3, 0.4), strict=True):
        at = np.array(carrier["home"][:3])
        carrier["reach"] = {"min": (at - half).tolist(), "max": (at + half).tolist()}
    box = resting_box(Robot.model_validate(data))
    assert box.low == pytest.approx([-0.3] * 3)
    assert box.high == pytest.approx([0.3] * 3)


@pytest.mark.parametrize(
    ("weight", "who"), [(2.4 + 3 * 1.5, "the carriers cannot hold the platform"), (1.5, "quad1 cannot hover at home")]
)
def test_a_team_with_too_little_thrust_rests_nowhere(weight, who):
    """Three equal thrusts carry the whole weight, or each its own quadrotor with cables of no tension."""
    data = load("multi-quadrotor-3").model_dump(mode="json")
    for cable in data["cables"]:
        cable["t_min"] = 0
    share = 1 if weight == 1.5 else 3
    for factor, strong in ((1.001, True), (0.999, False)):
        for carrier in data["carriers"]:
            carrier["thrust_max"] = factor * 9.81 * weight / share
        robot = Robot.model_validate(data)
        told = [warning for warning in diagnose(robot).warnings if warning.startswith(who)]
        assert bool(told) is not strong
        assert (resting_box(robot) is not None) is (strong and share == 3)


def test_no_position_no_box():
    assert resting_box(load("wang-ctmrts")) is None


@pytest.mark.parametrize("seed", range(20))
def test_no_box_of_the_grid_is_larger(seed):
    """Compare with all boxes, tried one by one."""
    rng = np.random.default_rng(seed)
    axes = [np.cumsum(rng.uniform(0.1, 1, size)) for size in (5, 4, 6)]
    able = rng.random((5, 4, 6)) < 0.85
    node = tuple(rng.integers(0, (5, 4, 6)))
    able[node] = True
    centre = np.array([axis[i] for axis, i in zip(axes, node, strict=True)])
    low, high = largest_box(able, axes, centre)
    ranges = [[(a, b) for a in range(i + 1) for b in range(i, len(axis))] for axis, i in zip(axes, node, strict=True)]
    best = max(
        np.prod([axis[b] - axis[a] for axis, (a, b) in zip(axes, ends, strict=True)])
        for ends in product(*ranges)
        if able[tuple(slice(a, b + 1) for a, b in ends)].all()
    )
    assert np.prod(high - low) == pytest.approx(best)
    inside = [(axis >= a) & (axis <= b) for axis, a, b in zip(axes, low, high, strict=True)]
    assert able[np.ix_(*inside)].all()


def test_a_box_without_width_has_its_whole_height():
    able = np.zeros((3, 3, 5), dtype=bool)
    able[1, 1, 1:4] = True
    low, high = largest_box(able, [np.arange(3.0), np.arange(3.0), np.arange(5.0)], np.array([1.0, 1.0, 2.0]))
    assert (low.tolist(), high.tolist()) == ([1, 1, 1], [1, 1, 3])
