"""Conditions on places: each against a second way to find its answer, pose by pose."""

import itertools
import json
import pickle
import time

import numpy as np
import pytest
from scipy.optimize import linprog, lsq_linear
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.models import Dynamics, Robot, load
from towline.models.shapes import BodyHull
from towline.solvers import capacity_margin, solve
from towline.statics.distribution import pose_problem
from towline.statics.equilibria import equilibria
from towline.workspace import (
    Dynamic,
    EquilibriumPosture,
    ExistsPlacement,
    ForceBalance,
    Interference,
    Lengths,
    Margin,
    Places,
    StaticEquilibrium,
    WrenchClosure,
    WrenchFeasible,
    WrenchWithTolerance,
    condition_from,
)
from towline.workspace.conditions.interference import outside, segment_distance

CUBE = ((-5.0, -5.0, -5.0, -1.0, -1.0, -1.0), (5.0, 5.0, 5.0, 1.0, 1.0, 1.0))


def some_places(name, count, seed=0, turn=0.2):
    """Poses among the anchors of a robot."""
    robot, rng = load(name), np.random.default_rng(seed)
    corners = np.vstack([robot.home_anchors, robot.home[:3]])
    poses = np.tile(robot.home, (count, 1))
    poses[:, :3] = rng.uniform(corners.min(axis=0), corners.max(axis=0), (count, 3))
    poses[:, 3:] += rng.uniform(-turn, turn, (count, 3))
    locked = robot.dof_mask == 0
    poses[:, locked] = robot.home[locked]
    return robot, Places.at_home(robot, poses)


def caspr_grid():
    """The 14 823 poses of CASPR's paper, XYZ Euler 30, -30, 5 degrees."""
    axes = np.linspace(-4, 4, 81), np.linspace(-3, 3, 61), [2.0, 3.0, 4.0]
    poses = np.zeros((81 * 61 * 3, 6))
    poses[:, :3] = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    poses[:, 3:] = Rotation.from_euler("XYZ", [30, -30, 5], degrees=True).as_euler("ZYX")[::-1]
    return poses


def closed_by_program(A):
    """Wrench closure as a linear program: how large the least of balanced tensions of sum 1 can be, and the rank."""
    n, m = A.shape
    equal = np.block([[A, np.zeros((n, 1))], [np.ones((1, m)), np.zeros((1, 1))]])
    found = linprog(
        [0.0] * m + [-1.0],
        A_ub=np.hstack([-np.eye(m), np.ones((m, 1))]),
        b_ub=np.zeros(m),
        A_eq=equal,
        b_eq=[0.0] * n + [1.0],
        bounds=[(None, None)] * (m + 1),
    )
    return bool(found.status == 0 and -found.fun > 1e-9 and np.linalg.matrix_rank(A) == n)


def test_wrench_closure_is_what_a_linear_program_finds():
    robot = load("ipanema-2")
    poses = caspr_grid()
    closed = WrenchClosure().holds(robot, Places.at_home(robot, poses))
    assert len(poses) == 14_823
    rows = np.arange(0, len(poses), 97)
    A = Dynamics(robot).wrench_matrix(poses[rows])
    np.testing.assert_array_equal(closed[rows], [closed_by_program(matrix) for matrix in A])
    assert 0.2 < closed.mean() < 0.8


def test_wrench_closure_with_one_spare_cable_is_the_sign_of_the_null_vector():
    robot, places = some_places("planar-4", 300, turn=0.6)
    A = Dynamics(robot).wrench_matrix(places.pose)[:, robot.dof_mask > 0]
    # By Cramer's rule: each entry is the determinant of the three other columns, with alternating sign.
    null = np.stack([(-1) ** i * np.linalg.det(np.delete(A, i, axis=2)) for i in range(4)], axis=1)
    expected = (null > 0).all(axis=1) | (null < 0).all(axis=1)
    np.testing.assert_array_equal(WrenchClosure().holds(robot, places), expected)
    assert 20 < expected.sum() < 280


def test_too_few_cables_never_close():
    robot, places = some_places("wang-flying", 50)
    assert not WrenchClosure().holds(robot, places).any()


