"""A load is proven too heavy only if it is heavier than all cables, or all carriers, can carry together."""

import pytest

from towline.models import load
from towline.ocp import MotionStatus, plan
from towline.ocp.proofs.infeasible_ends import infeasible_ends
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task

from .framed import framed

TEAM = load("multi-quadrotor-3")
G = 9.81
BY_THRUST = sum(carrier.thrust_max - carrier.mass * G for carrier in TEAM.carriers) / G - TEAM.platform.mass  # [kg]
BY_CABLES = sum(cable.t_max for cable in TEAM.cables) / G - TEAM.platform.mass
GROUND = {"name": "ground", "duration": 1, "path": {"kind": "rest", "pose": [0, 0, 0]}, "ground": {"slack": True}}


def lift(mass, *before, **fields):
    path = {"kind": "line", "start": [0, 0, 0], "end": [0, 0, 0.5]}
    phase = {"name": "lift", "duration": 2, "path": path, "load": {"mass": mass}}
    free = {"base": {"kind": "free"}, "tube": {"position": 0.1, "attitude": 0.2}, "scheme": "hermite"}
    return {"phases": [*before, phase], **free, **fields}


def proven(task):
    """The limits that are proven too small together, and the largest load [kg] that they carry."""
    proof = infeasible_ends(lay_out(TEAM, read_task(task)))
    return {} if proof is None else {excess.limit: excess.bound for excess in proof.excess}


@pytest.mark.parametrize(
    ("mass", "limits"),
    [
        (0.999 * BY_THRUST, set()),
        (1.001 * BY_THRUST, {"thrust_max"}),
        (0.999 * BY_CABLES, {"thrust_max"}),
        (1.001 * BY_CABLES, {"thrust_max", "t_max"}),
    ],
)
def test_from_rest_to_rest_the_largest_forces_carry_the_weight(mass, limits):
    assert set(proven(lift(mass))) == limits


def test_where_the_weight_need_not_be_carried_nothing_is_proven():
    """The ground carries it; a platform that may fall does not need it; a team that may fall lends its weight."""
    heavy = {**GROUND, "load": {"mass": 1000}}
    assert not proven({**lift(1), "phases": [heavy, {**heavy, "name": "still"}]})
    assert not proven({**lift(1000), "tube": {"position": 0.1, "attitude": 0.2, "ends": "free"}})
    assert set(proven(lift(1.5 * BY_CABLES, {**GROUND, "load": {"mass": 1.5 * BY_CABLES}}))) == {"t_max"}


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_one_vertical_cable_carries_its_largest_tension_and_no_more(share):
    """The bound is sharp: what weighs 2 % less is lifted, slowly."""
    platform = {"mass": share * 100 / G, "dof": ["z"], "home": [0, 0, 0, 0, 0, 0]}
    robot = framed([([0, 0, 9], [0, 0, 0])], platform, t_min=1, t_max=100)
    path = {"kind": "line", "start": [0, 0, 0], "end": [0, 0, 1]}
    task = {"path": path, "duration": 8, "tube": {"position": 0.01}, "steps": 20}
    lifted = plan(robot, task)
    assert lifted.status is (MotionStatus.FEASIBLE if share < 1 else MotionStatus.INFEASIBLE)
    assert share < 1 or "t_max of all cables together must be at least 102 N but is 100 N" in lifted.report()
    offers = {offer.name: offer for offer in lifted.relaxations}
    assert set(offers) == (set() if share < 1 else {"platform.mass", "cables.t_max"})
    assert share < 1 or 0.98 * 100 / G < offers["platform.mass"].possible < 100 / G
    assert share < 1 or 102 < offers["cables.t_max"].possible < 1.02 * 102
