"""Order of cables and heading by lengths and an AHRS, without positions: a correction is right, or none is offered."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.estimation.calibration import Measurements, mistake
from towline.estimation.calibration.attitude_orders import likely_order
from towline.models import Dynamics, load, points

from .robots_as_built import moved_anchors

SIGMA = {"lengths": 1e-3, "rotation": np.radians(0.5)}
REFLECTION = np.diag([1, -1.0, 1])


def a_log(folder, m, seed, count=28, irregular=1.0):
    """An irregular robot in a cuboid, the true orientations at random poses, readings there, and measured ones."""
    draw = np.random.default_rng(seed)
    size = draw.uniform(1, 10)
    corners = size * np.array([[1, 0.8, 0], [-1, 0.8, 0], [-1, -0.8, 0], [1, -0.8, 0]])
    upper, lower = [0, 0, 1.2 * size], [0, 0, -0.8 * size]
    anchors = np.vstack([corners + upper, corners + lower])[:m] + irregular * draw.normal(0, 0.04 * size, (m, 3))
    ends = np.vstack([0.13 * corners - [0, 0, 0.1 * size], 0.13 * corners + [0, 0, 0.1 * size]])[:m]
    ends = ends + irregular * draw.normal(0, 0.012 * size, (m, 3))
    cables = "\n".join(
        f"  - {{carrier: frame, anchor: {a}, attachment: {b}, t_min: 1, t_max: 2000}}"
        for a, b in zip(anchors.tolist(), ends.tolist(), strict=True)
    )
    platform = f"{{mass: 8, inertia: [0.3, 0.4, 0.5, 0, 0, 0], home: [0, 0, {0.1 * size}, 0, 0, 0]}}"
    file = folder / f"robot-{m}-{seed}.yaml"
    carriers = "[{name: frame, kind: ground}]"
    file.write_text(
        f"name: robot\nsource: made up\nplatform: {platform}\ncarriers: {carriers}\ncables:\n{cables}\n",
        encoding="utf-8",
    )
    robot = load(file)
    poses = robot.home + draw.uniform(-1, 1, (count, 6)) * [*0.3 * size * np.array([1, 0.8, 1]), 0.25, 0.25, 0.25]
    y = Dynamics(moved_anchors(robot, draw, 0.003 * size)).cable_lengths(poses)
    y = y + draw.normal(0, 0.01 * size, m) + draw.normal(0, 1e-3, y.shape)
    true = Rotation.from_euler("xyz", poses[:, 3:])
    return robot, true, y, Rotation.from_rotvec(draw.normal(0, SIGMA["rotation"], (count, 3))) * true, draw


def measured(y, rotation):
    angles = points.angles(rotation.as_matrix())
    return Measurements(y, np.hstack([np.full((len(y), 3), np.nan), angles]), sigma=SIGMA)


def test_an_order_of_four_cables_is_sure_only_if_it_is_right(tmp_path):
    """Four cables leave one equation a sample: robots that are nearly symmetric do not show their order."""
    named = 0
    for seed in range(10):
        robot, _, y, rotation, draw = a_log(tmp_path, 4, seed)
        columns = np.roll(np.arange(4), draw.integers(1, 4))
        for heading in (0.0, draw.uniform(0.3, 3)):
            turned = (Rotation.from_euler("z", heading) * rotation).as_matrix()
            likely = likely_order(robot, y[:, columns], turned, (1e-3, SIGMA["rotation"]))
            accepted = np.argsort(columns).tolist(), list(range(4))
            assert not likely.sure or likely.columns.tolist() in accepted
            named += bool((likely.columns != np.arange(4)).any())
    assert named >= 5  # robots that are irregular enough to show that the given order is wrong


def test_the_order_of_a_symmetric_robot_is_never_sure(tmp_path):
    """Half a revolution of the order is half a revolution of the heading."""
    named = 0
    for seed in range(6):
        robot, _, y, rotation, _ = a_log(tmp_path, 4, seed, irregular=0.0)
        likely = likely_order(robot, y[:, [1, 0, 2, 3]], rotation.as_matrix(), (1e-3, SIGMA["rotation"]))
        if likely.columns.tolist() != [0, 1, 2, 3]:
            assert not likely.sure
            named += 1
    assert named >= 2


@pytest.mark.parametrize("m", [6, 8])
def test_the_order_of_more_cables_is_found_in_any_heading_and_in_left_handed_axes(m, tmp_path):
    robot, _, y, rotation, draw = a_log(tmp_path, m, 0)
    columns, heading = draw.permutation(m), draw.uniform(0.3, 3)
    R = (Rotation.from_euler("z", heading) * rotation).as_matrix()
    noise = 1e-3, SIGMA["rotation"]
    likely = likely_order(robot, y[:, columns], R, noise)
    np.testing.assert_array_equal(likely.columns, np.argsort(columns))
    assert likely.sure
    assert abs(likely.heading + heading) < np.radians(4)
    likely = likely_order(robot, y[:, columns], REFLECTION @ R @ REFLECTION, noise)
    np.testing.assert_array_equal(likely.columns, np.argsort(columns))
    assert likely.sure
    assert likely_order(robot, y, REFLECTION @ R @ REFLECTION, noise).columns.tolist() == list(range(m))


@pytest.mark.parametrize("m", [6, 8])
def test_a_heading_alone_is_corrected_and_none_is_seen_in_sound_logs(m, tmp_path):
    for seed in range(4):
        robot, true, y, rotation, draw = a_log(tmp_path, m, seed)
        assert mistake(robot, measured(y, rotation)) is None
        turn = Rotation.from_euler("z", draw.choice([-1, 1]) * draw.uniform(0.3, 3))
        found = mistake(robot, measured(y, turn * rotation))
        assert found.text.startswith("the world of the orientations looks turned by")
        left = Rotation.from_euler("xyz", found.corrected.poses[:, 3:]) * true.inv()
        assert np.degrees(left.mean().magnitude()) < 4  # displaced anchors look turned, too
        np.testing.assert_array_equal(found.corrected.lengths, y)
