"""The rest of a motion, planned from where the robot is, while it moves."""

import numpy as np
import pytest

from towline.base.errors import InputError
from towline.control import State
from towline.models import Dynamics, load
from towline.ocp import MotionStatus, Planner, Task, plan

from .soak.replanning import CIRCLE, RATE, fly
from .told import told

ROBOT = load("wang-flying")
GROUND = load("ipanema-1")
LINE = {"path": {"kind": "line", "start": [0, 0, 1], "end": [0.5, 0.3, 1.2]}, "duration": 2, "steps": 40}
OFF = np.array([0.01, -0.006, 0.008, 0.004, -0.003, 0.005])
CARRIER_OFF = np.array([[0.008, -0.01, 0.006, 0.0, 0.0, 0.0]])


def state_of(planned, time, off=0.0, carriers_off=0.0, **changes):
    """The state of a plan, moved and pushed; its angular velocity too."""
    platform, carriers = planned.scenario.motion(np.array([time]), planned.deviation)
    parts = platform.pose[0] + off, platform.velocity[0] + 2 * off
    parts += carriers.pose[0] + carriers_off, carriers.velocity[0] + 2 * carriers_off
    return State(*parts)._replace(**changes)


def start_of(planned):
    """Pose and velocity at the start, by differences of the audited poses of platform and carriers."""
    times = planned.audit.times
    poses = np.concatenate([planned.audit.motion.pose[:, None], planned.audit.carriers.pose], axis=1)
    step = times[1] - times[0]
    return poses[0], (-11 * poses[0] + 18 * poses[1] - 9 * poses[2] + 2 * poses[3]) / (6 * step)


@pytest.fixture(scope="module")
def circle():
    planner = Planner(ROBOT, CIRCLE)
    return planner, planner.plan()


def test_the_rest_starts_as_measured_and_ends_where_and_when_the_whole_does():
    planner = Planner(ROBOT, CIRCLE)
    whole = planner.plan()
    planner.replan(state_of(whole, 0.0), 0.0)  # builds the program, with a robot that is not off its path
    times, centre, rate = [1.0, 1.4, 6.0], np.array([50, 50, 99]), 0.2 * np.pi
    for time in times:
        state = state_of(whole, time, OFF, CARRIER_OFF)
        rest = planner.replan(state, time, settle=1.5)
        assert rest.feasible
        assert [stage.name for stage in rest.stages] == ["nonlinear program, 100 steps", "audit"]
        poses, velocities = start_of(rest)
        np.testing.assert_allclose(poses, [state.pose, *state.carrier_pose], atol=1e-9)
        np.testing.assert_allclose(velocities, [state.velocity, *state.carrier_velocity], atol=1e-5)
        assert rest.audit.times[-1] == pytest.approx(10 - time, abs=1e-12)
        for mine, theirs in zip(
            (*rest.audit.motion, *rest.audit.carriers), (*whole.audit.motion, *whole.audit.carriers), strict=True
        ):
            np.testing.assert_allclose(mine[-1], theirs[-1], atol=1e-6)
        late = rest.audit.times >= 1.5
        angle = rate * (time + rest.audit.times[late])
        on_circle = centre + np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        np.testing.assert_allclose(rest.audit.motion.pose[late, :3], on_circle, atol=1e-9)
        np.testing.assert_allclose(rest.audit.motion.pose[late, 3:], 0.0, atol=1e-9)


def test_tensions_go_on_as_planned_or_as_measured(circle):
    """Balance the motion at the start with them, by inverse dynamics of the audited motion."""
    planner, whole = circle
    time, audit = 3.0, whole.audit
    planned = [np.interp(time, audit.times, its) for its in audit.tensions.T]
    for tensions in (None, np.array(planned) + np.array([0.2, 0.1, 0.0, 0.3, 0.1, 0.2])):
        rest = planner.replan(state_of(whole, time, OFF, CARRIER_OFF, tensions=tensions), time)
        assert rest.feasible
        motion, carriers = rest.audit.motion, rest.audit.carriers
        w = Dynamics(ROBOT).required_wrench(motion.pose[0], motion.velocity[0], motion.acceleration[0])
        A = Dynamics(ROBOT).wrench_matrix(motion.pose[0], carriers.pose[0])
        np.testing.assert_allclose(np.linalg.solve(A, w), planned if tensions is None else tensions, atol=2e-3)
        rates = np.abs(np.diff(rest.audit.tensions, axis=0)).max() / 1e-3
        assert rates < 20  # [N/s]


