"""A quadrotor has a size, the same for planning and for all pictures of it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Robot, load, plan
from towline.models.parsing import parse_yaml, to_yaml
from towline.statics.scene import rotor_discs, scene
from towline.viewer.geometry import rotors

QUAD = {
    "kind": "quadrotor",
    "mass": 1.2,
    "inertia": [0.01, 0.01, 0.02, 0, 0, 0],
    "thrust_max": 40,
    "torque_max": [2, 2, 0.5],
}
USUAL = 0.3 * np.sqrt(1.2)  # [m]
BEAM_HALF = 1.0  # [m]


def pair(anchor=(0, 0, 0), **quad):
    """A point mass under two quadrotors that fly 2 m apart."""
    end = {"attachment": [0, 0, 0], "t_min": 0.5, "t_max": 60}
    return Robot.model_validate(
        {
            "name": "pair",
            "source": "test",
            "platform": {"mass": 1, "dof": ["x", "y", "z"], "home": [0, 0, 0.5, 0, 0, 0]},
            "carriers": [
                {"name": "left", "home": [0, -BEAM_HALF, 2.5, 0, 0, 0], **QUAD, **quad},
                {"name": "right", "home": [0, BEAM_HALF, 2.5, 0, 0, 0], **QUAD},
            ],
            "cables": [
                {"carrier": "left", "anchor": list(anchor), **end},
                {"carrier": "right", "anchor": [0, 0, 0], **end},
            ],
        }
    )


def past(distance, **place):
    """A flight along x, past a post beside the left quadrotor: `distance` is that of its axis from the quadrotor."""
    y = -BEAM_HALF - distance
    post = {"kind": "capsule", "name": "post", "start": [1, y, 0], "end": [1, y, 5], "radius": 0.1, **place}
    around = {
        name: {"kind": "line", "start": [0, at, 2.5], "end": [2, at, 2.5]}
        for name, at in (("left", -BEAM_HALF), ("right", BEAM_HALF))
    }
    return {
        "path": {"kind": "line", "start": [0, 0, 0.5], "end": [2, 0, 0.5]},
        "duration": 4,
        "steps": 16,
        "tube": {"position": 0.3},
        "base": {"kind": "free", "ends": "rest", "around": around},
        "objective": {"carrier_offset": 0.5},
        "limits": {"keep_out": [post], "carrier_separation": "radius"},
    }


def nearest(found, y):
    """The distance of the nearest quadrotor's CoM from the surface of the post."""
    quads = found.audit.carriers.pose[..., :2]
    return np.linalg.norm(quads - [1, y], axis=-1).min() - 0.1


def apart(found):
    left, right = np.moveaxis(found.audit.carriers.pose[..., :3], 1, 0)
    return np.linalg.norm(left - right, axis=1).min()


@pytest.mark.parametrize(
    ("robot", "radii"),
    [
        (pair(), [USUAL, USUAL]),
        (pair(radius=0.2), [0.2, USUAL]),
        (pair(anchor=(0.3, 0.4, -2)), [0.5, USUAL]),
        (pair(anchor=(0.3, 0.4, 0), radius=0.1), [0.1, USUAL]),
        (load("multi-quadrotor-3"), [0.3 * np.sqrt(1.5)] * 3),
        (load("wang-flying-quadrotor"), [0.52]),
        (load("wang-flying"), [0]),
        (load("wang-ctmrts"), [0, 0, 0]),
        (load("cogiro"), [0]),
    ],
)
def test_the_radius_is_that_of_the_file_or_fits_mass_and_anchors(robot, radii):
    np.testing.assert_allclose(robot.carrier_radius, radii, rtol=1e-12)
    assert parse_yaml(to_yaml(robot), Robot, "again") == robot


def test_robots_of_the_library_do_not_touch_each_other_at_home():
    for name in ("flycrane", "multi-quadrotor-3", "multi-quadrotor-4", "multi-quadrotor-6"):
        robot = load(name)
        at, radii = robot.carrier_home[:, :3], robot.carrier_radius
        apart = np.linalg.norm(at[:, None] - at, axis=2) - radii[:, None] - radii
        assert apart[~np.eye(len(at), dtype=bool)].min() > 0, name


