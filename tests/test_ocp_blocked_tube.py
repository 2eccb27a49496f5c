"""A region that closes the whole tube is proven to block it, and no region past which the platform can go."""

import numpy as np
import pytest

from towline.models import load
from towline.ocp import plan
from towline.ocp.proofs.infeasible_ends import infeasible_ends
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task

TUBE, BALL, APART = 0.3, 0.1, 0.05
CORNER = 1 / np.cos(np.pi / 8)  # of an octagon around a circle of radius 1
PLAIN = load("ipanema-1")


def robot(body):
    platform = PLAIN.model_dump()["platform"] | {"body": body}
    return type(PLAIN).model_validate(PLAIN.model_dump() | {"platform": platform})


def task(region, end=(0.5, 0, 1)):
    """A line through the origin's plane x = 0, where the region is."""
    line = {"kind": "line", "start": [-0.5, 0, 1], "end": list(end)}
    region = {"name": "region", "platform": APART, "cables": None} | region
    return {"path": line, "duration": 6, "steps": 20, "tube": {"position": TUBE}, "limits": {"keep_out": [region]}}


def wall(half):
    return {"kind": "box", "min": [-0.02, -half, 0], "max": [0.02, half, 2]}


def proof(region, body=None, **others):
    body = body or {"kind": "sphere", "centre": [0, 0, 0], "radius": BALL}
    return infeasible_ends(lay_out(robot(body), read_task(task(region, **others))))


def test_a_wall_blocks_the_tube_from_the_width_at_which_no_ball_passes():
    blocking = CORNER * 1.01 * TUBE - BALL - APART
    (excess,) = proof(wall(blocking)).excess
    assert (excess.limit, excess.about, excess.bound) == ("keep_out", "platform's body outside region", APART)
    assert excess.value < APART
    assert 2.5 < excess.time < 3.5
    assert proof(wall(TUBE - BALL - APART)) is None
    passing = plan(robot({"kind": "sphere", "centre": [0, 0, 0], "radius": BALL}), task(wall(0.8 * blocking - 0.02)))
    assert passing.feasible


@pytest.mark.parametrize("kind", ["sphere", "capsule", "mesh", "turned box"])
def test_regions_of_every_shape_block_from_their_own_width(kind):
    def region(half):
        corners = [[x, y, z] for x in (-0.1, 0.1) for y in (-half, half) for z in (0, 2)]
        turned = {"kind": "box", "min": [-half, -0.1, 0], "max": [half, 0.1, 2], "attitude": [0, 0, np.pi / 2]}
        return {
            "sphere": {"kind": "sphere", "centre": [0, 0, 1], "radius": half},
            "capsule": {"kind": "capsule", "start": [0, 0, 0], "end": [0, 0, 2], "radius": half},
            "mesh": {"kind": "mesh", "vertices": corners},
            "turned box": turned,
        }[kind]

    assert proof(region(1.1 * TUBE - BALL - APART)) is not None
    assert proof(region(0.9 * TUBE - BALL - APART)) is None


def test_nothing_blocks_a_path_that_need_not_cross():
    assert proof(wall(2.0), end=(-0.25, 0.0, 1)) is None
    assert proof(wall(2.0) | {"platform": None, "carriers": 0.0}) is None


def test_a_body_off_the_origin_is_what_passes():
    body = {"kind": "sphere", "centre": [0, 0.2, 0], "radius": BALL}
    beside = {"kind": "box", "min": [-0.02, -0.1, 0], "max": [0.02, 0.5, 2]}
    assert proof(beside, body) is not None
    assert proof(beside) is None


def test_a_quick_way_over_a_wall_after_a_long_rest_is_seen():
    """The way over the wall takes a thousandth of the motion, and ends close to where it begins."""
    over = {"kind": "waypoints", "points": [[-0.25, 0, 1], [0, 0, 3.5], [0.25, 0, 1]], "dwell": [200, 0, 0]}
    quick = task({"kind": "box", "min": [-0.02, -2, -1], "max": [0.02, 2, 2.6]}) | {"path": over, "duration": 200.1}
    body = {"kind": "sphere", "centre": [0, 0, 0], "radius": BALL}
    assert infeasible_ends(lay_out(robot(body), read_task(quick))) is None