def test_a_flight_goes_on_with_each_new_plan_without_a_jump():
    """In gusts, with predictive control; later calls of one program take few iterations and no other stage."""
    controller, flight = fly(np.linspace(0.05, 0.35, 4), duration=0.4)
    assert len(controller.replanned) == 4
    assert all(one.feasible for one in controller.replanned)
    assert max(one.off for one in controller.replanned) > 1e-3
    assert max(one.gap for one in controller.replanned) < 1e-9
    assert max(one.jump for one in controller.replanned) < 1e-3 * RATE
    assert controller.rate_max <= RATE * (1 + 1e-9)
    assert [stage.name for stage in controller.last.stages] == ["nonlinear program, 100 steps", "audit"]
    assert controller.last.iterations <= 6
    assert flight.answered["as planned"] == 400


def test_the_program_with_parameters_has_the_solution_of_one_without(circle):
    """Planned from scratch, from the task as a file has it."""
    planner, whole = circle
    rest = planner.replan(state_of(whole, 4.0, 0.5 * OFF, CARRIER_OFF), 4.0)
    task = Task.model_validate(rest.scenario.task.model_dump(mode="json"))
    again = plan(ROBOT, task)
    assert again.feasible
    assert again.objective == pytest.approx(rest.objective, rel=1e-5)
    np.testing.assert_allclose(again.audit.carriers.pose, rest.audit.carriers.pose, atol=1e-3)


@pytest.mark.parametrize("tube", [{}, {"position": 0.1, "attitude": 0.1}])
def test_the_rest_of_a_line_ends_at_rest_at_its_end(tube):
    """Choose tensions alone, as there is no tube, for a robot with more cables than degrees of freedom."""
    planner = Planner(GROUND, LINE | {"tube": tube})
    whole = planner.plan()
    last, begun = whole, 0.0
    for time in (0.5, 0.9, 1.2):
        expected = [np.interp(time - begun, last.audit.times, its) for its in last.audit.tensions.T]
        state = state_of(last, time - begun, 0.5 * OFF)
        last, begun = planner.replan(state, time, settle=0.5), time
        assert last.feasible
        poses, velocities = start_of(last)
        np.testing.assert_allclose(poses[0], state.pose, atol=1e-8)
        np.testing.assert_allclose(velocities[0], state.velocity, atol=1e-4)
        np.testing.assert_allclose(last.audit.tensions[0], expected, atol=3e-4 * GROUND.force_scale)
        np.testing.assert_allclose(last.audit.motion.pose[-1, :3], LINE["path"]["end"], atol=1e-7)
        assert np.abs(last.audit.motion.velocity[-1]).max() < 1e-7


def test_teams_with_few_cables_go_on_too():
    """Four robots carry the platform with a cable each: balance decides which tensions the rest starts with."""
    robot = load("wang-ctmrts-4")
    x, y, z = robot.home[:3]
    line = {"kind": "line", "start": [x, y, z], "end": [x + 0.2, y, z]}
    tube = {"position": 0.1, "attitude": 0.3}
    planner = Planner(
        robot, {"path": line, "duration": 4, "tube": tube, "base": {"kind": "free"}, "steps": 16, "scheme": "hermite"}
    )
    whole = planner.plan()
    assert whole.feasible
    state = state_of(whole, 1.5, 1e-3 * robot.dof_mask * [1, 1, 1, 0.1, 0.1, 0.1])
    rest = planner.replan(state, 1.5)
    assert rest.feasible
    assert rest.stages[-1].name == "audit"
    poses, _ = start_of(rest)
    np.testing.assert_allclose(poses, [state.pose, *state.carrier_pose], atol=1e-6)
    np.testing.assert_allclose(rest.audit.motion.pose[-1, :3], line["end"], atol=1e-6)


