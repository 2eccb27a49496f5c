"""Designs that keep cables away from bodies and the floor, and stiff: judged from the found robot's file alone."""

from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest

from towline import Dynamics, InputError, Robot, TensionProblem, design, load, read_requirements, simulate, tensions
from towline.control import LengthControl
from towline.layout import run, search
from towline.layout.evaluation import Evaluation, rows_of
from towline.layout.room import room_of
from towline.layout.variables import variables_of
from towline.models.points import rotations
from towline.solvers import capacity_margin

from .stiff_robots import elastic, frequencies

ROOT = Path(__file__).parent.parent
BOX = {"min": [-1.5, -1.0, 2.0], "max": [1.5, 1.0, 3.0]}
BODY = {"kind": "box", "min": [-0.5, -0.1, 0.3], "max": [0.5, 0.1, 0.7]}
LAMP = {"kind": "sphere", "name": "lamp", "centre": [3.2, -2.7, 4.2], "radius": 0.2, "cables": 0.1}
SHELF = {"kind": "box", "name": "shelf", "min": [2.0, -3, 0], "max": [3, 3, 1.8]}
BEAM = {"kind": "capsule", "name": "beam", "start": [-4, 2, 3], "end": [-4, -2, 3], "radius": 0.2, "cables": 0.05}


def with_body(robot):
    data = robot.model_dump(mode="json")
    return Robot.model_validate({**data, "platform": {**data["platform"], "body": BODY}, "floor": 0.5})


@pytest.fixture(scope="module", autouse=True)
def _one_start():
    """From the robot's own layout, and audits until they agree: the result does not depend on the machine's speed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "_SEARCHING", 0.0)
        patch.setattr(search, "AUDITED", 10_000)
        for module in (search, run):
            patch.setattr(module, "ROOM_AUDITED", 2_000)
        yield


def around(own):
    return {"min": own.min(axis=0).tolist(), "max": own.max(axis=0).tolist()}


def wanted(robot, **changes):
    near = {"min": [-0.9, -0.3, 0.1], "max": [0.9, 0.3, 0.9]}
    free = [{"part": "anchor", "box": around(robot.anchors)}, {"part": "attachment", "box": near}]
    return {"free": free, "require": [{"box": BOX, "grid": [3, 3, 2]}], **changes}


def cable_points(robot, poses):
    """Return points along the cables in {G} and in the platform's frame, (poses, cables, points, 3), by sums alone."""
    R = rotations(poses[:, 3:])
    ends = poses[:, None, :3] + np.einsum("nij,kj->nki", R, robot.attachments)
    share = np.linspace(0, 1, 300)[:, None]
    points = ends[:, :, None] + share * (robot.anchors[:, None] - ends[:, :, None])
    return points, np.einsum("nji,nkpj->nkpi", R, points - poses[:, None, None, :3])


def from_box(points, low, high):
    return np.linalg.norm(points - np.clip(points, low, high), axis=-1).min()


def from_ball(points, centres, radius):
    return min(np.linalg.norm(points - centre, axis=-1).min() for centre in centres) - radius


def sampled(count, seed):
    poses = np.zeros((count, 6))
    poses[:, :3] = np.random.default_rng(seed).uniform(BOX["min"], BOX["max"], (count, 3))
    poses[:8, :3] = list(product(*np.transpose([BOX["min"], BOX["max"]])))
    return poses


def test_cables_keep_away_from_bodies_and_the_floor(tmp_path):
    """The published layout does not: points along its cables are inside. Those of the found one keep every distance."""
    before = with_body(load("ipanema-2"))
    asked = {"cable_platform_clearance": 0.12, "cable_floor_clearance": 0.7, "keep_out": [LAMP, SHELF, BEAM]}
    asked["free"] = [{"part": "anchor", "box": around(before.anchors)}]
    found = design(before, **wanted(before) | asked, time_limit=60.0)
    assert found.feasible, found.report()
    robot, poses = load(found.robot.save(tmp_path / "robot.yaml")), sampled(60, 7)
    beam = np.linspace(BEAM["start"], BEAM["end"], 400)

    def distances(robot):
        world, riding = cable_points(robot, poses)
        return {
            "the platform": from_box(riding, BODY["min"], BODY["max"]) - 0.12,
            "lamp": from_ball(world, [LAMP["centre"]], 0.2) - 0.1,
            "shelf": from_box(world, SHELF["min"], SHELF["max"]) - 1e-9,
            "beam": from_ball(world[:, :, ::4], beam[::8], 0.2) - 0.05,
            "floor": world[..., 2].min() - 1.2,
        }

    assert min(distances(robot).values()) >= -1e-9
    assert {name for name, space in distances(before).items() if space < 0} >= {"lamp", "shelf", "floor"}
    for name, least in {"the platform": 0.12, "lamp": 0.1, "shelf": 0.0, "beam": 0.05}.items():
        said, space = dict(found.judgement.distances)[name], distances(robot)[name]
        assert least <= said <= space + least + 2e-3, (name, said, space)
        assert name in found.report().splitlines()[0]
    assert found.to_dict()["cable_height"] == pytest.approx(robot.anchors[:, 2].min(), abs=1e-9)
    steep = design(before, **wanted(before) | asked | {"keep_out": [{**SHELF, "cables": 3.0}]}, time_limit=0.01)
    assert steep.status == "not-found"
    assert "distance of 3 m between cables and shelf" in steep.report()
    assert not steep.reasons.local_optimum


