"""Controllers know the load that a plan has at each time: it is carried from its phase on, not found by an observer."""

import itertools

import numpy as np
import pytest

from towline import InputError, load, plan, simulate
from towline.control import ComputedTorque, Predictive, Reference, State, references
from towline.models.rigid_load import RigidLoad

COGIRO = load("cogiro")
BAG = {"mass": 150.0, "com": [0.1, 0.05, -0.3], "inertia": [8, 9, 6, 0, 0.5, 0]}
PICKED, RELEASED = 1.5, 3.0  # [s]
LATE = {"delay": 0.03, "stamped": True}
PERIOD = 4e-3  # [s]


@pytest.fixture(scope="module")
def carries():
    """A plan that picks up 150 kg at 1.5 s and releases them at 3 s, where the platform is at rest."""
    at = [COGIRO.home[:3] + np.array(step) for step in ([0, 0, 0], [0.6, 0, 0.2], [-0.4, 0.6, 0.2], [0, 0, 0])]
    lines = [{"kind": "line", "start": a.tolist(), "end": b.tolist()} for a, b in itertools.pairwise(at)]
    phases = [{"name": f"phase-{k}", "path": line, "duration": 1.5} for k, line in enumerate(lines)]
    phases[1]["load"] = BAG
    return plan(COGIRO, {"phases": phases})


def test_references_of_a_plan_name_its_load(carries):
    of = references(carries, 0.5)
    assert [0.0 if each.load is None else each.load.mass for each in of] == [0, 0, 0, 150, 150, 150, 0, 0, 0, 0]
    assert of[3].load == RigidLoad.model_validate(BAG)


def test_a_plan_without_the_load_that_the_platform_carries_is_named(carries):
    """Nobody has set the load down: the platform still carries it, and sinks, since the reference has none."""
    run = simulate(COGIRO, carries, events=[{"kind": "follow", "plan": COGIRO.home, "at": 4.0}], duration=4.1)
    assert "load" not in run.conditions.doubt
    run = simulate(COGIRO, carries, events=[{"kind": "follow", "plan": COGIRO.home, "at": 2.9}], duration=3.5)
    assert "another plan, without the load of 150 kg that the platform carries" in run.report()
    assert "released" not in run.report()


@pytest.mark.parametrize(
    ("controller", "noise"),
    [
        (ComputedTorque(COGIRO), None),
        (ComputedTorque(COGIRO), LATE),
        (ComputedTorque(COGIRO, observer=0), LATE),
        (Predictive(COGIRO), LATE),
    ],
    ids=["computed torque", "computed torque, late", "without observer, late", "predictive, late"],
)
def test_a_planned_load_is_carried_within_a_millimetre(carries, controller, noise):
    """The plant carries it as the symbolic model says (test_simulation_own_events.py); unaware, 40 mm are missed."""
    run = simulate(COGIRO, carries, controller, noise=noise, period=PERIOD)
    assert run.error.max() < 3e-4
    assert run.to_dict()["answered"]["as planned"] == len(run.error)


@pytest.mark.parametrize("kind", [ComputedTorque, Predictive])
def test_a_load_that_is_released_before_its_pick_up_is_seen(kind):
    """It is carried for 20 ms, and states are 100 ms late: three robots lie between a state and its step."""
    at = [COGIRO.home[:3] + np.array(step) for step in ([0, 0, 0], [0.3, 0, 0.1], [0.3003, 0, 0.1], [0.1, 0.1, 0.2])]
    lines = [{"kind": "line", "start": a.tolist(), "end": b.tolist()} for a, b in itertools.pairwise(at)]
    lasting = zip(lines, (1.5, 0.02, 1.0), strict=True)
    phases = [{"name": f"phase-{k}", "path": line, "duration": time} for k, (line, time) in enumerate(lasting)]
    phases[1]["load"] = BAG
    planned, late = plan(COGIRO, {"phases": phases}), {"delay": 0.1, "stamped": True}
    run = simulate(COGIRO, planned, kind(COGIRO), noise=late, period=PERIOD)
    assert run.error.max() < 3e-4
    assert run.to_dict()["answered"]["as planned"] == len(run.error)


@pytest.mark.parametrize("period", [1e-3, 0.01, 0.1])
def test_a_controller_learns_of_the_load_of_another_plan_when_it_is_picked_up(carries, period):
    """The second plan begins with its load: the step at its begin names it, as the plant carries it from then on."""
    start, end = COGIRO.home[:3], COGIRO.home[:3] + np.array([0.3, 0, 0.2])
    line = {"kind": "line", "start": start.tolist(), "end": end.tolist()}
    second = plan(COGIRO, {"phases": [{"name": "second", "path": line, "duration": 1.5, "load": BAG}]})
    named = []

    class Asked(ComputedTorque):
        def step(self, time, state, reference):
            named.append((time, reference.load is not None))
            return super().step(time, state, reference)

    follow = {"kind": "follow", "at": 0.3, "plan": second}
    simulate(COGIRO, COGIRO.home, Asked(COGIRO), events=[follow], duration=0.6, period=period)
    assert [loaded for _, loaded in named] == [time > 0.3 - 1e-9 for time, _ in named]