def test_carriers_that_move_as_given_go_on_as_given():
    drive = {"kind": "line", "start": [0, 0, 0], "end": [1, 0, 0]}
    task = {"path": {"kind": "line", "start": [0, 0, -1], "end": [1, 0, -1]}, "duration": 3}
    planner = Planner(ROBOT, task | {"base": {"kind": "given", "paths": {"quad": drive}}})
    whole = planner.plan()
    rest = planner.replan(state_of(whole, 1.2, 0.2 * OFF, tensions=np.full(6, 2.1)), 1.2)
    assert rest.feasible
    later = np.isclose(whole.audit.times[:, None], 1.2 + rest.audit.times[::100], atol=1e-9).argmax(axis=0)
    np.testing.assert_allclose(rest.audit.carriers.pose[::100], whole.audit.carriers.pose[later], atol=1e-9)


def test_a_rest_that_is_impossible_is_proven_and_does_not_count(circle):
    planner, whole = circle
    still = state_of(whole, 9.5)
    fast = still.velocity - np.array([0, 0, 60, 0, 0, 0])
    fallen = planner.replan(still._replace(velocity=fast, tensions=np.full(6, 3.0)), 9.5)
    assert fallen.status is not MotionStatus.FEASIBLE
    assert fallen.certificate is not None
    assert fallen.certificate.shortfall > 1
    assert "wang-flying" in told(fallen)
    assert planner.replan(still, 9.5).feasible


def test_a_state_of_a_controller_is_an_initial_state():
    """Sensors are not exact: what the task fixes is replaced."""
    pose = np.array([0.02, 0.01, 1.0, 0.0, 0.01, 0.0])
    carriers = np.array(GROUND.carrier_home)
    task = LINE | {"tube": {"position": 0.1, "attitude": 0.1}}
    planned = plan(GROUND, task, initial=State(pose, np.full(6, 0.05), carriers + 1e-3, 0 * carriers + 1e-3))
    assert planned.feasible
    poses, velocities = start_of(planned)
    np.testing.assert_allclose(poses, [pose, *carriers], atol=1e-9)
    np.testing.assert_allclose(velocities[0], 0.05, atol=1e-5)
    far = State(pose, np.zeros(6), carriers + 0.02, 0 * carriers)
    with pytest.raises(InputError, match=r"initial: x of the .* must be within 0.01 of .*, which the task prescribes"):
        plan(GROUND, task, initial=far)


def test_a_motion_may_end_in_motion():
    """Pose and velocity at the end by differences of the audited poses."""
    end = {"pose": [0.5, 0.3, 1.15, 0, 0, 0.05], "velocity": [0.3, 0, 0.1, 0, 0, 0]}
    planned = plan(GROUND, LINE | {"tube": {"position": 0.2, "attitude": 0.2}, "final": end})
    assert planned.feasible
    poses, step = planned.audit.motion.pose, planned.audit.times[1]
    np.testing.assert_allclose(poses[-1], end["pose"], atol=1e-9)
    rates = (11 * poses[-1] - 18 * poses[-2] + 9 * poses[-3] - 2 * poses[-4]) / (6 * step)
    np.testing.assert_allclose(rates, end["velocity"], atol=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"state": None}, "state must be an Initial, a State"),
        ({"state": {"pose": [0, 1]}}, "state: pose must be 3 numbers"),
        ({"state": {"pose": [0, 0, 1, 0, 0, 0], "tensions": [1.0]}}, "initial.tensions must have a number for each"),
        ({"time": -0.1}, "time must"),
        ({"time": 2.0}, "time must"),
        ({"settle": 0}, "settle must"),
        ({"progress": 1}, "progress must"),
    ],
)
def test_what_does_not_fit_is_one_line(change, message):
    planner = Planner(GROUND, LINE | {"tube": {"position": 0.1}})
    with pytest.raises(InputError, match="replan must be called after a feasible plan"):
        planner.replan({"pose": [0, 0, 1, 0, 0, 0]}, 0.0)
    planner.plan()
    with pytest.raises(InputError, match=message) as caught:
        planner.replan(**({"state": {"pose": [0, 0, 1, 0, 0, 0]}, "time": 0.5} | change))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"final": {"acceleration": 0}}, "final.acceleration must be left out without final.pose or final.velocity"),
        ({"final": {"pose": [1, 0, 1, 0, 0, 0]}}, "final: x of the platform must be"),
        ({"final": {"carrier_pose": [[0] * 6] * 2}}, "final.carrier_pose must have a row"),
    ],
)
def test_tasks_whose_ends_do_not_fit_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        plan(GROUND, LINE | change)
