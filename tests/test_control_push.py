"""A push that has ended leaves nothing: loads that hang from fewer cables than degrees of freedom return."""

import numpy as np
import pytest

from towline.control import Predictive
from towline.models import load
from towline.simulation import simulate

from .slung_load import slung


@pytest.mark.parametrize("name", ["multi-quadrotor-3", "multi-quadrotor-4", "slung"])
def test_a_load_returns_after_a_push(name):
    """Carriers once stayed where the push had moved them along their cables, and the load hung 70 to 90 mm too high."""
    robot = slung(dof=["x", "y", "z"]) if name == "slung" else load(name)
    push = f"push {0.2 * robot.weight} 0 0 at 0.2 for 0.5"
    flown = simulate(robot, robot.home, events=[push], duration=6, period=0.002)
    off = np.linalg.norm(flown.trajectory["pose"].values[:, :3] - robot.home[:3], axis=1)
    assert off.max() > 0.1  # it was pushed
    assert off[-1] < 0.006


def test_a_load_that_may_spin_below_its_cable_is_flown_by_predictions():
    """Nothing holds the attitude of a load that hangs at its CoM, so its spin was taken for an unstable loop."""
    controller = Predictive(slung(inertia=[1e-2, 2e-2, 1e-2, 0, 0, 0]))
    assert controller.handed_over is None
    np.testing.assert_allclose(controller.uncontrolled[:, :3], 0.0, atol=1e-9)  # the quadrotor can push it anywhere
    assert np.linalg.matrix_rank(controller.uncontrolled[:, 3:]) == 3
