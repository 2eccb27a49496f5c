"""Pushes, walls, hand-overs and events of one's own: what they do to a robot, by computations of their own."""

import itertools
import json
import re
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from towline import InputError, load, plan, simulate
from towline.control import ComputedTorque, OpenLoop, references
from towline.control.late_states import Pending
from towline.control.trajectory import read_trajectory
from towline.models import Dynamics
from towline.simulation import Cut, Event, Follow, Push, Wall
from towline.simulation.events.event import read_events

PAGE = (Path(__file__).parent.parent / "docs" / "adding-an-event.md").read_text()
(CODE,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
LINE = {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.2, 1.2]}
PERIOD = 1e-3  # [s], of the controller
ON = {"kind": "line", "start": [0.6, 0.2, 1.2], "end": [0, 0.4, 1]}


@pytest.fixture(scope="module")
def robot():
    return load("cogiro")


def stiffness_at_home(robot):
    """Force per displacement, (3, 3) [N/m], of cables with constant tensions, by differences of the wrench matrix."""
    dynamics = Dynamics(robot)
    held = simulate(robot, robot.home, OpenLoop(robot), duration=1e-3).record.commanded[0]

    def force(step):
        pose = robot.home + np.r_[step, 0, 0, 0]
        return (dynamics.wrench_matrix(pose, robot.carrier_home) @ held)[:3]

    steps = 1e-5 * np.eye(3)
    return -np.stack([(force(step) - force(-step)) / 2e-5 for step in steps], axis=1)


def test_a_push_gives_the_platform_its_momentum(robot):
    lasting, force = 0.02, np.array([30.0, -20.0, 40.0])
    run = simulate(
        robot, robot.home, OpenLoop(robot), duration=0.2, events=[Push(force=tuple(force), at=0.1, duration=lasting)]
    )
    speed = run.record.motions[:, 0, 6:9]
    assert np.abs(speed[:101]).max() < 1e-7
    np.testing.assert_allclose(speed[120], force * lasting / robot.platform.mass, rtol=0.02)


@pytest.mark.parametrize(("at", "lasting"), [(0.1, 0.0004), (0.1003, 0.0104), (0.1, 0.0005), (0.1007, 0.02)])
def test_its_momentum_does_not_depend_on_the_controllers_period(robot, at, lasting):
    push = Push(force=(3000.0, 0.0, 0.0), at=at, duration=lasting)
    run = simulate(robot, robot.home, OpenLoop(robot), duration=0.2, events=[push])
    end = int(np.ceil((at + lasting) / PERIOD)) + 2
    np.testing.assert_allclose(run.record.motions[end, 0, 6], 3000.0 * lasting / robot.platform.mass, rtol=0.02)


def test_a_push_without_an_end_is_a_constant_disturbance(robot):
    wrench = [10.0, 0.0, -5.0, 1.0, 2.0, 0.0]
    pushed = simulate(robot, robot.home, duration=0.2, events=["push 10 0 -5 1 2 0 at 0"])
    disturbed = simulate(robot, robot.home, duration=0.2, disturbance=wrench)
    np.testing.assert_array_equal(pushed.record.motions, disturbed.record.motions)
    both = simulate(robot, robot.home, duration=0.2, disturbance=[10, 0, -5, 0, 0, 0], events=["push 0 0 0 1 2 0 at 0"])
    np.testing.assert_array_equal(both.record.motions, disturbed.record.motions)


def test_a_push_on_a_carrier_is_what_its_observer_estimates():
    team = load("multi-quadrotor-4")
    controller = ComputedTorque(team)
    run = simulate(
        team, team.home, controller, duration=0.8, events=["push quad2 1.5 -1 0.5 at 0.1", "push 0 0 0 at 0"]
    )
    estimates = controller.disturbance_of_carriers[0]
    np.testing.assert_allclose(estimates[1], [1.5, -1.0, 0.5], atol=0.05)
    np.testing.assert_allclose(np.delete(estimates, 1, axis=0), 0.0, atol=0.05)
    assert run.to_dict()["events"][1]["what"] == "a push of 1.871 N on quad2"
    both = simulate(
        team, team.home, ComputedTorque(team), duration=0.8, runs=2, events=["push quad2 1.5 -1 0.5 at 0.1"]
    )
    np.testing.assert_allclose(both["error_max"], run.error.max(), rtol=1e-9)


