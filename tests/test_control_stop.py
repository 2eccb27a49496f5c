"""Stops: on the path, inside the limits, as short as a linear program at each instant permits."""

import itertools

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import linprog
from scipy.sparse import block_diag
from scipy.spatial import KDTree

from towline import Dynamics, InputError, Planner, Robot, export_fmu, load, plan, simulate
from towline.control import Predictive, Stop, longest_stop, references, stop
from towline.models.parsing import to_yaml
from towline.ocp.search import stops_within, time_law
from towline.solvers import batch
from towline.statics import stops

from .framed import framed
from .told import told

PLANS = {
    "cogiro": {"path": {"kind": "line", "start": [-3, -1, 1.5], "end": [3, 1, 2]}, "duration": 2.5},
    "ipanema-2": {"path": {"kind": "circle", "centre": [0, 0, 2], "radius": 0.8, "rate": 0.8}},
    "point-mass-3": {"path": {"kind": "line", "start": [-0.3, 0, 1], "end": [0.3, 0.2, 1.3]}, "duration": 1.2},
}


@pytest.fixture(scope="module", params=PLANS)
def made(request):
    robot = load(request.param)
    found = plan(robot, {"name": "way", "margin": 1.0, **PLANS[request.param]})
    assert found.feasible
    return robot, found


def have_tensions(robot, dynamics, references):
    """Ask one linear program for which references tensions inside their limits give the wrench."""
    mask = robot.dof_mask > 0
    scale, blocks, wrenches = robot.wrench_scale[mask], [], []
    pose, carriers, velocity, acceleration = (
        np.stack([getattr(each, name) for each in references])
        for name in ("pose", "carrier_pose", "velocity", "acceleration")
    )
    matrices = dynamics.wrench_matrix(pose, carriers)[:, mask] * scale[:, None]
    for A, w in zip(matrices, dynamics.required_wrench(pose, velocity, acceleration)[:, mask] * scale, strict=True):
        blocks.append(np.hstack([np.vstack([A, -A]), -np.ones((2 * len(w), 1))]))
        wrenches.append(np.r_[w, -w])
    bounds = [*zip(robot.t_min, robot.t_max, strict=True), (0, None)] * len(blocks)
    costs = np.tile(np.r_[np.zeros(robot.m), 1.0], len(blocks))
    found = linprog(costs, block_diag(blocks, format="csr"), np.concatenate(wrenches), bounds=bounds)
    return found.x[robot.m :: robot.m + 1] <= 1e-5 * robot.force_scale


def test_stops_keep_the_path_and_the_limits_and_end_at_rest(made):
    robot, found = made
    dynamics, rng = Dynamics(robot), np.random.default_rng(3)
    fine = KDTree([each.pose[:3] for each in references(found, 2e-4)])
    for time in [0.0, *rng.uniform(0, found.duration, 6), found.duration, found.duration + 1]:
        its = stop(found, time)
        assert its.feasible
        each = references(its, 1e-3)
        assert have_tensions(robot, dynamics, each).all()
        if its.ends <= found.duration:
            assert fine.query([reference.pose[:3] for reference in each])[0].max() <= 1e-3
        assert (its.tensions >= robot.t_min - 1e-9).all()
        assert (its.tensions <= robot.t_max + 1e-9).all()
        first, last = references(found, 1e-3, start=min(time, found.duration))[0], each[-1]
        np.testing.assert_allclose(each[0].pose, first.pose, atol=1e-9)
        np.testing.assert_allclose(each[0].velocity, first.velocity, atol=1e-9)
        np.testing.assert_allclose(last.velocity, 0.0, atol=1e-9)
        np.testing.assert_allclose(last.acceleration, 0.0, atol=1e-9)


def test_a_stop_is_nearly_as_short_as_linear_programs_permit():
    robot, found = load("cogiro"), plan("cogiro", {"name": "way", **PLANS["cogiro"]})
    dynamics, time = Dynamics(robot), 1.1
    dense = references(found, 1e-3)
    tau, rate, took, step = time, 1.0, 0.0, 0.01
    while rate > 0:
        here = dense[round(tau / 1e-3)]
        still = np.zeros(6)
        A = dynamics.wrench_matrix(here.pose, here.carrier_pose)
        c = dynamics.required_wrench(here.pose, still, still)
        a = dynamics.required_wrench(here.pose, still, here.velocity) - c
        w = dynamics.required_wrench(here.pose, rate * here.velocity, rate**2 * here.acceleration)
        bounds = [(None, None), *zip(robot.t_min, robot.t_max, strict=True)]
        least = linprog(np.r_[1.0, np.zeros(robot.m)], A_eq=np.c_[-a, A], b_eq=w, bounds=bounds).fun
        tau, rate, took = tau + step * rate, rate + step * least, took + step
    assert took - step <= stop(found, time).duration <= 1.1 * took + 0.03


