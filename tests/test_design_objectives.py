"""Designs that are never worse than the robot's own layout, and need no stronger winches where more is free."""

from itertools import product

import numpy as np
import yaml

from towline import Dynamics, Robot, TensionProblem, design, load, read_requirements
from towline.cli.new import TEMPLATES
from towline.layout import search
from towline.layout.variables import variables_of
from towline.solvers import capacity_margin

ROBOT = load("ipanema-2")
FREE = [  # in the frame, and as far as the platform extends
    {"part": "anchor", "box": {"min": [-4, -3, 1], "max": [4, 3, 5]}},
    {"part": "attachment", "box": {"min": [-0.75, -0.125, 0.25], "max": [0.75, 0.125, 0.75]}},
]


def least_margin(robot, poses, length=ROBOT.length):
    scale = np.repeat([1.0, 1.0 / length], 3)
    w = scale * Dynamics(robot).required_wrench(poses[0], np.zeros(6), np.zeros(6))
    matrices = scale[:, None] * Dynamics(robot).wrench_matrix(poses)
    return min(capacity_margin(TensionProblem(A, w, robot.t_min, robot.t_max)).value for A in matrices)


def test_a_layout_is_never_worse_than_the_robots_own(monkeypatch):
    """A grid of one pose says nothing of the rest of the box: linear programs spoil the margin there.

    The robot's own margin is least between two corners of the box, so corners alone would not compare the worst.
    """
    monkeypatch.setattr(search, "AUDITED", 5_000)
    wide = {"min": [-2.5, -1.5, 1.5], "max": [2.5, 1.5, 4.0]}
    found = design(ROBOT, FREE, [{"box": wide, "grid": [1, 1, 1]}], time_limit=0.3)
    poses = np.zeros((27, 6))
    poses[:, :3] = list(product(*np.linspace(wide["min"], wide["max"], 3).T))
    assert least_margin(found.robot, poses) >= least_margin(ROBOT, poses) - 1e-6


def test_more_freedom_needs_no_stronger_winches(monkeypatch):
    """The margin that moved anchors lose in audits is restored, so free anchors need no stronger winches."""
    monkeypatch.setattr(search, "_SEARCHING", 0.0)  # from the robot's own layout alone
    monkeypatch.setattr(search, "AUDITED", 3000)
    text = (TEMPLATES / "frame.yaml").read_text().replace("$name", "crane")
    robot = Robot.model_validate(yaml.safe_load(text))
    anchors = {"min": robot.anchors.min(axis=0).tolist(), "max": robot.anchors.max(axis=0).tolist()}
    winches = {"part": "t_max", "range": {"min": 50, "max": 5000}}
    box = {"min": [-1.2, -0.9, 0.3], "max": [1.2, 0.9, 1.5]}
    needed = []
    for free in ([winches], [winches, {"part": "anchor", "box": anchors}]):
        data = {"free": free, "require": [{"box": box, "grid": [3, 3, 2]}], "minimise": "t_max", "margin": 10.0}
        requirements = read_requirements({**data, "time_limit": 60.0})
        variables = variables_of(robot, requirements)
        found = variables.robot_at(search.search(variables, requirements, lambda what, share, margin: None).y)
        places = requirements.require[0].places((2, 2, 2))
        assert least_margin(found, places, robot.length) >= 10.0
        needed.append(found.t_max.mean())
    assert needed[1] < 0.9 * needed[0] < 0.9 * robot.t_max.mean()
