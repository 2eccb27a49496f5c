"""Where to put the anchors: each command of its page finds a better robot, which can do what its file requires."""

import re
import shlex
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from towline import Dynamics, TensionProblem, design, load, read_requirements, solve
from towline.layout import run, search as searching

FOLDER = Path(__file__).parent.parent / "examples" / "design"
PAGE = FOLDER.parents[1] / "docs" / "howto" / "design.md"
COMMANDS = re.findall(r"^\|.*`(towline design [^`]*)` \|$", PAGE.read_text(), re.MULTILINE)


def test_every_file_is_used():
    used = {word for command in COMMANDS for word in shlex.split(command) if word.endswith(".yaml")}
    assert {file.name for file in FOLDER.glob("*.yaml")} == used


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: Path(command).stem.split()[-1])
def test_a_better_robot_is_found(command, monkeypatch):
    """From the robot's own layout until the audits agree: the result does not depend on the machine's speed."""
    monkeypatch.setattr(searching, "_SEARCHING", 0.0)
    monkeypatch.setattr(searching, "AUDITED", 3000)  # of larger audits, test_design.py has tests
    for module in (run, searching):
        monkeypatch.setattr(module, "ROOM_AUDITED", 600)
    monkeypatch.chdir(FOLDER)
    _, _, given, file = shlex.split(command)
    assert Path(file).read_text().startswith(f"# {command}\n")
    before, wanted = load(given), read_requirements(file)
    assert wanted.time_limit <= 10
    found = design(before, requirements=wanted.model_copy(update={"time_limit": 60.0}))
    assert found.feasible
    assert found.margin > found.margin_before
    assert found.margin >= wanted.margin
    for plan in found.plans:
        assert plan.feasible
    if wanted.minimise == "t_max":
        assert found.robot.t_max.max() < 0.5 * before.t_max.max()
    (required,) = wanted.require
    dynamics, kept = Dynamics(found.robot), np.flatnonzero(before.dof_mask)
    corners = list(product(*zip(required.box.min, required.box.max, strict=True)))
    for corner, attitude in product(corners, required.attitudes):
        pose = np.array([*corner, *attitude])
        A = dynamics.wrench_matrix(pose)[kept]
        for wrench, acceleration, _ in required.demands:
            w = dynamics.required_wrench(pose, np.zeros(6), acceleration) - wrench
            assert solve(TensionProblem(A, w[kept], found.robot.t_min, found.robot.t_max)).feasible