def test_cables_of_different_carriers_are_apart_whatever_their_anchors_are():
    """Each drone's cables start at the origin of its own frame: the distances between drones count all the same."""
    robot = load(ROOT / "examples" / "design" / "beam-drones.yaml")
    box = {"min": robot.attachments.min(axis=0).tolist(), "max": robot.attachments.max(axis=0).tolist()}
    found = design(robot, [{"part": "attachment", "box": box}], [{"poses": [robot.home.tolist()]}], time_limit=0.2)
    t, between = np.linspace(0.0, 1.0, 201)[:, None], {}
    starts, ends = (points[0] for points in Dynamics(found.robot).points(robot.home[None]))
    for i, j in combinations(range(robot.m), 2):
        if robot.carrier_of_cable[i] != robot.carrier_of_cable[j]:
            one, other = (starts[k] + t * (ends[k] - starts[k]) for k in (i, j))
            between[i, j] = np.linalg.norm(one[:, None] - other, axis=2).min()
    pair, pose = found.judgement.closest
    assert found.clearance == pytest.approx(min(between.values()), abs=0.03)
    assert between[pair] == pytest.approx(found.clearance, abs=0.03)
    assert pose == pytest.approx(robot.home)
    assert found.clearance == pytest.approx(found.judgement.clearance, abs=1e-9)


def test_slopes_of_the_room_are_those_of_differences():
    robot = with_body(elastic("ipanema-2", 1e4, t_min=5.0))
    tilted = [{"box": BOX, "grid": [2, 2, 1], "attitudes": [[0.1, -0.2, 0.3]]}]
    places = [{**LAMP, "cables": 3.0}, {**BEAM, "cables": 3.0}]
    asked = {"cable_platform_clearance": 1.0, "cable_floor_clearance": 3.0, "keep_out": places}
    read = read_requirements(wanted(robot, **asked, natural_frequency=20.0) | {"require": tilted})
    assert read_requirements(read.model_dump()) == read  # as the command does for --seconds
    variables = variables_of(robot, read)
    rows = rows_of(robot, read.require, [each.places() for each in read.require])
    y, step = variables.of_robot(), 1e-6
    y += 0.01 * np.random.default_rng(4).normal(size=y.size) * (variables.high - variables.low)
    room = room_of(robot, read)
    nothing = room._replace(regions=(), lowest=-np.inf, frequency=0.0)
    for one in ({"regions": room.regions[:1]}, {"regions": room.regions[1:2]}, {"regions": room.regions[2:]},
                {"lowest": room.lowest}, {"frequency": room.frequency}):  # fmt: skip
        evaluation = Evaluation(variables, rows, nothing._replace(**one))
        found = evaluation.space_slopes(y, 1, np.inf)
        smallest = found.value.argmin()
        assert found.value[smallest] < 0
        assert evaluation.missing(y) == pytest.approx(-found.value[smallest], abs=1e-9)
        steps = step * np.eye(y.size)
        expected = np.array([evaluation.missing(y - e) - evaluation.missing(y + e) for e in steps]) / (2 * step)
        np.testing.assert_allclose(found.by_variables[smallest], expected, atol=2e-5 * np.abs(expected).max())


def lowest_frequency(robot, pose):
    return frequencies(robot, pose, tensions(robot, pose).tensions)[0]


@pytest.fixture(scope="module")
def stiff():
    robot = elastic("ipanema-2", 3e3, t_min=20.0)
    box = {"min": [-1.0, -0.8, 2.0], "max": [1.0, 0.8, 2.8]}
    free = [{"part": "anchor", "box": around(robot.anchors)}]
    given = {"free": free, "require": [{"box": box, "grid": [3, 3, 2]}]}
    return robot, given, design(robot, **given, maximise="natural_frequency", margin=5.0, time_limit=60.0)


