"""Designs of robots: better than published ones, inside their boxes, honest about what is impossible and what binds."""

import json
from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from towline import (
    Dynamics,
    InputError,
    Requirements,
    Robot,
    TensionProblem,
    core,
    design,
    load,
    plan,
    read_requirements,
)
from towline.layout import Free, run, search as searching
from towline.layout.evaluation import Evaluation, rows_of
from towline.layout.goal import Goal
from towline.layout.impossibility import find_impossibility
from towline.layout.judgement import reasons
from towline.layout.linear_programs import maximise
from towline.layout.pairings import with_attachments
from towline.layout.room import Room
from towline.layout.search import search
from towline.layout.variables import variables_of
from towline.models.points import placed, rotations
from towline.models.record import record_of
from towline.solvers import capacity_margin
from towline.workspace import Interference, Places
from towline.workspace.conditions.interference import nearest_points

from .warm import towline

BOXES = {"cogiro": ([-4, -3, 0.5], [4, 3, 3]), "ipanema-2": ([-2, -1.5, 2], [2, 1.5, 3.5])}


def around(own):
    return {"min": own.min(axis=0).tolist(), "max": own.max(axis=0).tolist()}


def wanted(robot, **changes):
    """Free anchors and attachments in the boxes of the published ones, a box of poses."""
    low, high = BOXES[robot.name]
    free = [{"part": "anchor", "box": around(robot.anchors)}, {"part": "attachment", "box": around(robot.attachments)}]
    require = [{"box": {"min": low, "max": high}, "grid": [5, 5, 3]}]
    return {"free": free, "require": require, **changes}


def evaluation_of(robot, requirements):
    read = read_requirements(requirements)
    variables = variables_of(robot, read)
    return Evaluation(variables, rows_of(robot, read.require, [each.places() for each in read.require]))


@pytest.fixture(scope="module", autouse=True)
def _few_audited():
    """The worst of 10 000 random poses is nearly that of 100 000, which take ten times as long."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(searching, "AUDITED", 10_000)
        yield


@pytest.fixture(scope="module")
def found():
    """From the published layout, and audits until they agree: the result does not depend on the machine's speed."""
    robot = load("ipanema-2")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(searching, "_SEARCHING", 0.0)
        return design(robot, requirements=wanted(robot, clearance=0.04, time_limit=60.0))


def test_a_published_layout_is_improved_and_judged_from_its_file(found, tmp_path):
    """By the mechanics, the projection and the interference of the saved robot alone, also at the box's corners."""
    before = load("ipanema-2")
    robot = load(found.robot.save(tmp_path / "robot.yaml"))
    assert found.feasible
    assert found.status == "feasible"
    low, high = (np.array(side) for side in BOXES["ipanema-2"])
    poses = np.zeros((100, 6))
    poses[:, :3] = np.random.default_rng(5).uniform(low, high, (100, 3))
    poses[:8, :3] = list(product(*np.transpose([low, high])))
    w = Dynamics(robot).required_wrench(before.home, np.zeros(6), np.zeros(6))
    A = Dynamics(robot).wrench_matrix(poses)
    # In the unit of the robot's own file, though the attachments have moved.
    problems = [TensionProblem(each, w, robot.t_min, robot.t_max, length=before.length) for each in A]
    margin = min(capacity_margin(problem).value for problem in problems)
    assert margin >= found.margin - 1e-9
    assert found.margin > 2.5 * found.margin_before > 0
    for points, own in ((robot.anchors, before.anchors), (robot.attachments, before.attachments)):
        assert (points >= own.min(axis=0) - 1e-9).all()
        assert (points <= own.max(axis=0) + 1e-9).all()
    apart = Interference(between_cables=0.04)
    assert apart.evaluate(robot, Places.at_home(robot, poses)).all()
    assert found.clearance >= 0.04


def test_the_report_names_what_binds(found, tmp_path):
    report, data = found.report(), found.to_dict()
    assert report.startswith("ipanema-2, design: FEASIBLE, capacity margin")
    assert "local optimum" in report
    assert "t_max of every cable higher by 1 N" in report
    assert sum(one["weight"] for one in data["binding"]) == pytest.approx(1.0, abs=1e-6)
    assert json.loads(json.dumps(data))["margin"] == found.margin
    assert len(repr(found).splitlines()) <= 5
    assert [path.name for path in found.plot(tmp_path / "figures", "svg")] == ["before.svg", "after.svg"]
    at_home = replace(found, reasons=None)  # as after a search that no pose limited
    page = at_home.save_report(tmp_path / "home.html").read_text()
    assert page.count("<img") + page.count("<svg") == 2  # the robot after and before
    assert "The robot after the design, at home" in page
    assert "What a change would gain" in report
    robot = load("ipanema-2")
    for one in found.reasons.binding[:5]:  # the reserve along its direction is the margin
        A = Dynamics(found.robot).wrench_matrix(one.pose)
        pull = one.direction @ A
        reserve = np.maximum(pull * robot.t_max, pull * robot.t_min).sum() - one.direction @ one.wrench
        assert np.linalg.norm(one.direction * np.repeat([1, robot.length], 3)) == pytest.approx(1.0)
        assert reserve == pytest.approx(found.margin, rel=0.01)