@pytest.mark.parametrize("name", ["ipanema-2", "wang-flying", "planar-4", "point-mass-3"])
def test_static_equilibrium_is_what_solve_finds(name):
    robot, places = some_places(name, 120)
    dynamics = Dynamics(robot)
    expected = [solve(pose_problem(dynamics, pose)).feasible for pose in places.pose]
    np.testing.assert_array_equal(StaticEquilibrium().holds(robot, places), expected)
    assert 0 < np.sum(expected) < len(expected)


def test_a_dynamic_place_gives_its_accelerations():
    robot, places = some_places("ipanema-2", 60)
    dynamics = Dynamics(robot)
    accelerations = ((2.0, 1.0, 3.0, 0.5, 0.0, 0.2), (-2.0, 0.0, -3.0, 0.0, 0.4, 0.0))
    expected = [
        all(solve(pose_problem(dynamics, pose, acceleration=one)).feasible for one in accelerations)
        for pose in places.pose
    ]
    np.testing.assert_array_equal(Dynamic(accelerations=accelerations).holds(robot, places), expected)
    assert 0 < np.sum(expected) < 60


def test_a_box_of_wrenches_is_all_of_its_corners_and_what_lies_between():
    robot, places = some_places("ipanema-2", 24)
    held = WrenchFeasible(box=CUBE).holds(robot, places)
    corners = tuple(itertools.product(*zip(*CUBE, strict=True)))
    np.testing.assert_array_equal(held, WrenchFeasible(vertices=corners).holds(robot, places))
    dynamics, rng = Dynamics(robot), np.random.default_rng(1)
    w = dynamics.required_wrench(robot.home, np.zeros(6), np.zeros(6))
    for row, pose in enumerate(places.pose):
        A = dynamics.wrench_matrix(pose)
        pushes = rng.uniform(*CUBE, (4, 6)) if held[row] else np.array(corners)
        limits = list(zip(robot.t_min, robot.t_max, strict=True))
        answers = (linprog(np.zeros(8), A_eq=A, b_eq=w - push, bounds=limits).status == 0 for push in pushes)
        assert all(answers) == held[row]
    assert 0 < held.sum() < 24


