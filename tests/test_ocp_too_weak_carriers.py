"""Loads that move too fast for the thrusts of their quadrotors are proven infeasible, and no others."""

import numpy as np
import pytest
from scipy.optimize import linprog

from towline.ocp import plan
from towline.ocp.planner import Planner
from towline.ocp.proofs.infeasible_ends import infeasible_ends

from .slung_load import slung
from .told import told

GRAVITY, TILT, MASS = 9.81, 0.6, 1.5


def task(seconds):
    line = {"kind": "line", "start": [0, 0, 1], "end": [2, 0, 1.5]}
    return {"path": line, "base": {"kind": "free", "ends": "rest"}, "duration": seconds, "steps": 40}


def may_carry(forces, thrust):
    """Return whether thrusts in a cone and accelerations of at most 5 m/s^2 can give forces (n, 3), by linear programs.

    The load moves in the plane y = 0, and so may the quadrotor: the cone is a wedge there, exactly. Discs are polygons
    around them, larger by 0.02 %.
    """
    angles = np.linspace(0, 2 * np.pi, 180, endpoint=False)
    disc, nothing = np.stack([np.cos(angles), np.sin(angles)], axis=1), np.zeros((180, 2))
    wedge = np.array(
        [[1, -np.tan(TILT), 0, 0], [-1, -np.tan(TILT), 0, 0]]
    )  # of thrust f_x, f_z and acceleration a_x, a_z
    A = np.vstack([wedge, np.hstack([disc, nothing]), np.hstack([nothing, disc])])
    b = np.concatenate([np.zeros(2), np.full(180, thrust), np.full(180, 5.0)])
    equal, weight = np.hstack([np.eye(2), -MASS * np.eye(2)]), np.array([0, -MASS * GRAVITY])
    free = [(None, None)] * 4
    programs = (linprog(np.zeros(4), A, b, equal, force[[0, 2]] - weight, bounds=free) for force in forces)
    return all(program.status == 0 for program in programs)


@pytest.mark.parametrize("thrust", [20.5, 40.0])  # weak upwards, or not strong enough downwards
def test_a_duration_is_refused_only_where_no_thrust_gives_the_force(thrust):
    scenario = Planner(slung(thrust, dof=["x", "y", "z"]), task(0.3)).scenario
    proof = infeasible_ends(scenario)
    (excess,) = (each for each in proof.excess if each.limit == "duration")
    assert 0.3 < excess.bound < 1.5
    for factor, feasible in ((0.97, False), (1.0 / 0.97, True)):
        seconds = factor * excess.bound
        held = scenario.held(seconds)
        moved = held.motion(np.linspace(0, seconds, 41), None)[0]
        forces = 0.5 * (moved.acceleration[:, :3] + [0, 0, GRAVITY])
        assert may_carry(forces, thrust) is feasible
        assert (infeasible_ends(held) is None) is feasible


@pytest.mark.parametrize("seconds", [0.05, 0.3])
def test_a_team_that_is_too_fast_is_refused_before_planning_and_told_how_long_it_takes(seconds):
    refused = plan(slung(dof=["x", "y", "z"]), task(seconds))
    assert refused.status == "infeasible"
    assert refused.iterations == 0
    assert "duration of motion must be at least" in told(refused).replace("\n", " ")