def test_it_ends(robot):
    ended = simulate(robot, robot.home, duration=0.2, events=["push 10 0 0 at 0.05 for 0.05"])
    endless = simulate(robot, robot.home, duration=0.2, events=["push 10 0 0 at 0.05"])
    first = np.argmax((ended.record.motions != endless.record.motions).any(axis=(1, 2)))
    assert first == 101  # what is sensed one period after the first without it


def test_a_wall_carries_what_the_cables_do_not():
    """With constant tensions: push = wall + geometric stiffness times displacement, once the platform rests."""
    robot = load("cogiro")
    push, gap, stiffness = 100.0, 0.002, 2e4
    wall = Wall(at=0.0, point=(gap, 0, robot.home[2]), normal=(-2, 0, 0), stiffness=stiffness, damping=3e3)
    constant = stiffness_at_home(robot)
    run = simulate(robot, robot.home, OpenLoop(robot), duration=1.5, events=[wall, Push(force=(push, 0, 0), at=0.0)])
    x = run.record.motions[-1, 0, 0] - robot.home[0]
    assert x > gap
    assert stiffness * (x - gap) + constant[0, 0] * x == pytest.approx(push, rel=0.02)


@pytest.mark.parametrize(("stiffness", "period"), [(1e4, 5e-3), (1e6, 5e-3), (1e8, 1e-3)])
def test_a_wall_without_damping_gives_back_the_energy_of_an_impact(robot, stiffness, period):
    """With constant tensions, the platform leaves it as fast as it came; it enters a soft one as far as energy says."""
    mass, turns = robot.platform.mass, np.sqrt(robot.platform.mass / stiffness)
    wall = Wall(at=0.0, point=(0.1, 0, robot.home[2]), normal=(-1, 0, 0), stiffness=stiffness)
    push, duration = Push(force=(40 * mass, 0, 0), at=0.0, duration=0.02), 0.15 + 4 * turns
    run = simulate(robot, robot.home, OpenLoop(robot), duration=duration, period=period, events=[wall, push])
    x, speed = run.record.motions[:, 0, [0, 6]].T
    assert speed.min() == pytest.approx(-speed.max(), rel=0.01)
    if turns > 10 * period:
        fastest, cables, depth = np.argmax(speed), stiffness_at_home(robot)[0, 0], x.max() - 0.1
        energy = mass * speed[fastest] ** 2 + cables * x[fastest] ** 2
        assert stiffness * depth**2 + cables * x.max() ** 2 == pytest.approx(energy, rel=0.01)


def test_a_wall_never_pulls(robot):
    wall = Wall(at=0.0, point=(0, 0, 0), normal=(0, 0, 3), stiffness=100.0, damping=1e4, radius=0.1)
    motions = np.zeros((3, 2, 12))
    motions[:, 0, 2] = [0.1, 0.05, 0.05]  # at rest where it begins, inside, inside and quickly out
    motions[:, 0, 8] = [0.0, -0.1, 1.0]
    wrench = wall.wrench(0.0, motions)
    np.testing.assert_allclose(wrench[:, 2], [0.0, 100 * 0.05 + 1e4 * 0.1, 0.0])
    assert not np.delete(wrench, 2, axis=1).any()


