"""Paper C recomputed: verdicts follow from the numbers, and these from a second derivation where there is one."""

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import linprog, root
from scipy.spatial.transform import Rotation

from towline.models import Dynamics, load
from towline.studies.accounts.claim import Verdict
from towline.studies.towing import equations as towing_equations
from towline.studies.towing import loop as towing_loop
from towline.studies.towing import ranges as towing_ranges
from towline.studies.towing import tensions as towing_tensions
from towline.studies.towing.workspace import in_prism


@pytest.fixture(scope="module")
def equations():
    return {claim.id: claim for claim in towing_equations.chapter().claims}


@pytest.fixture(scope="module")
def tensions():
    return {claim.id: claim for claim in towing_tensions.chapter().claims}


@pytest.fixture(scope="module")
def loop():
    return {claim.id: claim for claim in towing_loop.chapter().claims}


ENDS = np.array([[2.2, 0.45, 1.2], [1.275, 2.027, 1.2], [0.308, 0.405, 1.2]])
SIDES = np.repeat([1, -1], 6)  # of a balance that is two inequalities
CORNERS = np.array([[0.05, -0.1 / np.sqrt(12), 0], [0, 0.1 / np.sqrt(3), 0], [-0.05, -0.1 / np.sqrt(12), 0]])


def cables(pose):
    """Vectors from the corners of the load to the robot-ends of W2, and the corners from its centre, by scipy."""
    arms = Rotation.from_euler("ZYX", pose[:2:-1]).apply(CORNERS)
    return ENDS - pose[:3] - arms, arms


def test_the_inertia_of_a_rotated_plate(equations):
    """The load is flat, Ix = Iy + Iz: a mass M in the plane x = 0, whose second moments are Iz and Iy."""
    points, share = towing_equations.masses(), 10 / 6
    np.testing.assert_allclose((share * points[:, :, None] * points[:, None]).sum(axis=0), np.diag([0, 0.28, 0.26]))
    spin = np.array([0.3, -0.2, 0.5])
    energy = share / 2 * (np.linalg.norm(np.cross(spin, points), axis=1) ** 2).sum()
    assert energy == pytest.approx(spin @ np.diag([0.54, 0.26, 0.28]) @ spin / 2, rel=1e-12)
    assert equations["eq-10"].verdict is equations["eq-8"].verdict is Verdict.REPRODUCED


def test_a_local_point_moves_with_the_load(equations):
    claim = equations["table-1"]
    home = load("wang-ctmrts").home
    lengths = [np.linalg.norm(cables(home + shift * np.eye(6)[0])[0][0]) for shift in (0, 0.1)]
    assert claim.verdict is Verdict.DIFFERS
    assert claim.printed == pytest.approx(0, abs=1e-12)
    assert claim.computed == pytest.approx(lengths[1] - lengths[0], rel=1e-9)


def test_the_third_row_of_eq_15_by_hand(loop):
    """Between 1 m and 1.4 m lie 0.38 m of each printed range, and between 1.2 m and 1.2 m nothing."""
    assert loop["eq-15-z"].computed == pytest.approx((0.38 / 0.78, 0, 0.38 / 1.38))
    assert loop["eq-15-z"].verdict is Verdict.IMPOSSIBLE


def test_poses_in_balance_have_dimension_three(loop):
    """Force and moment balance about a solved pose, in nine unknowns: as many directions change nothing."""

    def unbalanced(unknown):
        lines, arms = cables(unknown[:6])
        pulls = unknown[6:, None] * lines / np.linalg.norm(lines, axis=1)[:, None]
        return np.concatenate([pulls.sum(axis=0) - [0, 0, 98.1], np.cross(arms, pulls).sum(axis=0)])

    place = np.array([1.2, 0.9, 0.4])
    found = root(lambda x: unbalanced(np.concatenate([place, x])), [0, 0, 0, 50, 50, 50], tol=1e-12)
    assert found.success
    at = np.concatenate([place, found.x])
    slopes = np.stack([(unbalanced(at + row) - unbalanced(at - row)) / 2e-6 for row in 1e-6 * np.eye(9)], axis=1)
    assert loop["eq-14"].computed == null_space(slopes, rcond=1e-6).shape[1]
    assert loop["eq-14"].verdict is Verdict.DIFFERS


def test_the_load_rests_on_all_its_cables(loop):
    """Where the claim has it at rest, m cables of 1.2 m balance force and moment, by scipy's least squares."""
    for m in (3, 4, 5, 6):
        robot, pose = load(towing_equations.SIZES[m]), towing_loop.rest(m).pose
        arms = Rotation.from_euler("ZYX", pose[:2:-1]).apply(robot.attachments)
        lines = robot.carrier_home[:, :3] - pose[:3] - arms
        np.testing.assert_allclose(np.linalg.norm(lines, axis=1), 1.2, atol=1e-6)
        A = np.vstack([lines.T, np.cross(arms, lines).T]) / 1.2
        program = linprog(np.zeros(m), A_ub=np.vstack([A, -A]), b_ub=1e-6 + np.array([0, 0, 98.1, 0, 0, 0] * 2) * SIDES)
        assert program.status == 0
    assert loop["figure-1"].verdict is Verdict.REPRODUCED


def test_what_is_recorded_by_linear_programs(loop):
    poses, forces = towing_loop.around_the_ends()
    for pose, tensions in zip(poses[:200], forces[:200], strict=True):
        lines, _ = cables(pose)
        units = (lines / np.linalg.norm(lines, axis=1)[:, None]).T
        program = linprog(np.ones(3), A_eq=units, b_eq=[0, 0, 98.1], bounds=(0, 500))
        assert (program.status == 0) == bool(((tensions > 0) & (tensions < 500)).all())
    assert loop["step-f"].verdict is Verdict.REPRODUCED


