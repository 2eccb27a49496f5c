"""Soft limits and costs of one's own are part of what a plan costs, also of motions that no program chose."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from towline.models import Dynamics, load
from towline.ocp import plan
from towline.ocp.audits.violation import cost
from towline.ocp.costs import Cost

LINE = {"kind": "line", "start": [0, 0, 1], "end": [0.5, 0.3, 1.3]}


def test_the_fastest_time_law_pays_for_the_speed_by_which_it_exceeds_a_soft_limit():
    bound, amount = 0.3, 0.1
    task = {"path": LINE, "duration": {"min": 0.3, "max": 9}, "objective": {"time": 1, "tension": 1e6, "jerk": 1e6}}
    found = plan("point-mass-3", task | {"limits": {"platform_speed": bound, "soft": {"platform_speed": amount}}})
    share = np.linspace(0, 1, 2001)
    speed = 140 * share**3 * (1 - share) ** 3 * np.linalg.norm(np.subtract(LINE["end"], LINE["start"]))  # in 1 s

    def costs(seconds):
        return seconds + (np.maximum(speed / seconds - bound, 0) ** 2).mean() / amount**2

    best = minimize_scalar(costs, (1.0, 9.0))
    assert found.feasible
    assert found.scenario.duration == pytest.approx(best.x, rel=0.01)
    assert cost(found) == pytest.approx(best.fun, rel=0.01)


def test_tensions_of_a_given_motion_keep_a_soft_margin_as_well_as_any():
    robot, wanted = load("planar-4"), 60.0
    path = {"kind": "line", "start": [-0.3, 0, 0.6], "end": [0.3, 0, 0.9]}
    task = {"path": path, "duration": 2, "margin": wanted, "limits": {"soft": {"margin": 1}}, "steps": 30}
    found = plan(robot, task)
    assert found.feasible
    dynamics, rows, motion = Dynamics(robot), np.flatnonzero(robot.dof_mask), found.audit.motion
    best, reached = [], []
    for k in range(0, len(motion.pose), 40):
        A = dynamics.wrench_matrix(motion.pose[k])[rows]
        w = dynamics.required_wrench(motion.pose[k], motion.velocity[k], motion.acceleration[k])[rows]
        least, free = np.linalg.pinv(A) @ w, np.linalg.svd(A)[2][-1]
        each = np.vstack([found.audit.tensions[k], least + np.linspace(-400, 400, 4001)[:, None] * free])
        margins = np.minimum(each - robot.t_min, robot.t_max - each).min(axis=1)
        best.append(margins[1:].max())
        reached.append(margins[0])
    assert min(best) > 50
    np.testing.assert_allclose(reached, np.minimum(best, wanted), atol=1.0)


def test_tensions_of_a_given_motion_are_the_cheapest_by_a_cost_of_ones_own():
    class Preferred(Cost):
        name, unit = "preferred", "N"

        def values(self, state):
            return state.tensions[0] - 80

    path = {"kind": "line", "start": [-0.3, 0, 0.6], "end": [0.3, 0, 0.9]}
    task = {"path": path, "duration": 2, "steps": 30}
    usual = plan("planar-4", task)
    found = plan("planar-4", task | {"objective": {"own": (Preferred(1),)}})
    assert abs(usual.audit.tensions[:, 0] - 80).min() > 20
    np.testing.assert_allclose(found.audit.tensions[:, 0], 80, atol=0.5)  # which the other cables permit