@pytest.fixture(scope="module")
def two_plans(robot, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plans")
    first, second = (plan(robot, {"path": path, "duration": 1.5}) for path in (LINE, ON))
    return first, second, second.save(folder / "second.nc")


@pytest.mark.parametrize(("name", "body", "whose"), [
    ("wang-ctmrts", 0, "which"), ("wang-ctmrts", 2, "whose carrier 'robot2'"), ("wang-ctmrts", None, None),
    ("multi-quadrotor-3", 3, "whose carrier 'quad3'"),
])  # fmt: skip
def test_a_jump_of_the_reference_is_reported_also_if_only_a_carrier_jumps(name, body, whose):
    team = load(name)
    here = read_trajectory(team, team.home, None)

    def elsewhere(times):
        platform, carriers = ([part.copy() for part in parts] for parts in here.at(times))
        if body is not None:
            moved, order = (platform, carriers)[body > 0], (slice(None), *([body - 1] if body else []))
            moved[0][(*order, 0)] += 0.03
            moved[1][(*order, 1)] += 0.2
        return tuple(platform), tuple(carriers)

    doubt = Follow(plan=team.home, at=1.0).follow(team, here._replace(at=elsewhere), 1.0).doubt
    assert doubt == (f"another plan, {whose} jumps by 30 mm and 0.2 m/s at the hand-over" if whose else "")


def test_the_reference_becomes_another_plan(robot, two_plans):
    first, second, file = two_plans
    run = simulate(robot, first, events=[f"follow {file} at 1.5"])
    assert run.passed
    assert run.lasted == 3000
    assert "the reference became another plan at 1.5 s" in run.report()
    assert "hand-over" not in run.report()
    wanted = references(second, 1e-3)
    for k in (1, 700, 1499):
        np.testing.assert_allclose(run.references[1500 + k].pose, wanted[k].pose, atol=1e-12)
    by_plan = simulate(robot, first, events=[Follow(plan=second, at=1.5)])
    np.testing.assert_array_equal(run.record.motions, by_plan.record.motions)


def test_a_jump_at_the_hand_over_is_said(robot, two_plans):
    first, second, _ = two_plans
    run = simulate(robot, first, events=[Follow(plan=second, at=1.0)])
    where = np.linalg.norm(references(first, 1e-3)[1000].pose[:3] - references(second, 1e-3)[0].pose[:3])
    assert f"jumps by {1e3 * where:.4g} mm" in run.report()


def test_a_stop_of_the_second_plan(robot, two_plans):
    first, second, _ = two_plans
    run = simulate(robot, first, events=["stop at 2", Follow(plan=second, at=1.5)], duration=3.0)
    assert run.passed
    end = run.references[-1].pose[:3]
    assert 0.01 < np.linalg.norm(end - np.array(ON["end"])) < np.linalg.norm(np.subtract(ON["end"], ON["start"])) - 0.01
    assert np.abs(run.references[-1].velocity).max() < 1e-9


def test_events_from_a_file_are_relative_to_it(robot, two_plans, tmp_path):
    first, _, file = two_plans
    (file.parent / "events.yaml").write_text(
        "events: [{kind: follow, plan: second.nc, at: 1.5}, push 5 0 0 at 1 for 0.1, {kind: cut, cable: 2, at: 2.9}]"
    )
    run = simulate(robot, first, events=[str(file.parent / "events.yaml")])
    assert [type(event) for event in run.conditions.events] == [Push, Follow, Cut]
    assert run.to_dict()["events"][0]["what"] == "a push of 5 N for 0.1 s"


def test_events_in_json_and_as_objects_are_the_same(robot):
    events = ['{"kind": "cut", "cable": 3, "at": 0.01}', {"kind": "cut", "cable": 3, "at": 0.01}, Cut(cable=3, at=0.01)]
    for event in [*events, "cut 3 at 0.01"]:
        assert simulate(robot, robot.home, duration=0.02, events=[event]).conditions.events == (Cut(cable=3, at=0.01),)


def test_many_runs_are_pushed_as_one_is(robot):
    events = ["push 20 0 0 at 0.01 for 0.05", {"kind": "wall", "at": 0, "point": [0.0001, 0, 0], "normal": [-1, 0, 0]}]
    events[1]["stiffness"] = 1e4
    run = simulate(robot, robot.home, duration=0.2, events=events)
    runs = simulate(robot, robot.home, duration=0.2, events=events, runs=3)
    np.testing.assert_allclose(runs["error_max"].values, run.error.max(), rtol=1e-9)


def test_what_acts_on_a_run_is_the_same_to_the_bit_however_many_are_side_by_side():
    """How many are depends on the time that they take, but the same seed has to give the same bits."""
    random, wall = np.random.default_rng(0), Wall(at=0, point=(0.1, 0, 0), normal=(1, 2, 3), stiffness=1e3, damping=10)
    motions = random.normal(size=(40, 1, 12))
    alone = [wall.wrench(0.0, motions[[row]])[0] for row in range(40)]
    np.testing.assert_array_equal(wall.wrench(0.0, motions), alone)

    def means(commands, parts):  # of (K, N) commands, one every 2 ms, from 31 ms ago on
        queue = Pending(0.5)
        queue.reset(commands.shape[1])
        for command in commands:
            queue.add(command.tobytes())
            queue.wait(0.002)
        return queue.means(0.031, parts, 0.03 / parts)

    commands = random.normal(size=(30, 40))
    for parts in (1, 7):
        alone = [means(np.ascontiguousarray(commands[:, [row]]), parts)[:, 0] for row in range(40)]
        np.testing.assert_array_equal(means(commands, parts).T, alone)
    last = commands[14:30]  # the first of which is held for 1 ms more, and the last until 1 ms ago
    durations = np.r_[0.001, np.full(14, 0.002), 0.001]
    np.testing.assert_allclose(means(commands, 1)[0], durations @ last / 0.03, rtol=1e-12)


def test_runs_with_events_resume(robot, tmp_path):
    events = ["push 20 0 0 at 0.01 for 0.05", Wall(at=0, point=(0.1, 0, 0), normal=(-1, 0, 0), stiffness=1e4)]
    given = {"duration": 0.1, "events": events, "runs": 2, "checkpoint": tmp_path / "runs.checkpoint"}
    first = simulate(robot, robot.home, **given)
    again = simulate(robot, robot.home, **given, resume=True)
    np.testing.assert_array_equal(first["error_max"].values, again["error_max"].values)


def test_the_example_of_the_page_is_short_and_runs(capsys):
    assert len([line for line in CODE.splitlines() if line.strip()]) <= 30
    names = {}
    exec(CODE, names)
    assert "a rubber band of 20 N/m was tied to the platform at 0.5 s" in capsys.readouterr().out
    run, band = names["run"], names["RubberBand"]
    assert run.conditions.events == (band(at=0.5, end=(3, 0, 1)),)
    assert json.loads(json.dumps(run.conditions.to_dict()))["events"][0]["kind"] == "rubber-band"
    # The observer finds the force that the band exerts.
    controller = names["simulate"].__globals__["ComputedTorque"](names["robot"])
    simulate(names["robot"], names["robot"].home, controller, duration=3.0, events=run.conditions.events)
    expected = 20.0 * (np.array([3, 0, 1]) - names["robot"].home[:3])
    np.testing.assert_allclose(controller.disturbance[0, :3], expected, rtol=0.02, atol=0.5)


@pytest.mark.parametrize(
    ("wrench", "reference", "message"),
    [
        (None, None, None),
        *((odd, None, "six finite") for odd in (np.zeros(5), np.full(6, np.nan), "no", 3.0)),
        (None, 5, "the reference of Odd must be a Trajectory, got 5"),
    ],
)
def test_what_an_own_event_returns_is_checked(robot, wrench, reference, message):
    class Odd(Event):
        kind: Literal["odd"] = "odd"

        def describe(self, robot):
            return "something odd"

        def wrench(self, time, motions):
            return wrench

        def follow(self, robot, trajectory, time):
            return reference

    try:
        if message is None:
            assert simulate(robot, robot.home, duration=0.01, events=[Odd(at=0)]).passed
        else:
            with pytest.raises(InputError, match=message):
                simulate(robot, robot.home, duration=0.01, events=[Odd(at=0)])
    finally:
        del Event.kinds["odd"]


def test_a_file_of_events_names_no_other(robot, tmp_path):
    """A file that named itself would be read without end."""
    file = tmp_path / "events.yaml"
    file.write_text(f"events: [{file}]")
    with pytest.raises(InputError, match=r"events\[0\]: events\[0\] must be 'cut CABLE at SECONDS'"):
        simulate(robot, robot.home, duration=0.01, events=[str(file)])


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ("push quad1 1 2 3 at 0", "events[0] must name a carrier of 'cogiro' that flies (it has none), got 'quad1'"),
        ("push 1 at 0", "events[0]: force must be 3 numbers, got [1.0]"),
        ("push 1 2 x at 0", "events[0]: force[2] must be a number, got 'x'"),
        ("push 1 2 nan at 0", "events[0]: force[2] must be a finite number, got nan"),
        ("wall at 0", "got 'wall at 0'"),
        ({"kind": "wall", "at": 0}, "events[0]: point is missing"),
        (
            {"kind": "wall", "at": 0, "point": [0, 0, 0], "normal": [0, 0, 0], "stiffness": 1},
            "normal must have a length, got zeros",
        ),
        (
            {"kind": "wall", "at": 0, "point": [0, 0, 0], "normal": [0, 0, 1e-200], "stiffness": 1},
            "normal must have a length, got (0.0, 0.0, 1e-200)",
        ),
        ({"kind": "brush", "at": 0}, "events[0]: kind must be one of carry, cut, follow, lose, miss, push,"),
        ({"at": 0}, "events[0]: kind must be one of"),
        ("follow none.nc at 0", "no such file"),
        ("none.yaml", "none.yaml: no such file"),
        ("{", "JSON"),
        (3, "got 3"),
        ("cut 1 at 1", "events[0] must begin before the end at 0.01 s, got 1 s"),
        ("cut 1 at 1e300", "events[0]: at must be"),
    ],
)
def test_wrong_events_are_one_clear_line(robot, event, message):
    with pytest.raises(InputError) as caught:
        simulate(robot, robot.home, duration=0.01, events=[event])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


