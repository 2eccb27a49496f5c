"""Stops of teams of quadrotors: balance, lengths and thrusts by the equations of motion, and a simulation of each."""

import json

import numpy as np
import pytest
import xarray as xr

from towline import Dynamics, InputError, Robot, load, plan, simulate
from towline.control import ComputedTorque, Predictive, Stop, longest_stop, references, stop
from towline.control.planned_references import planned
from towline.control.trajectory import read_trajectory
from towline.models import points
from towline.models.trajectory import Trajectory
from towline.statics.continuation import continued
from towline.statics.team_limits import LINEAR, Row, worst_of
from towline.statics.team_stops import team_stop_along

from .robots_hooked_below import hooked_below
from .warm import towline as run


@pytest.fixture(scope="module")
def made():
    line = {"kind": "line", "start": [0, 0, 0], "end": [2.0, 0.2, 0.1]}
    found = plan("multi-quadrotor-3", {"path": line, "duration": 3.0, "base": {"kind": "free"}, "steps": 20})
    assert found.feasible
    return load("multi-quadrotor-3"), found


def test_stops_of_teams_obey_the_equations_of_motion(made):
    robot, found = made
    dynamics, g = Dynamics(robot), np.array(robot.gravity)
    fine = np.stack([each.pose for each in references(found, 2e-4)])
    for time in np.random.default_rng(1).uniform(0.0, found.duration, 2):
        its = stop(found, time)
        assert its.feasible
        assert its.duration <= found.duration - time + 1e-9
        (pose, velocity, acceleration), (carriers, _, bends) = its.platform, its.carriers
        A = dynamics.wrench_matrix(pose, carriers)
        missing = dynamics.required_wrench(pose, velocity, acceleration) - (A @ its.tensions[..., None])[..., 0]
        assert np.abs(missing @ np.diag(robot.wrench_scale)).max() < 0.02 * robot.weight
        lengths = dynamics.cable_lengths(pose, carriers)
        np.testing.assert_allclose(lengths, np.broadcast_to(robot.fixed_lengths, lengths.shape), atol=2e-3)
        assert (its.tensions > robot.t_min - 0.02 * robot.t_max).all()
        assert (its.tensions < 1.02 * robot.t_max).all()
        directions = A[:, :3].swapaxes(1, 2)
        for index, carrier in enumerate(robot.carriers):
            pull = -its.tensions[:, [index]] * directions[:, index]
            thrust = np.linalg.norm(carrier.mass * (bends[:, index, :3] - g) - pull, axis=1)
            assert (thrust < 1.02 * carrier.thrust_max).all()
            # The acceleration is that of the positions, by a formula of fourth order.
            x, h = carriers[:, index, :3], its.times[1]
            four = (-x[:-4] + 16 * x[1:-3] - 30 * x[2:-2] + 16 * x[3:-1] - x[4:]) / (12 * h**2)
            assert np.abs(four - bends[2:-2, index, :3]).max() < 0.25
        off = np.linalg.norm(fine[None, :, :3] - pose[:, None, :3], axis=2).min(axis=1)
        assert off.max() < 1e-3
        each = references(found, 1e-3, start=time)[0]
        for motion, first in zip((*its.platform, *its.carriers), each[:6], strict=True):
            np.testing.assert_allclose(motion[0], first, atol=1e-6)
        assert np.abs(its.platform[1][-1]).max() < 1e-3
        assert np.abs(its.carriers[1][-1]).max() < 1e-3


@pytest.mark.parametrize("room", [1.15, 1.3, 1.5])
def test_no_stop_of_a_plan_with_room_exceeds_accelerations_between_its_instants(made, room):
    """A follower gets the polynomials through the instants; they exceeded this limit by up to a tenth."""
    robot, found = made
    trajectory = planned(found)[1]
    most = room * np.linalg.norm(trajectory.at(np.linspace(0, 3, 3001))[1][2][..., :3], axis=-1).max()
    carriers = [each.model_dump() | {"acceleration_max": float(most)} for each in robot.carriers]
    tight = Robot.model_validate({**robot.model_dump(), "carriers": carriers})
    for begins in (0.3, 0.7, 1.1, 1.5, 1.6, 1.8, 2.2, 2.3, 2.95, 2.97):
        its = team_stop_along(tight, trajectory, begins)
        assert its.limit == ""
        assert its.tau[-1] <= found.duration + 1e-9  # where accelerations jump to zero
        halt = Stop(tight, begins, 3.0, its.times, its.platform, its.carriers, its.tensions, None)
        fine = read_trajectory(tight, halt, None).at(np.linspace(0, halt.duration, 4001)[:-1])[1]
        assert np.linalg.norm(fine[2][..., :3], axis=-1).max() <= most
        assert (its.tensions >= robot.t_min).all()


