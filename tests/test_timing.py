"""Timing along a path, held against closed forms, an optimal control program of its own, and the planner's audit."""

import sys

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError, SolverError
from towline.models import Dynamics, Robot, load
from towline.models.parsing import parse_yaml, to_yaml
from towline.ocp import MotionStatus, Task, plan, time_along
from towline.ocp.tasks.paths import CirclePath, LinePath, RestPath, SamplePath, TimedPath, WaypointPath
from towline.ocp.tasks.task import Tube
from towline.simulation import simulate
from towline.solvers import TensionProblem, capacity_margin, solve, solve_batch
from towline.solvers.available_wrench import facets

GRAVITY = 9.81
HOVER = RestPath(kind="rest", pose=(50, 50, 100, 0, 0, 0))
PAPER_F = CirclePath(kind="circle", centre=(50, 50, 99), radius=1, rate=0.2 * np.pi)
SMALL_CIRCLE = CirclePath(kind="circle", frame="quad", centre=(0, 0, -1), radius=0.1, rate=0.2 * np.pi)
ROUND_TRIP = WaypointPath(
    kind="waypoints", points=((0, 0, 2), (1, 1, 2.5), (2, 0, 2, 0, 0, 0.1), (-1, -1, 1.5))
)  # of cogiro

pytest.importorskip("toppra")


def point_mass(anchors, dof, kind="ground", mass=2.0, t_min=1.0, t_max=40.0, **carrier):
    """A point mass at the origin that hangs from a carrier at each anchor."""
    return Robot.model_validate(
        {
            "name": "mass",
            "source": "test",
            "platform": {"mass": mass, "home": [0, 0, 0, 0, 0, 0], "dof": dof},
            "carriers": [
                {"name": f"c{i}", "kind": kind, "home": [*anchor, 0, 0, 0], **carrier}
                for i, anchor in enumerate(anchors)
            ],
            "cables": [
                {"carrier": f"c{i}", "anchor": [0, 0, 0], "attachment": [0, 0, 0], "t_min": t_min, "t_max": t_max}
                for i in range(len(anchors))
            ],
        }
    )


def along(path, carriers=None, **more):
    """A task: this path of the platform, these of carriers, and more of its keys."""
    base = {"base": {"kind": "given", "paths": carriers}} if carriers else {}
    return {"path": path, **base, **more}


def straight(robot, by):
    return LinePath(kind="line", start=tuple(robot.home), end=tuple(robot.home + np.array(by)))


def optimal_duration(robot, path, intervals, margin=0.0, power=np.inf):
    """Minimum time by IPOPT: ds/dt at the grid points and tensions at the midpoints are free, A t = w holds there."""
    dynamics, h = Dynamics(robot), 1.0 / intervals
    pose, first, second = path.by_fraction((np.arange(intervals) + 0.5) * h)
    rows = np.flatnonzero(robot.dof_mask)
    A = dynamics.wrench_matrix(pose)[:, rows]
    rest = dynamics.required_wrench(pose, 0 * pose, 0 * pose)[:, rows]
    inertia = dynamics.required_wrench(pose, 0 * pose, first)[:, rows] - rest
    motion = dynamics.required_wrench(pose, first, second)[:, rows] - rest
    h_s = 1e-3 * h  # of differences of the lengths
    around = [
        dynamics.cable_lengths(path.by_fraction((np.arange(intervals) + 0.5) * h + by)[0]) for by in (-h_s, 0, h_s)
    ]
    slope, bend = (around[2] - around[0]) / (2 * h_s), (around[2] - 2 * around[1] + around[0]) / h_s**2
    reflected = np.array([cable.winch.inertia if cable.winch else 0.0 for cable in robot.cables])[:, None]
    speed = ca.MX.sym("speed", intervals + 1)
    tensions = ca.MX.sym("tensions", robot.m, intervals)
    square = speed**2
    u, x = (square[1:] - square[:-1]) / (2 * h), (square[1:] + square[:-1]) / 2
    given = ca.horzcat(*[A[k] @ tensions[:, k] for k in range(intervals)])
    needed = ca.DM(inertia.T) * ca.repmat(u.T, len(rows), 1) + ca.DM(motion.T) * ca.repmat(x.T, len(rows), 1)
    gap = (given - needed - ca.DM(rest.T)) / robot.force_scale
    paid_out = ca.DM(reflected * slope.T) * ca.repmat(u.T, robot.m, 1) + ca.DM(reflected * bend.T) * ca.repmat(
        x.T, robot.m, 1
    )
    motors = np.array([cable.winch.tension_max if cable.winch else 1e6 for cable in robot.cables])
    powers = tensions * ca.DM(slope.T) * ca.repmat(ca.sqrt(x).T, robot.m, 1)
    rows = ca.veccat(gap, (tensions - paid_out) / robot.force_scale, powers / min(power, 1e6))
    most = np.append(np.zeros(gap.numel()), np.tile(motors / robot.force_scale, intervals))
    most = np.append(most, np.ones(powers.numel()))
    duration = ca.sum1(2 * h / (speed[1:] + speed[:-1]))
    program = {"x": ca.veccat(speed, tensions), "f": duration, "g": rows}
    solver = ca.nlpsol("time", "ipopt", program, {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"})
    low = np.concatenate([[0.0], np.full(intervals - 1, 1e-4), [0.0], np.tile(robot.t_min + margin, intervals)])
    high = np.concatenate([[0.0], np.full(intervals - 1, np.inf), [0.0], np.tile(robot.t_max - margin, intervals)])
    start = np.concatenate([np.full(intervals + 1, 0.5), np.tile((robot.t_min + robot.t_max) / 2, intervals)])
    found = solver(x0=start, lbx=low, ubx=high, lbg=-most, ubg=most)
    assert solver.stats()["success"]
    return float(found["f"])


@pytest.mark.parametrize("name", ["ipanema-1", "nist-robocrane", "planar-4", "example-spatial"])
def test_facets_are_as_far_from_a_wrench_as_the_capacity_margin_says(name):
    robot, rng = load(name), np.random.default_rng(3)
    rows = np.flatnonzero(robot.dof_mask)
    poses = robot.home + 0.05 * rng.uniform(-1, 1, (30, 6)) * robot.dof_mask
    A = Dynamics(robot).wrench_matrix(poses)[:, rows] / np.array([1, 1, 1, *[robot.length] * 3])[rows][:, None]
    found = facets(A, robot.t_min, robot.t_max)
    assert not found.outside.any()
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=2), 1, atol=1e-12)
    for k in range(len(A)):
        w = A[k] @ rng.uniform(robot.t_min, robot.t_max)
        along = found.normals[k] @ w
        nearest = min((found.high[k] - along).min(), (along - found.low[k]).min())
        margin = capacity_margin(TensionProblem(A[k], w, robot.t_min, robot.t_max)).value
        assert nearest == pytest.approx(margin, abs=1e-9 * robot.t_max.max())