def test_the_stiffest_layout_has_its_frequency_by_differences_of_forces(stiff):
    """Also at corners and random poses of the box; the layout with the largest margin is less stiff."""
    robot, given, found = stiff
    assert found.feasible, found.report()
    assert found.margin >= 5.0
    said, before = found.judgement.frequency, found.judgement_before.frequency
    assert said > 1.05 * before
    assert found.report().startswith("ipanema-2, design: FEASIBLE, lowest natural frequency")
    poses = np.zeros((16, 6))
    poses[:, :3] = np.random.default_rng(3).uniform([-1, -0.8, 2], [1, 0.8, 2.8], (16, 3))
    poses[:8, :3] = list(product([-1, 1], [-0.8, 0.8], [2, 2.8]))
    assert min(lowest_frequency(found.robot, pose) for pose in poses) == pytest.approx(said, rel=0.01)
    assert min(lowest_frequency(robot, pose) for pose in poses) == pytest.approx(before, rel=0.01)
    enough = design(robot, **given, natural_frequency=0.95 * said, time_limit=60.0)
    assert enough.feasible
    assert enough.margin > found.margin
    assert 0.95 * said <= enough.judgement.frequency < said
    too_much = design(robot, **given, natural_frequency=3 * said, time_limit=0.01)
    assert too_much.status == "not-found"
    assert "natural frequency of" in too_much.report()


def test_a_pushed_platform_swings_at_the_frequency_of_the_design(stiff):
    """The lowest peak of the spectrum at the pose where it is least."""
    _, given, found = stiff
    robot, (low, high) = found.robot, given["require"][0]["box"].values()
    poses = np.array([(*corner, 0, 0, 0) for corner in product(*zip(low, high, strict=True))])
    pose = min(poses, key=lambda pose: lowest_frequency(robot, pose))
    pilot = LengthControl(robot, proportional=0, integral=0)
    push = "push 6 -4 5 0.9 1.2 -0.8 at 0 for 0.02"
    run = simulate(robot, pose, controller=pilot, duration=10.0, events=[push], period=4e-3)
    motion = run.trajectory["pose"].values[10:]
    count = 8 * len(motion)
    spectrum = np.abs(np.fft.rfft((motion - motion.mean(0)) * np.hanning(len(motion))[:, None], count, axis=0))
    spectrum /= spectrum.max(axis=0)
    inner = spectrum[1:-1]
    peaks = ((inner > spectrum[:-2]) & (inner > spectrum[2:]) & (inner > 0.2)).any(axis=1)
    assert np.fft.rfftfreq(count, 4e-3)[1:-1][peaks].min() == pytest.approx(lowest_frequency(robot, pose), rel=0.01)


def test_the_stiffest_pretension_is_that_of_a_scan():
    """Of one free number, the least tension of all cables, as far as the margin permits."""
    robot = elastic("ipanema-2", 3e3, t_min=5.0)
    pose = robot.home
    free = [{"part": "t_min", "range": {"min": 5, "max": 100}, "equal": True}]
    found = design(robot, free, [{"poses": [pose.tolist()]}], "natural_frequency", margin=30.0, time_limit=60.0)
    assert found.feasible
    A, w = Dynamics(robot).wrench_matrix(pose), Dynamics(robot).required_wrench(pose, np.zeros(6), np.zeros(6))
    best = 0.0
    for t_min in range(5, 101):
        if capacity_margin(TensionProblem(A, w, t_min, robot.t_max, length=robot.length)).value < 30.0:
            break
        data = robot.model_dump(mode="json")
        other = Robot.model_validate({**data, "cables": [{**c, "t_min": t_min} for c in data["cables"]]})
        best = max(best, lowest_frequency(other, pose))
    assert 1.04 * lowest_frequency(robot, pose) < best
    assert found.judgement.frequency == pytest.approx(best, rel=1e-3)


def test_slack_cables_have_no_frequency():
    robot = elastic("ipanema-2", 1e4, t_min=1.0)
    slack = [{"part": "t_min", "cables": [3], "range": {"min": 0, "max": 5}}]
    with pytest.raises(InputError, match="t_min of cable 3 must be above 0 N for natural_frequency"):
        design(robot, slack, [{"poses": [robot.home.tolist()]}], "natural_frequency")
