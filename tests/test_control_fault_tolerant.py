"""A team that loses the thrust of a carrier: the formation of the others, and how they fly on."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from towline import InputError, load, plan, simulate
from towline.cli.main import app
from towline.control import FaultTolerant, Reference, State, fault_tolerant
from towline.control.watch import lost_carrier
from towline.models import Robot
from towline.statics.distribution import tensions
from towline.statics.formation import formation

pytestmark = pytest.mark.usefixtures("stable_at_home")


def without(robot, index):
    data, lengths = robot.model_dump(), robot.fixed_lengths
    cables = np.flatnonzero(robot.carrier_of_cable != index)
    data["cables"] = [{**data["cables"][i], "length": float(lengths[i])} for i in cables]
    data["carriers"] = [one for i, one in enumerate(data["carriers"]) if i != index]
    return Robot.model_validate(data), lengths[cables]


@pytest.fixture(scope="module")
def prepared(stable_at_home):
    """Return a controller that is prepared for the loss of one carrier only, which takes less time."""
    usual = fault_tolerant._without
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fault_tolerant, "_without", lambda *given: usual(*given) if given[1] == 0 else "")
        return FaultTolerant("multi-quadrotor-4")


def unbalanced(robot, lengths, found):
    """Return what Newton's equations lack for load and carriers, and the errors of the lengths, all written here."""
    gravity = np.array(robot.gravity)
    turn = Rotation.from_euler("ZYX", found.pose[:2:-1])
    wrench, lacks, off = np.zeros(6), [], []
    wrench[:3] = robot.platform.mass * gravity
    for index, carrier in enumerate(robot.carriers):
        pull, place = np.zeros(3), found.carrier_pose[index]
        own = Rotation.from_euler("ZYX", place[:2:-1])
        for i in np.flatnonzero(robot.carrier_of_cable == index):
            arm = turn.apply(np.array(robot.cables[i].attachment) - robot.platform.com)
            end = found.pose[:3] + turn.apply(robot.cables[i].attachment)
            along = place[:3] + own.apply(robot.cables[i].anchor) - end
            off.append(np.linalg.norm(along) - lengths[i])
            force = found.tensions[i] * along / np.linalg.norm(along)
            wrench += np.concatenate([force, np.cross(arm, force)])
            pull -= force
        thrust = own.inv().apply(-pull - carrier.body.mass * gravity)
        lacks.append(thrust[:2])
        assert carrier.thrust_min < thrust[2] < carrier.thrust_max
    return np.abs(wrench).max(), np.abs(lacks).max(), np.abs(off).max()


@pytest.mark.parametrize(("name", "index"), [("multi-quadrotor-4", 0), ("multi-quadrotor-6", 2)])
def test_a_formation_is_in_balance_and_near(name, index):
    robot = load(name)
    rest, lengths = without(robot, index)
    home = np.delete(robot.carrier_home, index, axis=0)
    found = formation(rest, robot.home, home, lengths)
    assert found.exists
    np.testing.assert_allclose(unbalanced(rest, lengths, found), 0, atol=1e-5)
    assert (found.tensions > rest.t_min).all()
    assert (found.tensions < rest.t_max).all()
    assert np.linalg.norm(found.carrier_pose[:, :3] - home[:, :3], axis=1).max() < 0.5
    assert np.abs(found.pose[3:5]).max() < 0.3


@pytest.mark.filterwarnings("ignore:multi-quadrotor-3 cannot rest without quad[23]")
def test_where_no_formation_exists_the_missing_wrench_is_named():
    """A load on two cables at one side hangs from them, and tilts further than it may."""
    robot = load("multi-quadrotor-3")
    rest, lengths = without(robot, 0)
    found = formation(rest, robot.home, robot.carrier_home[1:], lengths)
    assert not found.exists
    lacks = unbalanced(rest, lengths, found._replace(missing=np.zeros(6)))[0]
    assert lacks == pytest.approx(np.abs(found.missing).max(), rel=1e-4)
    assert lacks > 1.0
    missing = ", ".join(f"{one:.4g}" for one in np.round(found.missing[:3], 9) + 0.0)
    with pytest.warns(UserWarning, match=f"cannot rest without quad1: a force of {missing} N and"):
        controller = FaultTolerant(robot)
    run = simulate(robot, robot.home, controller, duration=0.1, events=["lose quad1 at 0.05"])
    assert controller.lost.reason == "quad1 has lost its thrust: the others cannot carry the platform"
    assert 0.05 < controller.lost.time < 0.08
    assert not run.record.released.any()