def test_flat_and_shifted_sets_are_described_inside_their_span():
    rng = np.random.default_rng(5)
    A = rng.normal(size=(3, 4, 5))
    A[1] = rng.normal(size=(4, 2)) @ rng.normal(size=(2, 5))  # rank 2
    t_min, t_max = np.array([1.0, 1, 1, 2, 1]), np.array([3.0, 3, 3, 2, 3])  # cable 4 has no choice
    found = facets(A, t_min, t_max)
    assert np.trace(found.outside[1]) == pytest.approx(2)
    assert not found.outside[[0, 2]].any()
    for k in range(3):
        for t in rng.uniform(t_min - 0.5, t_max + 0.5, (200, 5)):
            t[3] = 2.0
            w = A[k] @ t
            along = found.normals[k] @ w
            inside = min((found.high[k] - along).min(), (along - found.low[k]).min())
            assert np.abs(found.outside[k] @ (w - found.offset[k])).max() < 1e-10
            assert (inside >= 0) == solve(TensionProblem(A[k], w, t_min, t_max)).feasible


def test_one_vertical_cable_has_a_closed_form():
    """Full tension up, least tension to slow down: T^2 = 2 h (1 / up + 1 / down)."""
    mass, height = 2.0, 1.5
    robot = point_mass([[0, 0, 4]], ["z"], mass=mass, t_min=1.0, t_max=40.0)
    for margin in (0.0, 3.0):
        timing = time_along(robot, along(straight(robot, [0, 0, height, 0, 0, 0]), margin=margin))
        up, down = (40 - margin) / mass - GRAVITY, GRAVITY - (1 + margin) / mass
        assert timing.feasible
        assert timing.duration == pytest.approx(np.sqrt(2 * height * (1 / up + 1 / down)), rel=2e-4)


def test_minimum_time_on_a_line_agrees_with_an_optimal_control_program():
    robot = load("ipanema-1")
    path = straight(robot, [0.6, 0.4, 0.3, 0, 0, 0])
    timing = time_along(robot, along(path, margin=30.0))
    best = optimal_duration(robot, path.model_copy(update={"timing": "uniform"}), 200, 30.0)
    assert timing.feasible
    assert timing.duration == pytest.approx(best, rel=0.01)


def test_motors_of_winches_give_the_minimum_time_of_an_optimal_control_program():
    """Their inertia is the mass of the platform; every second motor can do more than its cable."""
    data = load("ipanema-1").model_dump()
    mass = data["platform"]["mass"]
    data["cables"] = [
        cable | {"winch": {"inertia": mass / 8, "force_max": cable["t_max"] * (0.5 + 0.6 * (i % 2)), "speed_max": 9}}
        for i, cable in enumerate(data["cables"])
    ]
    robot = Robot.model_validate(data)
    path = straight(robot, [0.6, 0.4, 0.3, 0, 0, 0])
    fastest = time_along(robot, along(path, limits={"winch_power": 200.0}))
    assert fastest.feasible
    best = optimal_duration(robot, path.model_copy(update={"timing": "uniform"}), 200, power=200.0)
    assert fastest.duration == pytest.approx(best, rel=0.005)
    for name in ("winch_force", "winch_power"):
        assert any(name in each.limit for each in fastest.law.bottlenecks)


@pytest.mark.parametrize("power", [40.0, 80.0])
def test_a_limit_of_power_gives_the_minimum_time_of_one_vertical_cable(power):
    """Up with t_max, from v = P / t_max on with P / v, then down with t_min: dv/dt and dz/dv by quadrature."""
    mass, height, t_min, t_max = 2.0, 1.5, 1.0, 40.0
    robot = point_mass([[0, 0, 4]], ["z"], mass=mass, t_min=t_min, t_max=t_max)
    task = along(straight(robot, [0, 0, height, 0, 0, 0]), limits={"winch_power": power})
    fastest = time_along(robot, task, grid=800)
    assert fastest.feasible
    v = (np.arange(400_000) + 0.5) / 400_000 * power / (mass * GRAVITY)  # there the mass rises at a constant speed
    step, up = v[1] - v[0], np.minimum(t_max, power / v) / mass - GRAVITY
    down = GRAVITY - t_min / mass
    risen, seconds = np.cumsum(v / up) * step, np.cumsum(1 / up) * step
    turn = np.searchsorted(risen + v**2 / (2 * down), height)
    assert fastest.duration == pytest.approx(seconds[turn] + v[turn] / down, rel=1e-3)
    assert {each.limit for each in fastest.law.bottlenecks} == {
        "t_max of cable 1",
        "winch_power of cable 1",
        "t_min of cable 1",
    }


