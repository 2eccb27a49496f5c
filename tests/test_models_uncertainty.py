"""How well a robot is known: names of its numbers, the covariance in robot files, and robots drawn from it."""

import casadi as ca
import numpy as np
import pytest

from towline import Robot, load
from towline.base.errors import InputError
from towline.models import Uncertainty

NAMES = ["cables[0].anchor.x", "cables[3].attachment.z", "cables[1].pulley.radius"]
MIXED = np.array([[4e-4, 1e-4, 0], [1e-4, 1e-4, -2e-5], [0, -2e-5, 1e-5]])  # [m^2]


def known(name="caroca-pulleys", parameters=NAMES, covariance=MIXED):
    data = load(name).model_dump(mode="json")
    return Robot.model_validate(data | {"uncertainty": {"parameters": parameters, "covariance": covariance.tolist()}})


def test_a_file_keeps_the_uncertainty(tmp_path):
    robot = known()
    again = load(robot.save(tmp_path / "new" / "mine.yaml"))
    assert again == robot
    assert hash(again) == hash(robot)
    np.testing.assert_array_equal(again.uncertainty.matrix, MIXED)
    assert load("caroca-pulleys").uncertainty is None
    assert again != load("caroca-pulleys")


def test_robots_are_changed_by_name():
    robot = known()
    radius = robot.pulley_radii[1]
    expected = [robot.anchors[0, 0], robot.attachments[3, 2], radius]
    np.testing.assert_array_equal(robot.parameter_values(NAMES), expected)
    changed = robot.with_parameters(dict(zip(NAMES, [7.5, -0.25, 2 * radius], strict=True)))
    anchors, attachments, radii = robot.anchors, robot.attachments, robot.pulley_radii
    anchors[0, 0], attachments[3, 2], radii[1] = 7.5, -0.25, 2 * radius
    np.testing.assert_array_equal(changed.anchors, anchors)
    np.testing.assert_array_equal(changed.attachments, attachments)
    np.testing.assert_array_equal(changed.pulley_radii, radii)
    assert robot.with_parameters({}) == robot


@pytest.mark.parametrize("names", ["cables[0].anchor.x", 3, ca.DM(1)])
def test_names_of_numbers_are_a_list(names):
    """An array of CasADi has `__iter__`, and raises an exception of its own there."""
    with pytest.raises(InputError, match=r"^names must be a list of names of a robot's parameters, got "):
        known().parameter_values(names)


def test_drawn_robots_have_the_covariance():
    """The factor is exact; variances of 1000 draws, which deviate by sqrt(2 / 1000), are within 20 %."""
    robot = known()
    factor = robot.uncertainty.factor
    np.testing.assert_allclose(factor @ factor.T, MIXED, rtol=1e-9, atol=1e-9 * np.abs(MIXED).max())
    drawn = robot.drawn(1000, seed=3)
    errors = np.array([one.parameter_values(NAMES) for one in drawn]) - robot.parameter_values(NAMES)
    scale = robot.uncertainty.sigmas
    np.testing.assert_allclose(np.cov(errors.T) / np.outer(scale, scale), MIXED / np.outer(scale, scale), atol=0.2)
    assert np.abs(errors.mean(axis=0) / scale).max() < 4 / np.sqrt(len(drawn))
    assert drawn[:5] == robot.drawn(5, seed=3)
    assert drawn[0] != robot.drawn(1, seed=4)[0]
    assert drawn[0].uncertainty is None


def test_a_covariance_may_have_directions_without_error():
    """Two anchors that err by the same amount: one direction, and robots in which their difference is exact."""
    names = ["cables[0].anchor.x", "cables[1].anchor.x"]
    robot = known("cogiro", names, np.full((2, 2), 1e-4))
    assert robot.uncertainty.factor.shape == (2, 1)
    apart = np.diff(robot.parameter_values(names))
    for one in robot.drawn(5):
        np.testing.assert_allclose(np.diff(one.parameter_values(names)), apart, atol=1e-12)
    assert known("cogiro", names, np.zeros((2, 2))).drawn(1)[0] == load("cogiro")


WRONG = {
    "other name": ({"parameters": ["cables[0].anch.x"]}, r"parameters\[0\] must be like cables\[i\].anchor.x, .*anch"),
    "no such cable": ({"parameters": ["cables[8].anchor.x"]}, r"parameters\[0\] must be of a cable from 0 to 7, got"),
    "no pulley": ({"parameters": ["cables[0].pulley.radius"]}, r"must be of a cable with a pulley, got 'cables\[0\]"),
    "sign": ({"covariance": [[-1e-4]]}, r"covariance must have no negative eigenvalues, got one of -0.0001 m\^2"),
    "shape": ({"covariance": [[1, 0], [0, 1]]}, r"must have 1 rows of 1 numbers, .* got 2 rows of 2 numbers"),
    "not finite": ({"covariance": [[float("nan")]]}, r"covariance\[0\]\[0\] must be a finite number, got nan"),
    "text": ({"covariance": "none"}, r"covariance must be a list, got 'none'"),
    "twice": ({"parameters": ["cables[0].anchor.x"] * 2}, r"must name each parameter once, got cables\[0\].anchor.x"),
    "skew": (
        {"parameters": ["cables[0].anchor.x", "cables[1].anchor.x"], "covariance": [[1, 0.5], [0.4, 1]]},
        r"covariance must be symmetric, got 0.5 in row 1 and 0.4 in row 2",
    ),
}


@pytest.mark.parametrize(("change", "message"), WRONG.values(), ids=WRONG)
def test_wrong_uncertainty_is_one_line(change, message):
    block = {"parameters": ["cables[0].anchor.x"], "covariance": [[1e-4]]} | change
    with pytest.raises(InputError, match=message) as error:
        Robot.model_validate(load("cogiro").model_dump(mode="json") | {"uncertainty": block})
    assert str(error.value).startswith("robot: uncertainty.")
    assert "\n" not in str(error.value)


def test_wrong_names_and_values_are_one_line():
    robot = load("cogiro")
    for names, message in ((3, "names must be a list of names"), (["cables[9].anchor.x"], "must be of a cable from 0")):
        with pytest.raises(InputError, match=message):
            robot.parameter_values(names)
    for values, message in (
        (None, "values must be a Mapping, got None"),
        ({"mass": 3}, "keys of values must be like cables"),
        ({"cables[0].anchor.x": "far"}, r"cables\[0\].anchor.x must be a number from"),
    ):
        with pytest.raises(InputError, match=message):
            robot.with_parameters(values)
    with pytest.raises(InputError, match=r"robot\.uncertainty must be given to draw robots from it, got none"):
        robot.drawn(2)
    with pytest.raises(InputError, match=r"^robot: cables\[1\]"):
        known(covariance=np.diag([0, 0, 1e4])).drawn(20)
    assert Uncertainty(parameters=NAMES, covariance=MIXED.tolist()).sigmas[0] == pytest.approx(0.02)