def test_no_cable_pushes_in_the_rest_of_a_plan():
    """Other limits may seem to be exceeded by 0.2 % of their range, which may be more than the smallest tension."""
    times, pulls, bounds = np.array([0.0, 0.1, 0.2]), np.array([[0.3, -0.05, 0.3]]), (0.1, 100.0)
    assert worst_of([Row("tension 1", pulls, *bounds, LINEAR)], times, True)[1] == "tension 1: -0.05 of 0.1 at 0.1 s"
    assert not worst_of([Row("tension 1", pulls + 0.145, *bounds, LINEAR)], times, True)[1]
    assert not worst_of([Row("torque", pulls, *bounds)], times, True)[1]


def test_a_team_stops_in_a_simulation(made, stable_at_home):
    robot, found = made
    its = stop(found, 0.4 * found.duration)
    assert its.duration < 0.75 * (found.duration - its.begins)  # durations up to what is left are tried closely
    flown = simulate(robot, its, Predictive(robot), duration=its.duration + 0.3, period=4e-3)
    assert flown.passed
    assert flown.error.max() < 0.01
    assert flown.answered["as planned"] > 0.99 * len(flown.error)


def test_a_team_goes_on_to_its_end_where_no_stop_is_shorter(made):
    _, found = made
    its = stop(found, found.duration - 0.15)
    assert its.feasible
    assert its.duration <= 0.2
    assert its.ends <= found.duration + 0.01
    assert longest_stop(found, 0.5).duration >= stop(found, 1.0).duration


def test_a_stop_beyond_a_plan_that_ends_while_the_team_moves_is_balanced_with_cables_of_their_lengths(made):
    """Platform and carriers are extrapolated apart from each other, so lengths and balance would drift away."""
    robot, found = made
    motion = found.trajectory.sel(time=slice(0.0, 1.2))
    its, dynamics = stop(motion, float(motion.time[-1])), Dynamics(robot)
    assert its.duration > 0.5
    lengths = dynamics.cable_lengths(its.platform[0], its.carriers[0])
    np.testing.assert_allclose(lengths, np.tile(robot.fixed_lengths, (len(lengths), 1)), atol=1e-4)
    np.testing.assert_allclose(lengths[-1], robot.fixed_lengths, atol=1e-9)
    pulls = dynamics.wrench_matrix(its.platform[0], its.carriers[0]) @ its.tensions[..., None]
    missing = dynamics.required_wrench(*its.platform) - pulls[..., 0]
    assert np.abs(missing[:, :3]).max() < 0.005 * robot.weight


@pytest.mark.parametrize(
    ("robot", "height", "radius", "rate", "task"),
    [
        (load("multi-quadrotor-3"), 0.0, 0.6, 1.6, {"base": {"kind": "free", "ends": "periodic"}}),
        (load("ipanema-2"), 2.0, 0.8, 0.8, {}),  # which rests only in some places
    ],
)
def test_a_stop_near_the_end_of_a_periodic_plan_is_on_its_next_period(robot, height, radius, rate, task):
    """As on the samples of two periods, one after the other, where it begins far from the end."""
    circle = {"kind": "circle", "centre": [0, 0, height], "radius": radius, "rate": rate}
    if not task:
        weak = tuple(cable.model_copy(update={"t_max": 53.5}) for cable in robot.cables)
        robot = robot.model_copy(update={"cables": weak})
    found = plan(robot, {"path": circle} | task)
    assert found.feasible
    one, begins = found.trajectory, found.duration - 0.05
    later = one.isel(time=slice(1, None)).assign_coords(time=one.time[1:] + found.duration)
    twice = xr.concat([one, later], "time", data_vars="minimal")
    twice.attrs = one.attrs
    its, other = stop(one, begins), stop(twice, begins)
    assert its.feasible
    assert its.ends > found.duration + 0.1
    assert its.duration == pytest.approx(other.duration, abs=1e-9)
    for here, there in zip((*its.platform, *its.carriers), (*other.platform, *other.carriers), strict=True):
        np.testing.assert_allclose(here, there, atol=1e-6)
    np.testing.assert_allclose(its.tensions, other.tensions, rtol=1e-5, atol=1e-5)