def test_a_cable_that_rests_for_an_instant_needs_no_power():
    """Passing below an anchor, its length has no rate; there and back in time the law is the same."""
    robot = point_mass([[-2, 0, 2], [0, 0, 2], [2, 0, 2]], ["x", "z"])
    path = LinePath(kind="line", start=(-0.5, 0, 0), end=(0.5, 0, 0))
    with np.errstate(over="raise"):
        fastest = time_along(robot, along(path, limits={"winch_power": 5.0}))
    assert fastest.feasible
    assert fastest.duration > 1.3 * time_along(robot, along(path)).duration
    sd = fastest.law.sd
    np.testing.assert_allclose(sd, sd[::-1], atol=0.02 * sd.max())


@pytest.mark.parametrize(("inertia", "force"), [(3.0, 40.0), (300.0, 40.0), (2e4, 40.0), (3.0, 1.0)])
def test_of_two_cables_the_one_without_a_motor_pulls_what_a_motor_cannot(inertia, force):
    """A motor that accelerates its winch, and a cable beside it that takes the remainder of the load.

    The winch of 300 kg holds the platform up when it should fall; a motor that can just hold t_min accelerates nothing.
    """
    mass, height = 2.0, 1.5
    data = point_mass([[0, 0, 4], [0, 0, 4]], ["z"], mass=mass, t_min=1.0, t_max=40.0).model_dump()
    data["cables"][0]["winch"] = {"inertia": inertia, "force_max": force, "speed_max": 99.0}
    robot = Robot.model_validate(data)
    fastest = time_along(robot, along(straight(robot, [0, 0, height, 0, 0, 0])))
    if force == 1.0:
        assert fastest.status is MotionStatus.NOT_FOUND
        return
    up, down = (40 + force - mass * GRAVITY) / (mass + inertia), (mass * GRAVITY - 1 + force) / (mass + inertia)
    if inertia == 3.0:
        named = {each.limit for each in fastest.law.bottlenecks}
        assert named == {"t_max of cable 2; winch_force of cable 1", "t_min of cables 1, 2"}
    up, down = min(up, (force - 1) / inertia), min(down, GRAVITY - 2 / mass)  # with 1 N where a motor could pull less
    assert fastest.feasible
    assert fastest.duration == pytest.approx(np.sqrt(2 * height * (1 / up + 1 / down)), rel=2e-4)


def test_minimum_time_on_a_curve_agrees_with_an_optimal_control_program():
    robot, circle = load("cogiro"), CirclePath(kind="circle", centre=(0, 0, 2), radius=1, rate=1)
    timing = time_along(robot, along(circle))
    assert timing.feasible
    assert timing.duration == pytest.approx(optimal_duration(robot, circle, 150), rel=0.01)


def test_grids_hardly_matter_and_margins_cost_time():
    robot = load("cogiro")
    durations = [time_along(robot, along(ROUND_TRIP), grid=grid).duration for grid in (50, 200)]
    assert np.ptp(durations) < 3e-3 * durations[-1]
    assert durations[-1] == min(durations)
    slower = [time_along(robot, along(ROUND_TRIP, margin=margin)).duration for margin in (20.0, 60.0)]
    assert durations[-1] < slower[0] < slower[1]


def test_plans_of_timings_pass_the_audit():
    cogiro, flying = load("cogiro"), load("wang-flying")
    pitching = WaypointPath(kind="waypoints", points=((0, 0, 10), (1, 1, 10, 0, 0.1, 0), (3, 0, 11)))
    for robot, timing in [
        (cogiro, time_along(cogiro, along(ROUND_TRIP, margin=5.0))),
        (flying, time_along(flying, along(SMALL_CIRCLE))),
        (flying, time_along(flying, along(SMALL_CIRCLE, wind=(0, 0, 0)))),
        (flying, time_along(flying, along(SMALL_CIRCLE, {"quad": pitching}, margin=0.1))),
    ]:
        assert timing.feasible
        assert timing.audit.violation.max() <= 1e-6
        found = plan(robot, timing.scenario.task)
        assert found.feasible, found.report()
        assert found.margin >= timing.scenario.task.margin - 1e-6
        # The fastest motion comes near to a limit.
        assert found.margin < timing.scenario.task.margin + 0.02 * robot.weight
        assert found.audit.times[-1] == pytest.approx(timing.duration)
        # It is the same motion in {G}, by code that knows no s.
        times = found.audit.times
        for mine, its in zip(timing.scenario.motion(times, None)[0], found.audit.motion, strict=True):
            np.testing.assert_allclose(mine, its, atol=1e-9)


