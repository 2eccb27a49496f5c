"""Designs that keep cables away from bodies and the floor: judged from the found robot's file alone."""

from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest

from towline import Dynamics, Robot, design, load, read_requirements
from towline.layout import run, search
from towline.layout.evaluation import Evaluation, rows_of
from towline.layout.room import room_of
from towline.layout.variables import variables_of
from towline.models.points import rotations

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
        patch.setattr(search, "AUDITED", 20_000)
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
    steep = design(before, **wanted(before) | asked | {"keep_out": [{**SHELF, "cables": 3.0}]}, time_limit=0.1)
    assert steep.status == "not-found"
    assert "distance of 3 m between cables and shelf" in steep.report()


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
    robot = with_body(load("ipanema-2"))
    tilted = [{"box": BOX, "grid": [2, 2, 1], "attitudes": [[0.1, -0.2, 0.3]]}]
    places = [{**LAMP, "cables": 3.0}, {**BEAM, "cables": 3.0}]
    asked = {"cable_platform_clearance": 1.0, "cable_floor_clearance": 3.0, "keep_out": places}
    read = read_requirements(wanted(robot, **asked) | {"require": tilted})
    assert read_requirements(read.model_dump()) == read  # as the command does for --seconds
    variables = variables_of(robot, read)
    rows = rows_of(robot, read.require, [each.places() for each in read.require])
    y, step = variables.of_robot(), 1e-6
    y += 0.01 * np.random.default_rng(4).normal(size=y.size) * (variables.high - variables.low)
    room = room_of(robot, read)
    nothing = room._replace(regions=(), lowest=-np.inf)
    for one in ({"regions": room.regions[:1]}, {"regions": room.regions[1:2]}, {"regions": room.regions[2:]},
                {"lowest": room.lowest}):  # fmt: skip
        evaluation = Evaluation(variables, rows, nothing._replace(**one))
        found = evaluation.space_slopes(y, 1, np.inf)
        smallest = found.value.argmin()
        assert found.value[smallest] < 0
        assert evaluation.missing(y) == pytest.approx(-found.value[smallest], abs=1e-9)
        steps = step * np.eye(y.size)
        expected = np.array([evaluation.missing(y - e) - evaluation.missing(y + e) for e in steps]) / (2 * step)
        np.testing.assert_allclose(found.by_variables[smallest], expected, atol=2e-5 * np.abs(expected).max())
