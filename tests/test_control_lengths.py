"""Winches that take lengths: a robot keeps its plan although stiffness and lag of its cables are not as in its file."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import InputError, load, plan, simulate
from towline.control import ANSWERS, ComputedTorque, LengthControl, Reference, State, references
from towline.control.controller import HOLD, PLANNED
from towline.control.length_gains import LengthGains
from towline.models import Dynamics, Robot
from towline.models.points import angles

EA = 2e5
PERIOD = 2e-3  # [s]: twice the default, which halves the processor time


def elastic(name, stiffness, damped=0.002):
    data = load(name).model_dump(mode="json", exclude_none=True)
    for cable in data["cables"]:
        cable |= {"stiffness": stiffness, "damping": damped * stiffness}
    return Robot(**data)


def wound(command):
    assert command.lengths is not None
    return command.lengths


@pytest.fixture(scope="module")
def model():
    return elastic("cogiro", EA)


@pytest.fixture(scope="module")
def motion(model):
    found = plan(model, {"path": {"kind": "line", "start": [-2, -1, 1], "end": [2.5, 1.5, 2]}, "duration": 3.4})
    assert np.linalg.norm(found.trajectory.velocity.values[:, :3], axis=1).max() > 2.3
    return found


@pytest.mark.parametrize(("factor", "lag"), [(0.8, 0.02), (1.2, 0.02)])
def test_it_keeps_the_plan_with_other_cables_and_winches(model, motion, factor, lag):
    differs = {"winch_lag": lag, "stiffness": factor}
    run = simulate(model, motion, LengthControl(model, lag=lag), duration=3.6, period=2 * PERIOD, mismatch=differs)
    assert np.sqrt(np.mean(run.error**2)) < 2e-3
    assert run.error.max() < 5e-3
    assert run.answered["as planned"] == len(run.references)


def test_dampers_have_their_share_of_a_tension_that_jumps():
    """By the law of a spring and a damper side by side, t = EA e / L0 + C de/dt, of a platform at rest."""
    robot, dt = elastic("planar-4", 3e4), 1e-4  # 60 N s/m: a strain follows its tension after some ms
    far = Dynamics(robot).cable_lengths(robot.home)
    control, lengths = LengthControl(robot), []
    pulls = [20.0 + np.arange(4), 60.0 - 5 * np.arange(4)]  # [N], before and after
    for k in range(200):
        planned = Reference(robot.home, np.zeros(6), np.zeros(6), *np.zeros((3, 1, 6)), pulls[k >= 100])
        lengths.append(wound(control.step(k * dt, State(robot.home, np.zeros(6), *np.zeros((2, 1, 6))), planned)))
    L = np.array(lengths)
    tensions = 3e4 * (far / L[1:] - 1) - 60 * np.diff(L, axis=0) / dt
    assert np.abs(tensions[:99] - pulls[0]).max() < 1e-6
    assert np.abs(tensions[99:] - pulls[1]).max() < 0.03 * 40  # of the jump


def test_it_keeps_the_plan_on_another_plant():
    """In MuJoCo, in gusts of 3 m/s on 4 m^2, with winches that lag by 20 ms: the faster half of 3.6 m in 4 s."""
    pytest.importorskip("mujoco", reason="the extra 'mujoco' is not installed")
    from .soak.control_mujoco import cogiro, fly

    task = replace(whole := cogiro(), references=whole.references[:2200:2], period=2 * whole.period)
    stretch = {"stiffness": 0.8 * EA, "damping": 0.8 * 500.0}
    flown = fly(task, LengthControl(task.robot, stiffness=EA, lag=0.02), winch="lengths", lag=0.02, **stretch)
    assert flown.rms < 2e-3
    assert flown.error.max() < 5e-3
    assert (flown.answered == PLANNED).all()


def test_without_lead_the_lag_is_a_delay(model, motion):
    """Feed-forward alone: the error is the lag times the speed."""
    late, given = {"winch_lag": 0.02}, {"duration": 3.4, "period": PERIOD}
    run = simulate(model, motion, LengthControl(model, proportional=0, integral=0), mismatch=late, **given)
    speed = max(np.linalg.norm(reference.velocity[:3]) for reference in run.references)
    assert run.error.max() == pytest.approx(0.02 * speed, rel=0.1)
    for period in (PERIOD, 0.02):  # also where winches hold each length for as long as they lag
        led = LengthControl(model, lag=0.02, proportional=0, integral=0)
        assert (
            simulate(model, motion, led, mismatch=late, **given | {"period": period}).error.max()
            < 0.005 * run.error.max()
        )


def test_periods_in_which_winches_move_too_unevenly_are_reported_before_a_run():
    """Winches with a lag of 4 ms that hold a length for 30 ms: how far they are ahead of a ramp, from their samples."""
    lag, period, speed = 0.004, 0.03, 0.2
    into = np.linspace(0, period, 3001)
    ahead = (speed * period * (1 - np.exp(-into / lag)) / (1 - np.exp(-period / lag)) - speed * into).max()
    robot = elastic("point-mass-3", 2e4)
    far = Dynamics(robot).cable_lengths(robot.home)
    along = Dynamics(robot).length_jacobian(robot.home)[0] @ np.eye(6)[2]
    swing = 2e4 * ahead * abs(along) / far[0]
    control, still = LengthControl(robot, lag=lag), np.zeros_like(robot.carrier_home)
    for share, warns in ((0.9, True), (1.1, False)):
        pulls = np.full(3, share * swing)
        begin = Reference(robot.home, speed * np.eye(6)[2], np.zeros(6), robot.carrier_home, still, still, pulls)
        line = [begin, begin._replace(pose=robot.home + speed * period * np.eye(6)[2])]
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            control.follow(line, period)
        assert bool(said) == warns
        assert not warns or "lengths commanded every 0.03 s would change tensions by up to" in str(said[0].message)


@pytest.mark.parametrize("name", ["cogiro", "ipanema-1", "planar-4"])
def test_at_rest_the_lengths_give_the_planned_tensions(name):
    """Hooke's law at the pose: t = EA (l - L0) / L0, with distances of the points alone."""
    robot = elastic(name, EA)
    run = simulate(robot, robot.home, LengthControl(robot), duration=0.5)
    planned = run.references[0].tensions
    assert planned is not None
    controller = LengthControl(robot)
    state = State(robot.home, np.zeros(6), robot.carrier_home, np.zeros_like(robot.carrier_home))
    commanded = wound(controller.step(0.0, state, run.references[0]))
    distances = np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1)
    np.testing.assert_allclose(EA * (distances - commanded) / commanded, planned, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(run.record.tensions[-1], planned, rtol=1e-3, atol=0.1)
    assert run.error.max() < 1e-4


def test_a_constant_error_of_the_model_is_integrated_away(model):
    true = elastic("cogiro", 0.8 * EA)
    run = simulate(true, true.home, LengthControl(model), duration=4.0, period=2 * PERIOD)
    assert run.error.max() > 1e-3
    assert run.error[-1] < 2e-5


def test_an_old_state_is_compared_with_the_plan_of_its_time(model, motion):
    late = {"delay": 0.02}
    stamped = {"noise": {**late, "stamped": True}, "period": 2 * PERIOD}
    known = simulate(model, motion, LengthControl(model), **stamped, duration=3.7)
    assert known.error.max() < 5e-3  # a fifth of what is left if the age is not known
    assert known.error[-25:].max() < 1e-3
    other = simulate(elastic("cogiro", 1.2 * EA), motion, LengthControl(model), **stamped, duration=3.4)
    assert other.error.max() < 0.012


def test_gains_for_another_age_are_not_kept_quiet(model, motion):
    late = {"delay": 0.02}
    other = elastic("cogiro", 0.8 * EA)
    run = simulate(other, motion, LengthControl(model), noise=late, duration=3.4, period=PERIOD)
    assert not run.passed
    assert run.answered["hold"] > 0


def test_beyond_its_bound_it_says_hold(model):
    controller = LengthControl(model, most=1e-3)
    true = elastic("cogiro", 0.5 * EA)
    run = simulate(true, true.home, controller, duration=1.0)
    assert run.record.answered[-1] == HOLD
    state = State(model.home, np.zeros(6), model.carrier_home, np.zeros_like(model.carrier_home))
    controller.reset()
    assert controller.step(0.0, state, run.references[0]).answered == PLANNED


@pytest.mark.parametrize("lag", [0.0, 0.01])
@pytest.mark.parametrize(("missing", "measured"), [(np.nan, None), (np.inf, None), (0.5, -1.5)])
def test_without_a_pose_or_with_an_old_one_the_last_correction_stays(model, motion, lag, missing, measured):
    controller, reference = LengthControl(model, lag=lag, proportional=1.0, integral=0.0), references(motion, 0.1)[0]
    still = np.zeros(6), model.carrier_home, np.zeros_like(model.carrier_home)
    first = controller.step(0.0, State(reference.pose + 1e-3 * np.eye(6)[2], *still), reference)
    assert first.answered == PLANNED
    for time, answered in ((0.1, PLANNED if measured is None else HOLD), (0.21, HOLD)):
        lost = controller.step(time, State(np.full(6, missing), *still, time=measured), reference)
        assert lost.answered == answered
        np.testing.assert_allclose(wound(lost), wound(first))
    assert controller.step(0.3, State(reference.pose, *still), reference).answered == PLANNED


def test_rows_are_as_alone(model, motion):
    wanted = references(motion, 0.1)[:5]
    rng = np.random.default_rng(0)
    off = 1e-3 * rng.normal(size=(3, 6))
    together, alone = LengthControl(model, lag=0.01), [LengthControl(model, lag=0.01) for _ in off]
    for k, reference in enumerate(wanted):
        still = np.zeros((3, 6)), np.tile(model.carrier_home, (3, 1, 1)), np.zeros((3, 1, 6))
        both = together.step(0.1 * k, State(reference.pose + off, *still), reference)
        for row, controller in enumerate(alone):
            state = State(reference.pose + off[row], *(part[row] for part in still))
            one = controller.step(0.1 * k, state, reference)
            np.testing.assert_allclose(wound(both)[row], wound(one), rtol=1e-13)
            assert one.answered == both.answered[row]


def test_robots_of_a_batch_have_poses_of_their_own_ages(model, motion):
    """Poses that are held tell their age, also beside robots whose poses changed at other times, or end."""
    together, alone = LengthControl(model), [LengthControl(model) for _ in range(4)]
    still = np.zeros(6), model.carrier_home, np.zeros_like(model.carrier_home)
    wanted = references(motion, 0.02)[:30]
    for k, reference in enumerate(wanted):
        poses = [wanted[max(k - (k + row) % 5, 0)].pose for row in range(3)]
        poses.append(reference.pose + (1e-3 if k < 10 else np.nan))
        both = together.step(0.02 * k, State(np.stack(poses), *(np.stack([one] * 4) for one in still)), reference)
        for row, controller in enumerate(alone):
            one = controller.step(0.02 * k, State(poses[row], *still), reference)
            np.testing.assert_allclose(wound(both)[row], wound(one), rtol=1e-13)
            assert both.answered[row] == one.answered
    nobody = State(np.zeros((0, 6)), *(np.zeros((0, *one.shape)) for one in still))
    assert wound(LengthControl(model).step(0.0, nobody, reference)).shape == (0, 8)


def test_angles_are_compared_round_the_circle(model):
    pose = np.r_[model.home[:5], np.pi - 1e-3]
    state = State(np.r_[model.home[:5], -np.pi + 1e-3], np.zeros(6), model.carrier_home, np.zeros((1, 6)))
    reference = references_at_rest(model, pose)
    near = wound(LengthControl(model).step(0.0, state, reference))
    exact = wound(LengthControl(model).step(0.0, state._replace(pose=pose), reference))
    assert 0 < np.abs(near - exact).max() < 0.02


def references_at_rest(robot, pose):
    still = np.zeros(6), np.zeros(6)
    carriers = robot.carrier_home, np.zeros_like(robot.carrier_home), np.zeros_like(robot.carrier_home)
    return Reference(pose, *still, *carriers, np.full(robot.m, 100.0))


def test_wrong_calls_are_one_line(model):
    with pytest.raises(InputError, match=r"drive must be 'lengths' for a controller that commands lengths, got 'tensi"):
        simulate(model, model.home, LengthControl(model), duration=0.01, drive="tensions")
    with pytest.raises(InputError, match="flying carrier 'quad1'"):
        LengthControl("multi-quadrotor-3")
    with pytest.raises(InputError, match="stiffness must be given, as an argument or in the robot's file"):
        LengthControl("cogiro")
    assert LengthControl("cogiro", stiffness=EA).robot.m == 8
    # Its gains are for cables that yield: corrections of the others would grow from step to step.
    for name in ("cogiro", "fast"):
        with pytest.raises(InputError, match=r"cables\[0\]\.stiffness must be in the robot file of .* got none"):
            simulate(name, load(name).home, LengthControl(name, stiffness=EA), duration=0.01)
    with pytest.raises(InputError, match="stiffness"):
        LengthControl(model, stiffness=-1)
    with pytest.raises(InputError, match="lag"):
        LengthControl(model, lag=-1)
    state = State(model.home, np.zeros(6), model.carrier_home, np.zeros((1, 6)))
    reference = references_at_rest(model, model.home)
    controller = LengthControl(model)
    with pytest.raises(InputError, match=r"reference\.tensions must be planned"):
        controller.step(0.0, state, reference._replace(tensions=None))
    controller.step(0.0, state, reference)
    with pytest.raises(InputError, match="time must be"):
        controller.step(0.0, state, reference)


@pytest.mark.parametrize("huge", [1e300, 1.7e308])
def test_a_step_with_huge_numbers_leaves_no_trace(model, huge):
    """A state that overflows is not followed; a reference is refused. The next command is as if neither had come."""
    state = State(model.home, np.zeros(6), model.carrier_home, np.zeros((1, 6)))
    reference = references_at_rest(model, model.home)
    controller = LengthControl(model)
    usual = controller.step(0.0, state, reference).lengths
    far = controller.step(0.001, state._replace(pose=np.full(6, huge)), reference)
    assert far.answered == ANSWERS.index("hold")
    assert np.abs(far.lengths - usual).max() <= 0.05 * model.length + 1e-12
    with pytest.raises(InputError, match="reference must have finite lengths of cables, got pose"):
        controller.step(0.002, state, reference._replace(pose=np.full(6, huge)))
    np.testing.assert_allclose(controller.step(0.003, state, reference).lengths, usual, rtol=1e-12)


@pytest.mark.parametrize("pitch", [1.0, np.pi / 2, -np.pi / 2])
def test_axes_of_the_platform_frame_do_not_change_lengths(pitch):
    """A platform, whose CoM is off its origin, with two frames: at a pitch of 90 degrees roll and yaw are one angle."""
    data, com = elastic("cogiro", EA).model_dump(mode="json"), np.array([0.1, 0.2, 0.3])
    axes = Rotation.from_euler("ZYX", [0.4, pitch, 0.2])
    error, still = np.array([0.02, -0.01, 0.03, 0.01, 0.02, -0.03]), np.zeros((1, 6))
    found = []
    for attitude in (Rotation.identity(), axes):
        place = [0, 0, 2, *angles(attitude.as_matrix()).tolist()]
        body = {"com": attitude.inv().apply(com).tolist(), "inertia": [50, 50, 50, 0, 0, 0], "home": place}
        cables = [one | {"attachment": attitude.inv().apply(one["attachment"]).tolist()} for one in data["cables"]]
        own = Robot.model_validate(data | {"platform": data["platform"] | body, "cables": cables})
        turned = (Rotation.from_rotvec(error[3:]) * attitude).as_matrix()
        where, reference = np.append(error[:3] + own.home[:3], angles(turned)), references_at_rest(own, own.home)
        controller = LengthControl(own, proportional=1, integral=5, most=1)
        for time in (0.0, 0.01):
            command = controller.step(time, State(where, still[0], own.carrier_home, still), reference)
        assert command.answered == 0
        found.append(wound(command))
    np.testing.assert_allclose(*found, atol=1e-9)


def test_other_controllers_keep_their_drive(model):
    run = simulate(model, model.home, ComputedTorque(model), duration=0.01)
    assert run.passed


@pytest.mark.parametrize(
    ("name", "stiffness", "damping", "period"),
    [
        ("wang-ctmrts-4", None, None, 1e-3),  # rigid
        ("wang-flying", 13e3, 200.0, 5e-3),  # whose dampers tie it for a step
        ("wang-flying", 325e3, 20.0, 1e-3),  # with too little damping for a large P
    ],
)
def test_cables_that_do_not_yield_are_corrected_by_less_than_the_error(name, stiffness, damping, period):
    """With P = 4 each step made an error four times as large: up to 1.7 m. The push alone would move a mass by 4 mm."""
    data = load(name).model_dump(mode="json", exclude_none=True)
    for cable in data["cables"]:
        cable |= {} if stiffness is None else {"stiffness": stiffness, "damping": damping}
    robot = Robot(**data)
    events = [f"push {0.02 * robot.force_scale} 0 0 at 0.2 for 0.2"]
    run = simulate(robot, robot.home, LengthControl(robot), duration=1.0, period=period, events=events)
    assert run.error.max() < 0.02 * 9.81 * 0.2**2 / 2
    assert run.answered["as planned"] == len(run.error)


def test_a_platform_that_turns_slowly_comes_to_rest():
    """ipanema-1's attachments are 85 mm from its centre: it turns at 1 Hz, and I = 10 doubles this every second."""
    robot = elastic("ipanema-1", 2e5)
    push = {"kind": "push", "at": 0.1, "duration": 0.1, "force": [0, 0, 0], "moment": [1, 1, 1]}
    run = simulate(robot, robot.home, LengthControl(robot), duration=1.6, events=[push])
    turned = np.abs(run.record.motions[:, 0, 3:6] - robot.home[3:])
    assert (turned[950:].max(axis=0) < 1.03 * turned[300:950].max(axis=0)).all()


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_a_small_platform_on_long_cables_has_room_for_their_stretch(factor):
    """5 % of ipanema-1's length is 4 mm, less than the error by a wrong stiffness in 2.6 m of cable under 700 N."""
    controller = LengthControl(elastic("ipanema-1", 1e5))
    assert controller._most > abs(1 - 1 / factor) * 2.6 * 700 / 1e5


def test_cables_without_damping_are_warned_of():
    """From rest and rounding alone the oscillation grows by 1e12 within 3 s; without corrections it does not."""
    frame = np.array([[x, y, z] for z in (3, 0) for x, y in ((-2, -2), (2, -2), (2, 2), (-2, 2))])
    ends = np.sign(frame - [0, 0, 1.5]) * [0.1, 0.1, -0.1]
    common = {"carrier": "frame", "t_min": 20, "t_max": 2000, "stiffness": 5e4}
    cables = [
        {"anchor": one, "attachment": end} | common for one, end in zip(frame.tolist(), ends.tolist(), strict=True)
    ]
    platform = {"mass": 10, "inertia": [0.2, 0.2, 0.3, 0, 0, 0], "home": [0, 0, 1, 0, 0, 0]}
    whole = {
        "name": "bare",
        "source": "a test",
        "platform": platform,
        "carriers": [{"name": "frame", "kind": "ground"}],
    }
    bare = Robot.model_validate(whole | {"cables": cables})
    with pytest.warns(UserWarning, match=r"cables\[0\]\.damping is missing in the robot file of 'bare'"):
        run = simulate(bare, bare.home, LengthControl(bare, damping=100.0), duration=3.2, period=PERIOD)
    assert run.error[0] < 1e-12
    assert run.error[-1] > 1e-3
    for cable in cables:
        cable["damping"] = 100.0
    damped = Robot.model_validate(whole | {"cables": cables})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert simulate(damped, damped.home, LengthControl(damped), duration=0.5, period=PERIOD).error.max() < 1e-9
        still = simulate(bare, bare.home, LengthControl(bare, proportional=0, integral=0), duration=1.5, period=PERIOD)
    assert still.error.max() < 1e-9
    with pytest.warns(UserWarning, match=r"lengths of 'bare' are not corrected .* damping of 0 N s/m would grow"):
        calm = LengthControl(bare)
    assert simulate(bare, bare.home, calm, duration=1.5, period=PERIOD).error.max() < 1e-9


@pytest.mark.parametrize(("name", "stiffness", "delay"), [("ipanema-1", 1.4e5, 0.03), ("planar-4", 1e5, 0.004)])
def test_late_poses_on_cables_of_little_damping_let_no_oscillation_grow(name, stiffness, delay):
    """With P = 0.3 and I = 2 for all of them, a push of 5 % of the weight made errors of up to 270 mm within 3 s."""
    robot = elastic(name, stiffness, damped=0.0005)
    push, axis = np.zeros(3), int(robot.dof_mask.argmax())
    push[axis] = 0.05 * robot.force_scale
    events = [{"kind": "push", "at": 0.1, "duration": 0.2, "force": push.tolist()}]
    run = simulate(
        robot,
        robot.home,
        LengthControl(robot),
        duration=1.8,
        period=PERIOD,
        noise={"delay": delay, "stamped": True},
        events=events,
    )
    assert run.error[650:].max() < run.error[150:400].max()
    assert run.error.max() < 8e-3


def test_noise_of_known_sensors_hardly_changes_tensions(model):
    """With P = 4 springs change tensions by 4 EA / l times 1 mm, and dampers by far more: 17 % of the range."""
    sensors = {"position": 1e-3}
    run = simulate(model, model.home, LengthControl(model, sensors=sensors), duration=0.3, noise=sensors)
    ripple = run.record.tensions.std(axis=0) / (model.t_max - model.t_min)
    assert ripple.max() < 0.01


def test_a_known_delay_without_stamps_is_the_age_of_the_pose(model, motion):
    late = {"delay": 0.02}
    known = simulate(model, motion, LengthControl(model, sensors=late), noise=late, period=PERIOD, duration=3.4)
    assert known.error.max() < 5e-3


@pytest.mark.parametrize(
    "sensors", [{"rate": 150}, {"rate": 7, "stamped": True}, {"rate": 7, "delay": 0.15, "stamped": True}]
)
def test_held_and_old_poses_of_a_robot_as_in_its_file_change_no_tensions(model, motion, sensors):
    """They agree with the plan of their time. Compared with that of now, held ones changed tensions by up to 13 kN."""
    run = simulate(model, motion, LengthControl(model), noise=sensors, period=PERIOD, duration=1.5)
    planned = np.array([each.tensions for each in run.references[: run.lasted]])
    assert np.abs(run.record.tensions - planned).max() < 1e-3 * (model.t_max - model.t_min).max()


@pytest.mark.parametrize("damping", [None, 300.0])
def test_a_circle_on_stiff_cables_begins_and_goes_on_with_its_tensions(damping):
    """Lengths that were a period late, by 0.45 mm at 0.45 m/s, would change tensions by 150 N on these cables."""
    data = load("planar-4").model_dump()
    data["cables"] = [cable | {"stiffness": 4e5, "damping": damping} for cable in data["cables"]]
    robot = Robot.model_validate(data)
    circle = {"kind": "circle", "centre": [0, 0, 0.75], "radius": 0.15, "rate": 3.0, "axis": [0, 1, 0]}
    with warnings.catch_warnings(record=damping is None):  # that nothing is corrected
        run = simulate(robot, circle, LengthControl(robot), duration=1.0)
    assert run.passed, run.failures
    assert run.error.max() < 1e-4


@pytest.mark.parametrize(("period", "gains"), [(0.02, (0.5, 0.0)), (0.02, (0.2, 5.0)), (0.05, (0.3, 0.0))])
def test_the_growth_of_oscillations_is_that_of_a_simulation(period, gains):
    """Of 5 kg on three cables, pushed so little that none becomes slack, over 140 periods."""
    robot = elastic("point-mass-3", 5e3)  # with a damping of 10 N s/m
    control = LengthControl(robot, proportional=gains[0], integral=gains[1])
    push = [f"push 0.02 0.01 0.03 at {period} for {period}"]
    run = simulate(robot, robot.home, control, period=period, duration=160 * period, events=push)
    error = np.linalg.norm(run.record.motions[:160, 0, :3] - robot.home[:3], axis=1)
    means = np.sqrt(np.mean(np.square(error.reshape(-1, 20)), axis=1))
    expected = LengthGains(robot, control.stiffness, np.full(3, 10.0), 0.0, None)._growth(period, 0.0, *gains, 1.0)
    assert expected > 0.3
    assert np.log(means[-1] / means[0]) / (140 * period) == pytest.approx(expected, rel=0.1)