def test_carriers_moving_along_with_the_load_have_a_closed_form():
    """The whole robot is shifted: the carriers' limits of speed and acceleration make a trapezoid."""
    anchors, way = [[2, 0, 2], [-1, 1.7, 2], [-1, -1.7, 2]], np.array([1.2, 0.5, 0.0])
    reach = {"min": [-9, -9, 0], "max": [9, 9, 9]}
    robot = point_mass(anchors, ["x", "y", "z"], "mobile", reach=reach, speed_max=0.8, acceleration_max=1.5)
    carriers = {
        f"c{i}": LinePath(kind="line", start=tuple(anchor), end=tuple(anchor + way)) for i, anchor in enumerate(anchors)
    }
    timing = time_along(robot, along(straight(robot, [*way, 0, 0, 0]), carriers))
    assert timing.feasible
    assert timing.duration == pytest.approx(np.linalg.norm(way) / 0.8 + 0.8 / 1.5, rel=2e-3)
    assert plan(robot, timing.scenario.task).feasible
    slower = time_along(robot, along(straight(robot, [*way, 0, 0, 0]), carriers, limits={"carrier_speed": 0.5}))
    assert slower.duration == pytest.approx(np.linalg.norm(way) / 0.5 + 0.5 / 1.5, rel=2e-3)
    # Carriers alone may move too: then the platform's relative motion is theirs.
    alone = time_along(
        load("wang-flying"),
        along(
            RestPath(kind="rest", frame="quad", pose=(0, 0, -1)),
            {"quad": LinePath(kind="line", start=(0, 0, 10), end=(3, 0, 10))},
        ),
    )
    assert alone.feasible


def test_speeds_stay_inside_their_limits():
    robot = load("cogiro")
    free = time_along(robot, along(ROUND_TRIP))
    limited = time_along(robot, along(ROUND_TRIP, limits={"platform_speed": 1.2, "cable_speed": 1.0}))
    assert limited.feasible
    assert limited.duration > free.duration
    times = np.linspace(0, limited.duration, 4001)
    platform, _ = limited.scenario.motion(times, None)
    lengths = Dynamics(robot).cable_lengths(platform.pose)
    cable_speed = np.abs(np.diff(lengths, axis=0)).max() / times[1]
    speed = np.linalg.norm(platform.velocity[:, :3], axis=1).max()
    assert speed <= 1.2 * (1 + 1e-6)
    assert cable_speed <= 1.0 * (1 + 1e-5)
    assert max(speed / 1.2, cable_speed) > 0.995  # one of them holds it back


def test_hovering_quadrotor_cannot_start_the_papers_circle(tmp_path):
    robot = load("wang-flying")
    timing = time_along(robot, along(PAPER_F, {"quad": HOVER}))
    assert timing.status is MotionStatus.INFEASIBLE
    # On the circle the load could go round as a conical pendulum does; to rest there is what is impossible.
    np.testing.assert_array_equal(timing.law.blocked, [0, 1])
    assert timing.certificate.verify(timing.law.problem)
    assert timing.certificate.shortfall > 1
    assert "short by" in timing.report()
    away = time_along(robot, along(LinePath(kind="line", frame="quad", start=(0, 0, -1), end=(1, 0, -1))))
    assert away.status is MotionStatus.INFEASIBLE
    assert away.law.at == 1
    assert away.to_dict()["duration"] is None
    # Its motion only shows the path: nothing follows it or starts from it, not even from a file.
    file = away.save(tmp_path / "away.nc")
    for reference in (away, away.trajectory, file):
        with pytest.raises(InputError, match="reference must be a plan whose motion a robot can follow"):
            simulate(robot, reference)
    with pytest.raises(InputError, match="start must be a plan with a time law"):
        plan(robot, away.scenario.task.model_copy(update={"tube": Tube(position=0.1)}), start=away)


def test_a_blocked_arc_is_found_and_proven_for_every_speed():
    robot, angles = load("wang-flying"), np.linspace(0, np.pi / 4, 3)
    arc = [(0.4 * np.cos(angle), 0.4 * np.sin(angle), -1) for angle in angles]
    path = WaypointPath(
        kind="waypoints", frame="quad", points=((0, 0, -1), (0.2, 0, -1), *arc, (0.14, 0.14, -1), (0, 0, -1))
    )
    timing = time_along(robot, along(path, limits={"platform_speed": 0.3}))
    assert timing.status is MotionStatus.INFEASIBLE
    platform, _ = timing.law.parametrised.at(timing.law.blocked)
    radius = np.linalg.norm(platform.pose[:, :2], axis=1)
    assert radius.min() > 0.2
    certificate, problem = timing.certificate, timing.law.problem
    assert certificate.verify(problem)
    place, _ = timing.law.parametrised.at(np.array([timing.law.at]))
    top = 0.3 / np.linalg.norm(place.velocity[0, :3])
    rng = np.random.default_rng(1)
    places, _ = timing.law.parametrised.at(np.full(300, timing.law.at))
    motion = places.timed(rng.uniform(0, top, 300), rng.normal(size=300) * 30)
    w = timing.law.parametrised.dynamics.required_wrench(*motion)
    assert (w @ certificate.direction - certificate.support >= certificate.shortfall - 1e-6).all()


def test_samples_and_timed_paths_are_taken_as_curves():
    robot = load("cogiro")
    times = np.linspace(0, 3, 13)
    samples = SamplePath(kind="samples", times=tuple(times), poses=tuple((np.sin(t) ** 3, 0.2 * t, 2) for t in times))
    first = time_along(robot, along(samples))
    assert first.feasible
    # Tensions exist between the instants of the audit too, where 1.9 mN were missed.
    motion, _ = first.scenario.motion(np.linspace(0, first.duration, 8001), None)
    dynamics = Dynamics(robot)
    A, w = dynamics.wrench_matrix(motion.pose), dynamics.required_wrench(*motion)
    assert solve_batch(A, w, robot.t_min, robot.t_max, length=robot.length).feasible.all()
    again = time_along(robot, along(first.scenario.path))
    assert again.duration == pytest.approx(first.duration)