@pytest.mark.parametrize(("name", "seed"), [("cogiro", 0), ("ipanema-2", 1), ("caroca-pulleys", 2), ("planar-4", 3)])
def test_derivatives_are_those_of_differences(name, seed):
    """Of margins by anchors, attachments and limits, with attitudes, accelerations, equal and mirrored numbers."""
    robot, rng = load(name), np.random.default_rng(seed)
    spread = 0.2 * (1.0 if name == "planar-4" else 3.0)

    def box(points):
        return {"min": (points.min(axis=0) - 0.1).tolist(), "max": (points.max(axis=0) + 0.1).tolist()}

    m, moves = robot.m, np.flatnonzero(robot.dof_mask[:3])
    low = robot.home[:3].copy()
    high = low.copy()
    low[moves], high[moves] = low[moves] - spread, high[moves] + spread
    tilted = [[0.1, -0.2, 0.3]] if robot.dof_mask.all() else [[0, 0, 0]]
    requirements = {
        "free": [
            {"part": "anchor", "cables": list(range(1, m)), "box": box(robot.anchors)},
            {"part": "anchor", "cables": [m], "copy_of": [1], "mirrored": "x"},
            {"part": "attachment", "box": box(robot.attachments)},
            {"part": "t_max", "range": {"min": 300, "max": 900}, "equal": True},
            {"part": "t_min", "cables": [1, 2], "range": {"min": 1, "max": 9}},
        ],
        "require": [
            {"box": {"min": low.tolist(), "max": high.tolist()}, "grid": [2, 2, 2], "attitudes": tilted,
             "accelerations": [[0] * 6, [0.5, 0, 0, 0, 0, 0]], "wrenches": [[1, 0, 2, 0, 0.1, 0]]}
        ],
    }  # fmt: skip
    evaluation = evaluation_of(robot, requirements)
    variables = evaluation.variables
    y = np.clip(variables.of_robot() + 0.03 * rng.normal(size=variables.size), variables.low, variables.high)
    every = evaluation.all_reserves(y)
    rows, normals = np.arange(len(every)), every.argmin(axis=1)
    values, slopes = evaluation.reserves(y, rows, normals)
    np.testing.assert_allclose(values.value, evaluation.margins(y), rtol=1e-9, atol=1e-8)
    step = 1e-6
    differences = np.array(
        [(evaluation.margins(y + step * e) - evaluation.margins(y - step * e)) / (2 * step) for e in np.eye(y.size)]
    ).T
    smooth = np.partition(every, 1, axis=1)[:, 1] - every.min(axis=1) > 1e-2
    assert smooth.any()
    error = np.abs(differences - slopes)[smooth].max(axis=1) / np.abs(slopes)[smooth].max(axis=1)
    assert error.max() < 2e-8
    near = Evaluation(variables, evaluation.rows, Room(clearance=1e-9)).space_slopes(y, 6, np.inf)
    distances = evaluation.distances(y)
    where = [int(np.abs(distances.ravel() - value).argmin()) for value in near.value]
    slopes = np.array(
        [
            (evaluation.distances(y + step * e) - evaluation.distances(y - step * e)).ravel()[where]
            for e in np.eye(y.size)
        ]
    ).T / (2 * step)
    np.testing.assert_allclose(near.by_variables, slopes, atol=1e-6)