def test_the_others_carry_the_load_to_rest(prepared):
    name, lost, most = "multi-quadrotor-4", "quad1", 0.2
    robot, controller = load(name), prepared
    given = {"duration": 2.3, "period": 4e-3, "events": [f"lose {lost} at 0.2"], "tolerance": most}
    run = simulate(robot, robot.home, controller, **given)
    cable = int(lost[-1]) - 1
    assert run.error.max() < most
    assert run.error[-1] < 5e-3
    assert np.linalg.norm(run.record.motions[-1, 0, 6:9]) < 0.02
    at = run.times[run.record.released[:, cable].argmax()]
    assert 0.2 < at < 0.23
    assert controller.lost.time == pytest.approx(at)
    assert not run.record.released[:, np.arange(robot.m) != cable].any()
    assert (run.record.tensions[run.times >= at, cable] == 0).all()
    assert f"cable {cable + 1} was released at {at:.4g} s" in run.report()
    np.testing.assert_array_equal(run.trajectory["cut"].values[:, cable], run.times >= at)
    assert run.answered["not as modelled"] == 0


def kite(turned):
    """Four carriers, the second and fourth turned by an angle towards the first: the CoM is beyond all but the third.

    Newton's equations at rest: tensions balance along both axes if those of first and third differ by the angle's sine.
    """
    data, tan, height = load("multi-quadrotor-4").model_dump(mode="json"), 0.4, 1.2
    angles = np.array([0.0, np.pi / 2 - turned, np.pi, 3 * np.pi / 2 + turned])
    pulls = data["platform"]["mass"] * 9.81 / 4 * (1 + np.sin(turned) * np.array([-1, 0, 1, 0]))
    for carrier, cable, angle, pull in zip(data["carriers"], data["cables"], angles, pulls, strict=True):
        x, y = np.cos(angle), np.sin(angle)
        force = np.array([tan * pull * x, tan * pull * y, pull + carrier["mass"] * 9.81])
        lean = [-np.arcsin(force[1] / np.linalg.norm(force)), np.arctan2(force[0], force[2]), 0.0]
        far = 0.3 + tan * height
        carrier["home"] = [far * x, far * y, 0.03 + height, *lean]
        cable |= {"attachment": [0.3 * x, 0.3 * y, 0.03], "length": height * float(np.hypot(1, tan))}
    data["platform"]["home"] = [0.0] * 6
    return Robot.model_validate(data)


def test_a_formation_that_is_not_reached_is_refused_at_construction(monkeypatch):
    """Without the third carrier the load tips over before the others can lean their cables: it was 3 m off."""
    robot, usual, found = kite(0.2), fault_tolerant._without, []

    def kept(robot, index, *given):
        if index == 2:
            found.append(usual(robot, index, *given))
        return found[-1] if index == 2 else ""

    monkeypatch.setattr(fault_tolerant, "_without", kept)
    monkeypatch.setattr(fault_tolerant, "LEVELS", fault_tolerant.LEVELS[:2])  # four are refused, too, and take longer
    with pytest.warns(UserWarning, match="multi-quadrotor-4 loses its load without quad3: a formation exists"):
        controller = FaultTolerant(robot)
    given = {"period": 2e-3, "events": ["lose quad3 at 0.1"], "tolerance": 0.2}
    run = simulate(robot, robot.home, controller, duration=0.2, **given)
    assert controller.lost.reason == "quad3 has lost its thrust: the others cannot carry the platform"
    assert not run.record.released.any()
    controller._rests[2] = found[0]
    run = simulate(robot, robot.home, controller, duration=2.0, **given)
    assert run.record.released.any()
    assert run.error.max() > 0.5