def test_steps_leave_a_position_open_where_lengths_vary(loop):
    """Lengths of 1.2 m and a posture give a position by Newton, and with lengths unknown any position solves Eq. 1."""
    found = root(lambda x: np.linalg.norm(cables(np.r_[x, 0.2, 0.1, 0.3])[0], axis=1) - 1.2, [1.2, 0.9, 0.6])
    assert found.success
    assert found.x[2] < 1.2
    assert loop["step-b"].computed == (0, 3, 3)
    assert loop["step-c"].verdict is Verdict.REPRODUCED
    assert loop["step-e"].verdict is Verdict.IMPOSSIBLE


def test_what_the_model_leaves_out_is_the_gyroscopic_moment(equations):
    """Along principal axes by Euler's equations: (I_z - I_y) w_y w_z and so on, of the body's own rates."""
    claim = equations["eq-4-gyroscopic"]
    assert claim.verdict is Verdict.DIFFERS
    roll, pitch, _ = towing_equations.ANGLES
    # Body rates of ZYX angles, all of which turn by 1 rad/s.
    rates = np.array(
        [
            1 - np.sin(pitch),
            np.cos(roll) + np.sin(roll) * np.cos(pitch),
            -np.sin(roll) + np.cos(roll) * np.cos(pitch),
        ]
    )
    first, second, third = np.diag(load("wang-ctmrts").inertia)
    moment = [
        (third - second) * rates[1] * rates[2],
        (first - third) * rates[2] * rates[0],
        (second - first) * rates[0] * rates[1],
    ]
    assert claim.computed == pytest.approx(np.linalg.norm(moment), rel=1e-5)


def test_cables_in_the_printed_direction_would_push(equations):
    claim = equations["eq-6-direction"]
    assert claim.verdict is Verdict.DIFFERS
    robot = load("wang-ctmrts")
    force = Dynamics(robot).wrench_matrix(robot.home)[:3] @ np.array(claim.computed)
    np.testing.assert_allclose(force, [0, 0, -robot.weight], atol=1e-9)


def test_no_rank_allows_an_inverse(equations, tensions):
    """Nor that of six cables from a regular hexagon to a similar one, however the load is turned."""
    assert equations["eq-13-inverse"].computed == (3, 4, 5, 5)
    robot = load("wang-ctmrts-6")
    for turn in np.random.default_rng(1).uniform(-0.5, 0.5, (5, 3)):
        A = Dynamics(robot).wrench_matrix(np.r_[robot.home[:3], turn])
        assert np.linalg.svd(A, compute_uv=False)[5] < 1e-10
    assert equations["eq-13-inverse"].verdict is Verdict.IMPOSSIBLE
    assert tensions["eq-16-inverse"].verdict is Verdict.IMPOSSIBLE
    assert tensions["eq-17-null-space"].computed == (0, 0, 0, 1)


def test_the_ends_of_lambda_are_where_a_cable_goes_slack(tensions):
    low, high = tensions["eq-17-lambda"].computed
    problem = towing_tensions.forces(load("wang-ctmrts-4"))
    for end in (low, high):
        special, null = towing_tensions._null_space(problem)
        values = special + end * null
        np.testing.assert_allclose(problem.A @ values, problem.w, atol=1e-9)
        assert min(values.min(), (500 - values).min()) == pytest.approx(0, abs=1e-9)


def test_random_postures_are_never_in_balance_and_found_ones_are(tensions):
    assert tensions["step-d-rank"].verdict is Verdict.IMPOSSIBLE
    assert tensions["step-e-unique"].verdict is Verdict.REPRODUCED


def test_a_verdict_follows_what_is_printed(monkeypatch):
    monkeypatch.setattr(towing_equations, "SECOND", np.zeros(3))
    monkeypatch.setattr(towing_equations, "RATES", np.zeros(3))
    still = {claim.id: claim.verdict for claim in towing_equations.chapter().claims}
    assert still["eq-4-gyroscopic"] is still["eq-12-angular-acceleration"] is Verdict.REPRODUCED
    rest = towing_ranges._least_height()
    monkeypatch.setitem(towing_ranges.PRINTED, "fixed-length", ((0, 0), (0, 0), (rest.computed, 1)))
    assert (rest.verdict, towing_ranges._least_height().verdict) == (Verdict.DIFFERS, Verdict.REPRODUCED)


@pytest.mark.parametrize(
    ("computed", "told"),
    [((0, 3), "wider"), ((1.2, 1.8), "narrower"), ((0, 1.8), "lower"), ((1.2, 3), "higher")],
)
def test_how_a_range_lies_beside_the_printed_one(computed, told):
    assert towing_ranges._beside(np.array(computed), (1.0, 2.0)).startswith(f"{told} than printed")


def test_shapes_of_sections():
    """A triangle fills half of the smallest rectangle about it, turned or not; a rectangle all of it."""
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    triangle = np.array([[0, 0], [2, 0], [0.5, 1.0]]) @ turn
    rectangle = np.array([[0, 0], [2, 0], [2, 1], [0, 1]]) @ turn
    assert towing_ranges.share_of_rectangle(triangle) == pytest.approx(0.5)
    assert towing_ranges.share_of_rectangle(rectangle) == pytest.approx(1.0)


def test_the_prism_below_three_robot_ends():
    robot = load("wang-ctmrts")
    middle = robot.carrier_home[:, :3].mean(axis=0)
    corner = robot.carrier_home[0, :3]
    points = np.array([middle - [0, 0, 0.5], middle - [0, 0, -0.01], 1.01 * corner - [0, 0, 1], middle - [0, 1, 0.1]])
    np.testing.assert_array_equal(in_prism(robot, points), [True, False, False, False])