def test_advice_is_the_slope_of_optima_solved_again():
    robot = load("planar-4")
    reach = np.array([0.15, 0, 0.15])
    low, high = robot.home[:3] - reach, robot.home[:3] + reach

    def optimum(longer=0.0, stronger=0.0, slacker=0.0):
        cables = [
            {**cable.model_dump(), "t_max": cable.t_max + stronger, "t_min": cable.t_min - slacker}
            for cable in robot.cables
        ]
        changed = robot.model_validate({**robot.model_dump(), "cables": cables})
        wider, own = np.array([longer, 0, 0]), robot.anchors
        box = {"min": (own.min(axis=0) - wider).tolist(), "max": (own.max(axis=0) + wider).tolist()}
        require = [{"box": {"min": low.tolist(), "max": high.tolist()}, "grid": [3, 1, 3]}]
        evaluation = evaluation_of(changed, {"free": [{"part": "anchor", "box": box}], "require": require})
        y = evaluation.variables.of_robot()
        goal = Goal(np.inf, np.zeros(y.size))
        for delta in (0.1, 0.02, 0.004):
            maximise(evaluation, goal, y, np.inf, delta)
        return evaluation, goal, y, float(evaluation.margins(y).min())

    evaluation, goal, y, best = optimum()
    assert best > 1.0
    found = reasons(evaluation, goal, y)
    assert found.local_optimum
    gains = {one.change: one.gain for one in found.advice}
    for change, step, name in (("stronger", 0.1, "t_max of every cable higher by 1 N"),
                               ("slacker", 0.1, "t_min of every cable lower by 1 N"),
                               ("longer", 1e-3, "boxes of anchors longer by 1 m at each end along x")):  # fmt: skip
        ahead, behind = (optimum(**{change: s * step})[3] for s in (1, -1))
        assert gains.get(name, 0.0) == pytest.approx((ahead - behind) / (2 * step), rel=1e-3, abs=1e-3), name


def impossible(robot):
    """Requirements beyond any layout in the boxes: families that can be proven."""
    force, top = robot.m * robot.t_max[0], robot.anchors[:, 2].max()
    out = robot.anchors[:, 0].max() + 2.0
    down = 2.1 * robot.weight
    yield {"poses": [robot.home.tolist()], "wrenches": [[0, 0, -1.05 * force, 0, 0, 0]]}  # too heavy
    yield {"poses": [[0, 0, top + 1.5, 0, 0, 0]]}  # above the anchors
    yield {"poses": [[out, 0, robot.home[2], 0, 0, 0]]}  # outside the frame
    yield {"poses": [robot.home.tolist()], "wrenches": [[-force, 0, 0, 0, 0, 0]]}  # sideways
    yield {"poses": [robot.home.tolist()], "wrenches": [[0, 0, 0, 0, 0, 1.2 * force * robot.length]]}  # beyond levers
    if robot.name == "cogiro":  # suspended: nothing pulls down
        yield {"poses": [robot.home.tolist()], "wrenches": [[0, 0, down, 0, 0, 0]]}


@pytest.mark.parametrize("name", ["cogiro", "ipanema-2"])
def test_the_impossible_is_refused_with_a_certificate_that_no_layout_breaks(name):
    robot, rng = load(name), np.random.default_rng(8)
    for number, require in enumerate(impossible(robot)):
        requirements = wanted(robot) | {"require": [require]}
        result = design(robot, requirements=requirements)
        assert result.status == "infeasible", number
        assert result.robot == robot
        assert "no layout inside the boxes" in result.report()
        stronger = "stronger cables do not help" not in result.report()
        assert stronger == bool(result.certificate.at_max.size)
        assert "What you can try" in result.report()
        proof = result.impossibility
        variables = variables_of(robot, read_requirements(requirements))
        assert proof.verify(variables)
        d, certificate = result.certificate.direction, result.certificate
        assert np.linalg.norm(d * np.repeat([1, robot.length], 3)) == pytest.approx(1.0)
        assert d @ proof.wrench == pytest.approx(certificate.demand)
        assert certificate.shortfall > 0
        # No anchors, attachments and tensions that are drawn give as much along the direction.
        anchors, attachments = (
            rng.uniform(points.min(axis=0), points.max(axis=0), (3000, 3))
            for points in (robot.anchors, robot.attachments)
        )
        arms = (attachments - robot.platform.com) @ rotations(proof.pose[None, 3:])[0].T
        u = anchors - proof.pose[:3] - attachments
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        pull = np.hstack([u, np.cross(arms, u)]) @ d
        most = np.where(pull > 0, robot.t_max[0], robot.t_min[0]) * pull
        assert robot.m * most.max() <= certificate.support + 1e-6 * abs(certificate.support)


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(["cogiro", "ipanema-2"]), st.floats(0.0, 1.0), st.integers(0, 10_000))
def test_what_a_layout_can_do_is_never_called_impossible(name, share, seed):
    """Wrenches that the published layout gives, up to its boundary, at random poses and attitudes."""
    robot, rng = load(name), np.random.default_rng(seed)
    pose = np.r_[rng.uniform(*BOXES[name]), rng.uniform(-0.2, 0.2, 3)]
    given_wrench = Dynamics(robot).wrench_matrix(pose) @ (
        robot.t_min + share * rng.random(robot.m) * (robot.t_max - robot.t_min)
    )
    rest = Dynamics(robot).required_wrench(pose, np.zeros(6), np.zeros(6))
    require = [{"poses": [pose.tolist()], "wrenches": [(rest - given_wrench).tolist()]}]
    read = read_requirements(wanted(robot) | {"require": require})
    variables = variables_of(robot, read)
    assert find_impossibility(variables, rows_of(robot, read.require, [pose[None]])) is None