def test_two_cables_move_a_mass_in_their_plane_alone():
    robot = point_mass([[-1, 0, 2], [1, 0, 2]], ["x", "y", "z"])
    inside = time_along(robot, along(straight(robot, [0.2, 0, 0.3, 0, 0, 0])))
    assert inside.feasible
    assert plan(robot, inside.scenario.task).feasible
    with pytest.raises(InputError, match="rank 2 of 3"):
        time_along(robot, along(straight(robot, [0.2, 0.1, 0.3, 0, 0, 0])))
    tilted = point_mass([[-1, 0.5, 2], [1, 0.5, 2]], ["x", "y", "z"])
    beside = time_along(tilted, along(straight(tilted, [0.2, 0, 0, 0, 0, 0])))
    assert beside.status is MotionStatus.INFEASIBLE
    assert beside.certificate.singular


def test_a_timed_path_is_a_path_as_others_are():
    circle = CirclePath(kind="circle", centre=(0, 0, 1), radius=1, rate=1)
    path = TimedPath(kind="timed", along=circle, s=(0, 0.3, 0.7, 1), speeds=(0, 0.5, 0.4, 0))
    ends = path.times
    assert path.natural_duration == pytest.approx(0.6 / 0.5 + 0.8 / 0.9 + 0.6 / 0.4)
    step = 1e-4
    times = np.linspace(0.01, ends[-1] - 0.01, 50)
    times = times[np.abs(times[:, None] - ends).min(axis=1) > 2 * step]
    before, at, after = (path.at(times + shift, 1.0) for shift in (-step, 0, step))
    np.testing.assert_allclose(at.velocity, (after.pose - before.pose) / (2 * step), atol=1e-5)
    np.testing.assert_allclose(at.acceleration, (after.velocity - before.velocity) / (2 * step), atol=1e-5)
    late = path.at(np.array([ends[-1] + 1]), 1.0)
    np.testing.assert_allclose(late.pose, circle.by_fraction(np.array([1.0])).pose)
    assert not late.velocity.any()
    task = Task(path=path)
    assert parse_yaml(to_yaml(task), Task, "task") == task


def test_legs_rest_nowhere_along_s():
    path = WaypointPath(kind="waypoints", points=((0, 0, 1), (1, 0, 2, 0, 0, 0.5), (1, 1, 1)), blend=0.1)
    s, step = np.linspace(0.01, 0.99, 40), 1e-5
    before, at, after = (path.by_fraction(s + shift) for shift in (-step, 0, step))
    np.testing.assert_allclose(at.velocity, (after.pose - before.pose) / (2 * step), atol=1e-5)
    np.testing.assert_allclose(at.acceleration, (after.velocity - before.velocity) / (2 * step), atol=1e-2)
    assert np.linalg.norm(path.by_fraction(np.linspace(0, 1, 999)).velocity, axis=1).min() > 1
    np.testing.assert_allclose(path.by_fraction(np.array([0.0, 1.0])).pose[:, :3], [[0, 0, 1], [1, 1, 1]], atol=1e-12)


def test_a_leg_of_a_millimetre_is_timed_too():
    points = [[0, 0, 2], [1, 1, 2.3], [1.0005, 0.9992, 2.3003], [-0.5, 0.3, 1.8]]
    timings = [time_along("cogiro", along({"kind": "waypoints", "points": points, "blend": b})) for b in (None, 0)]
    assert all(timing.feasible for timing in timings)
    assert timings[0].duration < timings[1].duration  # which rests at both
    # A law on a third of the grid misses the bends, by more than 1 N for some 0.1 % of the time. The audit finds it.
    law, robot = timings[0].scenario.path, load("cogiro")
    fewer = {"s": (*law.s[:-1:3], 1.0), "speeds": (*law.speeds[:-1:3], 0.0)}
    coarse = TimedPath.model_validate(law.model_dump() | fewer)
    found = plan(robot, {"path": coarse})
    times = np.linspace(0, coarse.natural_duration, 50_001)
    motion, dynamics = coarse.at(times, times[-1]), Dynamics(robot)
    A, w = dynamics.wrench_matrix(motion.pose), dynamics.required_wrench(*motion)
    wider = solve_batch(A, w, robot.t_min - 1, robot.t_max + 1, length=robot.length)
    assert 0 < np.mean(~wider.feasible) < 2e-3
    assert not found.feasible
    assert found.audit.violation.max() > 1


def test_an_arc_of_many_chords_is_timed():
    robot = point_mass([[2, 2, 3], [-2, 2, 3], [-2, -2, 3], [2, -2, 3]], ["x", "y", "z"])
    arc = [[0.5 * np.cos(angle), 0.5 * np.sin(angle), 0] for angle in np.linspace(0, np.pi, 30)]
    timing = time_along(robot, along({"kind": "waypoints", "points": [*arc, [-0.5, -0.5, 0.3]]}))
    assert timing.feasible, timing.reason  # tensions are missing in a few bends: only there is the grid refined