def test_a_platform_that_turns_in_each_period_goes_on_turning():
    def at(times):
        pose = np.zeros((len(times), 6))
        pose[:, 0], pose[:, 5] = np.sin(2 * times), 2 * times
        rates, bends = np.zeros_like(pose), np.zeros_like(pose)
        rates[:, 0], rates[:, 5], bends[:, 0] = 2 * np.cos(2 * times), 2, -4 * np.sin(2 * times)
        return (pose, rates, bends), tuple(part[:, None] for part in (pose, rates, bends))

    def once(times):
        assert times.max() < np.pi + 1e-9
        return at(times)

    times = np.linspace(0.0, 20.0, 333)
    for found, true in zip(continued(Trajectory(np.pi, once), together=False).at(times), at(times), strict=True):
        np.testing.assert_allclose(found, true, atol=1e-9)


@pytest.mark.parametrize("share", [0.4, 0.6, 0.75])
def test_a_stop_that_begins_before_the_end_of_a_plan_and_goes_beyond_it_is_feasible(made, share):
    """If accelerations stayed as they are at the end, carriers would need up to twice their largest acceleration."""
    robot, found = made
    motion = found.trajectory.sel(time=slice(0.0, share * found.duration))
    its = stop(motion, float(motion.time[-1]) - 0.3)
    assert its.feasible
    assert its.duration < 2.5
    x, h = its.carriers[0][..., :3], its.times[1]
    bends = np.linalg.norm(np.diff(x, 2, axis=0), axis=-1) / h**2
    assert bends.max() < 1.05 * robot.carriers[0].motion_limits.acceleration


def test_noise_of_accelerations_is_not_extrapolated():
    """Of 0.05 m/s^2 at 0.5 m/s: differences over a millisecond would make it a jerk of 200 m/s^3."""

    def at(times):
        noise = 0.05 * np.cos(np.pi * np.round(1e3 * times))[:, None] * np.eye(6)[0]
        return (0.5 * times[:, None] * np.eye(6)[0], np.full((len(times), 1), 0.5) * np.eye(6)[0], noise), (
            np.zeros((3, len(times), 1, 6))
        )

    trajectory = Trajectory(1.0, at)
    *_, acceleration = continued(trajectory, together=False).at(np.linspace(1, 3, 201))[0]
    assert np.abs(acceleration).max() < 3


def test_a_stop_of_which_nothing_is_known_is_not_feasible(made):
    """Without weight and acceleration no cable has a tension, and so no direction."""
    robot, speed = Robot.model_validate({**made[0].model_dump(), "gravity": [0, 0, 0]}), np.eye(6)[0]

    def at(times):
        moved, homes = times[:, None] * speed, (robot.home, robot.carrier_home[:, None])
        platform, carriers = ((home + moved, 0 * home + 0 * moved + speed, 0 * home + 0 * moved) for home in homes)
        return platform, tuple(part.swapaxes(0, 1) for part in carriers)

    with np.errstate(all="ignore"):
        its = team_stop_along(robot, Trajectory(1.0, at), 0.5)
    assert its.excess == np.inf
    assert its.limit


