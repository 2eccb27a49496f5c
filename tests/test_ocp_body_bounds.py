"""Lower bounds of distances of bodies from regions, with which few of the distances need to be evaluated."""

import numpy as np
import pytest

from towline.ocp.global_path.at_rest import AtRest
from towline.ocp.global_path.body_bounds import BodyBounds
from towline.ocp.planner import Planner

from .test_bodies import BARE, KINDS, between_hulls, placed, random_shape, with_body

POSES = 40
SOLID = ("box", "mesh")


def random_room(seed, body_kind, count=6):
    """Return a scenario with a body among regions, the corners and radius of each, and poses of the platform."""
    rng = np.random.default_rng(seed)
    body, corners, radius = random_shape(rng, 1.0, body_kind)
    regions = [random_shape(rng, 1.5, KINDS[k % len(KINDS)], rng.uniform(-2, 2, 3)) for k in range(count)]
    keep_out = [BARE | {"platform": 0.02 * k} | shape for k, (shape, *_) in enumerate(regions)]  # all have one name
    still = {"path": {"kind": "rest", "pose": [0] * 6}, "duration": 1, "limits": {"keep_out": keep_out}}
    still |= {"tube": {"position": "free", "attitude": "free"}}
    poses = np.hstack([rng.uniform(-2, 2, (POSES, 3)), rng.uniform(-1, 1, (POSES, 3))])
    return Planner(with_body(body), still).scenario, (corners, radius), [each[1:] for each in regions], poses


def apart(body, region, pose):
    """Return the distance of a body on a platform from a region [m]; 0 where their hulls meet."""
    hulls = between_hulls(placed(pose, body[0]), region[0])[0]
    return hulls - body[1] - region[1]


@pytest.mark.parametrize("body_kind", KINDS)
def test_no_bound_is_larger_than_the_distance(body_kind):
    scenario, body, regions, poses = random_room(3, body_kind)
    bounds = BodyBounds(scenario.limits.all)
    found = bounds(poses)
    solid = [k for k in range(len(regions)) if body_kind in SOLID or KINDS[k % len(KINDS)] in SOLID]
    assert found.shape == (POSES, len(solid))
    least = np.array([[apart(body, regions[k], pose) - 0.02 * k for k in solid] for pose in poses])
    far = least > 0
    assert far.sum() > POSES
    assert (found[far] <= least[far] + 1e-6).all()
    assert found[far].max() > 0.5 * least[far].max()  # it is of use


def test_the_bound_is_the_distance_where_a_face_is_nearest():
    body = {"kind": "box", "min": [-0.2, -0.3, -0.1], "max": [0.2, 0.3, 0.1]}
    wall = BARE | {"kind": "box", "min": [1, -5, -5], "max": [1.5, 5, 5], "platform": 0.05}
    still = {"path": {"kind": "rest", "pose": [0] * 6}, "duration": 1, "limits": {"keep_out": [wall]}}
    bounds = BodyBounds(Planner(with_body(body), still).scenario.limits.all)
    turned = np.array([[0.1, 2, 0, 0, 0, 0.7], [-0.4, 0, 1, 0, 0, -0.2]])
    reached = turned[:, 0] + 0.2 * np.cos(turned[:, 5]) + 0.3 * np.sin(np.abs(turned[:, 5]))
    np.testing.assert_allclose(bounds(turned)[:, 0], 1 - reached - 0.05, atol=1e-12)


@pytest.mark.parametrize("body_kind", ["box", "mesh", "capsule"])
def test_a_robot_at_rest_is_clear_where_all_distances_are_kept(body_kind):
    """The slack is at most the least distance, and of the same sign; it is the distance itself where that is small."""
    scenario, body, regions, poses = random_room(11, body_kind)
    points = [limit for limit in scenario.limits if limit.labels[0] == "platform"]
    kept = AtRest(scenario, 100.0, balance=False)(poses, np.zeros((POSES, len(scenario.robot.carriers), 6)))
    values = dict(zip(scenario.limits, scenario.limits.at_rest(poses, np.zeros((POSES, 1, 6))), strict=True))
    of_points = np.min([(values[limit] - limit.low).min(axis=1) for limit in points], axis=0) if points else np.inf
    of_bodies = np.array([min(apart(body, its, pose) - 0.02 * k for k, its in enumerate(regions)) for pose in poses])
    least = np.minimum(of_points, of_bodies)
    outside = least > 1e-6
    assert 2 < outside.sum() < POSES
    np.testing.assert_array_equal(kept.slack[outside] > 0, True)
    assert (kept.slack[~outside] <= 1e-6).all()
    assert (kept.slack[outside] <= least[outside] + 1e-6).all()
    size = np.ptp(body[0], axis=0).max()
    near = outside & (least < 0.03 * size)
    np.testing.assert_allclose(kept.slack[near], least[near], atol=1e-6)
