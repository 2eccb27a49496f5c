"""Transcription schemes: integrals against quadrature, limits between points, optima against closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad

from towline.base.errors import InputError
from towline.models import Robot, load
from towline.ocp import plan
from towline.ocp.audits.audit import audit
from towline.ocp.nlp.program import build
from towline.ocp.nlp.rows import Mesh
from towline.ocp.nlp.solver import Solver
from towline.ocp.tasks import bernstein
from towline.ocp.tasks.deviation import Deviation
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.scheme import SCHEMES
from towline.ocp.tasks.task import Task
from towline.studies.flying import circle as flying_circle
from towline.studies.towing import plans as towing_plans

from .soak.random_work import with_beam

GRAVITY = 9.81
NAMES = tuple(SCHEMES)


def fitted(scheme, places, values, share):
    """Interpolated here by NumPy, not by the scheme's own points."""
    return np.array([np.polynomial.Polynomial.fit(places, column, scheme.degree)(share) for column in values.T])


def drawn(scheme, seed=3, steps=4):
    """Nodes, (q, v, a) and jerk of a random motion of two coordinates, integrated by scipy; and its acceleration."""
    rng = np.random.default_rng(seed)
    nodes = 2.0 * scheme.shares(steps)
    starts = nodes[:: scheme.size]
    h = starts[1]
    a = rng.normal(size=(len(nodes), 2))
    jerk = rng.normal(size=(len(nodes), 2)) if scheme.smooth else None

    def acceleration(time):
        k = min(int(time / h), steps - 1)
        s = time / h - k
        at = a[k * scheme.size : (k + 1) * scheme.size + 1]
        if scheme.smooth:
            hermite = np.array([1 - 3 * s**2 + 2 * s**3, 3 * s**2 - 2 * s**3])
            slopes = h * np.array([s - 2 * s**2 + s**3, s**3 - s**2])
            return hermite @ at + slopes @ jerk[k : k + 2]
        return fitted(scheme, [0, *scheme.inner, 1], at, s)

    def integral(first, time):
        breaks = starts[(starts > 0) & (starts < time)]
        found = [quad(lambda t: first(t)[i], 0, time, points=breaks, limit=200, epsabs=1e-12)[0] for i in range(2)]
        return np.array(found)

    q_0, v_0 = rng.normal(size=(2, 2))
    speed = np.array([v_0 + integral(acceleration, t) for t in nodes])
    place = np.array([q_0 + t * v_0 + integral(lambda s, t=t: (t - s) * acceleration(s), t) for t in nodes])
    return nodes, (place, speed, a), jerk, acceleration