def test_a_path_below_the_floor_is_infeasible_at_any_speed():
    robot = point_mass([[2, 2, 3], [-2, 2, 3], [-2, -2, 3], [2, -2, 3]], ["x", "y", "z"])
    below = robot.model_copy(update={"floor": 0.1})
    timing = time_along(below, along({"kind": "line", "start": [0, 0, 0.5], "end": [0.5, 0, 0]}))
    assert timing.status is MotionStatus.INFEASIBLE
    (excess,) = timing.audit.excess
    assert (excess.limit, excess.value) == ("floor", pytest.approx(-0.1))
    assert time_along(below, along({"kind": "line", "start": [0, 0, 0.5], "end": [0.5, 0, 0.1]})).feasible


def test_corners_and_dwells_are_rests_of_the_fastest_law():
    """A mass below one cable goes up, dwells, comes down again, and each way has a closed form."""
    mass, up, down = 2.0, 40 / 2.0 - GRAVITY, GRAVITY - 1 / 2.0
    robot = point_mass([[0, 0, 4]], ["z"], mass=mass, t_min=1.0, t_max=40.0)
    points, dwell = ((0, 0, 0), (0, 0, 1.5), (0, 0, 0.5), (0, 0, 0.8)), (0.2, 0.0, 0.7, 0.1)
    path = WaypointPath(kind="waypoints", points=points, dwell=dwell, blend=0)
    timing = time_along(robot, along(path))
    best = sum(np.sqrt(2 * h * (1 / up + 1 / down)) for h in (1.5, 1.0, 0.3))
    assert timing.feasible
    assert timing.duration == pytest.approx(best + sum(dwell), rel=1e-3)
    found = plan(robot, timing.scenario.task)
    assert found.feasible, found.report()
    times, heights = found.audit.times, found.audit.motion.pose[:, 2]
    for k, (point, seconds) in enumerate(zip(points, dwell, strict=True)):
        still = np.flatnonzero((np.abs(heights - point[2]) < 1e-9) & (np.abs(found.audit.motion.velocity[:, 2]) < 1e-9))
        near = times[still] if k else times[still][times[still] < 0.5]
        assert len(near) * times[1] == pytest.approx(seconds, abs=3e-3)
    again = Task.model_validate(timing.scenario.task.model_dump(mode="json"))
    assert again == timing.scenario.task
    dwells = [each.seconds for each in timing.law.bottlenecks if each.limit == "dwell"]
    assert dwells == pytest.approx([seconds for seconds in dwell if seconds], abs=1e-6)
    assert "dwell" in timing.report()


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ({"s": (0, 1), "speeds": (0, 0)}, "must not be 0 twice in a row"),
        ({"s": (0, 0.5), "speeds": (0, 1)}, "from 0 to 1"),
        ({"s": (0, 0.6, 0.5, 1), "speeds": (0, 1, 1, 0)}, "must increase"),
        (
            {"s": (0, 0.5, 1), "speeds": (0, 1, 0), "dwell": (0, 1, 0)},
            r"dwell\[1\] must be 0 s where the speed is not 0",
        ),
        ({"s": (0, 0.5, 1), "speeds": (0, 1, 0), "dwell": (0,)}, "dwell must have one number for each of the 3 s"),
        ({"s": (0, 0.5, 1), "speeds": (0, 1)}, "one number for each of the 3 s"),
        ({"s": (0, 0.5, 1), "speeds": (0, 1, 0), "frame": "quad"}, "must equal along.frame"),
    ],
)
def test_laws_that_are_none_are_refused(law, message):
    with pytest.raises(InputError, match=message):
        TimedPath.model_validate({"kind": "timed", "along": PAPER_F.model_dump(), **law})


CENTRE = {"kind": "line", "start": [0, 0, -1], "end": [0, 0, -1.2]}
QUAD = {"kind": "line", "start": [0, 0, 0], "end": [1, 0, 0]}


def given(paths):
    return {"base": {"kind": "given", "paths": paths}}