@pytest.mark.parametrize(("name", "clearance"), [("planar-4", 0.0), ("ipanema-2", 0.02)])
def test_the_best_pairing_is_that_of_brute_force(name, clearance):
    robot = load(name)
    cables = [0, 1, 2, 3] if name == "planar-4" else [0, 3, 4, 6]
    # Spoilt, so that another pairing is better.
    own = list(range(robot.m))
    own[cables[0]], own[cables[1]], own[cables[2]] = cables[1], cables[2], cables[0]
    spoilt = with_attachments(robot, np.array(own))
    poses = robot.home + 0.1 * np.random.default_rng(2).normal(size=(12, 6)) * robot.dof_mask * [1, 1, 1, 0, 0, 0]
    free = [{"part": "attachment", "cables": [cable + 1 for cable in cables], "pairing": True}]
    result = design(spoilt, free, [{"poses": poses.tolist()}], clearance=clearance)
    kept = np.flatnonzero(robot.dof_mask)
    w = (Dynamics(robot).required_wrench(poses[0], np.zeros(6), np.zeros(6)) * robot.wrench_scale)[kept]
    found = []
    for pairing in permutations(cables):
        order = np.arange(robot.m)
        order[cables] = pairing
        other = with_attachments(spoilt, order)
        apart = Interference(between_cables=clearance) if clearance else None
        if apart and not apart.evaluate(other, Places.at_home(other, poses)).all():
            continue
        A = Dynamics(other).wrench_matrix(poses)[:, kept] * robot.wrench_scale[kept][:, None]
        found.append(min(capacity_margin(TensionProblem(a, w, robot.t_min, robot.t_max)).value for a in A))
    assert result.starts == 24
    assert result.margin == pytest.approx(max(found), abs=1e-9)
    assert result.margin > result.margin_before
    assert "the best of all pairings" in result.report()


def test_an_interrupt_keeps_the_best_so_far():
    robot, calls = load("ipanema-2"), []

    def progress(what, share, best):
        calls.append((what, share, best))
        if len(calls) == 2:
            raise KeyboardInterrupt

    result = design(robot, requirements=wanted(robot, time_limit=60.0), progress=progress)
    assert result.stopped
    assert result.feasible
    assert result.margin > 1.5 * result.margin_before
    assert "INTERRUPTED" in result.report()
    assert calls[1][1] < 0.5


def test_an_interrupt_while_the_layout_is_judged_keeps_it(monkeypatch):
    """The search is over by then: its layout is judged again, and only the plans of tasks are left out."""
    calls = []

    def judged(*given):
        calls.append(given)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return its(*given)

    its = run.judge
    monkeypatch.setattr(run, "judge", judged)
    robot = load("ipanema-2")
    result = design(robot, requirements=wanted(robot, time_limit=0.5))
    assert result.stopped
    assert result.feasible
    assert result.margin > result.margin_before


def test_from_random_layouts_and_for_equal_and_mirrored_points(monkeypatch):
    """One start that knows nothing of the published layout, at any speed; a symmetric robot stays symmetric."""
    robot = load("ipanema-2")
    monkeypatch.setattr(searching, "_SEARCHING", 0.0)
    result = design(robot, requirements=wanted(robot, start="random", time_limit=60.0, seed=3))
    assert result.margin > result.margin_before
    box = around(robot.anchors)
    box["min"][0] = 0.5
    right = [i + 1 for i in range(8) if robot.anchors[i, 0] > 0]
    left = [i + 1 for i in range(8) if robot.anchors[i, 0] <= 0]
    free = [
        {"part": "anchor", "cables": right, "box": box},
        {"part": "anchor", "cables": left, "copy_of": right, "mirrored": "x"},
        {"part": "t_max", "range": {"min": 100, "max": 210}, "equal": True},
    ]
    mirrored = design(robot, requirements=wanted(robot, time_limit=0.5) | {"free": free})
    anchors = mirrored.robot.anchors
    np.testing.assert_allclose(anchors[np.array(left) - 1], anchors[np.array(right) - 1] * [-1, 1, 1], atol=1e-12)
    assert np.ptp(mirrored.robot.t_max) == 0
    np.testing.assert_array_equal(mirrored.robot.attachments, robot.attachments)


