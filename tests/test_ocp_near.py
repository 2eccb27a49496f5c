"""Programs with the rows of near places only, and with distances that are linear."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from towline import load, plan, read_task
from towline.ocp.audits.excess import Excess
from towline.ocp.nlp import solver
from towline.ocp.nlp.guess import initial_guess, usual_guess
from towline.ocp.nlp.linear import LinearDistances
from towline.ocp.nlp.near import Near, is_local, jumps, parts, regions_near
from towline.ocp.nlp.program import build
from towline.ocp.nlp.rows import CABLES, Mesh, swept
from towline.ocp.planner import Planner
from towline.ocp.search import feasible_changes, homotopy, search
from towline.ocp.search.other_forces import larger_t_max
from towline.ocp.search.refinement import _tightened, solved
from towline.ocp.tasks.lay_out import lay_out

PLATFORM = {"platform": 0.05, "cables": None, "carriers": None}
BALL = {"kind": "sphere", "name": "ball", "centre": [0.32, 0.12, 1.2], "radius": 0.25, **PLATFORM}
FAR = {"kind": "box", "name": "far", "min": [3.0, 3.0, 0.0], "max": [3.2, 3.2, 2.0], **PLATFORM}
TASK = {
    "path": {"kind": "line", "start": [-0.4, 0, 1.2], "end": [0.8, 0, 1.2]},
    "duration": 4,
    "steps": 40,
    "tube": {"position": "free"},
    "limits": {"keep_out": [BALL, FAR]},
}


def scenario_of(task):
    return Planner(load("ipanema-1"), task).scenario


def test_rows_of_far_places_are_left_out():
    scenario, mesh = scenario_of(TASK), Mesh(40)
    whole = build(scenario, mesh)
    guess = initial_guess(scenario, whole.shares * scenario.duration)
    near = Near.along(scenario, whole.shares, guess, 0.05)
    its = [part for part in parts(scenario.limits) if is_local(scenario.limits.all[part[0]])]
    points = 1 + scenario.robot.m  # of the platform, each with its own rows: CoM and attachments
    assert len(its) == 2 * points
    rows = near.chosen[[parts(scenario.limits).index(part) for part in its]]
    ball, far = rows[:points].any(axis=0), rows[points:]
    assert rows[:points].sum() < points * ball.sum()
    assert not far.any()
    assert ball.any()
    assert not ball[0]
    assert not ball[-1]
    part = build(scenario, mesh, near)
    assert len(part.lower_g) < len(whole.lower_g)
    assert part.suffices(guess)
    assert whole.suffices(guess)


@pytest.fixture(scope="module")
def expected():
    found = plan("ipanema-1", TASK)
    assert found.feasible
    return found


def test_what_a_solution_exceeds_is_added(monkeypatch, expected):
    monkeypatch.setattr(search, "NEAR", 0.0)
    planned = plan("ipanema-1", TASK)
    assert planned.feasible
    assert planned.objective == pytest.approx(expected.objective, rel=1e-3)


@pytest.mark.parametrize(("away", "again"), [(0.352, False), (0.2, True)])
def test_a_solution_that_grazes_what_was_left_out_is_the_next_start(monkeypatch, away, again):
    """The attachments, 0.06 m beside the line, keep 0.3 m from the middle of the ball. If one is deep, the guess is."""
    limits = {"keep_out": [{**BALL, "centre": [0.32, away, 1.2]}]}
    scenario = scenario_of({**TASK, "tube": {"position": 0.5}, "limits": limits})
    monkeypatch.setattr(search, "NEAR", -1e9)
    starts, ends, solve = [], [], solver.Solver.solve

    def recorded(self, guess, *others, **options):
        starts.append(guess.q)
        ends.append(solve(self, guess, *others, **options))
        return ends[-1]

    monkeypatch.setattr(solver.Solver, "solve", recorded)
    nodes = np.linspace(0.0, scenario.duration, 41)
    first = initial_guess(scenario, nodes)
    guess = replace(first, q=first.q + 1e-3 * np.sin(np.pi * nodes / nodes[-1])[:, None] ** 4)
    assert search.Search(scenario, {}, None).solve("program", Mesh(40), guess).success
    assert len(starts) > 1
    assert np.allclose(starts[1], starts[0] if again else ends[0].deviation.q)


def test_a_jump_over_a_place_between_two_points_is_noticed():
    small = {**BALL, "centre": [0.2, 0.1, 1.2], "radius": 0.05}
    scenario = scenario_of({**TASK, "limits": {"keep_out": [small]}})
    shares = np.array([0.0, 0.4, 0.6, 1.0])  # the ball is halfway
    guess = initial_guess(scenario, np.linspace(0.0, 1.0, 41) * scenario.duration)
    nothing = np.array([[not is_local(scenario.limits.all[index])] * 4 for index, _ in parts(scenario.limits)])
    holds = np.ones_like(nothing)
    assert not Near(nothing, holds).suffices(scenario, shares, guess)
    assert Near(nothing | (shares == 0.4), holds).suffices(scenario, shares, guess)  # that interval has rows
    assert Near(nothing[:, :2], holds[:, :2]).suffices(scenario, shares[:2] / 2, guess)
    # However few are near, those where it may be exceeded are added: the same program would have the same solution.
    widened = Near(nothing, holds).widened(scenario, shares, guess, reach=-np.inf)
    assert widened.suffices(scenario, shares, guess)
    assert not widened.is_everywhere


def test_a_platform_that_does_not_turn_keeps_true_distances_where_it_keeps_linear_ones():
    # A distance from a convex body is convex: nowhere is it less than its tangent.
    beside = {"kind": "line", "start": [-0.4, -0.1, 1.2], "end": [0.8, -0.1, 1.2]}
    scenario = scenario_of({**TASK, "path": beside, "tube": {"position": 0.2}})
    linear = LinearDistances(build(scenario, Mesh(40)))
    guess = usual_guess(scenario, linear.shares * scenario.duration)
    for shift in (np.zeros(3), np.array([0.0, -0.04, 0.0]), np.array([0.02, -0.03, 0.03])):
        motion = type(guess)(guess.nodes, guess.q + shift, guess.v, guess.a, guess.tensions)
        assert linear.missed(motion) > 0.01
        outcome = linear.solve(motion, None, np.inf)
        assert outcome.success
        assert linear.missed(outcome.deviation) <= 1e-7


def test_a_tightened_program_has_the_bounds_of_its_mesh_and_starts_from_the_last_solution():
    scenario, mesh, about = scenario_of(TASK), Mesh(40), "platform outside ball"
    looking = search.Search(scenario, {}, None)
    first = looking.solve("first", mesh, None)
    ball = next(limit for limit in scenario.limits if limit.is_about(about))

    def nearest(outcome):
        motion = scenario.motion(outcome.deviation.nodes, outcome.deviation)
        away = scenario.limits.along(*motion)[scenario.limits.all.index(ball)].min(axis=1)
        return float(away[len(away) // 4 : -len(away) // 4].min())  # limits are not tightened near fixed ends

    wanted = nearest(first) + 0.02
    tight = Mesh(40, 2.0, further=((ball.name, about, (wanted - ball.low) / ball.scale),))
    looking.tighten(tight)
    assert looking.has_solution(tight)
    assert not looking.knows(mesh)
    again = looking.solve("again", tight, None)
    fresh = search.Search(scenario, {}, None)
    expected = fresh.solve("fresh", tight, None)
    for outcome in (first, again, expected):
        assert outcome.success
    assert again.objective == pytest.approx(expected.objective, rel=1e-6)
    assert again.objective > first.objective
    assert again.iterations < expected.iterations
    assert nearest(again) >= wanted - 1e-6
    low, high = scenario.bounds()
    assert (again.deviation.tensions >= low + 2.0 - 1e-4).all()
    assert (again.deviation.tensions <= high - 2.0 + 1e-4).all()


def test_a_solution_that_stopped_improving_is_continued_with_its_multipliers(monkeypatch):
    scenario, mesh = scenario_of(TASK), Mesh(40)
    tight, looking, fresh = Mesh(40, 2.0), *(search.Search(scenario, {}, None) for _ in range(2))
    with monkeypatch.context() as patched:
        patched.setattr(solver, "PATIENCE", 1)
        patched.setattr(solver, "BETTER", 0.1)
        assert looking.solve("first", mesh, None).message == solver.SETTLED
    looking.tighten(tight)
    assert looking.has_solution(tight)
    again, expected = looking.solve("again", tight, None), fresh.solve("fresh", tight, None)
    assert again.success
    assert again.objective == pytest.approx(expected.objective, rel=1e-5)
    assert again.iterations < expected.iterations


def test_a_run_from_a_coarser_optimum_has_its_own_patience(monkeypatch):
    """Nothing is better by as much as is asked for: a run ends as many iterations after a solution as it may wait."""
    scenario, mesh, waited = scenario_of(TASK), Mesh(20), {}
    monkeypatch.setattr(solver, "BETTER", 1.0)
    monkeypatch.setattr(solver, "MET", 1e-3)  # long before the optimum
    for coarser, own, other in ((True, "FROM_COARSER", "PATIENCE"), (False, "PATIENCE", "FROM_COARSER")):
        monkeypatch.setattr(solver, other, 100)
        for patience in (1, 2):
            monkeypatch.setattr(solver, own, patience)
            guess = initial_guess(scenario, np.linspace(0.0, scenario.duration, 21))
            outcome = search.Search(scenario, {}, None).solve("own", mesh, guess, coarser=coarser)
            assert outcome.success
            waited[coarser, patience] = outcome.iterations
            assert outcome.message == solver.SETTLED
    assert waited[True, 2] == waited[True, 1] + 1
    assert waited[False, 2] == waited[False, 1] + 1


def test_where_a_program_goes_in_a_circle_distances_are_linear_about_the_motion_before(monkeypatch):
    """Within millimetres of a corner a step of Newton's method leads from one side to the other and back."""
    scenario, mesh = scenario_of(TASK | {"steps": 20}), Mesh(20)
    looking, fresh = (search.Search(scenario, {}, None) for _ in range(2))
    expected = fresh.solve("fresh", mesh, None)
    with monkeypatch.context() as patched:
        for name, value in {"ROUND": 1, "GAIN": 10.0, "CLOSE": np.inf}.items():
            patched.setattr(solver, name, value)  # the first iterate that is not twice as near is a circle
        outcome = looking.solve("first", mesh, None)
    assert [stage.message.split(" after")[0] for stage in looking.stages] == ["went in a circle", "solved"]
    assert outcome.success
    assert outcome.objective == pytest.approx(expected.objective, rel=1e-2)
    motion = scenario.motion(outcome.deviation.nodes, outcome.deviation)
    for limit, values in zip(scenario.limits, scenario.limits.along(*motion), strict=True):
        if limit.unit == "m":
            assert values.min() >= limit.low - search.APPROACHED * limit.scale
    again = looking.solve("again", mesh, outcome.deviation)
    assert again.success
    assert len(looking.stages) == 3  # linear at once


