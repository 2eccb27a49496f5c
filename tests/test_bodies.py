"""Bodies of platforms and loads: distances of their surfaces, floors and rooms, and plans around thin things.

What is expected comes from least squares over the corners of both bodies (`scipy.optimize.nnls`) at many instants.
"""

import json

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import minimize_scalar, nnls
from scipy.spatial.transform import Rotation

from towline import InputError, load, plan
from towline.models import Robot
from towline.ocp.audits.audit import audit
from towline.ocp.nlp.rows import Mesh, swept
from towline.ocp.planner import Planner
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import Task

from .soak.random_work import with_beam
from .warm import towline

SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
KINDS = ("sphere", "capsule", "box", "mesh")
BARE = {"name": "place", "cables": None}
BOX = {"kind": "box", "min": [-0.51, -0.5, 0.0], "max": [0.51, 0.5, 1.0]}  # about the attachments of CoGiRo
POST = {"start": [0, 0, 0], "end": [0, 0, 2.2]}
PILLAR = np.array([[0, 1.2, 0], [0, 1.2, 6]])
BEAM = {
    "phases": [
        {
            "name": "carry",
            "duration": 8,
            "path": {"kind": "line", "start": [-3, 0, 2], "end": [3, 0, 2]},
            "load": {
                "mass": 50,
                "com": [0, 0, -0.4],
                "inertia": [40, 1, 40, 0, 0, 0],
                "body": {"kind": "box", "min": [-0.1, -1.5, -0.5], "max": [0.1, 1.5, -0.3]},
            },
        }
    ],
    "steps": 20,
    "tube": {"position": 0.5, "attitude": 1},
    "limits": {
        "keep_out": [{"kind": "capsule", "start": [0, 1.2, 0], "end": [0, 1.2, 6], "radius": 0.2, "cables": None}]
    },
}
HEAVY = 1e4  # of the rows that make shares of corners add up to one


def with_body(body, name="cogiro", **keys):
    data = load(name).model_dump()
    return Robot.model_validate(data | {"platform": data["platform"] | {"body": body}} | keys)


def random_shape(rng, size, kind, at=(0.0, 0.0, 0.0)):
    """Return a shape as a file has it, its corners and its radius."""
    at = np.array(at)
    if kind == "sphere":
        radius = size * rng.uniform(0.1, 0.5)
        return {"kind": kind, "centre": at.tolist(), "radius": radius}, at[None], radius
    if kind == "capsule":
        ends, radius = at + size * rng.uniform(-0.5, 0.5, (2, 3)), size * rng.uniform(0.02, 0.2)
        return {"kind": kind, "start": ends[0].tolist(), "end": ends[1].tolist(), "radius": radius}, ends, radius
    if kind == "box":
        half, attitude = size * rng.uniform(0.03, 0.5, 3), rng.uniform(-1.5, 1.5, 3)
        corners = at + Rotation.from_euler("xyz", attitude).apply(SIGNS * half)
        low, high = (at - half).tolist(), (at + half).tolist()
        return {"kind": kind, "min": low, "max": high, "attitude": attitude.tolist()}, corners, 0.0
    points = at + size * rng.uniform(-0.5, 0.5, (7, 3))
    return {"kind": kind, "vertices": points.tolist()}, points, 0.0


def placed(pose, points):
    """Return points (k, 3) of a frame at poses (..., 6) in {G}, (..., k, 3)."""
    R = Rotation.from_euler("xyz", np.atleast_2d(pose)[:, 3:]).as_matrix().reshape(*np.shape(pose)[:-1], 3, 3)
    return points @ R.swapaxes(-1, -2) + pose[..., None, :3]


def between_hulls(first, second):
    """Return the distance of the hulls of points (k, 3) and (j, 3), and the way from the first to the second."""
    rows = np.block([[first.T, -second.T], [HEAVY * np.ones(len(first)), np.zeros(len(second))],
                     [np.zeros(len(first)), HEAVY * np.ones(len(second))]])  # fmt: skip
    shares, _ = nnls(rows, np.array([0, 0, 0, HEAVY, HEAVY]))
    mine, its = shares[: len(first)], shares[len(first) :]
    way = its @ second / its.sum() - mine @ first / mine.sum()
    return float(np.linalg.norm(way)), way