class Held(ComputedTorque):
    """A controller whose tensions are constant."""

    def step(self, time, state, reference):
        return super().step(time, state, reference)._replace(tensions=self.pulls)


def test_a_load_adds_its_wrench_to_the_motion_and_changes_no_velocity():
    """By the wrench that a carried load needs, from the symbolic model; the plant has one body with both inertias."""
    robot, load_on, step = (
        load("wang-flying"),
        np.array([0.4, 0.05, -0.1, 0.02, 0.01, 0.02, 0.015, 2e-3, 0, 1e-3]),
        1e-4,
    )
    held, dynamics = Held(robot), Dynamics(robot)
    held.pulls = np.linspace(14, 22, robot.m)
    events = [
        {"kind": "carry", "at": 0.1, "mass": load_on[0], "com": list(load_on[1:4]), "inertia": list(load_on[4:])},
        "carry 0 at 0.15",
    ]
    run = simulate(robot, robot.home, held, duration=0.2, period=step, events=events, drive="tensions")
    acceleration = np.diff(run.record.motions[:, 0, 6:], axis=0) / step  # in the middle of each period, as tensions
    motions = (run.record.motions[1:] + run.record.motions[:-1]) / 2
    pose, velocity = motions[:, 0, :6], motions[:, 0, 6:]
    assert np.abs(acceleration).max() < 200.0  # no jump of a velocity at either event
    for k in (500, 990, 1010, 1300, 1490, 1510, 1900):
        carried = 1000 <= k < 1500
        A = dynamics.wrench_matrix(pose[k], motions[k, 1:, :6])
        needed = dynamics.required_wrench(pose[k], velocity[k], acceleration[k], motions[k, 1:, :6])
        if carried:
            needed = needed + dynamics.carried_wrench(pose[k], velocity[k], acceleration[k], load_on)
        np.testing.assert_allclose(A @ run.record.tensions[k], needed, atol=1e-4 * robot.weight)
        without = dynamics.carried_wrench(pose[k], velocity[k], acceleration[k], load_on)
        assert np.abs(without).max() > 0.02 * robot.weight  # what a test without the load would miss
    assert np.linalg.norm(velocity[1000, 3:]) > 0.05


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ("carry at 1", r"events\[0\].*mass"),
        ("carry -1 at 0.1", r"events\[0\].*mass"),
        (
            {"kind": "carry", "at": 0.1, "mass": 1, "inertia": [-1, 0, 0, 0, 0, 0]},
            r"events\[0\]: inertia must have principal moments >= 0 .*smallest moment is -1, got \[-1, 0, 0, 0, 0, 0\]",
        ),
        (
            {"kind": "carry", "at": 0.1, "mass": 0, "inertia": [1, 1, 1, 0, 0, 0]},
            r"events\[0\] must have the inertia 0 kg m\^2 with the mass 0 kg, got \(1.0, 1.0, 1.0, 0.0, 0.0, 0.0\)",
        ),
        ("carry nan at 0.1", r"events\[0\]: mass must be a finite number, got nan"),
        ("carry 2.5kg at 0.1", r"events\[0\]: mass must be a number, got '2.5kg'"),
    ],
)
def test_loads_that_cannot_be_are_refused(event, message):
    with pytest.raises(InputError, match=message):
        simulate("wang-flying", load("wang-flying").home, duration=0.2, events=[event])


