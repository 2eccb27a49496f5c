"""Paper C's three workspaces: what their geometry proves, beside what the loops find."""

import time

import numpy as np
import pytest

from towline.models import Dynamics, Robot
from towline.statics.equilibria import equilibria
from towline.studies.towing import workspace as study
from towline.studies.towing.plans import DRIVES, robot
from towline.workspace import EquilibriumPosture, ExistsPlacement, ForceBalance, Places
from towline.workspace.volume import volume

REACH = 0.0577350269  # of an attachment from the load's middle [m]


@pytest.fixture(scope="module")
def timed():
    """Return the loops of each drive, and their processor time [s]."""
    results = {}
    for drive in DRIVES:
        start = time.process_time()
        results[drive] = study.loops(drive), time.process_time() - start
    return results


@pytest.fixture(scope="module")
def found(timed):
    return {drive: system for drive, (system, _) in timed.items()}


def triangle(corners):
    (ax, ay), (bx, by) = corners[1] - corners[0], corners[2] - corners[0]
    return abs(ax * by - ay * bx) / 2


def test_sixty_thousand_loops_of_each_type(timed):
    for drive, (system, seconds) in timed.items():
        assert len(system.places) == 60_000
        assert system.held.sum() > 10_000
        assert seconds < 5, drive


def test_a_load_of_fixed_length_hangs_at_its_lengths(found):
    places = found["fixed-length"].places.only(np.flatnonzero(found["fixed-length"].held)[:2000])
    lengths = Dynamics(found["fixed-length"].robot).cable_lengths(places.pose, places.carriers)
    np.testing.assert_allclose(lengths, 1.2, rtol=1e-9)


def test_what_is_held_is_held_by_pulling(found):
    """A second way: the tensions by Cramer's rule, and gravity."""
    for system in found.values():
        places = system.places.only(np.flatnonzero(system.held)[:3000])
        U = Dynamics(system.robot).wrench_matrix(places.pose, places.carriers)[:, :3]
        tensions = np.linalg.solve(U, np.tile([[0.0], [0.0], [system.robot.weight]], (len(places), 1, 1)))[..., 0]
        assert tensions.min() > -1e-9
        assert tensions.max() < 500 + 1e-6
        low, high = study.reach(system.robot)
        ends = places.carriers[:, :, :3]
        assert ((ends >= low) & (ends <= high)).all()


def test_fixed_and_variable_lengths_lie_inside_both(found):
    for drive in ("fixed-length", "variable-length"):
        assert study.placed_as_both(found[drive].places.only(found[drive].held)).all()


def test_fixed_lengths_do_not_lie_inside_variable_ones():
    """The erratum, with a witness: held at z > 1.26 m, above everything that anchors at 1.2 m can pull up.

    No attachment is more than 0.058 m below the load's middle, so above 1.258 m all three cables would pull down.
    """
    fixed, variable = robot("wang-ctmrts", "fixed-length"), robot("wang-ctmrts", "variable-length")
    rng = np.random.default_rng(0)
    poses = np.zeros((4000, 6))
    poses[:, :3] = rng.uniform([1.1, 0.8, 1.2 + REACH + 1e-3], [1.4, 1.1, 1.32], (4000, 3))
    held = ExistsPlacement(condition=ForceBalance(), tries=128, turn=0.1).holds(fixed, Places.at_home(fixed, poses))
    assert held.any()
    assert poses[held, 2].min() > 1.2 + REACH
    anywhere = ExistsPlacement(condition=ForceBalance(), tries=64, turn=1.0)
    assert not anywhere.holds(variable, Places.at_home(variable, poses[held])).any()


