"""Motions whose acceleration jumps between the rows of a plan: what controllers and stops read is what was planned."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import linprog

from towline import Dynamics, Robot, load, plan, time_along
from towline.control import stop
from towline.control.trajectory import read_trajectory

COGIRO = load("cogiro")
START, WAY = np.array([-0.5, 0.2, 1.0]), np.array([1.0, 0.6, 0.4])  # [m]
BENDS = {"kind": "waypoints", "points": [[0, 0, 1], [2, 1, 2], [-2, 1, 1.5], [-1, -2, 1]], "blend": 0.3}


def box():
    """A made-up frame with eight cables to a platform of 12 kg, at the height of its anchors' centre."""
    signs = np.array([[x, y, z] for z in (-1, 1) for x in (-1, 1) for y in (-1, 1)])
    crossed = signs * [1, 1, -1]
    cables = [
        {"carrier": "f", "anchor": anchor.tolist(), "attachment": at.tolist(), "t_min": 5, "t_max": 600}
        for anchor, at in zip(signs * [2.1, 1.7, 1.4], crossed * [0.15, 0.1, 0.12], strict=True)
    ]
    platform = {"mass": 12, "inertia": [0.2, 0.25, 0.3, 0, 0, 0]}
    carriers = [{"name": "f", "kind": "ground", "home": [0] * 6}]
    return Robot.model_validate(
        {"name": "box", "source": "made up", "platform": platform, "carriers": carriers, "cables": cables}
    )


TASKS = {
    "cogiro": (COGIRO, {"path": BENDS}),
    "box": (box(), {"path": BENDS | {"points": [[0, 0, 0], [0.7, 0.2, 0.3], [0, -0.6, -0.2]], "blend": 0.1}}),
}


@cache
def fastest(name):
    pytest.importorskip("toppra")
    found = time_along(*TASKS[name])
    assert found.feasible
    return found


def missing(robot, position, acceleration):
    """Wrench over the weight that no tensions give to a platform without rotation, by a linear program."""
    com, g = np.array(robot.platform.com), np.array(robot.gravity)
    to = np.array([cable.anchor for cable in robot.cables]) - position
    arms = np.array([cable.attachment for cable in robot.cables]) - com
    along = (to - arms - com) / np.linalg.norm(to - arms - com, axis=1, keepdims=True)
    A, force = np.vstack([along.T, np.cross(arms, along).T]), robot.platform.mass * (acceleration - g)
    m, unit = robot.m, np.eye(6)
    bounds = [*zip(robot.t_min, robot.t_max, strict=True), *[(0, None)] * 12]
    cost = np.append(np.zeros(m), np.ones(12))
    found = linprog(cost, A_eq=np.hstack([A, unit, -unit]), b_eq=np.append(force, np.zeros(3)), bounds=bounds)
    return found.fun / (robot.platform.mass * 9.81)


def around_jumps(found, count):
    """Times shortly before and after the jumps of a plan, most of which are between its rows."""
    jumps = found.scenario.path.jumps()
    accelerations = (found.scenario.motion(jumps[1:-1] + shift, None)[0].acceleration for shift in (0.0, -1e-7))
    largest = np.abs(np.subtract(*accelerations)).max(axis=1).argsort()[-count:]
    times = jumps[1:-1][largest, None] + np.array([-3e-3, -1e-3, -1e-5, 0.0, 1e-5, 1e-3, 3e-3])
    return np.unique(times[(times > 0) & (times < found.duration)])


def bang_bang(start, end, half):
    """A straight leg that speeds up for `half` of its time [s] and then brakes, with one constant acceleration."""
    legs = {"kind": "waypoints", "points": [start.tolist(), end.tolist()]}
    return {"kind": "timed", "along": legs, "s": [0, 0.5, 1], "speeds": [0, 1 / half, 0]}


@pytest.mark.parametrize("half", [0.7654321, 1.2])
def test_a_saved_line_at_constant_accelerations_is_the_closed_form(half, tmp_path):
    """The acceleration jumps between two rows, and at a row."""
    found = plan(COGIRO, {"path": bang_bang(START, START + WAY, half)})
    assert found.feasible
    assert np.ptp(np.diff(found.trajectory["time"])) < 1e-12
    trajectory = read_trajectory(COGIRO, found.save(tmp_path / "line.nc"), None)
    assert trajectory.duration == pytest.approx(2 * half)
    times = np.concatenate([np.linspace(0, 2 * half, 3001), half + np.array([-1e-4, -1e-6, -1e-8, 1e-8, 1e-6, 1e-4])])
    times = times[np.abs(times - half) > 1e-9]
    speeds_up = times < half
    rest = np.minimum(times, 2 * half - times)  # since or until the robot rests
    s = np.where(speeds_up, rest**2, 2 * half**2 - rest**2) / (2 * half**2)
    pose, velocity, acceleration = trajectory.at(times)[0]
    np.testing.assert_allclose(pose[:, :3], START + np.outer(s, WAY), atol=1e-10)
    np.testing.assert_allclose(velocity[:, :3], np.outer(rest / half**2, WAY), atol=1e-8)
    np.testing.assert_allclose(acceleration[:, :3], np.outer(np.where(speeds_up, 1, -1), WAY) / half**2, atol=1e-6)