def test_the_loads_of_a_plan_are_carried_in_their_phases(tmp_path):
    """Tensions balance the load that the plan has at each time; the task of the saved plan describes it."""
    robot, load_on = load("cogiro"), np.array([25.0, 0.1, 0, -0.2, 1, 2, 1.5, 0, 0.2, 0])
    bag = {"mass": load_on[0], "com": load_on[1:4].tolist(), "inertia": load_on[4:].tolist()}
    at = [robot.home[:3] + np.array(step) for step in ([0, 0, 0], [0.2, 0, 0.1], [0, 0.2, 0.1], [0, 0, 0])]
    lines = [{"kind": "line", "start": a.tolist(), "end": b.tolist()} for a, b in itertools.pairwise(at)]
    phases = [{"name": f"phase-{k}", "path": line, "duration": 0.8} for k, line in enumerate(lines)]
    phases[1]["load"] = bag
    plan(robot, {"phases": phases}).save(tmp_path / "moved.nc")
    run = simulate(robot, tmp_path / "moved.nc", duration=2.4)
    assert run.passed
    assert run.error.max() < 3e-3
    text = run.report()
    assert "a load of 25 kg was picked up at 0.8 s; the load was released at 1.6 s" in text
    assert "at 0 s" not in text
    dynamics, (pose, velocity) = Dynamics(robot), np.split(run.record.motions[:, 0], 2, axis=1)
    for k, carries in ((400, False), (1100, True), (1300, True), (2000, False)):
        acceleration = (velocity[k + 20] - velocity[k - 20]) / 0.04
        needed = dynamics.required_wrench(pose[k], velocity[k], acceleration)
        needed = needed + carries * dynamics.carried_wrench(pose[k], velocity[k], acceleration, load_on)
        given = dynamics.wrench_matrix(pose[k]) @ run.record.tensions[k - 20 : k + 20].mean(axis=0)
        np.testing.assert_allclose(given, needed, atol=0.01 * robot.weight)