BALL = {"kind": "sphere", "centre": [3.2, -2.7, 4.2], "radius": 0.2}
HOSTILE = [
    ({"free": []}, "free"),
    ({"require": []}, "require"),
    ({"free": [{"part": "anchors", "box": {"min": [0, 0, 0], "max": [1, 1, 1]}}]}, "part"),
    ({"free": [{"part": "anchor"}]}, "box or copy_of must be given"),
    ({"free": [{"part": "anchor", "range": {"min": 0, "max": 1}}]}, "range must be left out"),
    ({"free": [{"part": "t_max", "range": {"min": -3, "max": 1}}]}, "negative"),
    ({"free": [{"part": "t_max", "range": {"min": 3, "max": 1}}]}, "min must be at most max"),
    ({"free": [{"part": "t_min", "range": {"min": 100, "max": 900}}]}, "t_min of cable 1 below its t_max"),
    ({"free": [{"part": "t_max", "cables": [9], "range": {"min": 50, "max": 60}}]}, "cables must be cables"),
    ({"free": [{"part": "t_max", "cables": [0], "range": {"min": 50, "max": 60}}]}, "greater than or equal to 1"),
    ({"free": [{"part": "t_max", "cables": [1, 1], "range": {"min": 50, "max": 60}}]}, "each cable once"),
    ({"free": 2 * [{"part": "t_max", "range": {"min": 50, "max": 60}}]}, "as free.0. does"),
    ({"free": [{"part": "anchor", "cables": [1], "copy_of": [2, 3]}]}, "as many cables"),
    ({"free": [{"part": "anchor", "cables": [2], "copy_of": [1]}, {"part": "anchor", "cables": [3], "copy_of": [2]}]},
     "not copies themselves"),
    ({"free": [{"part": "anchor", "box": {"min": [0, 0, 0], "max": [-1, 1, 1]}}]}, "min must not exceed max"),
    ({"free": [{"part": "anchor", "box": {"min": [0, 0, 0], "max": [float("nan"), 1, 1]}}]}, "box.max"),
    ({"free": [{"part": "anchor", "pairing": True}]}, "pairing must be left out for anchor"),
    ({"free": [{"part": "attachment", "pairing": True, "equal": True}]}, "equal must be left out with pairing"),
    ({"free": [{"part": p, "pairing": p[0] == "a", "range": {"attachment": None, "t_max": {"min": 50, "max": 60}}[p]}
               for p in ("attachment", "t_max")]}, "no item besides a pairing"),
    ({"require": [{}]}, "box or poses must be given"),
    ({"require": [{"poses": [[0, 0]]}]}, "poses"),
    ({"require": [{"poses": [[0, 0, 0, 0, 0, float("inf")]]}]}, "poses"),
    ({"require": [{"box": {"min": [0, 0, 0], "max": [1, 1, 1]}, "grid": [100, 100, 100]}]}, "at most 20000"),
    ({"require": [{"box": {"min": [0, 0, 0], "max": [1, 1, 1]}, "grid": [0, 1, 1]}]}, "grid"),
    ({"margin": 0.5}, "margin"),
    ({"clearance": -1}, "clearance"),
    ({"maximise": "stiffness"}, "maximise"),
    ({"time_limit": 0}, "time_limit"),
    ({"seed": 1.5}, "seed"),
    ({"sed": 1}, "did you mean 'seed'"),
    ({"maximise": "natural_frequency"}, r"cables\[0\].stiffness must be given for natural_frequency"),
    ({"natural_frequency": 3}, "stiffness must be given"),
    ({"natural_frequency": 0}, "natural_frequency"),
    ({"natural_frequency": float("nan")}, "natural_frequency"),
    ({"cable_platform_clearance": 0.1}, "without platform.body"),
    ({"cable_floor_clearance": 0.1}, "without a floor"),
    ({"cable_floor_clearance": -1}, "cable_floor_clearance"),
    ({"keep_out": [{"kind": "sphere", "centre": [0, 0, 0]}]}, "radius"),
    ({"keep_out": [{**BALL, "platform": 0.2}]}, r"keep_out\[0\].platform must be left out"),
    ({"keep_out": [{**BALL, "carriers": None}]}, r"keep_out\[0\].carriers must be left out"),
    ({"keep_out": 3}, "keep_out"),
    ({"maximise": "natural_frequency", "minimise": "t_max",
      "free": [{"part": "t_max", "range": {"min": 100, "max": 900}}]}, "maximise must be left out with minimise"),
    ({"maximise": "natural_frequency", "free": [{"part": "attachment", "pairing": True}]}, "margin with a pairing"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "names"), HOSTILE)