def test_no_robot_stops_later_for_stronger_cables():
    """They pull far harder than the plan did, which an audit must not take for a wrench that they do not give."""
    cables = [((x, 0, z), (0.3 * x, 0, 0.3 * (1 - z))) for x, z in ((-1, 2), (1, 2), (1, 0), (-1, 0))]
    platform = {"mass": 1, "inertia": [0.02] * 3 + [0] * 3, "dof": ["x", "z", "pitch"], "home": [0, 0, 1, 0, 0, 0]}
    way = {"path": {"kind": "line", "start": [-0.2, 0, 1], "end": [0.2, 0, 1.1]}, "duration": 1}
    robots = [framed(cables, platform, t_min=1, t_max=most) for most in (50, 300)]
    weak, strong = (stop(plan(robot, way), 0.5) for robot in robots)
    assert weak.feasible
    assert strong.feasible
    assert strong.duration <= weak.duration < 0.04


def test_no_stop_takes_longer_than_the_longest(made):
    _, found = made
    longest = longest_stop(found, 0.1)
    stops = [stop(found, time) for time in np.linspace(0, found.duration, round(np.ceil(found.duration / 0.1)) + 1)]
    assert longest.duration == max(its.duration for its in stops)
    assert longest.begins in [its.begins for its in stops]
    with pytest.raises(InputError, match="period must be so long that there are at most 10000 periods, got 1e-05 s"):
        longest_stop(found, 1e-5)


def test_the_fastest_motion_may_stop_as_it_was_planned_to():
    # Before the plan brakes with all it has, a stop can only do the same: 1.5 m/s at (t_min - weight) / (mass).
    hoist = framed([((0, 0, 15), (0, 0, 0))], {"mass": 800, "dof": ["x", "y", "z"]}, {}, t_min=50, t_max=11900)
    path = {"kind": "line", "start": [0, 0, 1], "end": [0, 0, 4]}
    task = {"path": path, "duration": {"min": 1, "max": 60}, "objective": {"time": 1}, "limits": {"cable_speed": 1.5}}
    fastest, stopping = plan(hoist, task), plan(hoist, task | {"stop_within": 0.3})
    assert stopping.feasible
    assert stopping.duration < 1.002 * fastest.duration
    assert 1.5 / (9.81 - 50 / 800) < stopping.stop.duration < 0.25


def test_a_duration_with_a_stop_that_takes_too_long_is_known_from_some_of_its_stops(monkeypatch):
    counts, all_of = [], stops_within.longest_stop_along
    monkeypatch.setattr(stops_within, "longest_stop_along", lambda *call: counts.append(len(call[2])) or all_of(*call))
    laws, fastest = [], time_law.fastest
    monkeypatch.setattr(time_law, "fastest", lambda scenario: laws.append(scenario) or fastest(scenario))
    path = {"kind": "line", "start": [-0.4, 0, 0.8], "end": [0.5, 0.2, 1.2]}
    task = {"path": path, "duration": {"min": 0.2, "max": 9}, "objective": {"time": 0.05}, "stop_within": 0.25}
    found = plan("point-mass-3", task)
    assert found.feasible
    whole = found.duration / stops_within.LEAST_PERIOD  # stops of one duration
    few = [count for count in counts if count < 0.5 * whole]  # all that a duration that is too short takes
    assert sum(few) < 0.25 * whole * len(few)
    assert len(counts) - len(few) <= 2  # durations that suffice
    assert len(laws) == 1 < len(few)  # the fastest law along a path is that of all durations
    assert longest_stop(found, 0.013).duration <= 0.25 + 0.008  # also from instants that planning has not looked at


