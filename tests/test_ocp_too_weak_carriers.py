"""Loads that move too fast for the thrusts of their quadrotors are proven infeasible, and no others."""

import numpy as np
import pytest
from scipy.optimize import linprog

from towline.ocp import plan
from towline.ocp.planner import Planner
from towline.ocp.proofs.infeasible_ends import infeasible_ends

from .slung_load import slung

GRAVITY, TILT, THRUST, MASS = 9.81, 0.6, 40.0, 1.5


def task(seconds):
    line = {"kind": "line", "start": [0, 0, 1], "end": [2, 0, 1.5]}
    return {"path": line, "base": {"kind": "free", "ends": "rest"}, "duration": seconds, "steps": 40}


def may_carry(forces):
    """Return whether thrusts in a cone and accelerations of at most 5 m/s^2 can give forces (n, 3), by LPs.

    Cone and ball are replaced by larger polyhedra, so that a force out of reach of these is out of reach.
    """
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    wide = np.tan(TILT) / np.cos(np.pi / 24)
    cone = np.hstack([around, np.full((24, 1), -wide)])  # around . f_xy <= wide f_z
    ball = np.random.default_rng(5).normal(size=(400, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    # f, a: cone f <= 0, f_z <= thrust, ball a <= 5
    A = np.block([[cone, np.zeros((24, 3))], [np.array([[0, 0, 1.0]]), np.zeros((1, 3))], [np.zeros((400, 3)), ball]])
    b = np.concatenate([np.zeros(24), [THRUST], np.full(400, 5.0)])
    equal = np.hstack([np.eye(3), -MASS * np.eye(3)])
    weight = np.array([0, 0, -MASS * GRAVITY])
    free = [(None, None)] * 6
    return all(linprog(np.zeros(6), A, b, equal, force - weight, bounds=free).status == 0 for force in forces)


def test_a_duration_is_refused_only_where_no_thrust_gives_the_force():
    scenario = Planner(slung(dof=["x", "y", "z"]), task(0.3)).scenario
    proof = infeasible_ends(scenario)
    (excess,) = (each for each in proof.excess if each.limit == "duration")
    assert 0.3 < excess.bound < 1.5
    for factor, feasible in ((0.97, False), (1.0 / 0.97, True)):
        seconds = factor * excess.bound
        held = scenario.held(seconds)
        moved = held.motion(np.linspace(0, seconds, 41), None)[0]
        forces = 0.5 * (moved.acceleration[:, :3] + [0, 0, GRAVITY])
        assert may_carry(forces) is feasible
        assert (infeasible_ends(held) is None) is feasible


@pytest.mark.parametrize("seconds", [0.05, 0.3])
def test_a_team_that_is_too_fast_is_refused_before_planning_and_told_how_long_it_takes(seconds):
    refused = plan(slung(dof=["x", "y", "z"]), task(seconds))
    assert refused.status == "infeasible"
    assert refused.solve_s < 1
    assert "duration of motion must be at least" in refused.report().replace("\n", " ")