def test_a_moving_load_on_another_plant_is_carried_on(prepared):
    """In MuJoCo, in gusts, at up to 1.1 m/s: the plan goes on with the others."""
    pytest.importorskip("mujoco", reason="the extra 'mujoco' is not installed")
    from .soak.control_mujoco import TEAMS, Task, fly
    from .soak.mujoco_plant import Hardware

    robot, times = load("multi-quadrotor-4"), 2e-3 * np.arange(700)
    s = np.minimum(times / 2.0, 1.0)
    way = np.stack(
        [
            1.2 * s**3 * (10 - 15 * s + 6 * s**2),
            1.2 / 2 * 30 * (s * (1 - s)) ** 2,
            1.2 / 4 * 60 * s * (1 - s) * (1 - 2 * s),
        ]
    )
    along = np.zeros((3, len(times), 6))
    along[..., 0] = way
    pulls = tensions(robot, robot.home, method="soft-wrench").tensions
    references = [
        Reference(
            robot.home + along[0, k],
            *along[1:, k],
            robot.carrier_home + along[0, k],
            *(np.tile(one[k], (4, 1)) for one in along[1:]),
            pulls,
        )
        for k in range(len(times))
    ]
    task = Task(robot, references, None, Hardware(stiffness=2e4, damping=50.0), (2, 1.5, 0.3), 1.0, 0.1, 2e-3)
    controller = prepared
    flown = fly(task, controller, lost=(0, 0.5))
    assert flown.lasted
    assert 0.5 < controller.lost.time < 0.53
    assert 0.05 < flown.error.max() < 0.15  # 1.2 m without a new formation
    assert np.argmax(flown.error) < 650  # and on its way back
    # Lags, noise and delays are no loss.
    fly(replace(task, references=references[:50]), controller, **TEAMS["all"])
    assert controller.lost is None


def test_many_runs_have_the_releases_of_one(prepared):
    controller = prepared
    robot, kept = controller.robot, {"duration": 0.08, "events": ["lose quad1 at 0.05"], "tolerance": 0.1}
    alone = simulate(robot, robot.home, controller, **kept)
    many = simulate(robot, robot.home, controller, **kept, runs=2)
    np.testing.assert_allclose(many["slack_s"].values, alone.slack_s)
    np.testing.assert_allclose(many["tension_min"].values, alone.figures_of_merit()["tension_min"])
    assert alone.record.released.any()


def test_wrong_input_is_one_line(prepared, tmp_path, monkeypatch):
    for name, reason in (("wang-flying", "which does not fly"), ("cogiro", "which does not fly")):
        with pytest.raises(InputError, match=reason):
            FaultTolerant(name)
    controller = prepared
    controller.reset()
    robot, still = controller.robot, np.zeros_like(controller.robot.carrier_home)
    state = State(robot.home, np.zeros(6), robot.carrier_home, still)
    rest = Reference(robot.home, *np.zeros((2, 6)), robot.carrier_home, still, still, None)
    controller.step(0.0, state, rest)
    controller._lose(0.001, 0, state, rest)
    for wrong in (state._replace(carrier_pose=still[:2]), state._replace(pose=3)):
        with pytest.raises(InputError, match=r"state\."):
            controller.step(0.001, wrong, rest)
    monkeypatch.chdir(tmp_path)
    line = {"kind": "line", "start": [0, 0, -1], "end": [0.03, 0, -1.05]}
    plan(load("wang-flying"), {"path": line, "duration": 0.3}).save("step.nc")
    refused = CliRunner().invoke(app, ["simulate", "wang-flying", "step.nc", "--controller", "fault-tolerant"])
    assert isinstance(refused.exception, InputError)


def test_an_unknown_force_on_one_carrier_does_not_hide_that_another_has_lost_its_thrust():
    robot = load("multi-quadrotor-3")
    forces = np.zeros((3, 3))
    forces[1] = robot.carriers[1].body.mass * np.array(robot.gravity)
    forces[0] = np.nan
    assert lost_carrier(robot, forces) == 1
    assert lost_carrier(robot, 0.5 * forces) is None