@pytest.mark.parametrize(
    ("robot", "path", "more", "message"),
    [
        ("wang-flying", {"kind": "spiral"}, {}, "path.kind must be one of .*, got 'spiral'"),
        ("wang-flying", {**CENTRE, "end": [0, 0, -1]}, {}, "path must move platform or carriers everywhere"),
        ("wang-flying", {**CENTRE, "frame": "moon"}, {}, "path.frame must be world or quad, got 'moon'"),
        ("wang-flying", CENTRE, given({"moon": QUAD}), r"base\.paths must name carriers of the robot .*, got 'moon'"),
        ("wang-flying", CENTRE, given({"quad": {**QUAD, "frame": "quad"}}), "frame must be world"),
        ("cogiro", ROUND_TRIP, given({"frame": QUAD}), "of kind ground"),
        ("wang-flying", CENTRE, {"margin": 40}, "margin must be at most 29.75 N.* cable 1"),
        ("wang-flying", CENTRE, {"margin": -1}, "margin"),
        ("wang-flying", CENTRE, {"limits": {"platform_speed": 0}}, "platform_speed"),
        ("wang-flying", CENTRE, {"wind": (1, 0, 0)}, r"wind must be \[0, 0, 0\], still air"),
        ("cogiro", ROUND_TRIP, {"wind": (0, 0, 0)}, "no platform.aero"),
        ("wang-flying", CENTRE, {"tube": {"position": 0.1}}, "tube must be left out"),
        ("wang-flying", CENTRE, {"base": {"kind": "free"}}, "base.kind must be hold or given"),
        ("cogiro", ROUND_TRIP, {"limits": {"tension_rate": 3}}, "limits.tension_rate must be left out"),
        ("cogiro", ROUND_TRIP, {"margin": 1, "limits": {"soft": {"margin": 1}}}, "limits.soft must be left out"),
        ("flycrane", CENTRE, {}, "of kind quadrotor"),
        ("planar-4", {**CENTRE, "end": [0, 0.3, -1]}, {}, "path must keep y at its home value"),
        ("wang-ctmrts", {"kind": "line", "start": [1.2, 0.9, 0.3], "end": [1.3, 1, 0.5]}, {}, "rank 3 of 6"),
        (7, CENTRE, {}, "robot must be a Robot"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(robot, path, more, message):
    with pytest.raises(InputError, match=message) as error:
        time_along(robot, {"path": path, **more})
    assert "\n" not in str(error.value)


def test_wrong_arguments_are_refused_in_one_line():
    for task in (None, 3, ["path"], "no-such-file.yaml"):
        with pytest.raises(InputError) as error:
            time_along("cogiro", task)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="grid must be a whole number from 10"):
        time_along("cogiro", along(ROUND_TRIP), grid=2)


def test_speed_without_a_limit_is_refused():
    """A load that keeps its place in {G} while its carrier drifts by a hair: tensions hardly tell the speed."""
    robot = point_mass([[0, 0, 4]], ["z"], "prescribed")
    path, drift = RestPath(kind="rest", pose=(0, 0, 0)), LinePath(kind="line", start=(0, 0, 4), end=(0, 0, 5))
    for limits in ({}, {"winch_power": 5.0}):
        with pytest.raises(InputError, match="carrier_acceleration that bounds the speed, because the tension limits"):
            time_along(robot, along(path, {"c0": drift}, limits=limits))
    assert time_along(robot, along(path, {"c0": drift}, limits={"carrier_speed": 1.0})).feasible


@pytest.mark.parametrize(
    ("limits", "named"),
    [({"winch_power": 1e-4}, "winch_power of cable 1"), ({"platform_speed": 1e-6}, "speed of platform")],
)
def test_a_limit_that_permits_only_a_motion_of_days_is_named(limits, named):
    """The power that lifts 2 kg by 1 m in 10^4 s is 2 mW."""
    robot = point_mass([[0, 0, 4]], ["z"])
    with pytest.raises(InputError, match=rf"limits must permit a motion of at most 10000 s, .* by {named}"):
        time_along(robot, along(straight(robot, [0, 0, 1, 0, 0, 0]), limits=limits))


def test_without_the_extra_it_says_how_to_install_it(monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "toppra"]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, "toppra", None)
    monkeypatch.delitem(sys.modules, "towline.ocp.timing.toppra_law", raising=False)
    monkeypatch.delattr(sys.modules["towline.ocp"], "toppra_law", raising=False)
    robot = point_mass([[0, 0, 4]], ["z"])
    with pytest.raises(SolverError, match=r"pip install 'towline\[timing\]'"):
        time_along(robot, along(straight(robot, [0, 0, 1, 0, 0, 0])))


FACADE = [[x, 0.0, 0.4 + 0.2 * (k // 2)] for k, x in enumerate([-1, 1, 1, -1])]


def test_a_facade_is_painted_at_a_steady_speed_with_gentle_ends():
    """Lines at 0.3 m/s, 0.2 m apart: without a limit the ends were taken at 33 m/s^2."""
    path = {"kind": "waypoints", "points": FACADE, "blend": 0.002}
    timing = time_along("ipanema-1", {"path": path, "limits": {"platform_speed": 0.3, "platform_acceleration": 5}})
    assert timing.feasible
    times = np.linspace(0, timing.duration, 20_001)
    platform, _ = timing.scenario.motion(times, None)
    position = platform.pose[:, :3]
    velocity = np.gradient(position, times, axis=0)
    assert np.abs(np.diff(velocity, axis=0) / np.diff(times)[:, None]).max() <= 5 * 1.05
    speed = np.linalg.norm(velocity, axis=1)
    assert speed.max() <= 0.3 * (1 + 1e-4)
    assert np.mean(speed > 0.98 * 0.3) > 0.9
    from_point = np.linalg.norm(position[:, None] - np.array(FACADE), axis=2).min(axis=0)
    assert from_point.max() <= 0.002 * (1 + 1e-6)


@pytest.mark.parametrize("name", ["cable_acceleration", "platform_lateral_acceleration", "platform_acceleration"])
def test_accelerations_stay_inside_their_limits_and_one_holds_it_back(name):
    """By differences of poses and lengths alone; a platform that tilts feels gravity sideways."""
    path = {"kind": "waypoints", "points": [[0, 0, 1, 0, 0, 0], [0.4, 0.2, 1.1, 0.03, -0.02, 0.1]], "blend": 0.05}
    robot, most = load("cogiro"), 0.8
    timing = time_along(robot, {"path": path, "limits": {name: most}})
    assert timing.feasible
    times = np.linspace(0, timing.duration, 4001)
    pose = timing.scenario.motion(times, None)[0].pose
    h = times[1]
    if name == "cable_acceleration":
        size = np.abs(np.diff(Dynamics(robot).cable_lengths(pose), 2, axis=0)).max(axis=1) / h**2
    else:
        felt = np.diff(pose[:, :3], 2, axis=0) / h**2
        if name == "platform_lateral_acceleration":
            R = Rotation.from_euler("ZYX", pose[1:-1, 5:2:-1])
            felt = R.inv().apply(felt + np.array([0, 0, 9.81]))[:, :2]
        size = np.linalg.norm(felt, axis=1)
    assert size.max() <= most * (1 + 5e-3)
    assert size.max() > 0.98 * most
    assert any(name.partition("_")[2].replace("_", " ") in each.limit for each in timing.law.bottlenecks)


def test_a_lateral_acceleration_that_rest_exceeds_has_no_law():
    path = {"kind": "line", "start": [0, 0, 1, 0, 0, 0], "end": [0.3, 0, 1, 0.1, 0, 0]}
    timing = time_along("cogiro", {"path": path, "limits": {"platform_lateral_acceleration": 0.5}})
    assert not timing.feasible
    assert timing.status is not MotionStatus.FEASIBLE


FASTEST = {"duration": {"min": 2, "max": 60}, "objective": {"time": 1}}


@pytest.mark.parametrize(("through", "planned"), [([0, 0, 1.5], True), ([0, 0.2, 1.5], False)])
def test_it_is_slow_near_a_place(through, planned):
    """Also with the centre of the place on the path, where the distance has no derivative."""
    path = {"kind": "line", "start": [-1.5, -0.5, 1.5], "end": [1.5, 0.5, 1.5]}
    task = {"path": path, "limits": {"zone_speed": [{"centre": through, "radius": 0.6, "speed": 0.4}]}}
    found = plan("cogiro", task | FASTEST) if planned else time_along("cogiro", task)
    assert found.feasible
    times = np.linspace(0, found.duration, 20_001)
    position = found.scenario.motion(times, None)[0].pose[:, :3]
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) / times[1]
    inside = np.linalg.norm(position - through, axis=1)[1:] < 0.6
    assert speed[inside].max() <= 0.4 * (1 + 1e-3)
    assert speed[inside].mean() > 0.38
    assert speed.max() > 1
    if not planned:
        assert len(found.law.s) < 1000  # a fine grid only where the bound rises, not 3201 points


def test_it_brakes_to_the_edge_of_a_slow_zone():
    """No grid found a law: a point of it inside the zone was passed slowly enough, and the edge before it was not."""
    far, radius, slow, most = 2.0, 0.77, 0.25, 2.0  # [m], [m], [m/s], [m/s^2]
    path = {"kind": "line", "start": [-far, 0, 2], "end": [far, 0, 2]}
    zone = {"centre": [0.13, 0, 2], "radius": radius, "speed": slow}
    law = time_along("cogiro", {"path": path, "limits": {"zone_speed": [zone], "platform_acceleration": most}})
    assert law.feasible
    seconds = 2 * radius / slow
    for way in (far + 0.13 - radius, far - 0.13 - radius):  # from rest to the zone, and back
        peak = np.sqrt(most * way + slow**2 / 2)
        seconds += (2 * peak - slow) / most
    assert law.duration == pytest.approx(seconds, rel=1e-3)


@pytest.mark.parametrize(
    ("ends", "zones", "slow"),
    [
        ((-0.5, 0.5), [(0.0, 0.5)], 1.0),  # both ends are at the edge
        ((-1.0, 1.0), [(-0.5, 0.5), (0.5, 0.5)], 2.0),  # zones that touch
        ((-1.0, 1.0), [(0.0013, 0.0015)], 0.003),  # smaller than a step of the grid
    ],
)
def test_edges_of_zones_at_ends_and_at_each_other(ends, zones, slow):
    """Points of the grid were at one place, where the law stood still."""
    v, most, fastest = 0.3, 2.0, 1.0  # [m/s], [m/s^2], [m/s]
    path = {"kind": "line", "start": [ends[0], 0, 2], "end": [ends[1], 0, 2]}
    limits = {"platform_speed": fastest, "platform_acceleration": most}
    limits["zone_speed"] = [{"centre": [x, 0, 2], "radius": radius, "speed": v} for x, radius in zones]
    law = time_along("cogiro", {"path": path, "limits": limits})
    assert law.feasible
    seconds = slow / v + v / most  # from rest and to rest inside
    if slow < ends[1] - ends[0]:
        braking = (fastest**2 - v**2) / (2 * most), (fastest - v) / most  # [m], [s]
        rest = ends[1] - ends[0] - slow - 2 * braking[0] - fastest**2 / most
        seconds = slow / v + 2 * braking[1] + rest / fastest + 2 * fastest / most
    assert law.duration == pytest.approx(seconds, rel=2e-3)


def test_a_law_is_not_cut_off_by_a_shorter_duration():
    """It ended at its speed half of the way, and the plan was feasible; a longer one rests at the end."""
    task = time_along("cogiro", {"path": {"kind": "line", "start": [0, 0, 1], "end": [1, 0, 1]}}).scenario.task
    with pytest.raises(InputError, match=r"duration must be at least .* where the times of path end, got 0\.1 s"):
        plan("cogiro", task.model_copy(update={"duration": 0.1}))
    assert plan("cogiro", task.model_copy(update={"duration": 9.0})).feasible


@pytest.mark.parametrize("speed", [0.02, 0.5])
def test_a_slow_speed_limit_is_reached_as_soon_as_a_large_acceleration_permits(speed):
    """Between limits of speed and acceleration the fastest law is a trapezoid of known duration."""
    start, end = [-1, -0.5, 1.5], [1, 0.5, 2.0]
    limits = {"platform_speed": speed, "platform_acceleration": 0.5}
    found = time_along("cogiro", {"path": {"kind": "line", "start": start, "end": end}, "limits": limits})
    assert found.feasible
    assert found.duration == pytest.approx(np.sqrt(5.25) / speed + speed / 0.5, rel=5e-4)