def test_another_pair_of_one_limit_is_tightened_beyond_what_all_pairs_have():
    """One share applies to all pairs of quadrotors: less for a second pair changed nothing, and meshes got finer."""
    task = {
        "path": {"kind": "rest", "pose": [0, 0, 0]},
        "duration": 1,
        "base": {"kind": "free"},
        "limits": {"carrier_separation": 0.5},
    }
    scenario = lay_out(load("multi-quadrotor-3"), read_task(task))
    (limit,) = [each for each in scenario.limits if each.name == "carrier_separation"]
    mesh = Mesh(60, further=(("carrier_separation", "quad1 and quad2", 3e-4),))
    for about, beyond in (("quad2 and quad3", 1e-4), ("quad1 and quad3", 2e-4), ("quad1 and quad2", 1e-4)):
        excess = Excess.of(limit, limit.labels.index(about), 0.5, limit.low - beyond * limit.scale)
        tightened = replace(mesh, further=_tightened(scenario, SimpleNamespace(excess=[excess]), mesh.further, 1.1))
        assert tightened.shrink_of(limit) == pytest.approx(3e-4 + 1.1 * beyond, rel=1e-9)
    both = [Excess.of(limit, index, 0.5, limit.low - 1e-4 * limit.scale) for index in (0, 1)]
    together = replace(mesh, further=_tightened(scenario, SimpleNamespace(excess=both), mesh.further, 1.1))
    assert together.shrink_of(limit) == pytest.approx(4.1e-4, rel=1e-9)