def test_loads_on_the_ground_are_refused(tmp_path):
    robot = load("cogiro")
    line = {"kind": "line", "start": [0, 0, 1.3], "end": [0, 0, 1]}
    bag = {"mass": 20}
    phases = [{"name": "down", "path": line, "duration": 2, "load": bag}]
    phases.append({"name": "put", "ground": {}, "duration": 0.5, "load": bag})
    with pytest.raises(InputError, match="reference must have no phase on the ground if it carries loads"):
        simulate(robot, plan(robot, {"phases": phases}))


def test_a_thin_rod_is_a_load_in_any_direction():
    """Its moment about its own axis is zero, and as an eigenvalue a rounding error of either sign."""
    random = np.random.default_rng(0)
    for axis in random.normal(size=(50, 3)):
        axis /= np.linalg.norm(axis)
        of = np.eye(3) - np.outer(axis, axis)
        inertia = [of[0, 0], of[1, 1], of[2, 2], of[0, 1], of[0, 2], of[1, 2]]
        read_events(load("wang-flying"), [{"kind": "carry", "at": 0, "mass": 1, "inertia": inertia}])


@pytest.mark.parametrize("name", ["multi-quadrotor-3", "flycrane", "cogiro"])
def test_loads_of_robots_of_each_drive_have_the_wrench_of_the_symbolic_model(name):
    """Also with a disturbance, which acts at the CoM of both, and in parallel runs."""
    robot, step, push = load(name), 2e-4, np.array([1, 0.5, 0.2, 0.02, 0.01, 0.03])
    own, dynamics, push = robot.platform.mass, Dynamics(robot), 0.05 * robot.weight * push
    load_on = own * np.array([0.3, 0.05 / own, -0.03 / own, 0.02 / own, 2e-3, 1e-3, 1.5e-3, 0, 2e-4, 0])
    event = {"kind": "carry", "at": 0.04, "mass": load_on[0], "com": list(load_on[1:4]), "inertia": list(load_on[4:])}
    given: dict[str, Any] = {
        "duration": 0.12,
        "period": step,
        "disturbance": push,
        "events": [event, "carry 0 at 0.08"],
    }
    run = simulate(robot, robot.home, **given)
    acceleration = np.diff(run.record.motions[:, 0, 6:], axis=0) / step
    motions = (run.record.motions[1:] + run.record.motions[:-1]) / 2
    arm = load_on[0] * (load_on[1:4] - robot.platform.com) / (own + load_on[0])
    for k in (150, 190, 210, 390, 410, 590):
        pose, velocity, carriers = motions[k, 0, :6], motions[k, 0, 6:], motions[k, 1:, :6]
        needed, pushed = dynamics.required_wrench(pose, velocity, acceleration[k], carriers), push.copy()
        if 200 <= k < 400:
            needed = needed + dynamics.carried_wrench(pose, velocity, acceleration[k], load_on)
            pushed[3:] += np.cross(arm, push[:3])  # nearly level
        given_by = dynamics.wrench_matrix(pose, carriers) @ run.record.tensions[k] + pushed
        np.testing.assert_allclose(given_by, needed, atol=1e-4 * robot.weight)
    many = simulate(robot, robot.home, runs=3, **given)
    np.testing.assert_allclose(many["error_max"].values, run.error.max(), rtol=1e-9)


