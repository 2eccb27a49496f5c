"""Paper C recomputed: verdicts follow from the numbers, and these from a second derivation where there is one."""

import numpy as np
import pytest

from towline.models import Dynamics, load
from towline.studies.accounts.claim import Verdict
from towline.studies.towing import equations as towing_equations
from towline.studies.towing import ranges as towing_ranges
from towline.studies.towing import tensions as towing_tensions
from towline.studies.towing.workspace import in_prism


@pytest.fixture(scope="module")
def equations():
    return {claim.id: claim for claim in towing_equations.chapter().claims}


@pytest.fixture(scope="module")
def tensions():
    return {claim.id: claim for claim in towing_tensions.chapter().claims}


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