def without_rows(scenario, shares):
    """Return the places of no rows of regions."""
    everywhere = Near.everywhere(scenario, shares)
    local = [is_local(scenario.limits.all[index]) for index, _ in parts(scenario.limits)]
    return replace(everywhere, chosen=everywhere.chosen & ~np.array(local)[:, None])


def test_a_run_ends_early_in_a_region_of_which_the_program_has_no_rows(monkeypatch):
    empty = plan("ipanema-1", TASK | {"limits": {}})
    centre = empty.scenario.motion(np.array([2.0]), empty.deviation)[0].pose[0, :3]  # in the way of the best motion
    task = TASK | {"limits": {"keep_out": [BALL | {"centre": centre.tolist()}]}}
    scenario, mesh = scenario_of(task), Mesh(40)
    whole = build(scenario, mesh)
    part = build(scenario, mesh, without_rows(scenario, whole.shares))
    through = empty.deviation.at(whole.shares * scenario.duration)
    beside = replace(through, q=through.q + 0.8 * np.eye(through.q.shape[1])[1])
    assert part.strays(part.pack(through))
    assert not part.strays(part.pack(beside))
    assert not whole.strays(whole.pack(through))
    monkeypatch.setattr(solver, "LOOK", 3)
    ended = solver.Solver(part).solve(beside, stray=False)
    assert (ended.message, ended.success) == (solver.STRAYED, False)
    assert solver.Solver(part).solve(beside).iterations > ended.iterations
    assert solver.Solver(whole).solve(beside, stray=False).message != solver.STRAYED
    found = plan("ipanema-1", task)
    assert found.feasible
    poses = found.scenario.motion(np.linspace(0, 4, 2000), found.deviation)[0].pose
    assert np.linalg.norm(poses[:, :3] - centre, axis=1).min() > 0.25 + 0.05 - 1e-6