def test_where_the_planner_finds_only_a_much_slower_motion_the_fastest_law_is_slowed_down():
    path = {"kind": "line", "start": [-0.4, 0, 0.8], "end": [0.5, 0.2, 1.2]}
    fastest = {"path": path, "duration": {"min": 0.2, "max": 9}, "objective": {"time": 0.05}}
    planner, calls = Planner(load("point-mass-3"), fastest), []
    slow = plan("point-mass-3", {"path": path, "duration": 4})

    def climb(*call):
        calls.append(call)
        return slow

    fast = planner.plan()
    found = stops_within.stopping_within(fast, planner.scenario, 0.2, climb)
    assert found.feasible
    assert len(calls) == 1
    assert fast.duration < found.duration < slow.duration
    for time in np.random.default_rng(1).uniform(0, found.duration, 5):
        assert stop(found, time).duration <= 0.2 + 0.008
    share = np.linspace(0, 1, 7)  # the same law, slower: where it is after each share of its time
    rows = [(each.duration, *(each.trajectory[name].values for name in ("time", "pose"))) for each in (fast, found)]
    places = [np.interp(share * duration, times, poses[:, 0]) for duration, times, poses in rows]
    np.testing.assert_allclose(*places, atol=1e-3)


WITHIN = {"path": {"kind": "line", "start": [-1, -0.5, 1], "end": [1, 0.5, 1.5]}, "stop_within": 0.25}


def test_a_plan_is_as_fast_as_stops_in_time_permit():
    """Stops from instants between those of the check are in time, too; with a little less time they are not."""
    task = {**WITHIN, "duration": {"min": 2.7, "max": 20}, "objective": {"time": 1}, "tube": {"position": 0.02}}
    found = plan("cogiro", task)
    assert found.feasible
    assert found.stop.feasible
    for time in np.random.default_rng(1).uniform(0, found.duration, 8):
        assert stop(found, time).duration <= 0.25 + 0.008
    too_fast = plan("cogiro", {**task, "duration": 0.95 * found.duration})
    assert not too_fast.feasible
    (excess,) = too_fast.audit.excess
    assert (excess.limit, excess.bound) == ("stop_within", 0.25)
    assert 0.25 < stop(too_fast, excess.time).duration == pytest.approx(excess.value)
    assert "stops" in told(too_fast)
    assert found.to_dict()["stop"]["duration"] == found.stop.duration


