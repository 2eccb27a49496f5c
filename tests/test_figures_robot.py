"""The picture of a robot: its platform is the convex hull of its attachments, whatever its shape."""

from collections import Counter

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.text import Text

from towline import Robot, available, load
from towline.figures import robot as figure, style
from towline.figures.scene import faces, outline
from towline.figures.views import ABOVE, FRONT, SIDE, views_of
from towline.statics.scene import scene_at


def drawn_faces(robot):
    """Draw a robot, and return the corners (c, 3) of each face of the platform."""
    found = [robot.home_attachments[face] for face in faces(robot.home_attachments)]
    ax = figure.draw(scene_at(robot, robot.home, None, robot.name)).axes[0]
    blue = [patch for patch in ax.patches if to_hex(patch.get_facecolor()).upper() == style.colour(4)]
    assert sorted(len(patch.get_xy()) - 1 for patch in blue) == sorted(map(len, found))
    return found


@pytest.mark.parametrize("name", available())
def test_the_drawn_platform_is_a_convex_body_that_holds_all_attachments(name):
    robot = load(name)
    points, size = robot.home_attachments, robot.length
    rank = np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-6 * size)
    drawn = drawn_faces(robot)
    assert len(drawn) == {0: 0, 1: 0, 2: 1}.get(rank, len(drawn))
    for face in drawn:
        arms = face - face.mean(axis=0)
        _, thickness, axes = np.linalg.svd(arms)
        assert len(face) < 4 or thickness[2] < 1e-6 * size, "a face is not flat"
        # Around a convex face all turns go the same way.
        edges = np.roll(face, -1, axis=0) - face
        turns = np.cross(edges, np.roll(edges, -1, axis=0)) @ axes[2]
        assert (turns > -1e-9).all() or (turns < 1e-9).all(), "a face has a notch"
        if rank == 3:
            beyond = (points - face[0]) @ axes[2]
            assert min(beyond.max(), -beyond.min()) < 1e-6 * size, "attachments lie on both sides of a face"


@pytest.mark.parametrize("name", ["the-cable-robot-simulator", "cogiro"])
def test_the_faces_close_the_body(name):
    corners = Counter()
    for face in drawn_faces(load(name)):
        for start, end in zip(face, np.roll(face, -1, axis=0), strict=True):
            corners[frozenset({tuple(np.round(start, 9)), tuple(np.round(end, 9))})] += 1
    assert corners
    assert set(corners.values()) == {2}


def test_the_hull_of_a_box_has_six_faces_of_four_corners():
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float)
    rng = np.random.default_rng(0)
    inside = rng.uniform([0, 0, 0], [1, 2, 3], (20, 3))
    hull = faces(np.vstack([inside, box]))
    assert sorted(len(face) for face in hull) == [4] * 6
    assert {int(corner) for face in hull for corner in face} == set(range(20, 28))


def test_flat_bodies_lines_and_points():
    square = np.array([[0, 0, 0], [1, 1, 0.5], [1, 0, 0.25], [0, 1, 0.25], [0.5, 0.5, 0.25]])
    assert [sorted(face) for face in faces(square)] == [[0, 1, 2, 3]]
    assert faces(np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 3]])) == []
    assert faces(np.ones((4, 3))) == []
    assert faces(np.zeros((0, 3))) == []
    assert outline(np.array([[1.0, 1], [0, 0], [3, 3]])).tolist() == [[0, 0], [3, 3]]
    assert outline(np.ones((3, 2))).tolist() == [[1, 1]]
    assert len(outline(square[:, :2])) == 4


def test_views_have_what_they_show_in_their_middle():
    points = np.random.default_rng(0).uniform([5, -3, 1], [9, -2, 4], (30, 3))
    views = [ABOVE, FRONT, SIDE]
    _, panels = views_of(points, views)
    for ax, view in zip(panels, views, strict=True):
        for limits, axis in ((ax.get_xlim(), view.across), (ax.get_ylim(), view.up)):
            low, high = points[:, axis].min(), points[:, axis].max()
            assert limits[0] < low < high < limits[1]
            assert sum(limits) == pytest.approx(low + high)
    shown = [(ax.xaxis.get_tick_params()["labelbottom"], ax.yaxis.get_tick_params()["labelleft"]) for ax in panels]
    assert shown == [(False, True), (True, True), (True, False)], "numbers are where panels have none beside or below"


def test_the_title_of_a_robot_that_fills_the_width_is_inside_the_picture():
    corners = [[x, y, 25.0] for x in (-45, 45) for y in (-30, 30)]
    ends = {"carrier": "masts", "attachment": [0, 0, 0], "t_min": 5, "t_max": 2000}
    camera = Robot.model_validate(
        {
            "name": "camera",
            "source": "a test",
            "platform": {"mass": 25, "dof": ["x", "y", "z"], "home": [0, 0, 10, 0, 0, 0]},
            "carriers": [{"name": "masts", "kind": "ground"}],
            "cables": [ends | {"anchor": corner} for corner in corners],
        }
    )
    resting = np.array([[x, y, 5.0] for x in (-40, 40) for y in (-27, 27)])
    canvas = figure.draw(scene_at(camera, camera.home, np.full(4, 229.0), "camera"), resting)
    canvas.draw_without_rendering()
    (title,) = canvas.findobj(lambda it: isinstance(it, Text) and it.get_text().startswith("camera"))
    assert title.get_window_extent().y1 <= canvas.bbox.height