@pytest.mark.parametrize("together", [True, False])
def test_a_plan_that_ends_while_the_team_moves_goes_on_smoothly(made, together):
    """Velocities are the derivatives of poses, accelerations those of velocities, and nothing jumps at the end."""
    _, found = made
    trajectory = continued(planned(found.trajectory.sel(time=slice(0.0, 1.2)))[1], together)
    times, h = trajectory.duration + np.linspace(-0.05, 1.5, 311), 1e-4
    before, now, after = (trajectory.at(times + step) for step in (-h, 0.0, h))
    for one, two, three in zip(before, now, after, strict=True):
        for order in (0, 1):
            slope = (three[order] - one[order]) / (2 * h)
            np.testing.assert_allclose(slope, two[order + 1], atol=2e-3)
    platform, carriers = now
    assert np.abs(platform[2][-1]).max() < 1e-12
    assert np.abs(platform[1][-1, 3:]).max() < 1e-12
    if together:
        np.testing.assert_allclose(carriers[1][-1, :, :3], np.tile(platform[1][-1, :3], (3, 1)), atol=1e-12)


def test_a_stop_that_cables_are_too_weak_for_takes_no_half_minute(made):
    """They cannot hold the load at rest either, so that a longer stop misses their limit by nearly as much."""
    robot, found = made
    cables = [
        {**cable.model_dump(), "t_max": 0.8 * float(found.trajectory.tensions[-1].min())} for cable in robot.cables
    ]
    weak = Robot.model_validate({**robot.model_dump(), "cables": cables})
    its = team_stop_along(weak, planned(found.trajectory.sel(time=slice(0.0, 1.2)))[1], 1.0)
    assert its.limit.startswith("tension ")
    assert its.times[-1] < 20 * np.sqrt(robot.fixed_lengths.max() / 9.81)
    # The rest of the plan, which breaks this limit more, is not followed instead.
    its, rest = team_stop_along(weak, planned(found)[1], 1.5), found.trajectory.sel(time=slice(1.5, None)).tensions
    assert its.excess == pytest.approx(((its.tensions - weak.t_max) / (weak.t_max - weak.t_min)).max(), rel=1e-6)
    assert its.excess < 0.9 * ((rest.values - weak.t_max) / (weak.t_max - weak.t_min)).max()


def test_the_rest_of_a_plan_for_stronger_cables_is_no_feasible_stop(made):
    robot, found = made
    begins = found.duration - 0.15
    highest = stop(found, begins).tensions.max()
    cables = [{**cable.model_dump(), "t_max": 0.9 * highest} for cable in robot.cables]
    weak = Robot.model_validate({**robot.model_dump(), "cables": cables})
    its = team_stop_along(weak, planned(found)[1], begins)
    cable = int(its.tensions.max(axis=0).argmax())
    share = (its.tensions.max() - weak.t_max[cable]) / (weak.t_max[cable] - weak.t_min[cable])
    assert its.excess == pytest.approx(share, rel=1e-6)
    assert its.limit.startswith(f"tension {cable + 1}: ")


def test_an_event_stops_a_team_from_the_command_line(made, tmp_path):
    robot, found = made
    found.save(tmp_path / "line.nc")
    done = run("simulate", robot.name, "line.nc", "--event", "stop at 0.6", "--json", cwd=tmp_path)
    assert json.loads(done.stdout)["passed"]


def test_the_rest_of_a_plan_for_stronger_rotors_is_no_feasible_stop(made):
    """Thrusts by Newton's law, from the positions of carriers and the pull of their cables."""
    robot, found = made
    begins, carrier = found.duration - 0.15, 1
    trajectory, g = planned(found)[1], np.array(robot.gravity)
    its = stop(found, begins)
    along = Dynamics(robot).wrench_matrix(its.platform[0], its.carriers[0])[:, :3, carrier]
    force = robot.carriers[carrier].mass * (its.carriers[2][:, carrier, :3] - g) + its.tensions[:, [carrier]] * along
    most = float(np.linalg.norm(force, axis=1).max())
    carriers = [each.model_dump() | {"thrust_max": 0.9 * most if k == carrier else 1e3}
                for k, each in enumerate(robot.carriers)]  # fmt: skip
    weak = team_stop_along(Robot.model_validate({**robot.model_dump(), "carriers": carriers}), trajectory, begins)
    assert weak.limit.startswith(f"thrust of {robot.carriers[carrier].name}: ")
    assert weak.excess == pytest.approx(1 / 0.9 - 1, rel=0.02)


