"""Circles about any axis: where they are, which way they turn, and planned in front of a wall."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.ocp import plan
from towline.ocp.tasks.paths import CirclePath

numbers = st.floats(-3, 3).map(lambda value: round(value, 3))


@given(axis=st.tuples(numbers, numbers, numbers).filter(any), rate=numbers.filter(bool), phase=numbers)
def test_a_circle_is_the_rotation_of_its_first_point_about_its_axis(axis, rate, phase):
    centre, radius, drift = np.array([1.0, -2.0, 3.0]), 0.7, np.array([0.1, 0.2, -0.3])
    path = CirclePath(kind="circle", centre=centre, radius=radius, rate=rate, axis=axis, phase=phase, drift=drift)
    times = np.linspace(0, 4, 9)
    motion = path.at(times, 4.0)
    unit = np.array(axis) / np.linalg.norm(axis)
    (first,) = path.model_copy(update={"phase": 0.0}).at(np.zeros(1), 4.0).pose[:, :3] - centre
    assert np.linalg.norm(first) == pytest.approx(radius)
    assert first @ unit == pytest.approx(0, abs=1e-9)
    toward_x = np.array([1.0, 0, 0]) - unit[0] * unit  # the part of the x axis in the plane of the circle
    if np.linalg.norm(toward_x) > 1e-3:
        assert first @ toward_x == pytest.approx(radius * np.linalg.norm(toward_x))
    turns = Rotation.from_rotvec((phase + rate * times)[:, None] * unit)
    arms = turns.apply(first)
    np.testing.assert_allclose(motion.pose[:, :3], centre + times[:, None] * drift + arms, atol=1e-12)
    np.testing.assert_allclose(motion.velocity[:, :3], drift + np.cross(rate * unit, arms), atol=1e-12)
    np.testing.assert_allclose(motion.acceleration[:, :3], -(rate**2) * arms, atol=1e-11)


def test_a_circle_in_front_of_a_wall_is_planned_and_a_horizontal_one_leaves_the_plane():
    circle = {"kind": "circle", "centre": [0, 0, 0.75], "radius": 0.2, "rate": 1}
    upright, level = (plan("planar-4", {"path": {**circle, "axis": axis}}) for axis in ([0, 1, 0], [0, 0, 1]))
    assert upright.feasible, upright.report()
    assert not level.feasible
    assert level.audit.excess[0].limit == "dof"


def test_an_axis_has_a_direction():
    with pytest.raises(InputError, match=r"axis must be a direction other than zero, got \[0, 0, 0\]"):
        CirclePath(kind="circle", centre=(0, 0, 0), radius=1, rate=1, axis=[0, 0, 0])