def test_regions_near_a_motion_are_those_that_it_comes_near():
    scenario = scenario_of(TASK)
    motion = initial_guess(scenario, np.linspace(0, 4, 41))
    assert [region.name for region in regions_near(scenario, motion, 0.05)] == ["ball"]
    assert regions_near(scenario, motion, 10.0) == scenario.task.limits.keep_out


def test_smaller_clearances_are_not_searched_where_even_none_would_not_do(monkeypatch):
    """The tube lets the platform out of the ball nowhere: a way round is offered, and no program is solved for less."""
    called = []
    monkeypatch.setattr(feasible_changes, "solved", lambda *arguments: called.append(arguments))
    blocked = TASK | {"tube": {"position": 0.05}, "limits": {"keep_out": [BALL | {"centre": [0.2, 0, 1.2]}, FAR]}}
    found = plan("ipanema-1", blocked)
    assert found.status == "infeasible"
    assert [each.name for each in found.relaxations] == ["length of a way round"]
    assert not called
    poses = found.relaxations[0].plan.scenario.motion(np.linspace(0, 4, 2000), found.relaxations[0].plan.deviation)[0]
    assert np.linalg.norm(poses.pose[:, :3] - [0.2, 0, 1.2], axis=1).min() > 0.25 + 0.05 - 1e-6


def test_programs_of_offers_have_half_the_steps_where_they_have_rows_of_regions(monkeypatch):
    steps, own = [], search.Search.solve

    def solve(self, name, mesh, *arguments, **named):
        steps.append(mesh.steps)
        return own(self, name, mesh, *arguments, **named)

    monkeypatch.setattr(search.Search, "solve", solve)
    task = TASK | {"steps": 200, "tube": {"position": 0.3}}
    for places in (TASK["limits"]["keep_out"], []):
        scenario = scenario_of(task | {"limits": {"keep_out": places}})
        outcome = solved(search.Search(scenario, {}, None), scenario, None)
        assert outcome is not None
        assert len(outcome.deviation.nodes) == steps[-1] + 1
    assert steps == [100, 200]


@pytest.mark.parametrize("limit", [{}, {"tension_rate": 1e3}, {"winch_power": 1e4}])
def test_robots_with_other_tension_limits_have_the_same_distances(limit):
    scenario = scenario_of(TASK | {"limits": TASK["limits"] | limit})
    stronger = larger_t_max(scenario).at(0.5)[0]
    assert stronger.robot.t_max[0] > scenario.robot.t_max[0]
    assert (stronger.limits is scenario.limits) == (not limit)
    fresh = lay_out(stronger.robot, scenario.task).limits
    poses, frame = np.random.default_rng(0).uniform(-0.3, 0.3, (20, 6)) + np.eye(6)[2], np.zeros((20, 1, 6))
    for mine, its in zip(stronger.limits.at_rest(poses, frame), fresh.at_rest(poses, frame), strict=True):
        np.testing.assert_array_equal(mine, its)


def test_a_change_of_one_scenario_is_made_once():
    made = []
    make = feasible_changes._once(lambda scenario: made.append(scenario) or len(made))
    first, second = scenario_of(TASK), scenario_of(TASK)
    assert [make(first), make(second), make(first), make(second)] == [1, 2, 1, 2]
    assert made == [first, second]