def test_tensions_of_a_motion_that_has_none_carry_its_load(carries):
    bare, bag = (COGIRO.platform.mass, COGIRO.platform.com), (BAG["mass"], BAG["com"])
    of = references(carries.trajectory.drop_vars("tensions"), PICKED)  # where the platform rests
    for reference, bodies in zip(of, [[bare], [bare, bag], [bare]], strict=False):
        missing = balance_of_bodies(reference.pose, reference.tensions, bodies)
        inertial = sum(mass for mass, _ in bodies) * np.abs(reference.acceleration).max()
        np.testing.assert_allclose(missing, 0, atol=1e-3 * COGIRO.weight + inertial)


@pytest.mark.parametrize("announced", [None, BAG], ids=["not announced", "announced"])
def test_a_load_that_differs_from_the_announced_one_is_carried(announced):
    """At rest: the announced references have the motion and another load than the platform has now."""
    still, carriers, rest = np.zeros(6), COGIRO.carrier_home, np.zeros_like(COGIRO.carrier_home)
    given = RigidLoad.model_validate({**BAG, "mass": 60.0}) if announced else RigidLoad.model_validate(BAG)
    plain = Reference(COGIRO.home, still, still, carriers, rest, rest)
    controller = Predictive(COGIRO)
    loads = [RigidLoad.model_validate(announced) if announced else None for _ in range(200)]
    controller.follow([plain._replace(load=each) for each in loads], 0.01)
    bodies = [(COGIRO.platform.mass, COGIRO.platform.com), (given.mass, given.com)]
    for k in range(10):
        command = controller.step(0.01 * k, State(COGIRO.home, still, carriers, rest), plain._replace(load=given))
        missing = balance_of_bodies(COGIRO.home, command.tensions, bodies)
        np.testing.assert_allclose(missing, 0, atol=5e-3 * COGIRO.weight)
    assert controller.handed_over is None


def balance_of_bodies(pose, tensions, bodies):
    """Force and moment about the origin of {G} on bodies at rest, from cables and weights, (6,)."""
    anchors = np.array([cable.anchor for cable in COGIRO.cables])
    attachments = pose[:3] + np.array([cable.attachment for cable in COGIRO.cables])  # level
    units = (anchors - attachments) / np.linalg.norm(anchors - attachments, axis=1, keepdims=True)
    pulls, masses = tensions[:, None] * units, np.array([mass for mass, _ in bodies])
    centres = pose[:3] + np.array([com for _, com in bodies])
    weights = masses[:, None] * np.array(COGIRO.gravity)
    forces, points = np.vstack([pulls, weights]), np.vstack([attachments, centres])
    return np.r_[forces.sum(axis=0), np.cross(points, forces).sum(axis=0)]


@pytest.mark.parametrize(("kind", "rows"), [(ComputedTorque, None), (ComputedTorque, 2), (Predictive, None)])
def test_the_first_command_with_a_load_balances_both_weights(kind, rows):
    """At rest, in the very step in which the reference names it; again without it, and after a reset."""
    controller, still = kind(COGIRO), np.zeros(6)
    pose = COGIRO.home + np.array([0.4, -0.3, 0.2, 0, 0, 0])
    bare, bag = (COGIRO.platform.mass, COGIRO.platform.com), RigidLoad.model_validate(BAG)
    carriers, rest = COGIRO.carrier_home, np.zeros_like(COGIRO.carrier_home)
    plain = Reference(pose, still, still, carriers, rest, rest)
    state = State(pose, still, carriers, rest)
    if rows:
        state = State(*(np.tile(part, (rows, *[1] * part.ndim)) for part in state[:4]))
    for _ in range(2):
        for k, carried in enumerate((None, None, bag, bag.model_copy(), None, bag)):
            command = controller.step(1e-3 * k, state, plain._replace(load=carried))
            bodies = [bare] if carried is None else [bare, (bag.mass, bag.com)]
            for tensions in np.atleast_2d(command.tensions):
                missing = balance_of_bodies(pose, tensions, bodies)
                np.testing.assert_allclose(missing, 0, atol=1e-3 * COGIRO.weight)
        controller.reset()


@pytest.mark.parametrize("noise", [None, LATE], ids=["now", "30 ms late"])
def test_an_estimated_push_stays_as_it_was_when_a_load_comes_and_goes(carries, noise):
    """A constant force of 100 N is known before; a load moves its moment, by the CoM, and nothing else."""
    push = np.array([60.0, -80.0, 0, 0, 0, 0])
    seen = []

    class Watched(ComputedTorque):
        def step(self, time, state, reference):
            command = super().step(time, state, reference)
            seen.append(self.disturbance[0])
            return command

    run = simulate(COGIRO, carries, Watched(COGIRO), disturbance=push, noise=noise, period=PERIOD)
    estimates = np.array(seen)
    assert run.error.max() < 0.02  # until the push is known
    for time in (PICKED, RELEASED):
        near = estimates[round(time / PERIOD) - 1 : round((time + 0.5) / PERIOD)]
        assert np.abs(near[:, :3] - push[:3]).max() < 2.0
        assert np.abs(near[:, 2]).max() < 1e-3 * BAG["mass"] * 9.81


def test_a_load_that_is_none_is_refused():
    carriers, rest, still = COGIRO.carrier_home, np.zeros_like(COGIRO.carrier_home), np.zeros(6)
    reference = Reference(COGIRO.home, still, still, carriers, rest, rest, load=150.0)
    with pytest.raises(InputError, match=r"reference\.load must be a RigidLoad, got 150"):
        ComputedTorque(COGIRO).step(0.0, State(COGIRO.home, still, carriers, rest), reference)