def test_wrong_requirements_are_refused_in_one_line(change, names):
    robot = load("ipanema-2")
    with pytest.raises(InputError, match=names) as error:
        design(robot, requirements=wanted(robot) | change)
    assert len(str(error.value).splitlines()) == 1


def test_wrong_arguments_are_refused():
    robot = load("ipanema-2")
    parts = {name: value for name, value in wanted(robot).items() if name in ("free", "require")}
    for arguments, names in (
        ({"free": "anchor", "require": parts["require"]}, "free must be a list"),
        ({**parts, "requirements": wanted(robot)}, "free must be left out"),
        ({**parts, "seeds": 3}, "did you mean 'seed'"),
        ({**parts, "maximise": "largest"}, "maximise"),
        ({}, "free is missing"),
    ):
        with pytest.raises(InputError, match=names):
            design(robot, **arguments)
    for name, names in (("flycrane", "must have winches"), ("wang-ctmrts", "at least 6 cables")):
        with pytest.raises(InputError, match=names):
            design(name, **parts)
    assert Free(part="anchor", box={"min": [0, 0, 0], "max": [1, 1, 1]}).cables is None
    assert Requirements(**parts).margin == 1.0


def test_the_command_writes_a_robot_and_says_no(tmp_path):
    robot = load("ipanema-2")
    file, out = tmp_path / "wanted.yaml", tmp_path / "better.yaml"
    file.write_text(json.dumps(wanted(robot, name="box", time_limit=0.5)))
    done = towline("design", "ipanema-2", str(file), "--out", str(out), "--json", cwd=tmp_path)
    data = json.loads(done.stdout)
    assert data["feasible"]
    assert data["margin"] > data["margin_before"]
    assert data["file"] == str(out)
    assert load(out).m == 8
    heavy = {"poses": [robot.home.tolist()], "wrenches": [[0, 0, -1e4, 0, 0, 0]]}
    file.write_text(json.dumps(wanted(robot) | {"require": [heavy]}))
    done = towline("design", "ipanema-2", str(file), cwd=tmp_path, code=1)
    assert "INFEASIBLE" in done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["better.yaml", "wanted.yaml"]
    for text in ("", "free: [", "free: 3", "\x00", "free: [{part: anchor}]"):
        file.write_text(text)
        with pytest.raises(InputError, match=r"wanted\.yaml") as error:
            read_requirements(file)
        assert len(str(error.value).splitlines()) == 1
    done = towline("design", "ipanema-2", str(file), cwd=tmp_path, code=2)
    assert len(done.stderr.splitlines()) == 1
    file.write_text(json.dumps(wanted(robot) | {"free": [winches(robot) | {"cables": [9]}]}))
    done = towline("design", "ipanema-2", str(file), cwd=tmp_path, code=2)
    assert f"{file}: free[0].cables must be cables of the robot, 1 to 8, got 9" in done.stderr


