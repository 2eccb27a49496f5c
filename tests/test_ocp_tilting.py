"""A platform on four cables tilts as it moves: a path that keeps it level is infeasible, and the advice says so."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.benchmarks.scenes import carried
from towline.models import Robot
from towline.ocp import plan

ANCHORS = np.array([[-2.0, -2.0, 3.0], [2.0, -2.0, 3.0], [2.0, 2.0, 3.0], [-2.0, 2.0, 3.2]])
ATTACHMENTS = np.array([[-0.2, -0.2, 0.1], [0.2, -0.2, 0.1], [0.2, 0.2, 0.1], [-0.2, 0.2, 0.1]])
MASS = 10.0


def suspended(count=4):
    ends = list(zip(ANCHORS.tolist(), ATTACHMENTS.tolist(), strict=True))[:count]
    cables = [
        {"carrier": "frame", "anchor": anchor, "attachment": attachment, "t_min": 5, "t_max": 400}
        for anchor, attachment in ends
    ]
    platform = {"mass": MASS, "inertia": [2e-4, 2e-4, 3e-4, 0, 0, 0], "home": [0, 0, 1, 0, 0, 0]}
    frame = {"name": "frame", "kind": "ground"}
    return Robot.model_validate(
        {"name": "four", "source": "a test", "platform": platform, "carriers": [frame], "cables": cables}
    )


def unbalanced(pose, tensions):
    """Return force and moment about the platform's origin, where its CoM is, that are not in balance at rest."""
    arms = Rotation.from_euler("ZYX", pose[[5, 4, 3]]).apply(ATTACHMENTS)
    lines = ANCHORS - pose[:3] - arms
    forces = tensions[:, None] * lines / np.linalg.norm(lines, axis=1)[:, None]
    return np.append(forces.sum(axis=0) - [0, 0, MASS * 9.81], np.cross(arms, forces).sum(axis=0))


def test_the_tube_in_which_it_may_tilt_is_offered():
    task = {"path": {"kind": "line", "start": [0.1, 0, 1], "end": [0.5, 0.2, 1.3]}, "duration": 3}
    refused = plan(suspended(), task)
    assert refused.certificate is not None
    (offer,) = (each for each in refused.relaxations if each.name == "tube.attitude")
    again = plan(suspended(), {**task, "tube": {"attitude": offer.possible}})
    assert again.feasible, again.report()
    audit = again.audit
    assert 0.05 < np.abs(audit.motion.pose[:, 3:]).max() <= offer.possible + 1e-9
    np.testing.assert_allclose(audit.motion.pose[[0, -1], :3], [[0.1, 0, 1], [0.5, 0.2, 1.3]], atol=1e-9)
    for end in (0, -1):  # at rest, but for an angular acceleration
        np.testing.assert_allclose(unbalanced(audit.motion.pose[end], audit.tensions[end]), 0, atol=0.02)
    level = np.append(audit.motion.pose[-1, :3], np.zeros(3))
    assert np.abs(unbalanced(level, audit.tensions[-1])).max() > 1.0


def test_it_is_offered_also_where_its_first_program_is_too_coarse():
    points = [[0, 0, 1], [0.3, 0, 1.2], [0.3, 0.3, 1]]
    task = {"path": {"kind": "waypoints", "points": points}, "duration": 4, "steps": 30}
    (offer,) = (each for each in plan(suspended(), task).relaxations if each.name == "tube.attitude")
    assert plan(suspended(), {**task, "tube": {"attitude": offer.possible}}).feasible


def test_it_is_not_offered_on_a_closed_path_on_which_no_tilt_helps():
    """The CoM is on an edge of the triangle of the three attachments."""
    path = {"kind": "circle", "centre": [0, 0, 1.2], "radius": 0.3, "rate": 2}
    refused = plan(suspended(3), {"path": path, "tube": {"ends": "periodic"}, "steps": 20})
    assert not refused.feasible
    assert "tube.attitude" not in [each.name for each in refused.relaxations]


def test_it_is_not_offered_where_enough_cables_hold_each_attitude():
    refused = plan("point-mass-3", {"path": {"kind": "line", "start": [0, 0, 1], "end": [1.5, 0.5, 1]}, "duration": 5})
    assert not refused.feasible
    assert "tube.attitude" not in [each.name for each in refused.relaxations]


def test_what_no_tilt_makes_feasible_is_not_offered():
    """Outside the anchors no attitude balances the weight."""
    task = {"path": {"kind": "line", "start": [0, 0, 1], "end": [4, 0, 1]}, "duration": 5, "steps": 30}
    refused = plan(suspended(), task)
    assert "tube.attitude" not in [each.name for each in refused.relaxations]


def test_a_point_mass_has_no_attitude_to_change():
    low, high = [-1, -1, -1], [2, 1, 1]
    refused = plan(
        *carried(1, [0, 0, 0], [1, 0, 0], low, high, [], at_goal=[(0.0, 1.0)])
    )  # at rest it hangs vertically
    assert refused.status == "infeasible"
    assert refused.certificate is not None
    assert "a tilting platform" not in refused.report()


@pytest.mark.parametrize("scheme", ["linear", "hermite"])
def test_three_cables_hold_a_platform_on_a_closed_path(scheme):
    """Equal poses, velocities and wrenches at both ends imply equal accelerations: these are no further equations."""
    azimuths = 2 * np.pi / 3 * np.arange(3) + 0.3
    ways = np.stack([np.cos(azimuths), np.sin(azimuths), 0 * azimuths], axis=1)
    data = suspended(3).model_dump()
    for cable, way in zip(data["cables"], ways, strict=True):
        cable.update(anchor=(2 * way + [0, 0, 3]).tolist(), attachment=(0.2 * way + [0, 0, 0.05]).tolist())
    data["platform"].update(com=[0, 0, -0.1], inertia=[0.1, 0.1, 0.15, 0, 0, 0])
    path = {"kind": "circle", "centre": [0, 0, 1.2], "radius": 0.3, "rate": 1.5}
    tube = {"ends": "periodic", "attitude": 0.5}
    found = plan(Robot.model_validate(data), {"path": path, "tube": tube, "steps": 60, "scheme": scheme})
    assert found.feasible, found.report()
    assert found.message == "Solve_Succeeded"
    motion = found.audit.motion
    assert np.abs(motion.pose[:, 3:]).max() > 0.01  # it tilts
    for part in motion:
        np.testing.assert_allclose(part[0], part[-1], atol=1e-5)
