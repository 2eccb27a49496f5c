"""Metrics against formulas of the literature by other means, and their maps by samples, files and figures."""

import json
import time

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import eigh
from scipy.optimize import linprog, lsq_linear
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from towline import Dynamics, Robot, TensionProblem, load, sample, solve_batch, tensions
from towline.base import processors
from towline.base.errors import InputError
from towline.cli import workspace as cli
from towline.cli.main import app
from towline.solvers import capacity_margin
from towline.workspace import METRICS, Margin, MetricInRange, Places, StaticEquilibrium, draw, metric_values

from .stiff_robots import elastic, inertia


def poses_of(robot, spread, count=12):
    rng = np.random.default_rng(5)
    poses = np.tile(robot.home, (count, 1))
    poses[:, :3] += np.array(spread) * rng.uniform(-1, 1, (count, 3))
    poses[:, 3:] += 0.1 * rng.normal(size=(count, 3)) * robot.dof_mask[3:]
    return poses


PLANAR = {
    "name": "planar",
    "source": "a test",
    "platform": {"mass": 2, "inertia": [1, 0.3, 1, 0, 0, 0], "dof": ["x", "z", "pitch"], "com": [0.05, 0, 0.02]},
    "carriers": [{"name": "frame", "kind": "ground"}],
    "cables": [
        {"carrier": "frame", "anchor": [a, 0, b], "attachment": [c, 0, d], "t_min": 1, "t_max": 90, "stiffness": 9e3}
        for a, b, c, d in ((-2, 2, -0.2, -0.1), (2, 2, 0.2, -0.1), (-2, -2, -0.2, 0.1), (2, -2, 0.2, 0.1))
    ],
}
ROBOTS = {
    "ipanema-2": lambda: (elastic("ipanema-2", 1e5), (2.5, 2, 1)),
    "cogiro": lambda: (elastic("cogiro", 1e5), (5, 4, 1)),
    "planar": lambda: (Robot.model_validate(PLANAR), (0.9, 0, 0.9)),
    "wang-flying": lambda: (load("wang-flying"), (0.2, 0.2, 0.2)),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_metrics_are_those_of_the_literature(name):
    robot, spread = ROBOTS[name]()
    dynamics, rows = Dynamics(robot), np.flatnonzero(robot.dof_mask)
    poses = poses_of(robot, spread)
    found = {metric: metric_values(metric, robot, Places.at_home(robot, poses)) for metric in METRICS}
    scale = np.r_[1, 1, 1, np.full(3, 1 / robot.length)][rows]
    held_somewhere = False
    for k, pose in enumerate(poses):
        got = {metric: values[k] for metric, values in found.items()}
        S = dynamics.wrench_matrix(pose)[rows] * scale[:, None]
        w = dynamics.required_wrench(pose, np.zeros(6), np.zeros(6))
        assert_allclose(got["condition_number"], np.linalg.cond(S), rtol=1e-7)
        assert_allclose(got["dexterity"], 1 / np.linalg.cond(S), rtol=1e-7)
        assert_allclose(got["tension_factor"], tension_factor(S), atol=1e-8)
        assert_allclose(got["cable_distance"], cable_distance(robot, *dynamics.points(pose)), atol=1e-7)
        problem = TensionProblem(dynamics.wrench_matrix(pose)[rows], w[rows], robot.t_min, robot.t_max)
        t = tensions(robot, pose).tensions
        limited = ("natural_frequency", "translational_stiffness", "rotational_stiffness", "payload", "acceleration")
        if t is None:
            assert got["margin"] < 0
            assert np.isnan([got[metric] for metric in limited]).all()
            continue
        held_somewhere = True
        scaled = TensionProblem(S, w[rows] * scale, robot.t_min, robot.t_max)
        assert_allclose(got["margin"], capacity_margin(scaled).value, atol=1e-9)
        K = dynamics.stiffness(pose, t)
        K = ((K + K.T) / 2)[np.ix_(rows, rows)]
        squares = eigh(K, inertia(robot, pose)[np.ix_(rows, rows)], eigvals_only=True)
        assert_allclose(got["natural_frequency"], np.sqrt(squares[0]) / (2 * np.pi), rtol=1e-8)
        C = np.linalg.inv(K)
        force = rows < 3
        assert_allclose(got["translational_stiffness"], 1 / np.linalg.eigvalsh(C[np.ix_(force, force)])[-1], rtol=1e-7)
        assert_allclose(got["rotational_stiffness"], 1 / np.linalg.eigvalsh(C[np.ix_(~force, ~force)])[-1], rtol=1e-7)
        assert_allclose(got["payload"], payload(problem, robot.platform.mass), atol=1e-6)
        # Any moment is free where lengths are tiny, so that the margin counts forces alone.
        forces = S / np.where(force, 1, 1e-6)[:, None]
        reserve = capacity_margin(TensionProblem(forces, w[rows] * scale, robot.t_min, robot.t_max)).value
        assert_allclose(got["acceleration"], reserve / robot.platform.mass, rtol=1e-4, atol=1e-7)
    assert held_somewhere


def tension_factor(A):
    """Return the largest t_low with A t = 0 and t_low <= t <= 1, as CASPR's linear program."""
    m = A.shape[1]
    ordered = np.hstack([-np.eye(m), np.ones((m, 1))])
    bounds = [(0, 1)] * (m + 1)
    balance = np.hstack([A, np.zeros((len(A), 1))])
    return -linprog(np.r_[np.zeros(m), -1], ordered, np.zeros(m), balance, np.zeros(len(A)), bounds).fun


def payload(problem, mass):
    """Return the largest p with A t = w (1 + p / mass)."""
    m = problem.A.shape[1]
    bounds = [*zip(problem.t_min, problem.t_max, strict=True), (0, None)]
    A = np.column_stack([problem.A, -problem.w / mass])
    return -linprog(np.r_[np.zeros(m), -1], A_eq=A, b_eq=problem.w, bounds=bounds).fun


def cable_distance(robot, anchors, attachments):
    """Return the smallest distance of two segments without a common end, each pair by bounded least squares."""
    found = []
    for i in range(robot.m):
        for j in range(i):
            apart = [np.linalg.norm(points[i] - points[j]) > 1e-9 for points in (anchors, attachments)]
            if all(apart):
                along = np.column_stack([attachments[i] - anchors[i], anchors[j] - attachments[j]])
                gap = lsq_linear(along, anchors[j] - anchors[i], (0, 1), tol=1e-14)
                found.append(np.sqrt(2 * gap.cost))
    return min(found)


def test_a_payload_is_the_most_that_can_be_held():
    robot, spread = ROBOTS["cogiro"]()
    poses = poses_of(robot, spread, 200)
    most = metric_values("payload", robot, Places.at_home(robot, poses))
    A, w = Dynamics(robot).wrench_matrix(poses), Dynamics(robot).required_wrench(robot.home, np.zeros(6), np.zeros(6))
    heavier = (1 + np.multiply.outer([1 - 1e-6, 1 + 1e-6], most) / robot.platform.mass)[..., None] * w
    feasible = solve_batch(A, heavier, robot.t_min, robot.t_max, length=robot.length).feasible
    held = most > 0
    assert held.sum() > 50
    assert feasible[0][held].all()
    assert not feasible[1].any()


def test_an_acceleration_is_possible_in_every_direction():
    robot, spread = ROBOTS["ipanema-2"]()
    poses = poses_of(robot, spread, 40)
    most = metric_values("acceleration", robot, Places.at_home(robot, poses))
    rows = np.flatnonzero(most > 0)
    ways = np.random.default_rng(2).normal(size=(500, 1, 3))
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    A, w = Dynamics(robot).wrench_matrix(poses[rows]), np.zeros((500, rows.size, 6))
    w[..., 2] = 9.81 * robot.platform.mass
    for share, always in ((1 - 1e-6, True), (1.1, False)):
        more = w.copy()
        more[..., :3] += robot.platform.mass * share * most[rows, None] * ways
        assert solve_batch(A, more, robot.t_min, robot.t_max).feasible.all(axis=0).all() == always


def test_what_has_no_value_is_nan_and_what_does_not_apply_is_refused():
    rope = {"carrier": "frame", "anchor": [0, 0, 2], "attachment": [0, 0, 0], "t_min": 1, "t_max": 90, "stiffness": 1e4}
    point = {**PLANAR, "name": "pendulum", "platform": {"mass": 2, "dof": ["x", "y", "z"]}, "cables": [rope]}
    pendulum = Robot.model_validate(point)
    places = Places.at_home(pendulum, [[0, 0, 0, 0, 0, 0], [0.5, 0, 0, 0, 0, 0]])
    assert_array_equal(metric_values("condition_number", pendulum, places), np.inf)
    assert_array_equal(metric_values("dexterity", pendulum, places), 0.0)
    assert_array_equal(metric_values("cable_distance", pendulum, places), np.inf)
    assert_array_equal(metric_values("tension_factor", pendulum, places), 0.0)
    assert_allclose(metric_values("payload", pendulum, places), [90 / 9.81 - 2, np.nan])
    assert_allclose(metric_values("acceleration", pendulum, places), [0, np.nan], atol=1e-12)
    swing = np.sqrt(9.81 / 2) / (2 * np.pi)
    assert_allclose(metric_values("natural_frequency", pendulum, places), [swing, np.nan], rtol=1e-12)
    assert_allclose(metric_values("translational_stiffness", pendulum, places), [2 * 9.81 / 2, np.nan], rtol=1e-12)
    weightless = Robot.model_validate({**PLANAR, "gravity": [0, 0, 0]})
    for call, message in (
        (lambda: metric_values("speed", pendulum, places), "metric must be one of margin, natural_frequency"),
        (lambda: metric_values("rotational_stiffness", pendulum, places), "platform does not turn"),
        (lambda: metric_values("payload", weightless, Places.at_home(weightless, weightless.home)), "without gravity"),
        (lambda: sample(load("cogiro"), StaticEquilibrium(), metrics="natural_frequency"), r"cables\[0\].stiffness"),
        (lambda: sample(pendulum, StaticEquilibrium(), metrics=["margin", 3]), "metrics must be one of"),
        (lambda: sample(pendulum, StaticEquilibrium(), metrics=3), "metrics must be names"),
        (lambda: sample(pendulum, StaticEquilibrium(), metrics="margin", keep="none"), "keep must be accepted or all"),
        (lambda: draw(xr.Dataset({"x": 1.0})), "result must be a result of sample"),
        (lambda: MetricInRange(metric="speed", min=1), "metric must be one of"),
        (lambda: MetricInRange(metric="margin"), "min or max must be given"),
        (lambda: MetricInRange(metric="margin", min=np.nan), "min must"),
    ):
        with pytest.raises(InputError, match=message) as error:
            call()
        assert "\n" not in str(error.value)


def test_a_workspace_is_drawn_with_its_metrics():
    robot = load("ipanema-2")
    region = {"position": {"min": [-2, -1, 3], "max": [2, 1, 3]}}
    mapped, plain = (sample(robot, StaticEquilibrium(), region, 500, metrics=names) for names in (["margin"], []))
    assert draw(mapped, robot).axes[-1].get_xlabel() == "margin [N]"
    np.testing.assert_allclose(draw(mapped, robot).axes[0].lines[-1].get_xydata(), robot.home_anchors[:, :2])
    assert "accepted" in draw(plain).get_suptitle() + "".join(ax.get_title() for ax in draw(plain).axes)


def test_a_metric_as_a_condition():
    robot, spread = ROBOTS["ipanema-2"]()
    places = Places.at_home(robot, poses_of(robot, spread, 300))
    margin = metric_values("margin", robot, places)
    assert_array_equal(
        MetricInRange(metric="margin", min=10).holds(robot, places), Margin(above=10).holds(robot, places)
    )
    inside = MetricInRange(metric="margin", min=0, max=20).holds(robot, places)
    assert_array_equal(inside, (margin >= 0) & (margin <= 20))
    mass = metric_values("payload", robot, places)
    assert np.isnan(mass).any()
    assert_array_equal(MetricInRange(metric="payload", min=5).holds(robot, places), np.nan_to_num(mass, nan=-1) >= 5)


REGION = {"position": {"min": [-2, -2, 2], "max": [2, 2, 3]}, "attitude": {"min": [0, 0, -0.2], "max": [0, 0, 0.2]}}
NAMES = ("natural_frequency", "payload", "tension_factor")


def test_a_sample_has_the_metrics_of_its_points(tmp_path):
    robot, _ = ROBOTS["ipanema-2"]()
    given = {"region": REGION, "samples": 8_000, "metrics": NAMES}
    result = sample(robot, StaticEquilibrium(), **given)
    poses = np.hstack([result["position"], result["attitude"]])
    assert 400 < len(poses) < 8_000
    for name in NAMES:
        values = metric_values(name, robot, Places.at_home(robot, poses))
        assert_array_equal(result[name], values)
        assert result[name].attrs["units"] == METRICS[name].unit
    shared = sample(robot, StaticEquilibrium(), **given, workers=2)
    xr.testing.assert_equal(result, shared)
    # Flags are in the checkpoint, values are computed again.
    sample(robot, StaticEquilibrium(), REGION, 8_000, checkpoint=tmp_path / "run.db")
    xr.testing.assert_equal(
        sample(robot, StaticEquilibrium(), **given, checkpoint=tmp_path / "run.db", resume=True), result
    )
    every = sample(robot, StaticEquilibrium(), **given, keep="all", method="grid")
    assert_array_equal(np.isfinite(every["payload"]), every["accepted"])


def test_the_command_computes_and_draws_metrics(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    elastic("ipanema-2", 1e5).save("robot.yaml")
    assert ", ".join(METRICS) == cli.METRICS
    for box in ("-2 -2 2; 2 2 3", "-2 0 2; 2 0 3", "-2 0 2; 2 0 2"):
        options = ["--metric", "margin", "--metric", "natural_frequency", "--figure", "map.svg", "--samples", "2000"]
        done = CliRunner().invoke(app, ["workspace", "robot.yaml", "--box", box, *options, "--json"])
        assert done.exit_code == 0, done.output
        written = xr.load_dataset("ipanema-2-workspace.nc")
        for name in ("margin", "natural_frequency"):
            some = json.loads(done.stdout)["metrics"][name]
            values = written[name].values
            assert [some["min"], some["max"], some["unit"]] == [values.min(), values.max(), METRICS[name].unit]
            assert values.min() <= some["median"] <= values.max()
        assert "<svg" in (tmp_path / "map.svg").read_text()
    shown = CliRunner().invoke(app, ["workspace", "robot.yaml", "--metric", "margin", "--samples", "2000"])
    assert "  margin " in shown.output
    assert ", median " in shown.output
    nowhere = ["--box", "20 20 20; 30 30 30", "--metric", "margin", "--figure", "none.png", "--samples", "50"]
    empty = CliRunner().invoke(app, ["workspace", "robot.yaml", *nowhere])
    assert empty.exit_code == 1
    assert "margin no value" in empty.output
    wrong = CliRunner().invoke(app, ["workspace", "robot.yaml", "--metric", "speed"])
    assert "metrics must be one of margin" in str(wrong.exception)


def test_a_million_poses_take_seconds():
    robot, spread = ROBOTS["cogiro"]()
    places = Places.at_home(robot, poses_of(robot, spread, 16_384))
    with processors.at_most(1):
        for name, seconds in (("margin", 1), ("natural_frequency", 4), ("condition_number", 3)):
            spent = []
            for _ in range(3):
                start = time.process_time()
                metric_values(name, robot, places)
                spent.append(time.process_time() - start)
            assert min(spent) * 1e6 / len(places) < 2 * seconds  # other work on the processor slows this down, too


def test_attitudes_do_not_change_what_a_turned_robot_has():
    """A robot and its poses turned about z as a whole have the same values."""
    robot, spread = ROBOTS["ipanema-2"]()
    turn = Rotation.from_euler("z", 0.7)
    data = robot.model_dump(mode="json")
    for cable in data["cables"]:
        cable["anchor"] = turn.apply(cable["anchor"]).tolist()
    turned = Robot.model_validate(data)
    poses = poses_of(robot, spread, 50)
    moved = np.column_stack([turn.apply(poses[:, :3]), poses[:, 3:5], poses[:, 5] + 0.7])
    for name in METRICS:
        one, other = (metric_values(name, r, Places.at_home(r, p)) for r, p in ((robot, poses), (turned, moved)))
        assert_allclose(one, other, rtol=1e-6, atol=1e-9)