def test_distances_of_the_core_are_those_of_interference():
    """Also of parallel cables, and of cables of no length."""
    rng = np.random.default_rng(11)
    for name in ("cogiro", "planar-4", "multi-quadrotor-3"):
        robot = load(name)
        poses = robot.home + rng.normal(scale=0.3, size=(11, 6))
        poses[0] = robot.home
        record = record_of(robot).copy()
        record["cable"]["attachment"][1] = record["cable"]["attachment"][0]
        if name == "planar-4":
            record["cable"]["anchor"][2] = placed(poses[0], record["cable"]["attachment"][2][None])[0]
        distances = np.empty((11, robot.m * (robot.m - 1) // 2))
        core.cable_distances(record, poses, robot.carrier_home, distances)
        anchors, attachments = np.empty((11, robot.m, 3)), np.empty((11, robot.m, 3))
        core.ends(record, poses, robot.carrier_home, anchors, attachments)
        i, j = np.triu_indices(robot.m, 1)
        gaps = nearest_points(attachments[:, i], anchors[:, i], attachments[:, j], anchors[:, j])[0]
        np.testing.assert_allclose(distances, np.linalg.norm(gaps, axis=2), atol=1e-9)
        alone = np.empty((1, distances.shape[1]))
        core.cable_distances(record, poses[3:4], robot.carrier_home, alone)
        np.testing.assert_array_equal(alone[0], distances[3])
        for wrong in (distances[:, 1:].copy(), distances[1:], None):
            with pytest.raises(ValueError, match="rows of the sizes"):
                core.cable_distances(record, poses, robot.carrier_home, wrong)


def winches(robot):
    """One t_max for all cables."""
    return {"part": "t_max", "range": {"min": robot.t_min.max() + 1.0, "max": 20_000}, "equal": True}


@pytest.mark.parametrize(("name", "margin"), [("cogiro", 30.0), ("planar-4", 5.0)])
def test_the_weakest_winches_are_those_of_a_bisection(name, margin):
    """With the points of the file: the margin at listed poses is that of weaker winches up to what `design` finds."""
    robot, rng = load(name), np.random.default_rng(3)
    poses = np.tile(robot.home, (6, 1))
    poses[:, :3] += 0.1 * rng.uniform(-1, 1, (6, 3)) * robot.dof_mask[:3]
    found = design(
        robot,
        [winches(robot)],
        [{"poses": poses.tolist()}],
        minimise="t_max",
        margin=margin,
        start="robot",
        time_limit=0.5,
    )
    assert found.feasible, found.report()
    kept = np.flatnonzero(robot.dof_mask)
    w = Dynamics(robot).required_wrench(robot.home, np.zeros(6), np.zeros(6))[kept]
    scale = np.repeat([1.0, 1.0 / robot.length], 3)[kept]
    matrices = Dynamics(robot).wrench_matrix(poses)[:, kept] * scale[:, None]

    def least(t_max):
        problems = (TensionProblem(A, w * scale, robot.t_min, np.full(robot.m, t_max)) for A in matrices)
        return min(capacity_margin(problem).value for problem in problems)

    low, high = robot.t_min.max(), 20_000.0
    while high - low > 1e-7:
        middle = (low + high) / 2
        low, high = (low, middle) if least(middle) >= margin else (middle, high)
    (t_max,) = set(found.robot.t_max)
    assert high - 1e-6 <= t_max <= 1.01 * high + 1.0  # it searches for 0.5 % more margin than is required
    first, *_ = found.reasons.advice
    slope = (least(t_max + 0.01) - least(t_max - 0.01)) / 0.02
    assert first.change == "margin lower by 1 N"
    assert first.gain == pytest.approx(1.0 / slope, rel=1e-3)


def test_where_the_margin_is_not_reached_the_gains_are_those_of_the_margin():
    """Its slope with t_max is that of the capacity margins of robots with slightly other winches."""
    robot = load("ipanema-2")
    strongest = {"part": "t_max", "range": {"min": 20, "max": 200}, "equal": True}
    options = {"minimise": "t_max", "margin": 120.0, "start": "robot", "time_limit": 0.2}
    found = design(robot, [strongest], [{"poses": [robot.home.tolist()]}], **options)
    assert found.status == "not-found"
    assert "t_max of every cable higher by 1 N  margin +" in found.report()
    A = Dynamics(robot).wrench_matrix(robot.home)
    w = Dynamics(robot).required_wrench(robot.home, np.zeros(6), np.zeros(6))
    low, high = (
        capacity_margin(TensionProblem(A, w, robot.t_min, 200.0 + change, length=robot.length)).value
        for change in (-0.01, 0.01)
    )
    assert found.reasons.advice[0].gain == pytest.approx((high - low) / 0.02, rel=1e-6)


def test_weaker_winches_are_enough_for_a_better_layout(tmp_path):
    robot = load("ipanema-2")
    requirements = wanted(robot, minimise="t_max", margin=12.0, clearance=0.03, time_limit=4.0)
    fixed = design(robot, requirements=requirements | {"free": [winches(robot)], "time_limit": 0.5})
    (tmp_path / "wanted.yaml").write_text(json.dumps(requirements | {"free": [*requirements["free"], winches(robot)]}))
    done = towline("design", "ipanema-2", str(tmp_path / "wanted.yaml"), "--json", "--out", str(tmp_path / "out.yaml"))
    better = json.loads(done.stdout)
    assert max(better["t_max"]) < 0.95 * fixed.robot.t_max.max()
    assert load(tmp_path / "out.yaml").t_max.tolist() == better["t_max"]
    assert fixed.report().startswith("ipanema-2, design: FEASIBLE, mean t_max")
    with pytest.raises(InputError, match="free must have an item with part t_max for minimise: t_max, got none"):
        design(robot, requirements=requirements)


def test_a_robot_that_meets_the_requirements_is_never_replaced_by_one_that_does_not(monkeypatch):
    """A search that has no time may end anywhere."""

    def lost(variables, *others):
        found = search(variables, *others)
        found.y = variables.low.copy()
        return found

    monkeypatch.setattr(run, "search", lost)
    robot = load("ipanema-2")
    requirements = wanted(robot, minimise="t_max", margin=12.0, time_limit=1e-3) | {"free": [winches(robot)]}
    hardly = design(robot, requirements=requirements)
    assert hardly.feasible, hardly.report()
    assert np.allclose(hardly.robot.t_max, robot.t_max)
    assert not design(robot, requirements=requirements | {"margin": 30.0}).feasible


def test_winches_are_strong_enough_for_a_task_and_not_much_stronger():
    """A fast lift needs more than rest does; with 0.95 of the tensions that `design` finds it is infeasible."""
    robot, path = load("ipanema-2"), {"kind": "line", "start": [0, 0, 2.2], "end": [0, 0, 2.8]}
    task = {"name": "fast", "path": path, "duration": 0.3}
    rest = {"poses": [[0, 0, 2.5, 0, 0, 0]]}
    given = {"free": [winches(robot)], "require": [rest], "minimise": "t_max", "time_limit": 0.3}
    found = design(robot, **given, tasks=[task])
    assert found.feasible
    assert "ipanema-2, fast: FEASIBLE" in found.report()
    assert found.robot.t_max.max() > 2 * design(robot, **given).robot.t_max.max()
    cables = [{**cable.model_dump(), "t_max": 0.95 * cable.t_max} for cable in found.robot.cables]
    weaker = Robot.model_validate(found.robot.model_dump() | {"cables": cables})
    assert plan(weaker, task).status == "infeasible"
    weak = design(robot, [winches(robot) | {"range": {"min": 50, "max": 100}}], [rest], time_limit=0.3, tasks=[task])
    assert weak.status == "not-found"
    assert "feasible plan of each task" in weak.report()
    with pytest.raises(InputError, match=r"tasks\[0\]\.path"):
        design(robot, **given, tasks=[{"name": "pathless"}])


@pytest.mark.parametrize("name", ["ipanema-2", "caroca-pulleys"])
def test_slopes_of_lengths_are_those_of_differences(name):
    """Of both bounds, at a tilted pose, over pulleys too."""
    robot = load(name)
    low, high = robot.home[:3] - 0.3, robot.home[:3] + 0.3
    box = {"min": low.tolist(), "max": high.tolist()}
    require = [{"box": box, "grid": [2, 2, 1], "attitudes": [[0.1, -0.2, 0.3]]}]
    free = [{"part": part, "box": around(getattr(robot, f"{part}s"))} for part in ("anchor", "attachment")]
    read = read_requirements({"free": free, "require": require})
    variables = variables_of(robot, read)
    lengths = Dynamics(robot).cable_lengths(read.require[0].places())
    room = Room(shortest=float(lengths.min()) + 0.1, longest=float(lengths.max()) - 0.1)
    evaluation = Evaluation(variables, rows_of(robot, read.require, [read.require[0].places()]), room)
    y = variables.of_robot()
    found = evaluation.space_slopes(y, 500, np.inf)
    assert found.value.min() == pytest.approx(-0.1, abs=1e-9)
    step = 1e-6
    changes = [
        np.sort(evaluation.spaces(y + step * e).ravel()) - np.sort(evaluation.spaces(y - step * e).ravel())
        for e in np.eye(y.size)
    ]
    order = np.argsort(found.value)
    gaps = np.diff(found.value[order])
    alone = np.concatenate([[True], gaps > 1e-5]) & np.concatenate([gaps > 1e-5, [True]])
    assert alone.sum() > 5
    np.testing.assert_allclose(np.array(changes).T[alone] / (2 * step), found.by_variables[order][alone], atol=2e-8)


def test_cables_are_as_long_as_the_winches_permit(monkeypatch):
    """The longest are at corners of the box, by distances of points alone.

    The search starts from the robot's own layout and goes on until audits agree, whatever the machine's speed.
    """
    monkeypatch.setattr(searching, "_SEARCHING", 0.0)
    robot = load("ipanema-2")
    low, high = BOXES["ipanema-2"]
    corners = np.array(list(product(*np.transpose([low, high]))))

    def reach(robot):
        return np.linalg.norm(robot.anchors - robot.attachments - corners[:, None], axis=2).max()

    longest = 0.97 * reach(robot)
    anchors = {"part": "anchor", "box": {"min": [-4, -3, 1], "max": [4, 3, 5]}}
    found = design(
        robot, [anchors], [{"box": {"min": low, "max": high}, "grid": [3, 3, 2]}],
        cable_length={"min": 0.2, "max": longest}, time_limit=60.0,
    )  # fmt: skip
    assert found.feasible, found.report()
    assert 0.97 * longest < reach(found.robot) <= longest
    assert found.lengths[1] == pytest.approx(reach(found.robot), abs=1e-9)
    far = design(
        robot, [anchors], [{"poses": [[0, 0, 2.5, 0, 0, 0]]}], cable_length={"min": 8, "max": 9}, time_limit=0.2
    )
    assert far.status == "not-found"
    assert "a margin of 1 N, a cable length of 8 to 9 m;" in far.report()
