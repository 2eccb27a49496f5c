"""Symmetric layouts: margins are those at mirrored poses, and only cables of mirrored bounds are paired."""

import numpy as np
import pytest

from towline import Robot, load, read_requirements
from towline.layout.annealing import Moves
from towline.layout.evaluation import Evaluation, rows_of
from towline.layout.symmetry import Mirrors
from towline.layout.variables import variables_of

HERE = np.array([[0.7, 0.4, 1.2, 0.0, 0.0, 0.0], [-0.9, 1.1, 2.0, 0.0, 0.0, 0.0], [0.2, -1.3, 1.6, 0.0, 0.0, 0.0]])
MIRRORINGS = [(-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]


def required(poses, *free):
    return read_requirements({"free": list(free), "require": [{"poses": poses.tolist()}]})


def variables_with(robot, *free):
    return variables_of(robot, required(HERE, *free))


def box(low, high):
    return {"min": list(low), "max": list(high)}


def pairs(variables, signs):
    """Return the pairs of cables, counted from 1, of a random symmetry."""
    symmetry = Mirrors(variables).symmetry(signs, np.random.default_rng(0))
    if symmetry is None:
        return set()
    cable = [int(name.split("[")[1].split("]")[0]) + 1 for name in variables.names]
    return {frozenset((cable[i], cable[j])) for i, j in zip(symmetry.first, symmetry.second, strict=True)}


@pytest.mark.parametrize("signs", MIRRORINGS)
@pytest.mark.parametrize("name", ["cogiro", "ipanema-2"])
def test_the_margin_at_a_pose_is_that_at_its_mirror_image(name, signs):
    """Weight is the only wrench, and the CoM is moved to the planes of symmetry."""
    data = load(name).model_dump()
    data["platform"]["com"] = (0.0, 0.0, 0.1)
    robot = Robot.model_validate(data)
    free = [
        {"part": "anchor", "box": box((-7.0, -6.0, 3.0), (7.0, 6.0, 5.5))},
        {"part": "attachment", "box": box((-0.5, -0.4, -0.5), (0.5, 0.4, 0.5))},
        {"part": "t_max", "range": {"min": 500.0, "max": 900.0}},
    ]
    variables, rng = variables_with(robot, *free), np.random.default_rng(4)
    moves = Moves(variables, Mirrors(variables).symmetry(signs, rng))
    both = np.vstack([HERE, HERE * [*signs, 1.0, 1.0, 1.0, 1.0]])
    evaluation = Evaluation(variables, rows_of(robot, required(both, *free).require, [both]))
    y = moves.layout(rng)
    for _ in range(50):
        y = moves.neighbour(y, rng)
        assert (y >= variables.low).all()
        assert (y <= variables.high).all()
        margins = evaluation.margins(y)
        np.testing.assert_allclose(margins[:3], margins[3:], rtol=1e-9, atol=1e-6)


def test_only_cables_whose_bounds_are_mirror_images_are_paired():
    robot = load("ipanema-2")
    left = {"part": "anchor", "cables": [1, 2, 3, 4], "box": box((-6, -4, 1), (-4, 4, 5))}
    right = {"part": "anchor", "cables": [5, 6, 7, 8], "box": box((4, -4, 1), (6, 4, 5))}
    anywhere = {"part": "attachment", "box": box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))}
    variables = variables_with(robot, left, right, anywhere)
    assert all(min(pair) <= 4 < max(pair) for pair in pairs(variables, (-1.0, 1.0)))
    assert all((min(pair) <= 4) == (max(pair) <= 4) for pair in pairs(variables, (1.0, -1.0)))
    assert all(len(pairs(variables, signs)) == 4 for signs in MIRRORINGS)
    # One cable is stronger, so it has no image, and one is left.
    data = robot.model_dump()
    data["cables"] = [{**cable, "t_max": cable["t_max"] * (1 + (i == 0))} for i, cable in enumerate(data["cables"])]
    stronger = variables_with(Robot.model_validate(data), left, right, anywhere)
    assert len(pairs(stronger, (-1.0, 1.0))) == 3
    assert 1 not in set().union(*pairs(stronger, (-1.0, 1.0)))
    # Points that cables share, or copy from others, stay as the requirements have them.
    shared = {"part": "attachment", "box": anywhere["box"], "equal": True}
    assert pairs(variables_with(robot, left, right, shared), (-1.0, 1.0)) == set()


def test_fixed_attachments_are_paired_with_their_images():
    """Those of CoGiRo were measured: its lower ones are images of each other after half a turn only."""
    variables = variables_with(load("cogiro"), {"part": "anchor", "box": box((-7, -6, 3), (7, 6, 5.5))})
    assert pairs(variables, (-1.0, 1.0)) == {frozenset((2, 4)), frozenset((6, 8))}
    assert pairs(variables, (1.0, -1.0)) == {frozenset((2, 8)), frozenset((4, 6))}
    assert pairs(variables, (-1.0, -1.0)) == {frozenset(pair) for pair in ((1, 5), (2, 6), (3, 7), (4, 8))}


def test_a_planar_robot_is_mirrored_in_its_plane_only():
    robot = load("planar-4")
    low, high = robot.anchors.min(axis=0), robot.anchors.max(axis=0)
    assert Mirrors(variables_with(robot, {"part": "anchor", "box": box(low, high)})).signs == [(-1.0, 1.0)]


def test_cables_that_share_a_limit_are_paired_too():
    robot = load("ipanema-2")
    anywhere = {"part": "anchor", "box": box((-6, -4, 1), (6, 4, 5))}
    attachments = {"part": "attachment", "box": box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))}
    shared = {"part": "t_max", "range": {"min": 500.0, "max": 900.0}, "equal": True}
    variables = variables_with(robot, anywhere, attachments, shared)
    symmetry = Mirrors(variables).symmetry((-1.0, 1.0), np.random.default_rng(0))
    assert len(symmetry.first) == 4 * 6  # of each pair an anchor and an attachment
    assert variables.names.index("cables[0].t_max") not in {*symmetry.first, *symmetry.second}


def test_a_cable_with_a_small_box_does_not_lead_one_without():
    """The variable of the second one did not exist, so the last one was changed."""
    robot = load("cogiro")
    near = {"part": "anchor", "cables": [1], "box": box(robot.anchors[0] - 0.05, robot.anchors[0] + 0.05)}
    limit = {"part": "t_max", "cables": [1], "range": {"min": 4990.0, "max": 5010.0}}
    mirrors = Mirrors(variables_with(robot, near, limit))
    for signs in MIRRORINGS:
        for seed in range(20):
            symmetry = mirrors.symmetry(signs, np.random.default_rng(seed))
            assert symmetry is None or (symmetry.second >= 0).all()


def test_no_mirroring_turns_the_weight_around():
    data = load("planar-4").model_dump()
    turned = [[1, 0, 0], [0, 0, 1], [0, 1, 0]]  # z to y
    for cable in data["cables"]:
        cable |= {end: (np.array(turned) @ cable[end]).tolist() for end in ("anchor", "attachment")}
    platform = data["platform"] | {"home": [*(np.array(turned) @ data["platform"]["home"][:3]), 0, 0, 0]}
    platform["dof"] = ["x", "y", "yaw"]
    robot = Robot.model_validate(data | {"platform": platform, "gravity": [0, -9.81, 0]})
    low, high = robot.anchors.min(axis=0), robot.anchors.max(axis=0)
    assert Mirrors(variables_with(robot, {"part": "anchor", "box": box(low, high)})).signs == [(-1.0, 1.0)]