def test_rotors_keep_out_of_a_place_that_states_no_distance():
    """The post is 0.3 m from the straight flight of the CoM: the rotors would hit it."""
    robot, y = pair(), -BEAM_HALF - 0.3
    task = past(0.3, platform=None, cables=None)
    found = plan(robot, task)
    assert found.feasible, found.report()
    assert nearest(found, y) >= USUAL - 1e-5
    assert apart(found) >= 2 * USUAL - 1e-5
    assert not found.warnings
    small = plan(pair(radius=0.1), task)
    assert small.feasible
    assert 0.1 - 1e-5 <= nearest(small, y) < USUAL


def test_a_stated_distance_is_kept_as_it_was_and_warned_of():
    robot, y = pair(), -BEAM_HALF - 0.3
    found = plan(robot, past(0.3, carriers=0.05, platform=None, cables=None))
    assert found.feasible
    least = nearest(found, y)
    assert 0.05 - 1e-5 <= least < USUAL
    (sentence,) = found.warnings
    assert sentence.startswith(f"the centre of left comes within {least:.3g} m of 'post' at t = ")
    assert f"inside the radius of its body, {USUAL:.3g} m" in sentence
    assert sentence in found.report()
    wide = plan(robot, past(0.3, carriers=USUAL + 0.1, platform=None, cables=None))
    assert nearest(wide, y) >= USUAL + 0.1 - 1e-5
    assert not wide.warnings
    assert not plan(robot, past(0.3, carriers=None, platform=None, cables=None)).warnings


def test_quadrotors_are_kept_apart_by_both_radii_if_the_task_says_so():
    robot = pair(radius=1.75)  # at home the two are 2 m apart
    task = past(2.0) | {"base": {"kind": "free", "ends": "rest"}, "objective": {}}
    del task["limits"]["keep_out"]
    assert apart(plan(robot, task)) >= 1.75 + USUAL - 1e-5
    del task["limits"]["carrier_separation"]
    (sentence,) = plan(robot, task).warnings
    assert "limits.carrier_separation: radius keeps them apart" in sentence


def test_quadrotors_that_meet_are_warned_of():
    """The two together are as wide as their distance, and 1 cm more or less."""
    task = {"path": {"kind": "rest", "pose": [0, 0, 0.5]}, "duration": 1, "base": {"kind": "hold"}}
    robot = pair(radius=2 * BEAM_HALF - USUAL + 0.01)
    (sentence,) = plan(robot, task).warnings
    assert (
        "the centres of left and right are 2 m apart at t = 0.000 s, less than the sum of the radii of their bodies"
        in sentence
    )
    assert not plan(pair(radius=2 * BEAM_HALF - USUAL - 0.01), task).warnings


def test_pictures_draw_that_radius():
    radius = 0.37
    points = np.vstack(rotors(radius)[2:])
    assert np.linalg.norm(points, axis=1).max() == pytest.approx(radius, rel=1e-12)
    robot = load("multi-quadrotor-4")
    carriers = robot.carrier_home[None] + np.random.default_rng(1).normal(size=(3, 4, 6)) * 0.3
    discs = rotor_discs(robot, carriers)
    arms = discs - carriers[:, :, None, :3]
    np.testing.assert_allclose(np.linalg.norm(arms, axis=-1), robot.carrier_radius[0], rtol=1e-12)
    up = Rotation.from_euler("ZYX", carriers[..., 5:2:-1].reshape(-1, 3)).as_matrix()[:, :, 2].reshape(3, 4, 3)
    np.testing.assert_allclose(np.einsum("kcpi,kci->kcp", arms, up), 0, atol=1e-12)
    task = {"path": {"kind": "rest", "pose": [0, 0, 0]}, "duration": 1, "base": {"kind": "hold"}}
    drawn = scene(robot, plan(robot, task).trajectory, np.array([0.0, 1.0])).rotors
    np.testing.assert_allclose(drawn, rotor_discs(robot, robot.carrier_home[None]).repeat(2, axis=0), atol=1e-9)
    assert rotor_discs(load("cogiro"), load("cogiro").carrier_home[None]).size == 0