def test_a_plan_that_rests_on_the_ground_is_no_silent_reference():
    """Its cables would bear less with the ground than in a simulation without one."""
    robot = load("cogiro")
    line = {"kind": "line", "start": robot.home[:3].tolist(), "end": (robot.home[:3] + np.array([0, 0, 0.3])).tolist()}
    rest = {"name": "rest", "path": {"kind": "rest", "pose": robot.home.tolist()}, "duration": 0.5, "ground": {}}
    found = plan(robot, {"phases": [rest, {"name": "up", "duration": 1.5, "path": line}]})
    assert found.trajectory["ground_reaction"].max() > 0.1 * robot.weight
    assert "a plan with phases on the ground, which simulations do not have" in simulate(robot, found).report()
    above = plan(robot, {"path": line, "duration": 1.5})
    assert "ground" not in simulate(robot, above, duration=0.01).report()


def test_a_push_that_a_robot_cannot_follow_is_refused():
    planar = load("planar-4")
    simulate(planar, planar.home, duration=0.01, events=["push 1 1e-16 2 0 0.1 0 at 0"])
    for name, words in (("planar-4", "0 1 0"), ("planar-4", "0 0 0 1 0 0"), ("point-mass-3", "0 0 0 0 1 0")):
        with pytest.raises(InputError, match=rf"^events\[0\] must push '{name}' along what it can move \(x, "):
            simulate(name, load(name).home, duration=0.01, events=[f"push {words} at 0"])