def test_accelerations_of_later_phases_jump_when_they_do():
    """Times from the beginning of a phase are rounded: 2.426 + 0.933 s is less than 0.933 s after 2.426 s."""
    first, second = 1.213, 0.933
    there, back = bang_bang(START, START + WAY, first), bang_bang(START + WAY, START, second)
    found = plan(COGIRO, {"phases": [{"name": "there", "path": there}, {"name": "back", "path": back}]})
    assert found.feasible
    jumps = np.array([first, 2 * first, 2 * first + second])
    times = (jumps + np.array([[-4e-3], [-1e-6], [1e-6], [4e-3]])).T.ravel()
    acceleration = read_trajectory(COGIRO, found, None).at(times)[0][2][:, :3]
    a, b = WAY / first**2, WAY / second**2
    expected = [a, a, -a, -a, -a, -a, -b, -b, -b, -b, b, b]
    np.testing.assert_allclose(acceleration, expected, atol=1e-6)


@pytest.mark.parametrize("name", TASKS)
def test_tensions_exist_wherever_a_saved_fastest_motion_is_read(name, tmp_path):
    found = fastest(name)
    robot, times = found.scenario.robot, around_jumps(found, 12)
    file = found.save(tmp_path / "fastest.nc")
    assert np.ptp(np.diff(found.trajectory["time"])) < 1e-12
    pose, _, acceleration = read_trajectory(robot, file, None).at(times)[0]
    assert max(missing(robot, *row) for row in zip(pose[:, :3], acceleration[:, :3], strict=True)) < 1e-5
    pose, _, acceleration = read_trajectory(robot, found.trajectory.drop_dims("jump"), None).at(times)[0]
    assert max(missing(robot, *row) for row in zip(pose[:, :3], acceleration[:, :3], strict=True)) > 1e-2


@pytest.mark.parametrize("name", TASKS)
def test_fastest_motions_can_be_stopped_at_any_time(name):
    found, rng = fastest(name), np.random.default_rng(5)
    robot = found.scenario.robot
    for time in rng.uniform(0, found.duration, 25):
        its = stop(found, time)
        assert its.feasible
        assert np.abs(its.platform[1][-1]).max() < 1e-6
        worst = its.tensions.min(axis=1).argmin()
        assert missing(robot, its.platform[0][worst, :3], its.platform[2][worst, :3]) < 1e-5


def test_a_motion_that_was_cut_or_changed_is_that_of_its_own_rows():
    """The rows at jumps belong to others: with them a platform 1 mm higher would fall by 1 mm at each jump."""
    given = fastest("box").trajectory
    higher, times = given.copy(deep=True), np.linspace(0, fastest("box").duration, 2000)
    higher["pose"].values[:, 2] += 1e-3
    cut = given.isel(time=slice(3, 40)), given.isel(jump=slice(4, None)), given.drop_vars("jump_pose")
    for changed in (higher, *cut):
        inside = times[(times >= changed["time"].values[0]) & (times <= changed["time"].values[-1])]
        for part, alone in zip(
            read_trajectory(TASKS["box"][0], changed, None).at(inside)[0],
            read_trajectory(TASKS["box"][0], changed.drop_dims("jump"), None).at(inside)[0],
            strict=True,
        ):
            np.testing.assert_array_equal(part, alone)


DENSE = {"output_rate": 100_000}


def test_rows_10_us_apart_have_the_accelerations_of_the_motion_between_them():
    """At a distance of 1 m, differences of poses over h^2 have rounding errors of 1e-5 m/s^2."""
    found = plan(COGIRO, {"path": {"kind": "line", "start": [2, 2, 2], "end": [2.004, 2, 2]}, "duration": 0.05} | DENSE)
    times = np.arange(20, 4980) * 1e-5 + 0.43e-5
    tau = times / 0.05
    law = 0.004 * (420 * tau**2 - 1680 * tau**3 + 2100 * tau**4 - 840 * tau**5) / 0.05**2  # of degree 7
    acceleration = read_trajectory(COGIRO, found, None).at(times)[0][2]
    np.testing.assert_allclose(acceleration[:, 0], law, atol=1e-7)


def test_planned_tensions_bear_a_load_until_it_is_released_in_the_air():
    """1 ms before and after, though rows are 10 ms apart."""
    mass, com = 50.0, np.array([0.1, 0.05, -0.4])
    lower = {"path": {"kind": "line", "start": [0, 0, 2], "end": [0, 0, 1]}, "duration": 2.003}
    lower |= {"name": "lower", "load": {"mass": mass, "com": com.tolist()}}
    leave = {"path": {"kind": "line", "start": [0, 0, 1], "end": [0, 0, 2]}, "duration": 2, "name": "leave"}
    found = plan(COGIRO, {"phases": [lower, leave]})
    assert found.feasible
    times = 2.003 + np.array([-1e-3, 1e-3])
    trajectory = read_trajectory(COGIRO, found, None)
    dynamics, (platform, carriers) = Dynamics(COGIRO), trajectory.at(times)
    needed = dynamics.required_wrench(*platform)
    weight = mass * np.array([0, 0, 9.81])
    needed[0] += np.append(weight, np.cross(com - COGIRO.platform.com, weight))
    given = (dynamics.wrench_matrix(platform[0], carriers[0]) @ trajectory.tensions(times)[:, :, None])[..., 0]
    np.testing.assert_allclose(given, needed, atol=0.1)