REFUSED = {
    "flying": ("multi-quadrotor-3", {}, "stop_within must be left out with flying carriers"),
    "nothing": ("cogiro", {"stop_within": 0}, "stop_within must be greater than 0, got 0"),
    "nan": ("cogiro", {"stop_within": float("nan")}, "stop_within"),
    "robust": ("ipanema-1", {"robust": 0.9}, "robust must be left out"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_stopped_is_one_line(case):
    robot, keys, message = REFUSED[case]
    task = {key: value for key, value in {**WITHIN, **keys}.items() if value is not None}
    with pytest.raises(InputError, match=message) as caught:
        plan(robot, task if "phases" in task else {"duration": 3, **task})
    assert "\n" not in str(caught.value)


def test_stops_in_time_carry_the_loads_of_phases_within_their_tolerances():
    """Each load is judged by its own plan; phases on the ground are not checked; a sufficient time is offered."""
    bag = {"mass": 300, "com": [0.1, 0, -0.2]}
    fast = {"name": "carry", "duration": 0.8, "path": {"kind": "line", "start": [0, 0, 1], "end": [0.3, 0, 1.1]}}
    take = {"name": "take", "duration": 0.3, "ground": {}, "path": {"kind": "rest", "pose": [0, 0, 1]}}
    unsure = [phase | {"load": bag | {"mass_tolerance": 0.2}} for phase in (take, fast)]
    short = plan("cogiro", {"phases": unsure, "stop_within": 0.05})
    assert not short.feasible
    begins = short.stop.begins - 0.3
    alone = [stop(plan("cogiro", {"phases": [fast | {"load": bag | {"mass": m}}]}), begins) for m in (240, 300, 360)]
    assert all(its.feasible for its in alone)
    assert short.stop.duration == pytest.approx(max(its.duration for its in alone), rel=1e-6)
    (offer,) = short.relaxations
    assert (offer.name, offer.unit) == ("stop_within", "s")
    assert plan("cogiro", {"phases": unsure, "stop_within": offer.possible}).feasible


@pytest.mark.parametrize("floor", [None, 0.9])
def test_what_is_offered_stops_in_time_when_it_is_planned(floor):
    """With a floor above the path, the shift that is offered alone would leave a motion that stops too late."""
    robot = load("point-mass-3").model_copy(update={"floor": floor})
    line = {"kind": "line", "start": [0, 0, 1], "end": [0.5, 0.3, 0.8]}
    task = {"path": line, "duration": 1.3, "stop_within": 0.06}
    offers = {offer.name: offer for offer in plan(robot, task).relaxations}
    assert set(offers) == {"stop_within", "duration" if floor is None else "shift of the path"}
    for offer in offers.values():
        varied = offer.plan.scenario.task
        found = plan(robot, varied.model_dump())
        assert found.feasible
        assert found.stop.duration <= varied.stop_within * (1 + 1e-9)
    least = offers["stop_within"].possible
    assert not plan(robot, task | {"path": varied.path, "stop_within": 0.99 * least}).feasible


def test_a_remainder_is_not_planned_with_stops():
    planner = Planner("cogiro", {**WITHIN, "duration": 6, "tube": {"position": 0.1}})
    assert planner.plan().feasible
    with pytest.raises(InputError, match="stop_within must be left out to replan"):
        planner.replan({"pose": [-1, -0.5, 1, 0, 0, 0]}, 0.0)


def spiral():
    """Return a motion that swings around outside of the anchors, where it cannot rest, and then spirals in to rest."""
    turn, end = np.sqrt(9.81 / 2.0), 24.0
    t = np.arange(0.0, end + 1e-9, 0.002)
    s = np.clip((t - 4) / (end - 6), 0, 1)
    law = np.polyval([-20, 70, -84, 35, 0, 0, 0, 0], s)
    radius = 1.4 * (1 - law)
    pose = np.stack(
        [radius * np.cos(turn * t), radius * np.sin(turn * t), np.full_like(t, -2.0), *np.zeros((3, len(t)))], 1
    )
    velocity = np.gradient(pose, t, axis=0, edge_order=2)
    acceleration = np.gradient(velocity, t, axis=0, edge_order=2)
    ends = [([np.cos(angle), np.sin(angle), 0], [0, 0, 0]) for angle in 2 * np.pi * np.arange(3) / 3]
    platform = {"mass": 10, "dof": ["x", "y", "z"], "home": [0, 0, -2, 0, 0, 0]}
    robot = framed(ends, platform, t_min=1, t_max=500)
    still = np.zeros((len(t), 1, 6))
    parts = {"pose": pose, "velocity": velocity, "acceleration": acceleration}
    variables = {name: (("time", "coordinate"), part) for name, part in parts.items()}
    variables |= {f"carrier_{name}": (("time", "carrier", "coordinate"), still) for name in parts}
    return robot, xr.Dataset(variables, {"time": t}, {"robot": to_yaml(robot)})


def test_a_robot_that_cannot_rest_where_it_is_goes_on_to_where_it_can():
    robot, motion = spiral()
    dynamics = Dynamics(robot)
    its = stop(motion, 2.0)
    assert its.feasible
    each = references(its, 5e-3)
    assert have_tensions(robot, dynamics, each).all()
    assert np.linalg.norm(each[0].pose[:2]) == pytest.approx(1.4, abs=1e-3)
    assert np.linalg.norm(each[-1].pose[:2]) < 0.7  # in the triangle of the anchors
    np.testing.assert_allclose(each[-1].velocity, 0.0, atol=1e-9)


def test_where_no_stop_is_possible_the_result_has_a_certificate():
    _, motion = spiral()
    its = stop(motion.isel(time=slice(0, 1500)), 2.5)  # ends while it swings, outside of the anchors
    assert not its.feasible
    assert its.certificate.shortfall > 0
    assert "stop beyond limits" in str(its)


def test_a_stop_is_simulated_as_a_plan_is(made):
    robot, found = made
    its = stop(found, 0.4 * found.duration)
    assert isinstance(its, Stop)
    run = simulate(robot, its, duration=its.duration + 0.5)
    assert run.passed


def test_a_simulation_stops_at_an_event(made):
    robot, found = made
    at = 0.4 * found.duration
    run = simulate(robot, found, events=[f"stop at {at:.6f}"], period=2e-3)
    assert run.passed
    its = stop(found, at)
    last = run.references[-1]
    np.testing.assert_allclose(last.pose, its.platform[0][-1], atol=1e-6)
    np.testing.assert_allclose(last.velocity, 0.0, atol=1e-9)
    size = f"{its.duration:.4g} s and {its.distance:.4g} m at {at:.4g} s"
    assert f"the reference began a stop of {size}" in run.report()
    both = simulate(robot, found, events=[f"stop at {at:.6f}"], period=2e-3, runs=2)
    assert both["passed"].values.all()


def test_a_stop_beyond_limits_is_said_in_the_report():
    robot, motion = spiral()
    run = simulate(robot, motion.isel(time=slice(0, 1500)), events=["stop at 2.5"], drive="tensions")
    assert "a stop that needs tensions beyond their limits" in run.report()


@pytest.mark.parametrize(
    ("given", "time", "message"),
    [
        ("none.nc", 0.1, "plan must be a plan.*no such file"),
        (7, 0.1, "plan must be a plan, its dataset or its NetCDF file, got 7"),
        (None, -1.0, "time must be"),
        (None, float("nan"), "time must be"),
    ],
)
def test_wrong_arguments_are_one_line(given, time, message):
    found = spiral()[1] if given is None else given
    with pytest.raises(InputError, match=message) as error:
        stop(found, time)
    assert "\n" not in str(error.value)


def test_the_wind_of_a_plan_acts_on_its_stop(tmp_path):
    robot, wind = load("wang-flying"), [1.0, 0.5, 0.0]
    path = {"kind": "line", "start": [0, 0, -1], "end": [0.1, 0, -0.9]}
    found = plan(robot, {"path": path, "duration": 1, "wind": wind})
    assert found.feasible
    dynamics, its = Dynamics(robot), stop(found.save(tmp_path / "plan.nc"), 0.4)
    A = dynamics.wrench_matrix(its.platform[0], its.carriers[0])
    given = (A @ its.tensions[:, :, None])[..., 0]
    np.testing.assert_allclose(given, dynamics.required_wrench(*its.platform, wind=wind), atol=1e-5)
    assert np.abs(given - dynamics.required_wrench(*its.platform)).max() > 0.01  # which the wind makes


def test_a_swinging_load_on_one_cable_follows_its_plan_to_the_end(monkeypatch):
    """The cable has the direction of the planned acceleration less gravity, so no other rate balances the load.

    No instant needs the solver of single problems, which made such a stop take seconds.
    """
    limits = {"reach": {"min": [-9] * 3, "max": [9] * 3}, "speed_max": 9, "acceleration_max": 90}
    trolley = {"name": "trolley", "kind": "mobile", "home": [0, 0, 2, 0, 0, 0], **limits}
    cable = {"carrier": "trolley", "anchor": [0, 0, 0], "attachment": [0, 0, 0], "t_min": 1, "t_max": 500}
    body = {"mass": 10, "home": [0] * 6, "dof": ["x", "y", "z"]}
    robot = Robot.model_validate(
        {"name": "pendulum", "source": "a test", "platform": body, "carriers": [trolley], "cables": [cable]}
    )
    t, along = np.linspace(0, 2, 4001), np.polynomial.Polynomial([0, 0.5])
    way = np.polynomial.Polynomial([0] * 5 + [126, -420, 540, -315, 70])(along)
    platform, trolleys = np.zeros((3, len(t), 6)), np.zeros((3, len(t), 1, 6))
    for k, motion in enumerate(platform):
        motion[:, 0] = way.deriv(k)(t)
    force = np.column_stack([platform[2, :, 0], np.zeros(len(t)), np.full(len(t), 9.81)])
    tensions = 10 * np.linalg.norm(force, axis=1)[:, None]
    trolleys[0, :, 0, :3] = platform[0, :, :3] + 20 * force / tensions
    for k in (1, 2):
        trolleys[k] = np.gradient(trolleys[k - 1], t, axis=0)
    plan_of_it = Stop(robot, 0.0, 2.0, t, tuple(platform), tuple(trolleys), tensions, None)
    monkeypatch.setattr(batch, "solve", None)
    halt = stop(plan_of_it, 1.0)
    assert halt.feasible, halt
    assert (halt.ends, halt.duration) == pytest.approx((2.0, 1.0))


def test_a_stop_carries_the_load_of_its_phase(tmp_path):
    """By the wrench that a carried load needs, from the symbolic model; none in the phases before and after."""
    robot = load("cogiro")
    bag = {"mass": 60.0, "com": [0.1, 0, -0.2], "inertia": [1, 2, 1.5, 0, 0.2, 0], "mass_tolerance": 0.1}
    at = [robot.home[:3] + np.array(step) for step in ([0, 0, 0], [0.5, 0, 0.3], [0, 0.5, 0.3], [0, 0, 0])]
    lines = [{"kind": "line", "start": a.tolist(), "end": b.tolist()} for a, b in itertools.pairwise(at)]
    phases = [{"name": f"phase-{k}", "path": line, "duration": 1.5} for k, line in enumerate(lines)]
    phases[1]["load"] = bag
    found = plan(robot, {"phases": phases})
    dynamics, numbers = Dynamics(robot), np.array([bag["mass"], *bag["com"], *bag["inertia"]])
    for time, carries in ((0.7, False), (1.5, True), (2.2, True), (3.7, False)):
        halt = stop(found, time)
        assert halt.feasible
        assert (halt.load is not None) == carries
        needed = dynamics.required_wrench(*halt.platform) + carries * dynamics.carried_wrench(*halt.platform, numbers)
        given = np.einsum("nij,nj->ni", dynamics.wrench_matrix(halt.platform[0]), halt.tensions)
        np.testing.assert_allclose(given, needed, atol=1e-5 * robot.weight)
    halt, period = stop(found, 2.2), {"period": 2e-3}  # twice the default, in half of the time
    for run in (
        simulate(robot, halt, Predictive(robot), duration=halt.duration + 0.3, **period),
        simulate(robot, found, events=["stop at 2.2"], duration=2.5 + halt.duration, **period),
    ):
        assert run.passed
        loaded = run.record.tensions[-1] @ dynamics.wrench_matrix(run.record.motions[-1, 0, :6]).T
        assert loaded[2] == pytest.approx(robot.weight + 9.81 * bag["mass"], rel=0.01)
    with pytest.raises(
        InputError, match="reference must begin without a load, because exported units have none, got one of 60"
    ):
        export_fmu(robot, tmp_path / "stop.fmu", reference=halt)


def test_no_motion_is_audited_twice_for_a_stop(monkeypatch):
    """Three cables give no other wrench than the plan's, so all attempts at a stop were the same motion.

    Their audits took most of the time of a stop, which is limited to ten milliseconds.
    """
    robot, laws = load("wang-ctmrts"), []
    home = list(robot.home[:3])
    path = {"kind": "line", "start": home, "end": [home[0] + 0.05, home[1] + 0.04, home[2] + 0.1]}
    found = plan(robot, {"path": path, "duration": 2, "base": {"kind": "free"}, "steps": 16})
    audited = stops._audited
    monkeypatch.setattr(stops, "_audited", lambda *given: (laws.extend(given[2]), audited(*given))[1])
    its = stop(found, 0.8)
    assert its.feasible
    assert len(laws) > 1
    for one, other in itertools.combinations(laws, 2):
        assert one.times.shape != other.times.shape or not np.array_equal(np.stack(one), np.stack(other))


def test_towing_robots_brake_as_hard_as_their_accelerations_permit():
    """No audit sees these limits: |a| of the carriers reaches the largest one, and by no more than rounding."""
    robot = load("wang-ctmrts-6").model_dump(mode="json")
    for carrier in robot["carriers"]:
        carrier |= {"reach": {"min": [-9] * 3, "max": [9] * 3}, "acceleration_max": 0.6}
    robot, (x, y, z) = Robot.model_validate(robot), robot["platform"]["home"][:3]
    path = {"kind": "line", "start": [x, y, z], "end": [x + 1.5, y, z]}
    found = plan(robot, {"path": path, "duration": 4.0, "base": {"kind": "free"}, "steps": 16})
    assert found.feasible
    for time in (1.6, 2.0):
        _, _, acceleration = stop(found, time).carriers
        assert np.linalg.norm(acceleration[..., :3], axis=-1).max() == pytest.approx(0.6, rel=2e-3)
