"""The derivatives of a program, put together from those of nodes and intervals, are CasADi's own of the whole."""

import casadi as ca
import numpy as np
import pytest

from towline import load
from towline.ocp.nlp.program import build
from towline.ocp.nlp.rows import Mesh
from towline.ocp.planner import Planner

BOX = {"kind": "box", "name": "rack", "min": [0.2, -0.2, 0.0], "max": [0.4, 0.3, 1.6], "platform": 0.05, "cables": 0.01}
LINE = {"kind": "line", "start": [0.1, 0, 1.2], "end": [0.6, 0.2, 1.5]}
ROUND = {"kind": "waypoints", "points": [[0.1, 0, 1.2], [0.3, 0.2, 1.6], [0.6, 0.2, 1.5]]}
TEAM = {"path": {"kind": "line", "start": [0, 0, 0], "end": [1, 0, 0]}, "base": {"kind": "free"}, "duration": 4}
TASKS = {
    "obstacle": (
        "ipanema-1",
        {"path": LINE, "duration": 3, "tube": {"position": "free"}, "limits": {"keep_out": [BOX]}},
    ),
    "duration": (
        "ipanema-1",
        {"path": LINE, "duration": {"min": 1, "max": 9}, "tube": {"position": 0.1}, "objective": {"time": 1.0}},
    ),
    "waypoints": (
        "ipanema-1",
        {
            "path": ROUND,
            "duration": 3,
            "tube": {"position": 0.1, "waypoints": "exact"},
            "limits": {"tension_rate": 500.0, "soft": {"tension_rate": 100.0}},
        },
    ),
    "margin": ("ipanema-1", {"path": LINE, "duration": 3, "tube": {"position": 0.1}, "objective": {"margin": 5.0}}),
    "team": ("multi-quadrotor-3", TEAM),
}


@pytest.mark.parametrize("elastic", [False, True])
@pytest.mark.parametrize("name", TASKS)
def test_derivatives_are_those_of_the_whole_program(name: str, elastic: bool) -> None:
    robot, task = TASKS[name]
    program = build(Planner(load(robot), task).scenario, Mesh(5, elastic=elastic))
    x, g, f = (program.problem[part] for part in "xgf")
    multipliers, of_objective = ca.MX.sym("lam_g", g.numel()), ca.MX.sym("lam_f")
    whole = of_objective * f + ca.dot(multipliers, g)
    own = ca.Function("own", [x, of_objective, multipliers], [ca.jacobian(g, x), ca.triu(ca.hessian(whole, x)[0])])
    rng = np.random.default_rng(5)
    at, weights = rng.normal(size=x.numel()) * 0.3, rng.normal(size=g.numel())
    jacobian, hessian = (part.full() for part in own(at, 0.7, weights))
    put_together = program.derivatives
    np.testing.assert_allclose(
        put_together["jac_g"](at, [])[1].full(), jacobian, rtol=1e-10, atol=1e-10 * np.abs(jacobian).max()
    )
    np.testing.assert_allclose(
        put_together["hess_lag"](at, [], 0.7, weights).full(), hessian, rtol=1e-10, atol=1e-10 * np.abs(hessian).max()
    )