@pytest.mark.parametrize("name", NAMES)
def test_motions_are_the_integrals_of_their_acceleration(name):
    scheme = SCHEMES[name]
    nodes, (q, v, a), jerk, acceleration = drawn(scheme)
    motion = Deviation(nodes, q, v, a, np.zeros((len(nodes), 1)), scheme, jerk)
    # From the left of each node: where the next interval starts the values are those integrated by scipy.
    before = nodes[1:] - 1e-9
    np.testing.assert_allclose(motion.evaluate(before)[0], q[1:], atol=1e-7)
    np.testing.assert_allclose(motion.evaluate(before)[1], v[1:], atol=1e-7)
    times = np.array([0.013, 0.21, 0.49, 0.77, 1.3, 1.99])
    np.testing.assert_allclose(motion.evaluate(times)[2], [acceleration(t) for t in times], atol=1e-10)
    step = 1e-5
    ahead, behind = (motion.evaluate(times + shift)[2] for shift in (step, -step))
    np.testing.assert_allclose(motion.evaluate(times)[3], (ahead - behind) / (2 * step), atol=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_bernstein_points_bound_the_motion(name):
    scheme = SCHEMES[name]
    nodes, (q, v, a), jerk, _ = drawn(scheme, seed=8)
    h = nodes[scheme.size]
    motion = Deviation(nodes, q, v, a, np.zeros((len(nodes), 1)), scheme, jerk)
    position, speed, acceleration = motion.evaluate(np.linspace(0, h * (1 - 1e-9), 500))[:3]
    points = scheme.acceleration(h, a[: scheme.size + 1], None if jerk is None else (jerk[0], jerk[1]))
    speeds = bernstein.integral(h, v[0], points)
    places = bernstein.integral(h, q[0], speeds)
    told = bernstein.joined(h, places, v[0], q[scheme.size], v[scheme.size])
    np.testing.assert_allclose(told, places, atol=1e-9)
    for values, bound in ((position, places), (speed, speeds), (acceleration, points)):
        assert (values <= np.max(bound, axis=0) + 1e-9).all()
        assert (values >= np.min(bound, axis=0) - 1e-9).all()


@pytest.mark.parametrize("name", NAMES)
def test_mean_squares_are_quadratures(name):
    points = list(np.random.default_rng(2).normal(size=(SCHEMES[name].degree + 1, 3)))
    truth = quad(lambda s: np.sum(bernstein.value(points, s) ** 2), 0, 1)[0]
    assert bernstein.mean_square(points, np.dot) == pytest.approx(truth, rel=1e-10)
    weights = SCHEMES[name].quadrature(np.full(6, 1 / 6))
    assert weights.sum() == pytest.approx(1)


def test_accelerations_are_continuous_and_a_spline_is_smooth():
    """What each name promises, seen in plans: continuity of the acceleration, and of its derivative."""
    for name, smooth in (("linear", False), ("hermite", False), ("spline", True)):
        deviation = plan(load("ipanema-1"), {**CRANE, "scheme": name, "steps": 20}).deviation
        nodes = deviation.nodes[:: SCHEMES[name].size][1:-1]
        after, before = deviation.evaluate(nodes), deviation.evaluate(nodes - 1e-9)
        assert np.abs(after[2] - before[2]).max() < 1e-6
        assert (np.abs(after[3] - before[3]).max() < 1e-4) == smooth


CRANE = {
    "path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.4, 1.3]},
    "duration": 1.5,
    "tube": {"position": "free", "ends": "exact"},
    "objective": {"deviation": 1.0},
}


def hoist():
    """A mass that can but rise, on one vertical cable of twice its weight: |ddz| <= g."""
    data = load("point-mass-3").model_dump(mode="json")
    weight = data["platform"]["mass"] * GRAVITY
    cable = {**data["cables"][0], "anchor": [0, 0, 3], "t_min": 0, "t_max": 2 * weight}
    return Robot.model_validate({**data, "platform": {**data["platform"], "dof": ["z"]}, "cables": [cable]})


@pytest.mark.parametrize("name", NAMES)
def test_least_square_acceleration_is_the_cubic(name):
    """From rest to rest, min of the mean of a^2: a = (6 - 12 t/T) d / T^2, mean square 12 d^2 / T^4.

    A t = w makes the tension's square that of g + a; its mean is g^2 + 12 d^2 / T^4, a having the mean zero.
    """
    robot, duration, rise = hoist(), 2.0, 1.0
    task = {
        "path": {"kind": "line", "start": [0, 0, 0.5], "end": [0, 0, 1.5]},
        "tube": {"position": "free", "ends": "exact"},
        "objective": {"jerk": 1e6, "deviation": 1e6},
        "duration": duration,
        "scheme": name,
    }
    errors = []
    for steps in (5, 10, 20):
        found = plan(robot, {**task, "steps": steps})
        assert found.feasible, found.report()
        least = 1 + 12 * rise**2 / duration**4 / GRAVITY**2  # in units of the weight's square
        # The motion itself, integrated: what the program took the cost for does not count.
        times, tensions = found.audit.times, found.audit.tensions[:, 0] / robot.force_scale
        errors.append(float(np.trapezoid(tensions**2, times) / duration - least))
    rate = np.log2(errors[0] / errors[-1]) / 2
    assert min(errors) >= -1e-6
    assert errors[0] < {"linear": 1e-3, "spline": 3e-4}.get(name, 1e-4)
    assert rate > {"hermite": 4}.get(name, 1.8)
    assert errors[-1] < 1e-5


@pytest.mark.parametrize("name", NAMES)
def test_minimum_time_keeps_its_limits(name):
    """Up with g, down with g: T = 2 sqrt(d / g)."""
    task = {
        "path": {"kind": "line", "start": [0, 0, 0.5], "end": [0, 0, 1.5]},
        "tube": {"position": "free", "ends": "exact"},
        "objective": {"time": 0.001, "jerk": 1e4},
        "duration": {"min": 0.1, "max": 3},
        "scheme": name,
        "steps": 40,
    }
    found = plan(hoist(), task)
    assert found.feasible, found.report()
    shortest = 2 * np.sqrt(1 / GRAVITY)
    assert shortest * (1 - 1e-6) <= found.scenario.duration <= 1.02 * shortest


def test_more_balances_miss_less_between_them():
    """Paper C's three cables cannot follow any motion exactly: what is missing falls with the scheme's order."""
    robot = towing_plans.robot("wang-ctmrts", "variable-length")
    missing = {}
    for name in ("linear", "hermite"):
        for steps in (20, 40):
            task = towing_plans.task(robot).model_copy(update={"scheme": name})
            scenario = lay_out(robot, task)
            outcome = Solver(build(scenario, Mesh(steps))).solve(None)
            assert outcome.success
            missing[name, steps] = audit(scenario, outcome.deviation).violation.max()
    orders = {name: np.log2(missing[name, 20] / missing[name, 40]) for name in ("linear", "hermite")}
    assert orders["linear"] > 1.7
    assert orders["hermite"] > orders["linear"] + 0.5
    assert missing["hermite", 20] < 0.1 * missing["linear", 20]


def test_a_beam_that_misses_equations_between_the_nodes_takes_another_scheme():
    """Four cables of two quadrotors: lines miss the thrust's direction, quadratics on the same nodes do not."""
    line = {"kind": "line", "start": [-2, 0, 1.5], "end": [0, 0.5, 1.8]}
    task = {"path": line, "duration": {"min": 1, "max": 9}, "objective": {"time": 1}, "steps": 20}
    task |= {"tube": {"position": "free", "attitude": 0.4}, "base": {"kind": "free", "ends": "rest"}}
    quadratic, lines = (plan(with_beam(1.0, 2), task | scheme) for scheme in ({}, {"scheme": "linear"}))
    assert quadratic.feasible
    assert quadratic.scenario.task.scheme == "hermite"
    assert lines.feasible
    assert lines.scenario.task.scheme == "linear"
    assert len(quadratic.deviation.nodes) < len(lines.deviation.nodes)
    assert quadratic.duration == pytest.approx(lines.duration, rel=2e-3)  # the least time


@pytest.mark.parametrize("name", NAMES)
def test_limits_hold_between_the_points_of_every_scheme(name):
    """A quadrotor's speed limit that binds: seen every millisecond, by the audit."""
    given = flying_circle.tasks()[1]
    base = given.base.model_copy(update={"ends": "rest", "speed_max": 0.45})
    found = plan(load("wang-flying"), given.model_copy(update={"scheme": name, "steps": 24, "base": base}))
    assert found.feasible, found.report()
    fastest = np.linalg.norm(found.audit.carriers.velocity[:, 0, :3], axis=1).max()
    assert 0.44 <= fastest <= 0.45 * (1 + 1e-6)


def test_waypoints_and_resampled_starts_know_the_scheme():
    path = {"kind": "waypoints", "points": [[0, 0, 1], [0.2, 0, 1.1], [0, 0.2, 1.2], [0, 0, 1]]}
    tube = {"position": 0.1, "ends": "exact", "waypoints": "exact"}
    for name in ("hermite", "spline"):
        task = {"path": path, "duration": 4, "steps": 17, "tube": tube, "scheme": name}
        found = plan(load("ipanema-1"), task)
        assert found.feasible, (name, found.report())
        knots = found.scenario.task.path.knots(4.0)
        there, _ = found.scenario.motion(knots, found.deviation)
        np.testing.assert_allclose(there.pose[:, :3], path["points"], atol=1e-9)
        again = plan(load("ipanema-1"), {**task, "steps": 23, "scheme": "linear"}, start=found)
        assert again.feasible


def test_schemes_and_solvers_that_there_are_not():
    """Files of earlier versions name the one solver that is left."""
    assert Task.model_validate({**CRANE, "solver": "ipopt"}) == Task.model_validate(CRANE)
    with pytest.raises(InputError, match="solver"):
        plan(load("ipanema-1"), {**CRANE, "solver": "fatrop"})
    with pytest.raises(InputError, match=r"scheme must be .* got 'cubic'"):
        plan(load("ipanema-1"), {**CRANE, "scheme": "cubic"})