WIRE = {"kind": "capsule", "name": "wire", "radius": 0.01, "platform": None, "cables": 0.0, "carriers": None}


def ends_of_cable(cable, place):
    """Return anchor and attachment of a cable of the platform at a place, (3,) each [m]."""
    its = load("ipanema-1").cables[cable]
    return np.array(its.anchor), np.array(its.attachment) + place


def across(cable, place, aside=0.0):
    """Return a wire across the middle of a cable of the platform at a place, which moves along x, so much `aside`."""
    anchor, attachment = ends_of_cable(cable, place)
    along = np.cross(anchor - attachment, [1, 0, 0])
    normal = np.cross(along, anchor - attachment)
    middle = (anchor + attachment) / 2 + aside * normal / np.linalg.norm(normal)
    along *= 0.1 / np.linalg.norm(along)
    return WIRE | {"start": (middle - along).tolist(), "end": (middle + along).tolist()}


def test_a_cable_is_kept_from_a_wire_at_places_between_two_points():
    """The middle of the cable moves by 0.05 m over a wire of 0.02 m, which it misses at both points."""
    places = np.array([[0.15, 0, 1.2], [0.25, 0, 1.2]])
    wire, robot = across(2, [0.2, 0, 1.2]), load("ipanema-1")
    scenario = scenario_of(TASK | {"limits": {"keep_out": [wire]}})
    assert not swept(scenario, Mesh(6))
    [(limit, way)] = swept(scenario, Mesh(6, between=(CABLES,))).items()
    (first, second), still = np.hstack([places, np.zeros((2, 15))]), [np.zeros(18)] * len(robot.carriers)
    values = np.array(way(first, *still, second, *still)).reshape(-1, robot.m)[:, 2]
    share = np.linspace(0, 1, 2001)[:, None]
    axis = wire["start"] + share * np.subtract(wire["end"], wire["start"])

    def apart(part):
        anchor, attachment = ends_of_cable(2, places[0] + part * (places[1] - places[0]))
        near = attachment + share[800:1201] * (anchor - attachment)
        return np.linalg.norm(near[:, None] - axis, axis=2).min() - 0.01

    assert values == pytest.approx([apart(1 / 3), apart(2 / 3)], abs=1e-4)
    assert max(values) < limit.low < min(apart(0), apart(1))
    whole, sparse = (build(scenario, Mesh(6, between=its)) for its in ((CABLES,), ()))
    assert len(whole.lower_g) - len(sparse.lower_g) == 2 * 6 * robot.m  # nodes keep theirs


@pytest.mark.parametrize(("aside", "jump"), [(0.0, True), (0.008, False), (-0.008, False)])
def test_a_jump_over_a_wire_is_told_from_a_touch(aside, jump):
    """Between two points so far apart, a bend of the way would be larger than the wire."""
    scenario = scenario_of(TASK | {"limits": {"keep_out": [across(2, [0.2, 0, 1.2], aside)]}})
    guess = initial_guess(scenario, np.array([0.0, 0.45, 0.55, 1.0]) * scenario.duration)
    line = replace(guess, q=0 * guess.q, v=0 * guess.v, a=0 * guess.a)  # halfway it is at x = 0.2
    assert jumps(scenario, line) is jump


@pytest.mark.parametrize("solved", [True, False])
def test_where_a_solution_jumps_programs_have_rows_of_cables_between_their_nodes(monkeypatch, solved):
    scenario = scenario_of(TASK | {"steps": 20, "limits": {"keep_out": [across(2, [0.2, 0, 1.2])]}})
    looking, own, meshes = search.Search(scenario, {}, None), search.Search.solve, []

    def solve(self, name, mesh, *arguments, **named):
        meshes.append(mesh)
        outcome = own(self, name, mesh, *arguments, **named)
        return replace(outcome, success=outcome.success and (solved or not mesh.between))

    monkeypatch.setattr(search.Search, "solve", solve)
    kept = homotopy.from_easier(looking, Mesh(20), None, True)
    assert kept.success
    assert [mesh.between for mesh in meshes] == [()]
    monkeypatch.setattr(homotopy, "jumps", lambda scenario, motion: True)
    meshes.clear()
    looking = search.Search(scenario, {}, None)
    outcome = homotopy.from_easier(looking, Mesh(20), None, True)
    assert outcome.success
    assert {mesh.between for mesh in meshes} == {(), (CABLES,)}
    assert looking.between == ((CABLES,) if solved else ())
    assert looking.audit(outcome).passed or not solved