@pytest.mark.parametrize("name", ["ipanema-2", "wang-flying", "planar-4"])
def test_margins_are_those_of_the_solver(name):
    robot, places = some_places(name, 60)
    dynamics = Dynamics(robot)
    expected = np.array([capacity_margin(pose_problem(dynamics, pose)).value for pose in places.pose])
    found = Margin().margins(robot, places)
    inside = expected > 0
    # `pose_problem` keeps six rows, of which some are zero: there the set is flat, and measured inside the flat.
    scale = 1.0 if robot.dof_mask.all() else np.nan_to_num(found[inside] / expected[inside], nan=1.0)
    np.testing.assert_allclose(found[inside], expected[inside] * scale, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(found > 0, inside)
    # Outside, the nearest facet is no farther than the nearest point.
    assert (found[~inside] <= 1e-9).all()
    assert (found[~inside] >= expected[~inside] * (1 + 1e-7) - 1e-9).all()
    np.testing.assert_array_equal(Margin(above=0.5).holds(robot, places), found >= 0.5)


def test_force_balance_asks_for_the_forces_alone():
    robot, places = some_places("wang-ctmrts", 200, turn=0.8)
    U = Dynamics(robot).wrench_matrix(places.pose, places.carriers)[:, :3]
    tensions = np.linalg.solve(U, np.tile([[0.0], [0.0], [robot.weight]], (200, 1, 1)))[..., 0]
    expected = ((tensions >= 0) & (tensions <= 500)).all(axis=1)
    np.testing.assert_array_equal(ForceBalance().holds(robot, places), expected)
    assert 20 < expected.sum() < 180


def test_the_wrench_error_is_the_least():
    """Three cables cannot balance six rows: what they leave is a bounded least-squares residual."""
    from scipy.optimize import lsq_linear

    robot, places = some_places("wang-ctmrts", 40, turn=0.3)
    A = Dynamics(robot).wrench_matrix(places.pose, places.carriers)
    scale = np.array([1, 1, 1] + [1 / robot.length] * 3)
    w = np.array([0, 0, robot.weight, 0, 0, 0])
    least = [np.sqrt(2 * lsq_linear(scale[:, None] * one, scale * w, (0, 500), tol=1e-14).cost) for one in A]
    found = WrenchWithTolerance(tolerance=1.0).error(robot, places)
    np.testing.assert_allclose(found, least, rtol=1e-6, atol=1e-6)
    tolerance = float(np.median(found))
    np.testing.assert_array_equal(WrenchWithTolerance(tolerance=tolerance).holds(robot, places), found <= tolerance)


def test_without_any_tolerance_the_platform_rests_in_equilibrium():
    robot, places = some_places("ipanema-2", 300, turn=0.5)
    rests = StaticEquilibrium().holds(robot, places)
    np.testing.assert_array_equal(WrenchWithTolerance(tolerance=0.0).holds(robot, places), rests)
    assert 20 < rests.sum() < 280


def test_the_posture_found_is_where_the_load_comes_to_rest():
    """From lengths, energy and IPOPT (`equilibria`); from the position, Newton: the same attitude and tensions."""
    robot = load("wang-ctmrts")
    for lengths in ([1.2, 1.2, 1.2], [1.3, 1.1, 1.2], [1.25, 1.3, 1.05]):
        rest = equilibria(robot, np.array(lengths))[0]
        place = Places.at_home(robot, [*rest.pose[:3], 0, 0, 0])
        pose, tensions = EquilibriumPosture().postures(robot, place)
        np.testing.assert_allclose(pose[0], rest.pose, atol=1e-5)
        np.testing.assert_allclose(tensions[0], rest.tensions, rtol=1e-4)
        assert EquilibriumPosture().holds(robot, place).all()


def test_the_lengths_of_a_fixed_drive_stay():
    data = load("wang-ctmrts").model_dump() | {"drive": "fixed-length"}
    robot = type(load("wang-ctmrts")).model_validate(data)
    pose, tensions = EquilibriumPosture().postures(robot, Places.at_home(robot, [1.2, 0.9, 0.5, 0, 0, 0]))
    np.testing.assert_allclose(Dynamics(robot).cable_lengths(pose[0]), 1.2, rtol=1e-9)
    rest = equilibria(robot, np.full(3, 1.2))[0]
    np.testing.assert_allclose(pose[0], rest.pose, atol=1e-5)
    np.testing.assert_allclose(tensions[0], rest.tensions, rtol=1e-4)


def test_a_posture_that_does_not_exist_is_not_found():
    robot = load("wang-ctmrts")
    places = Places.at_home(robot, [[1.26, 0.96, 2.0, 0, 0, 0], [4.0, 4.0, 0.4, 0, 0, 0]])
    assert not EquilibriumPosture().holds(robot, places).any()


def test_lengths():
    robot, places = some_places("ipanema-2", 100)
    lengths = Dynamics(robot).cable_lengths(places.pose)
    np.testing.assert_array_equal(
        Lengths(min=1.0, max=7.0).holds(robot, places), (lengths.min(axis=1) >= 1) & (lengths.max(axis=1) <= 7)
    )
    most = tuple(np.median(lengths, axis=0))
    np.testing.assert_array_equal(Lengths(max=most).holds(robot, places), (lengths <= most).all(axis=1))


def test_a_placement_that_is_found_is_one():
    """A load outside the robot-ends at home, and inside where they may go; but nowhere beyond the hull of the boxes."""
    robot = load("wang-ctmrts")
    places = Places.at_home(robot, [[0.25, 0.3, 0.5, 0, 0, 0], [2.22, 0.4, 0.5, 0, 0, 0], [1.2, 0.1, 0.5, 0, 0, 0]])
    assert not ForceBalance().holds(robot, places).any()
    found = ExistsPlacement(condition=ForceBalance(), tries=512).holds(robot, places)
    np.testing.assert_array_equal(found, [True, True, False])


def test_what_is_lacking_is_nothing_where_a_condition_holds():
    """And for a point mass it is the distance from the weight to the cables' cone, along some direction."""
    for name, kinds in {
        "wang-flying": (StaticEquilibrium(), Margin(above=1.0), WrenchFeasible(box=CUBE), Lengths(max=1.2)),
        "point-mass-3": (ForceBalance(), StaticEquilibrium() & Lengths(max=4.0), ForceBalance() | Lengths(max=3.0)),
    }.items():
        robot, places = some_places(name, 500)
        for condition in kinds:
            short, held = condition.shortfall(robot, places), condition.holds(robot, places)
            assert (short >= 0).all()
            np.testing.assert_array_equal(short == 0, held)
            assert held.any() or name == "wang-flying"
            assert not held.all()


def test_a_search_that_goes_downhill_finds_more_than_points_alone():
    """Of the same number of tries; and a second derivation of where three free robot-ends can hold a point.

    With attachments in the middle and no turn: the weight is in the cone of three boxes if and only if a linear program
    over the boxes' corners has a solution.
    """
    data = load("wang-ctmrts").model_dump(mode="json")
    data["cables"] = [cable | {"attachment": [0.0, 0.0, 0.0], "t_max": 1e6} for cable in data["cables"]]
    robot = Robot.model_validate(data)
    poses = np.zeros((300, 6))
    poses[:, :3] = np.random.default_rng(3).uniform([0.1, 0.2, 0.2], [2.4, 2.2, 0.9], (300, 3))
    places = Places.at_home(robot, poses)
    truth = np.array([held_by_corners(robot, pose[:3]) for pose in poses])
    found = ExistsPlacement(condition=ForceBalance(), tries=256).holds(robot, places)
    assert not (found & ~truth).any()
    assert (found & truth).sum() > 0.97 * truth.sum()
    assert 0.1 < truth.mean() < 0.9

    class Flat(ForceBalance):
        """The same without a slope."""

        def shortfall(self, robot, places):
            return np.where(self.holds(robot, places), 0.0, 1.0)

    few = {type(one): ExistsPlacement(condition=one, tries=64).holds(robot, places) for one in (ForceBalance(), Flat())}
    missed = {kind: (truth & ~held).sum() for kind, held in few.items()}
    assert missed[ForceBalance] < 0.5 * missed[Flat]


def held_by_corners(robot, position):
    corners = [
        np.array(list(itertools.product(*zip(one.reach.min, one.reach.max, strict=True)))) for one in robot.carriers
    ]
    directions = np.vstack(corners) - position
    return linprog(np.zeros(len(directions)), A_eq=directions.T, b_eq=[0, 0, 1.0]).status == 0


def test_places_of_fixed_length_have_it():
    """What is found has carriers in their boxes at 1.2 m: a condition that asks for the length says so."""
    data = load("wang-ctmrts").model_dump() | {"drive": "fixed-length"}
    robot = type(load("wang-ctmrts")).model_validate(data)
    rng = np.random.default_rng(0)
    poses = np.zeros((400, 6))
    poses[:, :3] = rng.uniform([0.8, 0.6, 0.1], [1.7, 1.4, 1.3], (400, 3))
    places = Places.at_home(robot, poses)
    found = ExistsPlacement(condition=ForceBalance(), tries=64).holds(robot, places)
    as_long = Lengths(min=1.2 - 1e-8, max=1.2 + 1e-8)
    np.testing.assert_array_equal(
        ExistsPlacement(condition=ForceBalance() & as_long, tries=64).holds(robot, places), found
    )
    assert 20 < found.sum() < 380
    # No carrier reaches a sphere about the attachment that misses its box.
    low, high = np.array([c.reach.min for c in robot.carriers]), np.array([c.reach.max for c in robot.carriers])
    for pose in poses[found]:
        ends = pose[:3] + robot.attachments
        nearest = np.linalg.norm(np.clip(ends, low, high) - ends, axis=1)
        farthest = np.linalg.norm(np.maximum(np.abs(low - ends), np.abs(high - ends)), axis=1)
        assert (nearest <= 1.2 + 1e-8).all()
        assert (farthest >= 1.2 - 1e-8).all()


def test_segment_distance_is_the_least_over_all_pairs_of_points():
    rng = np.random.default_rng(3)
    ends = rng.normal(size=(40, 4, 3))
    ends[0, 3] = ends[0, 2] + ends[0, 1] - ends[0, 0]  # parallel
    ends[1, 2] = ends[1, 0]  # they touch
    found = segment_distance(*ends.transpose(1, 0, 2))
    shares = np.linspace(0, 1, 401)[:, None]
    for (p, p_end, q, q_end), distance in zip(ends, found, strict=True):
        one, other = p + shares * (p_end - p), q + shares * (q_end - q)
        least = np.linalg.norm(one[:, None] - other[None], axis=-1).min()
        assert distance <= least + 1e-12
        assert least - distance < 0.02


def test_cables_keep_away_from_obstacles():
    """Distance of a cable from each kind of obstacle, by points along it."""
    robot, places = some_places("ipanema-2", 80)
    shares = np.linspace(0, 1, 801)[:, None]
    turned = Rotation.from_euler("ZYX", places.pose[:, 5:2:-1]).as_matrix()
    ends = places.pose[:, None, :3] + np.einsum("nij,mj->nmi", turned, robot.attachments)
    points = robot.home_anchors[None, :, None] * (1 - shares) + ends[:, :, None] * shares  # (n, m, 801, 3)
    low, high, centre = np.array([0.5, 0.5, 1.5]), np.array([1.0, 1.5, 2.5]), np.array([-1.0, 0.5, 2.0])
    angles, middle = [0.4, -0.5, 0.9], (low + high) / 2
    off = (points - middle) @ Rotation.from_euler("ZYX", angles[::-1]).as_matrix()  # in the turned box
    corners = [[x, y, z] for x in (-0.25, 0.25) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    tip = np.array([0.0, 0.0, -1.5])  # of the capsule, from the centre
    within = np.clip((points - centre) @ tip / (tip @ tip), 0, 1)[..., None]
    away = {
        "box": np.linalg.norm(points - np.clip(points, low, high), axis=-1),
        "turned": np.linalg.norm(off - np.clip(off, low - middle, high - middle), axis=-1),
        "mesh": np.linalg.norm(off - np.clip(off, low - middle, high - middle), axis=-1),
        "sphere": np.linalg.norm(points - centre, axis=-1) - 0.3,
        "capsule": np.linalg.norm(points - centre - tip * within, axis=-1) - 0.2,
    }
    obstacles = {
        "box": {"kind": "box", "min": low.tolist(), "max": high.tolist()},
        "turned": {"kind": "box", "min": low.tolist(), "max": high.tolist(), "attitude": angles},
        "mesh": {"kind": "mesh", "vertices": corners, "pose": [*middle.tolist(), *angles]},
        "sphere": {"kind": "sphere", "centre": centre.tolist(), "radius": 0.3},
        "capsule": {"kind": "capsule", "start": centre.tolist(), "end": (centre + tip).tolist(), "radius": 0.2},
    }
    for kind, distance in away.items():
        least = distance.min(axis=(1, 2))
        sure = np.abs(least - 0.1) > 0.01  # what the points leave open
        held = Interference(obstacles=[obstacles[kind]], clearance=0.1).holds(robot, places)
        np.testing.assert_array_equal(held[sure], least[sure] > 0.1)
        assert 0 < held.sum() < 80


def test_a_rounded_hull_is_nearer_by_its_radius():
    """Distance of segments from the platform's body in a design, by points along them."""
    low, high = np.array([-0.5, -0.3, -0.1]), np.array([0.5, 0.3, 0.1])
    hull = BodyHull(kind="mesh", vertices=tuple(itertools.product(*zip(low, high, strict=True))), radius=0.2)
    p, q = np.random.default_rng(5).uniform(-1.5, 1.5, (2, 60, 3))
    along = p[:, None] + np.linspace(0, 1, 2001)[:, None] * (q - p)[:, None]
    least = np.linalg.norm(along - np.clip(along, low, high), axis=2).min(axis=1)
    found = outside(hull, p, q)
    np.testing.assert_allclose(found[least > 0], (least - 0.2)[least > 0], atol=1e-3)
    assert (found[least == 0] <= -0.2).all()
    assert (least == 0).any()


def test_a_cable_through_an_obstacle_is_not_free_whatever_its_kind():
    """Without any clearance too: the ball, the capsule and the box lie about the middle of the first cable."""
    robot = load("point-mass-3")
    places = Places.at_home(robot, robot.home)
    middle = (robot.home_anchors[0] + robot.home[:3] + robot.attachments[0]) / 2
    beyond = middle + 100.0
    for at, free in ((middle, False), (beyond, True)):
        low, high = (at - 0.01).tolist(), (at + 0.01).tolist()
        ball = {"kind": "sphere", "centre": at.tolist(), "radius": 0.01}
        capsule = {"kind": "capsule", "start": low, "end": high, "radius": 0.01}
        box = {"kind": "box", "min": low, "max": high}
        corners = [[x, y, z] for x in (-0.01, 0.01) for y in (-0.01, 0.01) for z in (-0.01, 0.01)]
        mesh = {"kind": "mesh", "vertices": corners, "pose": [*at, 0.3, 0.2, 0.1]}
        for obstacle in (ball, capsule, box, box | {"attitude": [0.3, 0.2, 0.1]}, mesh):
            assert Interference(obstacles=(obstacle,)).holds(robot, places)[0] == free, obstacle


def test_cables_keep_apart():
    """Least distance of two cables that share no end: bounded least squares over where on each."""
    robot, places = some_places("ipanema-2", 40, turn=0.6)
    least = np.full(len(places), np.inf)
    for place, pose in enumerate(places.pose):
        ends = pose[:3] + robot.attachments @ Rotation.from_euler("ZYX", pose[5:2:-1]).as_matrix().T
        along = ends - robot.home_anchors
        for i, j in itertools.combinations(range(robot.m), 2):
            between = robot.home_anchors[j] - robot.home_anchors[i]
            if np.linalg.norm(between) > 0 and np.linalg.norm(robot.attachments[i] - robot.attachments[j]) > 0:
                nearest = lsq_linear(np.stack([along[i], -along[j]], axis=1), between, bounds=(0, 1), method="bvls")
                least[place] = min(least[place], np.sqrt(2 * nearest.cost))
    distance = float(np.median(least))
    held = Interference(between_cables=distance).holds(robot, places)
    np.testing.assert_array_equal(held, least >= distance)
    assert 10 < held.sum() < 30


def test_no_cable_runs_through_the_platform():
    """Platform of planar-4, a box whose corners are the attachments: turned far enough, cables cut it."""
    robot = load("planar-4")
    body = {"min": [-0.2, -0.05, -0.1], "max": [0.2, 0.05, 0.1]}
    pitches = np.deg2rad([0, 10, 100, 180])
    poses = np.array([[0, 0, 0.75, 0, pitch, 0] for pitch in pitches])
    held = Interference(platform=body).holds(robot, Places.at_home(robot, poses))
    shares = np.linspace(0.001, 1, 2000)[:, None]
    for pose, free in zip(poses, held, strict=True):
        R = Rotation.from_euler("ZYX", pose[5:2:-1]).as_matrix()
        anchors = (robot.home_anchors - pose[:3]) @ R
        along = robot.attachments[:, None] * (1 - shares) + anchors[:, None] * shares
        inside = (np.abs(along) < np.array([0.2, 0.05, 0.1]) - 1e-6).all(axis=-1).any()
        assert free != inside
    assert held.any()
    assert not held.all()


def test_conditions_join():
    robot, places = some_places("ipanema-2", 300)
    one, other, third = StaticEquilibrium(), Lengths(max=7.0), WrenchClosure()
    a, b, c = (condition.holds(robot, places) for condition in (one, other, third))
    np.testing.assert_array_equal((one & other).holds(robot, places), a & b)
    np.testing.assert_array_equal((one | other).holds(robot, places), a | b)
    np.testing.assert_array_equal(((one & other) | third).holds(robot, places), (a & b) | c)
    assert len((one & other & third).conditions) == 3


def test_a_subclass_without_a_kind_of_its_own_leaves_its_parents_place():
    class Quieter(StaticEquilibrium):
        """Rest, evaluated by somebody else's class."""

    assert type(condition_from({"kind": "static-equilibrium"})) is StaticEquilibrium


def test_a_condition_is_data():
    condition = (StaticEquilibrium() & Margin(above=2.0)) | ExistsPlacement(
        condition=ForceBalance() & Lengths(max=(1.0, 2.0, 3.0)) & WrenchFeasible(box=CUBE), tries=4
    )
    assert condition_from(json.loads(condition.model_dump_json())) == condition
    assert pickle.loads(pickle.dumps(condition)) == condition


def test_one_bad_pose_is_no_and_leaves_the_others_alone():
    robot, places = some_places("ipanema-2", 40)
    conditions = (StaticEquilibrium(), WrenchClosure(), Margin(), Lengths(max=9.0), Interference(between_cables=0.01))
    poses = places.pose.copy()
    poses[3, 0], poses[5, 4], poses[7, 2] = np.nan, np.inf, 1e300
    poses[9, :3] = robot.home_anchors[0] - robot.attachments[0]  # a cable without length
    poses[9, 3:] = 0
    rest = np.delete(np.arange(40), [3, 5, 7, 9])
    for condition in conditions:
        held = condition.holds(robot, Places.at_home(robot, poses))
        assert not held[[3, 5]].any()
        np.testing.assert_array_equal(held[rest], condition.holds(robot, places)[rest])
    assert not StaticEquilibrium().holds(robot, Places.at_home(robot, poses))[[7, 9]].any()


@pytest.mark.parametrize(
    ("data", "told"),
    [
        ({"kind": "near"}, "condition.kind must be one of"),
        ({}, "condition must be a mapping with a kind"),
        ({"kind": "margin", "above": "much"}, "above must be a number"),
        ({"kind": "wrench-feasible"}, "box or vertices must be given, and not both, got neither"),
        ({"kind": "lengths", "min": 2, "max": 1}, "min must not exceed max"),
        ({"kind": "all", "conditions": [{"kind": "margin", "abov": 1}]}, "abov is not a known key"),
        ({"kind": "wrench-with-tolerance", "tolerance": -1}, "tolerance"),
        ({"kind": ["margin"]}, "got ['margin']"),
        ({"kind": "margin", "self": 1}, "self is not a known key"),
        ({"kind": "margin", 1: 2}, "1 is not a known key"),
        ({"kind": "lengths", "min": [2, 1], "max": [3, 0.5]}, "min must not exceed max"),
        ({"kind": "lengths", "min": [1, 2], "max": 1.5}, "min must not exceed max"),
        ({"kind": "interference", "between_cables": 0}, "between_cables must be greater than 0"),
        ({"kind": "interference", "clearance": 0.1}, "between_cables, platform or obstacles must be given"),
        ({"kind": "lengths"}, "min above 0 or max must be given"),
        ({"kind": "metric", "metric": "payload"}, "metric: min or max must be given"),
    ],
)
def test_wrong_conditions_are_told_in_a_line(data, told):
    with pytest.raises(InputError) as caught:
        condition_from(data)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_conditions_that_do_not_apply_to_a_robot():
    robot, places = some_places("planar-4", 1)
    for condition in (EquilibriumPosture(), ExistsPlacement(condition=ForceBalance()), Lengths(max=(1.0, 2.0))):
        with pytest.raises(InputError, match="must have"):
            condition.holds(robot, places)


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ([["a"] * 6] * 500_000, r"\[0\]\[0\] must be a number.*; also wrong: accelerations\[0\]\[1\], .* and 2 more"),
        (["x"] * 500_000, r"accelerations\[0\] must be a list of 6 numbers, got 'x'"),
        (np.broadcast_to(0.0, (10**8, 6)), r"accelerations must be a list of at most 100000 items, got an array of"),
    ],
)
def test_long_lists_are_refused_at_their_first_wrong_row(wrong, line):
    started = time.process_time()
    with pytest.raises(InputError, match=line):
        Dynamic(accelerations=wrong)
    assert time.process_time() - started < 5
