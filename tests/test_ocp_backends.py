"""fatrop finds what IPOPT finds, by another factorisation of another order of the same rows."""

import casadi as ca
import numpy as np
import pytest

from towline.base.errors import InputError
from towline.models import load
from towline.ocp import Planner, plan
from towline.ocp.nlp.program import build
from towline.ocp.nlp.rows import Mesh
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import Task
from towline.studies.flying import circle as flying_circle
from towline.studies.towing import plans as towing_plans

LINE = {
    "path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.4, 1.3]},
    "duration": 1.5,
    "steps": 30,
    "tube": {"position": "free", "ends": "exact"},
    "objective": {"deviation": 1.0},
}
WAYS = {
    "path": {"kind": "waypoints", "points": [[0, 0, 1], [0.25, 0, 1.1], [0, 0.2, 1.2], [0, 0, 1]]},
    "duration": 4,
    "steps": 17,
    "tube": {"position": 0.1, "ends": "exact", "waypoints": "exact"},
}


def circle():
    given = flying_circle.tasks()[1]
    return load("wang-flying"), given.model_copy(
        update={"base": given.base.model_copy(update={"ends": "rest"}), "steps": 40}
    )


def towing():
    robot = towing_plans.robot("wang-ctmrts", "variable-length")
    return robot, towing_plans.task(robot, "effort", 30)


def crane(**more):
    return lambda: (load("ipanema-1"), Task.model_validate({**LINE, **more}))


CASES = {
    "circle": circle,
    "towing": towing,
    "crane": crane(),
    "smooth": crane(scheme="spline"),
    "middle points": crane(scheme="hermite"),
    "jumps": crane(scheme="constant"),
    "tension rates": crane(objective={"deviation": 1.0, "tension_rate": 500}, limits={"tension_rate": 4000}),
    "soft": crane(limits={"cable_speed": 0.5, "soft": {"cable_speed": 0.1}}),
    "duration and margin": crane(
        duration={"min": 1, "max": 2}, objective={"deviation": 1.0, "time": 1.0, "margin": 100.0, "tension": 1000}
    ),
    "waypoints": lambda: (load("ipanema-1"), Task.model_validate(WAYS)),
}


@pytest.mark.parametrize("case", CASES)
def test_fatrop_finds_the_same_optimum(case):
    robot, task = CASES[case]()
    first = plan(robot, task)
    second = plan(robot, task.model_copy(update={"solver": "fatrop"}))
    assert first.feasible, first.report()
    assert second.feasible, second.report()
    assert second.iterates[-1][1] == pytest.approx(first.iterates[-1][1], rel=1e-5)
    assert second.scenario.duration == pytest.approx(first.scenario.duration, rel=1e-3)
    for one, other in zip(first.audit.motion, second.audit.motion, strict=True):
        assert np.abs(one - other).max() < 2e-2 * max(1.0, np.abs(one).max())


@pytest.mark.parametrize("case", CASES)
def test_rows_of_a_stage_know_only_that_stage(case):
    """The pattern that fatrop factorises: a stage's rows depend on its unknowns, its gaps on the next state too."""
    robot, task = CASES[case]()
    program = build(lay_out(robot, task.model_copy(update={"solver": "fatrop"})), Mesh(6))
    stages = program.stages
    slope = ca.Function("slope", [program.problem["x"]], [ca.jacobian(program.problem["g"], program.problem["x"])])
    pattern = np.column_stack(slope.sparsity_out(0).get_triplet())
    widths = np.array(stages.states) + np.array(stages.controls)
    first = np.concatenate([[0], np.cumsum(widths)])
    gaps = np.array([*stages.states[1:], 0])
    heights = np.concatenate([[0], np.cumsum(gaps + np.array(stages.rows))])
    assert first[-1] == program.problem["x"].numel()
    assert heights[-1] == program.problem["g"].numel()
    for row, column in pattern:
        stage = np.searchsorted(heights, row, side="right") - 1
        own = first[stage] <= column < first[stage + 1]
        place = row - heights[stage]
        its_state = place < gaps[stage] and column == first[stage + 1] + place
        assert own or its_state


def test_fatrop_plans_again_and_tells_what_it_came_to():
    told = []
    planner = Planner(load("ipanema-1"), {**LINE, "solver": "fatrop"})
    first = planner.plan(lambda *seen: told.append(seen))
    again = planner.plan()
    assert first.feasible
    assert again.feasible
    assert first.message == "Solve_Succeeded"
    assert len(told) == 1 == len(first.iterates)
    assert told[0][0] == first.iterations
    assert again.iterations < first.iterations
    np.testing.assert_allclose(again.audit.motion.pose, first.audit.motion.pose, atol=1e-5)


def test_fatrop_says_no_as_ipopt_does():
    """No tensions hold a load beside its frame: an answer with a certificate, not an exception."""
    path = {"kind": "line", "start": [0, 0, 1], "end": [40, 0, 1]}
    for solver in ("ipopt", "fatrop"):
        task = {"path": path, "duration": 2, "steps": 10, "solver": solver}
        task["tube"] = {"position": 0.01, "ends": "free"}  # at rest on the path the ends alone are a proof
        found = plan(load("ipanema-1"), task)
        assert found.status == "not-found"
        assert found.certificate.shortfall > 0


def test_what_fatrop_cannot_do_is_one_line():
    with pytest.raises(InputError, match=r"solver must be ipopt if base\.ends is periodic, got fatrop") as caught:
        plan(load("wang-flying"), flying_circle.tasks()[1].model_copy(update={"solver": "fatrop"}))
    assert "\n" not in str(caught.value)