def test_the_printed_least_height_of_fixed_lengths_is_not_the_least():
    """With the robot-ends at the printed x, y and least z, whatever the boxes: 1.2 m hold the load far below 0.6 m."""
    system = robot("wang-ctmrts", "fixed-length")
    lowest = system.carrier_home.copy()
    lowest[:, 2] = 1.0
    rest = equilibria(system, np.full(3, 1.2), lowest)[0]
    # A level load: three cables of 1.2 m to points at one height, from attachments 0.058 m inward.
    ends = lowest[:, :2] - system.attachments[:, :2]
    middle = np.linalg.solve(2 * (ends[1:] - ends[0]), (ends[1:] ** 2).sum(axis=1) - (ends[0] ** 2).sum())
    level = 1.0 - np.sqrt(1.2**2 - ((ends[0] - middle) ** 2).sum())
    assert rest.pose[2] < level + 1e-9 < study.PRINTED["fixed-length"][2][0] - 0.05


def test_ranges_are_beside_the_printed_ones(found):
    """Where the robot-ends stay, nothing is inferred: the printed range is met. Else within the inferred boxes."""
    variable = found["variable-length"].ranges
    np.testing.assert_allclose(variable, study.PRINTED["variable-length"], atol=0.06)
    both = found["both"].ranges
    printed = np.array(study.PRINTED["both"])
    np.testing.assert_allclose(both, printed, atol=0.1)
    system = found["both"].robot
    low, high = study.reach(system)
    assert (both[:, 0] >= [*low[:, :2].min(axis=0) - REACH, 0]).all()
    assert (both[:, 1] <= high.max(axis=0) + REACH).all()


def test_the_level_workspace_of_variable_length_is_a_prism():
    """Level, each cable's line passes through the middle if the anchor is shifted by its attachment: a triangle."""
    data = robot("wang-ctmrts", "variable-length").model_dump(mode="json")
    data["cables"] = [cable | {"t_max": 1e7} for cable in data["cables"]]
    system = Robot.model_validate(data)
    corners = (system.carrier_home[:, :3] - system.attachments)[:, :2]
    low, high = np.array([0.2, 0.3, 0.0]), np.array([2.3, 2.1, 1.3])
    poses = np.zeros((60_000, 6))
    poses[:, :3] = np.random.default_rng(4).uniform(low, high, (60_000, 3))
    held = ForceBalance().holds(system, Places.at_home(system, poses))
    size = volume(int(held.sum()), held.size, float(np.prod(high - low)))
    assert size.low < triangle(corners) * 1.2 < size.high


def test_volumes_grow_from_one_type_to_the_next():
    sizes = [study.volume_of(drive, samples=4000, tries=24) for drive in DRIVES]
    assert sizes[0].high < sizes[1].low < sizes[1].high < sizes[2].low
    assert all(size.low < size.value < size.high for size in sizes)


def test_postures_in_balance_agree_with_the_prism(found):
    """The third condition: Newton nearly always converges, and then the cables pull inside the prism only."""
    for drive in ("variable-length", "both"):
        system = found[drive]
        places = system.places.only(slice(0, 6000))
        pose, tensions = EquilibriumPosture().postures(system.robot, places)
        ends = places.carriers[:, :, :3]
        corners = np.concatenate([ends[..., :2].transpose(0, 2, 1), np.ones((6000, 1, 3))], axis=1)
        points = np.concatenate([places.pose[:, :2], np.ones((6000, 1))], axis=1)
        shares = np.linalg.solve(corners, points[..., None])[..., 0]  # barycentric in the triangle of robot-ends
        above = np.einsum("nc,nc->n", shares, ends[..., 2])
        inside = (shares > 0).all(axis=1) & (places.pose[:, 2] < above)
        solved = np.isfinite(pose[:, 0])
        assert solved[inside].mean() > 0.99
        assert ((tensions > 0).all(axis=1) == inside)[solved].mean() > 0.999
        A = Dynamics(system.robot).wrench_matrix(pose[solved], places.carriers[solved])
        left = np.einsum("nij,nj->ni", A, tensions[solved]) - [0, 0, system.robot.weight, 0, 0, 0]
        assert np.abs(left).max() < 1e-6 * system.robot.weight