def test_carriers_with_two_cables_keep_the_path_of_their_hooks():
    robot = hooked_below(0.1)
    line = {"path": {"kind": "line", "start": [0, 0, 0], "end": [1.5, 0, 0.2]}, "duration": 3.0}
    found = plan(robot, {**line, "base": {"kind": "free"}, "steps": 24})
    assert found.feasible
    its, dynamics, g = stop(found, 1.5), Dynamics(robot), np.array(robot.gravity)
    assert its.feasible
    assert its.duration < 1.5  # what is left of the plan
    (pose, velocity, acceleration), (carriers, _, bends) = its.platform, its.carriers
    A = dynamics.wrench_matrix(pose, carriers)
    missing = dynamics.required_wrench(pose, velocity, acceleration) - (A @ its.tensions[..., None])[..., 0]
    assert np.abs(missing).max() < 1e-3 * robot.weight
    lengths = dynamics.cable_lengths(pose, carriers)
    np.testing.assert_allclose(lengths, np.broadcast_to(robot.fixed_lengths, lengths.shape), atol=1e-4)
    assert its.tensions.min() > 0.49
    fine = references(found, 1e-3)
    hooks = np.stack([points.anchors(robot, each.carrier_pose[None])[0] for each in fine])
    own = points.anchors(robot, carriers)
    off = np.linalg.norm(own[:, None] - hooks[None], axis=3).min(axis=1)
    assert off.max() < 2e-3
    for index, carrier in enumerate(robot.carriers):
        mine = robot.carrier_of_cable == index
        pull = -(its.tensions[:, None, mine] * A[:, :3, mine]).sum(axis=2)
        thrust = np.linalg.norm(carrier.mass * (bends[:, index, :3] - g) - pull, axis=1)
        assert (thrust < carrier.thrust_max).all()
    flown = simulate(
        robot, found, ComputedTorque(robot), duration=1.7 + its.duration, period=2e-3, events=["stop at 1.5"]
    )
    assert flown.passed
    assert flown.error.max() < 1e-3


def test_a_team_with_more_cables_than_it_needs_keeps_the_tensions_of_its_plan():
    """Eight cables on three quadrotors, which tilt for the planned tensions: others give forces across the thrust."""
    data = load("flycrane").model_dump(mode="json")
    corners = [cable["attachment"] for cable in data["cables"]]
    data["cables"] += [{**data["cables"][k], "attachment": corners[j], "length": None} for k, j in ((0, 2), (2, 0))]
    robot = Robot.model_validate(data)
    dynamics, carriers = Dynamics(robot), robot.carrier_home.copy()
    A, w = dynamics.wrench_matrix(robot.home, carriers), dynamics.required_wrench(robot.home, *np.zeros((2, 6)))
    tensions = np.linalg.lstsq(A, w - A @ (near := np.full(robot.m, 6.0)))[0] + near
    for k, carrier in enumerate(robot.carriers):
        pull = -(A[:3] @ (tensions * (robot.carrier_of_cable == k)))
        tilts = carrier.balanced_tilt(carriers[[k]], np.zeros((1, 6)), pull[None], np.array(robot.gravity))
        carriers[k, 3:5] = tilts[0]

    def at(times):
        poses = [np.repeat(each[None], len(times), axis=0) for each in (robot.home, carriers)]
        return tuple((pose, 0 * pose, 0 * pose) for pose in poses)

    rest = Trajectory(0.05, at, lambda times: np.tile(tensions, (len(times), 1)))
    its = team_stop_along(robot, rest, 0.0)
    assert (its.excess, its.limit) == (0.0, "")
    np.testing.assert_allclose(its.tensions, np.tile(tensions, (len(its.times), 1)), atol=1e-6)


def test_robots_that_have_hardly_begun_to_move_do_not_follow_their_plan_to_its_end():
    """Also where the shortest stop of those that are tried first is beyond limits between its instants."""
    robot = load("flycrane")
    end = robot.home + np.array([-0.2, 0.1, 0.1, 0, 0, 0])
    line = {"kind": "line", "start": robot.home.tolist(), "end": end.tolist()}
    found = plan(robot, {"path": line, "duration": 1.0, "base": {"kind": "free"}, "steps": 12})
    for its in (stop(found, time) for time in np.arange(0, 0.05, 0.01)):
        assert its.feasible
        assert its.duration < 0.5 * found.duration


