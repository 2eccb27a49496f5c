"""Past obstacles without a guess from the user: a team of quadrotors takes its load through a slot and back."""

import time
from dataclasses import replace

import numpy as np

from towline.models import load
from towline.ocp import plan
from towline.ocp.nlp.guess import clear_formation, initial_guess
from towline.ocp.result import Offers
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import Task

HALF_SLOT, HALF_WALL = 0.5, 0.2  # [m]
APART = 0.6  # [m]
KEPT = {"platform": 0.05, "carriers": 0.1, "cables": 0.05}  # [m] from the walls


def walls():
    box = {"kind": "box", **KEPT}
    return [
        {**box, "name": "left wall", "min": [-HALF_WALL, HALF_SLOT, -3], "max": [HALF_WALL, 6, 6]},
        {**box, "name": "right wall", "min": [-HALF_WALL, -6, -3], "max": [HALF_WALL, -HALF_SLOT, 6]},
    ]


def there_and_back(**changes):
    task = {
        "path": {"kind": "waypoints", "shape": "spline", "points": [[-3, 0, 0], [3, 0, 0], [-3, 0, 0]]},
        "duration": 16,
        "steps": 32,
        "tube": {"position": "free", "attitude": "free", "ends": "exact", "waypoints": "exact"},
        "base": {"kind": "free", "ends": "rest"},
        "objective": {"deviation": 1.0},
        "limits": {"keep_out": walls(), "carrier_separation": APART},
    }
    return task | changes


def from_walls(points):
    """Euclidean distance of points (..., 3) from the nearer wall, zero inside."""
    found = []
    for wall in walls():
        low, high = np.array(wall["min"]), np.array(wall["max"])
        found.append(np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=-1))
    return np.minimum(*found)


def bodies(robot, pose, carriers):
    """CoM and attachments (n, 1 + m, 3), and points along each cable (n, m, 21, 3): by scipy's rotations."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("ZYX", pose[:, 5:2:-1]).as_matrix()
    attachments = pose[:, None, :3] + np.einsum("nij,mj->nmi", turn, robot.attachments)
    anchors = carriers[:, robot.carrier_of_cable, :3]  # cables run to the quadrotors' CoM
    share = np.linspace(0, 1, 21)[:, None]
    cables = attachments[:, :, None] + share * (anchors - attachments)[:, :, None]
    return np.concatenate([pose[:, None, :3], attachments], axis=1), cables


def test_the_formation_draws_together_and_keeps_clear():
    robot = load("multi-quadrotor-4")
    scenario = lay_out(robot, Task.model_validate(there_and_back()))
    formation = clear_formation(scenario)
    assert formation is not None
    times = np.linspace(0, 16, 801)
    pose, carriers = formation.motion(times)
    platform, cables = bodies(robot, pose, carriers)
    off = 0.01  # [m]: it is a guess
    assert from_walls(platform).min() >= KEPT["platform"] - off
    assert from_walls(cables).min() >= KEPT["cables"] - off
    assert from_walls(carriers[..., :3]).min() >= KEPT["carriers"] - off
    apart = np.linalg.norm(carriers[:, :, None, :3] - carriers[:, None, :, :3], axis=-1) + 9 * np.eye(4)
    assert apart.min() >= APART - off
    inside = np.abs(pose[:, 0]) < HALF_WALL
    assert inside.sum() > 20  # it does go through


def test_nothing_in_the_way_leaves_the_formation_as_it_is():
    robot = load("multi-quadrotor-4")
    far = [{"kind": "sphere", "centre": [0, 0, 30], "radius": 1.0}]
    for limits in ({}, {"keep_out": far}):
        assert clear_formation(lay_out(robot, Task.model_validate(there_and_back(limits=limits)))) is None
    held = there_and_back(tube={}, base={"kind": "hold"})
    assert clear_formation(lay_out(robot, Task.model_validate(held))) is None


def test_quadrotors_are_guessed_to_tilt_as_their_cables_pull():
    """At rest at home: the attitudes of the library file, in which thrust carries weight and cables."""
    robot = load("multi-quadrotor-4")
    task = {"path": {"kind": "rest", "pose": [0, 0, 0]}, "duration": 1, "base": {"kind": "free"}}
    level = robot.model_dump(mode="json")
    for carrier in level["carriers"]:
        carrier["home"][3:] = [0.0, 0.0, 0.0]
    scenario = lay_out(type(robot).model_validate(level), Task.model_validate(task))
    guess = initial_guess(scenario, np.linspace(0, 1, 5))
    _, carriers = scenario.motion(guess.nodes, guess)
    np.testing.assert_allclose(carriers.pose[:, :, 3:], robot.carrier_home[None, :, 3:].repeat(5, axis=0), atol=1e-6)


def test_short_motions_of_a_team_are_found():
    """With nothing in the way: the programs of teams are factorised in a way of their own, which must not fail here."""
    path = {"kind": "line", "start": [0, 0, 0], "end": [0.1, 0, 0]}
    found = plan(
        load("multi-quadrotor-3"), {"path": path, "duration": 2, "base": {"kind": "free", "ends": "rest"}, "steps": 16}
    )
    assert found.feasible, found.message


def test_a_time_limit_ends_a_search():
    """Beyond its limit it takes what laying out, building and the step under way take: what one without time does."""
    robot, took = load("multi-quadrotor-3"), []
    for limit in (0.01, 0.5):
        before = time.process_time()  # not the time on a clock, most of which other programs may have
        found = plan(robot, there_and_back(steps=16, time_limit=limit))
        took.append(time.process_time() - before)
        assert found.status == "not-found"
        assert found.message == "time limit"
        assert found.reason.startswith("the time limit of")
        assert found.audit.excess or found.audit.violation.max() > found.audit.tolerance  # of the best attempt
    assert took[1] < 0.5 + 2 * took[0]
    assert found.reason in replace(found, offers=Offers).report()  # what is offered takes three times as long