class Scene:
    """A body that moves past a place, and how near it comes, by dense evaluation."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        fast = seed % 3 == 0  # through more than the place's size from one sample of the audit to the next
        size = rng.uniform(0.02, 0.05) if fast else rng.uniform(0.3, 1.5)
        self.body, self.corners, self.radius = random_shape(
            rng, size, KINDS[seed % 4], size * rng.uniform(-0.5, 0.5, 3)
        )
        if self.body["kind"] == "mesh":
            self.radius = self.body["radius"] = size * rng.uniform(0.0, 0.1)
        ends = np.concatenate([rng.uniform((-2, -2, 0), (2, 2, 4), (2, 3)), rng.uniform(-0.6, 0.6, (2, 3))], axis=1)
        self.path = {"kind": "line", "start": ends[0].tolist(), "end": ends[1].tolist()}
        self.duration = rng.uniform(0.1, 0.2) if fast else rng.uniform(1.0, 3.0)
        middle = Planner(with_body(self.body), self.task([])).scenario.path
        self.at = lambda times: middle.at(np.atleast_1d(times), self.duration).pose.reshape(*np.shape(times), 6)
        about = self.at(self.duration * rng.uniform(0.2, 0.8))
        beside = rng.normal(size=3)
        beside *= size * rng.uniform(0.2, 1.2) / np.linalg.norm(beside)
        centre = placed(about, self.corners).mean(axis=0) + beside
        self.place, self.others, its = random_shape(rng, rng.uniform(0.3, 1.0) * size, KINDS[(seed // 4) % 4], centre)
        self.radius += its

    def task(self, places):
        limits = {"keep_out": [BARE | place for place in places]}
        return {"path": self.path, "duration": self.duration, "limits": limits}

    def distance(self, time):
        return between_hulls(placed(self.at(time), self.corners), self.others)

    def nearest(self, samples):
        """Return when the bodies are nearest, and their distance there, negative if they overlap at all."""
        times = np.linspace(0.0, self.duration, samples)
        values = np.array([between_hulls(each, self.others)[0] for each in placed(self.at(times), self.corners)])
        best = (times[values.argmin()], values.min())
        for k in np.argsort(values)[:3]:
            ends = times[max(k - 1, 0)], times[min(k + 1, samples - 1)]
            found = minimize_scalar(
                lambda time: self.distance(time)[0], bounds=ends, method="bounded", options={"xatol": 1e-12}
            )
            best = min(best, (found.x, found.fun), key=lambda pair: pair[1])
        return best[0], best[1] - self.radius

    def verdict(self, least, shift=(0.0, 0.0, 0.0)):
        """Return what the audit reports of the place, moved by a shift, with a required distance."""
        moved = {key: (np.array(self.place[key]) + shift).tolist() for key in ("centre", "start", "end", "min", "max")
                 if key in self.place}  # fmt: skip
        if "vertices" in self.place:
            moved["pose"] = [*shift, 0.0, 0.0, 0.0]
        scenario = Planner(with_body(self.body), self.task([self.place | moved | {"platform": least}])).scenario
        return [each for each in audit(scenario, None).excess if each.about == "platform's body outside place"]


def check(seed, samples=1500, near=5e-6):
    """Check the audit of a scene against the nearest approach: with a required distance just below it, and above."""
    scene = Scene(seed)
    time, apart = scene.nearest(samples)
    if apart < 2e-5:
        assert apart > -near or scene.verdict(0.0)
        return "inside"
    assert not scene.verdict(apart - near)
    found = scene.verdict(apart + near)
    assert len(found) == 1
    assert found[0].value == pytest.approx(apart, abs=near)
    # Moved to it, by a tenth of a millimetre too far, it overlaps; by as much too little it does not.
    _, way = scene.distance(time)
    direction = way / np.linalg.norm(way)
    touching = scene.verdict(0.0, -(apart + 1e-4) * direction)
    assert len(touching) == 1
    assert touching[0].value < 0
    return "outside"


@pytest.mark.parametrize("seed", [0, 3, 6, 9, 11])
def test_no_wrong_verdict_where_a_body_touches_or_misses(seed):
    check(seed, samples=200)


def test_the_tip_of_a_long_body_passes_between_instants():
    # Peak speed of the tip 62 m/s, 47 mm from instant to instant; attachments move by 7 mm meanwhile.
    body = {"kind": "capsule", "start": [0, 0, 0], "end": [5, 0, 0], "radius": 0.01}
    task = {"path": {"kind": "line", "start": [0, 0, 2, 0, 0, 0], "end": [0, 0, 2, 0, 0, 1]}, "duration": 0.15}
    robot = with_body(body)
    pose = Planner(robot, task).scenario.path.at(np.array([100.5 / 200 * 0.15]), 0.15).pose
    for beyond, seen in ((0.0, True), (0.014, True), (0.016, False)):
        tip = placed(pose[0], np.array([[5 + beyond, 0, 0]]))[0].tolist()
        ball = {"kind": "sphere", "centre": tip, "radius": 0.005, **BARE}
        audited = audit(Planner(robot, task | {"limits": {"keep_out": [ball]}}).scenario, None)
        # At no instant do they meet: the tip is 23 mm from the ball's centre at the nearest ones.
        poses = audited.motion.pose
        lines = placed(poses, np.array([[0, 0, 0], [5, 0, 0]]))
        apart = [between_hulls(line, np.array([tip]))[0] for line in lines]
        assert min(apart) > 0.02
        assert any(excess.about == "platform's body outside place" for excess in audited.excess) == seen


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_distance_is_that_of_the_surfaces(seed):
    rng = np.random.default_rng(seed)
    body, corners, radius = random_shape(rng, 1.0, str(rng.choice(KINDS)))
    place, others, rounding = random_shape(rng, 1.0, str(rng.choice(KINDS)), rng.uniform(-1.5, 1.5, 3))
    still = {"path": {"kind": "rest", "pose": [0] * 6}, "duration": 1, "limits": {"keep_out": [BARE | place]}}
    scenario = Planner(with_body(body), still).scenario
    pose = np.concatenate([rng.uniform(-0.5, 0.5, 3), rng.uniform(-1, 1, 3)])
    values = zip(scenario.limits, scenario.limits.at_rest(pose[None], np.zeros((1, 1, 6))), strict=True)
    least = min(its.min() for limit, its in values if limit.labels[0] == "platform's body")
    apart = between_hulls(placed(pose, corners), others)[0]
    if apart > 1e-6:
        assert least == pytest.approx(apart - radius - rounding, abs=1e-6)
    else:
        assert least <= 1e-6 - radius - rounding


def nearest(planned, corners, radius, others):
    """Return the least distance of a body and a place along a plan [m], by least squares."""
    times = np.linspace(0.0, planned.scenario.duration, 1500)
    poses = planned.scenario.motion(times, planned.deviation)[0].pose
    return min(between_hulls(each, others)[0] for each in placed(poses, corners)) - radius


def test_a_post_between_the_attachments_is_seen_and_avoided():
    # 40 mm thick, 2.2 m high: the attachments of CoGiRo pass on both sides of it, and its centre of mass above.
    task = {
        "path": {"kind": "line", "start": [-3, 0.25, 2], "end": [3, 0.25, 2]},
        "duration": 8,
        "steps": 40,
        "limits": {"keep_out": [{"kind": "capsule", "name": "post", **POST, "radius": 0.02, "cables": None}]},
    }
    points = plan("cogiro", task)
    assert points.feasible
    [warning] = points.warnings
    assert warning.startswith("'post' passes between the points of the platform: it is 0.22 m inside the hull of")
    beside = task | {"path": {"kind": "line", "start": [-3, 0.55, 2], "end": [3, 0.55, 2]}}
    assert not plan("cogiro", beside).warnings
    robot = with_body(BOX)
    seen = plan(robot, task)
    assert seen.status == "infeasible"
    sentence = str(seen.audit.excess[0])
    assert sentence.startswith("platform's body is 0.22 m inside the keep-out region 'post' at t = ")  # its height
    # Rest to rest, the platform's front, 0.51 m before its origin, has come to the post, and its back not yet passed.
    x = seen.scenario.motion(np.array([seen.audit.excess[0].time]), None)[0].pose[0, 0]
    assert abs(x) < 0.51 + 0.02
    around = plan(robot, task | {"tube": {"position": 1.0}, "margin": 20})
    assert around.feasible
    corners = (SIGNS + 1) / 2 * (np.array(BOX["max"]) - BOX["min"]) + BOX["min"]
    apart = nearest(around, corners, 0.02, np.array([POST["start"], POST["end"]]))
    assert -1e-6 <= apart < 0.05  # the way is not longer than it has to be


def test_a_beam_is_carried_past_a_pillar():
    planned = plan("cogiro", BEAM)
    assert planned.feasible
    corners = np.array([0.1, 1.5, 0.1]) * SIGNS + [0, 0, -0.4]
    assert nearest(planned, corners, 0.2, PILLAR) >= -1e-6
    straight = plan("cogiro", {key: value for key, value in BEAM.items() if key != "tube"})
    assert [str(each).partition(" is ")[0] for each in straight.audit.excess] == ["load's body"]
    assert nearest(straight, corners, 0.2, PILLAR) < -0.19


def test_a_beam_under_quadrotors_does_not_jump_over_a_post():
    """A step of 0.6 m over a post of 0.2 m: both nodes keep 0.16 m, a third of the way the beam is inside."""
    post = {"kind": "capsule", "name": "post", "start": [0, 0.2, -1], "end": [0, 0.2, 5], "radius": 0.1, "cables": None}
    line = {"kind": "line", "start": [-2, 0, 1.5], "end": [2, 0, 1.5]}
    task = {"path": line, "duration": 4, "tube": {"position": "free"}, "base": {"kind": "free"}, "steps": 10}
    scenario = lay_out(with_beam(1.0, 2), Task.model_validate(task | {"limits": {"keep_out": [post]}}))
    ways = {limit: way for limit, way in swept(scenario, Mesh(10)).items() if "platform's body" in limit.labels}
    [(limit, way)] = ways.items()
    at = np.zeros((2, 18))
    at[:, 0], at[:, 2] = (-0.3, 0.3), 1.5
    carriers = np.zeros((2, 18))
    values = np.array(way(at[0], *carriers, at[1], *carriers)).ravel()
    thick = 0.1 + 0.04  # of the post and of the beam
    assert values == pytest.approx([0.1 - thick, 0.1 - thick, 0.3 - thick], abs=1e-9)
    assert limit.low == 0.0


@pytest.mark.parametrize(("x", "feasible", "tube"), [(-1.5, False, 0.6), (0.5, True, 0.05)])
def test_a_body_of_a_load_counts_while_it_is_carried(x, feasible, tube):
    load_ = BEAM["phases"][0]["load"]
    support = [[sx, sy, -0.5] for sx in (-1, 1) for sy in (-1, 1)]
    pillar = {**BEAM["limits"]["keep_out"][0], "start": [x, 1.2, 0], "end": [x, 1.2, 6]}
    task = {
        "phases": [
            {"name": "carry", "duration": 4, "path": {"kind": "line", "start": [-3, 0, 2], "end": [-1, 0, 2]},
             "load": load_},
            {"name": "down", "duration": 1, "load": load_, "ground": {"support": support}},
            {"name": "on", "duration": 6, "path": {"kind": "line", "start": [-1, 0, 2], "end": [3, 0, 2]}},
        ],
        "limits": {"keep_out": [pillar]},
    }  # fmt: skip
    planned = plan("cogiro", task)
    assert planned.feasible is feasible
    freely = plan("cogiro", task | {"tube": {"position": tube}, "steps": 40})
    assert freely.feasible
    corners = np.array([0.1, 1.5, 0.1]) * SIGNS + [0, 0, -0.4]
    times = np.linspace(0.0, 5.0, 500)  # while it is carried
    poses = freely.scenario.motion(times, freely.deviation)[0].pose
    ends = np.array([pillar["start"], pillar["end"]])
    assert min(between_hulls(each, ends)[0] for each in placed(poses, corners)) - 0.2 >= -1e-6


@pytest.mark.parametrize("with_radius", [0.0, 0.05])
def test_floor_and_room_bound_the_lowest_and_outermost_places(with_radius):
    points = [[0.4, 0.1, -0.3], [-0.5, 0.4, 0.0], [0.1, -0.4, 0.1], [0.0, 0.0, 0.9]]
    body = {"kind": "mesh", "vertices": points, "radius": with_radius}
    ends = [[-1, 0, 2, 0, 0, 0], [1, 0.5, 1.5, 0.4, -0.5, 0.3]]
    task = {"path": {"kind": "line", "start": ends[0], "end": ends[1]}, "duration": 3}
    scenario = Planner(with_body(body), task).scenario
    poses = scenario.motion(np.linspace(0, 3, 3001), None)[0].pose
    corners = placed(poses, np.array(points))
    low, high = corners.min(axis=(0, 1)) - with_radius, corners.max(axis=(0, 1)) + with_radius
    for slack, exceeded in ((1e-5, False), (-1e-5, True)):
        room = {"min": (low - slack).tolist(), "max": (high + slack).tolist()}
        robot = with_body(body, floor=low[2] - slack, workspace_box=room)
        found = [str(each) for each in audit(Planner(robot, task).scenario, None).excess]
        assert len(found) == (7 if exceeded else 0)
        if exceeded:
            assert "platform's body is 10 um below the floor at t = 3.000 s" in found
            assert any(text.startswith("platform's body is 10 um beyond the largest x of the room") for text in found)
    # Without a body its centre of mass and its attachments count.
    lowest = placed(poses, scenario.robot.attachments)[..., 2].min()
    data = load("cogiro").model_dump()
    for slack, count in ((1e-5, 0), (-1e-5, 1)):
        robot = Robot.model_validate(data | {"floor": lowest - slack})
        assert len(audit(Planner(robot, task).scenario, None).excess) == count


def test_a_plan_stays_above_the_floor():
    wall = {"kind": "box", "min": [-0.1, -20, 1.3], "max": [0.1, 20, 20], **BARE}
    task = {
        "path": {"kind": "line", "start": [-3, 0, 1.5], "end": [3, 0, 1.5]},
        "duration": 8,
        "steps": 20,
        "tube": {"position": "free"},
        "limits": {"keep_out": [wall]},
    }
    planned = plan(with_body(BOX, floor=0.0), task)
    assert planned.feasible
    heights = planned.scenario.motion(np.linspace(0, 8, 2000), planned.deviation)[0].pose[:, 2]
    assert -1e-6 <= heights.min() < 0.3  # level: it passes between floor and wall, which are 1.3 m apart


def test_cables_and_carriers_keep_away_from_bodies():
    name = "multi-quadrotor-4"
    robot = load(name)
    low = robot.attachments[:, 2].min()
    body = {"kind": "box", "min": [-0.1, -0.1, low - 0.4], "max": [0.1, 0.1, low - 0.3]}
    still = {"path": {"kind": "rest", "pose": robot.home.tolist()}, "duration": 1}
    limits = {"carrier_platform_clearance": 50.0, "cable_platform_clearance": 0.29}
    scenario = Planner(with_body(body, name), still | {"limits": limits}).scenario
    values = scenario.limits.at_rest(robot.home[None], robot.carrier_home[None])
    by_name = {limit.name: its[0] for limit, its in zip(scenario.limits, values, strict=True)}
    corners = placed(robot.home, (SIGNS + 1) / 2 * (np.array(body["max"]) - body["min"]) + body["min"])
    cables = np.stack([robot.home_anchors, robot.home_attachments], axis=1)
    expected = [between_hulls(corners, ends)[0] for ends in cables]
    np.testing.assert_allclose(by_name["cable_platform_clearance"], expected, atol=1e-6)
    expected = [between_hulls(corners, place[None, :3])[0] for place in robot.carrier_home]
    np.testing.assert_allclose(by_name["carrier_platform_clearance"], expected, atol=1e-6)


def test_wrong_bodies_are_one_line():
    still = {"path": {"kind": "rest", "pose": [0, 0, 2, 0, 0, 0]}, "duration": 1}
    for name in ("cable", "carrier"):
        with pytest.raises(InputError, match=rf"limits.{name}_platform_clearance must be left out without a body"):
            plan("cogiro", still | {"limits": {f"{name}_platform_clearance": 0.1}})
    with pytest.raises(InputError, match="platform's body must leave all attachments outside by at least"):
        plan(with_body(BOX), still | {"limits": {"cable_platform_clearance": 0.0}})
    for wrong, text in (
        ({"kind": "box", "min": [0, 0, 0], "max": [1, 1, 0]}, "body.min must be smaller than max"),
        ({"kind": "box", "min": [0, 0, 0], "max": [1, 1, 1e-6]}, "body must be at least 1e-05 m thick"),
        ({"kind": "mesh", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]}, "body.vertices must span a body"),
        ({"kind": "mesh", "file": "no.stl", "scale": 1}, "no.stl: no such file"),
        ({"kind": "capsule", "start": [0, 0, np.nan], "end": [0, 0, 1], "radius": 1}, r"start\[2\] must be a finite"),
        ({"kind": "cone"}, "body.kind must be one of box, capsule, mesh, sphere"),
    ):
        with pytest.raises(InputError, match=text) as raised:
            with_body(wrong)
        assert "\n" not in str(raised.value)
    with pytest.raises(InputError, match="floor must be a finite number"):
        with_body(BOX, floor=np.inf)
    with pytest.raises(InputError, match=r"workspace_box\.min must not exceed max"):
        with_body(BOX, workspace_box={"min": [1, 0, 0], "max": [0, 0, 0]})


def test_an_stl_file_beside_the_robot_is_a_body(tmp_path):
    stl = tmp_path / "platform.stl"
    faces = [(0, 1, 3), (0, 1, 5), (0, 3, 5), (1, 3, 5)]  # of a tetrahedron of the corners of a cube, [mm]
    corners = 510 * SIGNS + [0, 0, 510]
    lines = [f"vertex {x} {y} {z}" for face in faces for x, y, z in corners[list(face)]]
    stl.write_text("solid part\n" + "\n".join(lines) + "\nendsolid part\n")
    data = load("cogiro").model_dump(mode="json")
    data["platform"]["body"] = {"kind": "mesh", "file": "platform.stl", "scale": 0.001, "radius": 0.01}
    (tmp_path / "robot.yaml").write_text(json.dumps(data))
    robot = load(tmp_path / "robot.yaml")
    assert robot.platform.body.radius == 0.01
    stl.unlink()
    assert load(robot.save(tmp_path / "again.yaml")) == robot  # it has the corners itself
    ball = {"kind": "sphere", "name": "ball", "centre": [-0.255, -0.255, 2.765], "radius": 0.05, "cables": None}
    task = {"path": {"kind": "rest", "pose": [0, 0, 2, 0, 0, 0]}, "duration": 1, "limits": {"keep_out": [ball]}}
    Task.model_validate(task).save(tmp_path / "task.yaml")
    files = [tmp_path / name for name in ("again.yaml", "task.yaml")]
    printed = towline("plan", *files, "--json", "--out", tmp_path / "plan.nc", code=1)
    [found] = json.loads(printed.stdout)["audit"]["excess"]
    assert found["about"] == "platform's body outside ball"
    # The centre of the tetrahedron is a quarter of its height above its largest face, which is 1.02 m / sqrt(3) high.
    assert found["value"] == pytest.approx(-(1.02 / np.sqrt(3) / 4 + 0.05 + 0.01), abs=1e-6)