def with_winches(name):
    """Return three quadrotors with a winch each, or a ring of six cables below one quadrotor with one to the ground."""
    data = load("multi-quadrotor-3" if name == "team" else "wang-flying-quadrotor").model_dump(mode="json")
    if name == "team":
        winch = {"inertia": 0.2, "friction": 0.1, "speed_max": 3, "force_max": 80}
        data |= {"drive": "both", "cables": [each | {"length": None, "winch": winch} for each in data["cables"]]}
    if name == "tied":
        tied = {"carrier": "ground", "anchor": [3, 0, -3], "attachment": [0, 0, -0.05]}
        data["carriers"].append({"name": "ground", "kind": "ground"})
        data["cables"].append(data["cables"][0] | tied)
    return Robot.model_validate(data | {"name": name})


@pytest.mark.parametrize("name", ["team", "tied"])
def test_stops_of_flying_carriers_with_winches_obey_the_equations_of_motion(name):
    robot = with_winches(name)
    dynamics, g, start = Dynamics(robot), np.array(robot.gravity), robot.home[:3]
    path = {"kind": "line", "start": start.tolist(), "end": (start + np.array([0.9, 0.3, 0.1])).tolist()}
    found = plan(robot, {"path": path, "duration": 1.5, "base": {"kind": "free"}, "margin": 0.2, "steps": 15})
    assert found.feasible
    way = np.stack([each.pose[:3] for each in references(found, 1e-3)])
    for time in (0.7, 1.2):
        its = stop(found, time)
        assert its.feasible
        assert its.duration <= found.duration - time + 1e-9
        assert np.linalg.norm(its.platform[0][:, None, :3] - way, axis=2).min(axis=1).max() < 2e-3
        A = dynamics.wrench_matrix(its.platform[0], its.carriers[0])
        missing = dynamics.required_wrench(*its.platform) - (A @ its.tensions[..., None])[..., 0]
        assert np.abs(missing * robot.wrench_scale).max() < 1e-4 * robot.weight
        assert (its.tensions > 0.9 * robot.t_min).all()
        directions, R = -A[:, :3].swapaxes(1, 2), points.rotations(its.carriers[0][..., 3:])
        for k, carrier in enumerate(robot.carriers):
            mine, (pose, velocity, acceleration) = robot.carrier_of_cable == k, (part[:, k] for part in its.carriers)
            inside = slice(2, -2)  # the differences of which are of second order
            rate = np.gradient(pose, its.times, axis=0)
            np.testing.assert_allclose(rate[inside], velocity[inside], atol=0.02 * (1 + np.abs(velocity).max()))
            if not carrier.actuators:
                np.testing.assert_array_equal(pose, np.tile(pose[0], (len(pose), 1)))
                continue
            pulls = its.tensions[:, mine, None] * directions[:, mine]
            force = carrier.mass * (acceleration[:, :3] - g) - pulls.sum(axis=1)
            along = (R[:, k, :, 2] * force).sum(axis=1)
            assert (along < carrier.thrust_max).all()
            assert np.linalg.norm(force - along[:, None] * R[:, k, :, 2], axis=1).max() < 0.02 * along.max()
    run = simulate(
        robot, found, ComputedTorque(robot), duration=1.5 + its.duration, period=2e-3, events=["stop at 1.2"]
    )
    assert run.passed
    assert run.error.max() < 2e-3


def test_what_is_no_such_team_is_refused_in_one_line():
    data = load("wang-flying-quadrotor").model_dump(mode="json")
    robot = Robot.model_validate(data | {"cables": data["cables"][:5]})

    def at(times):
        poses = [np.repeat(each[None], len(times), axis=0) for each in (robot.home, robot.carrier_home)]
        return tuple((pose, 0 * pose, 0 * pose) for pose in poses)

    with pytest.raises(
        InputError, match=r"have one cable each, or cables that give every .* got 'wang-flying-q"
    ) as error:
        team_stop_along(robot, Trajectory(1.0, at), 0.5)
    assert "\n" not in str(error.value)
