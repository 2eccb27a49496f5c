"""The mechanics of the core are those of the CasADi model, in lanes as for one pose, at every attitude."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Dynamics, available, load
from towline.core import _core
from towline.models.record import RECORD, record_of

LEVEL = np.pi / 2
COUNT = 203  # no multiple of eight


def motions(robot, rng):
    """Poses of the platform, a fifth at a pitch of 90 degrees up or down, poses of carriers, and derivatives."""
    pose = robot.home + rng.normal(scale=0.3, size=(COUNT, 6))
    pose[:, 3:] = rng.uniform(-np.pi, np.pi, (COUNT, 3))
    carriers = robot.carrier_home + rng.normal(scale=0.2, size=(COUNT, len(robot.carriers), 6))
    for poses in (pose, carriers[:, 0]):
        poses[: COUNT // 5, 4] = rng.choice([-LEVEL, LEVEL], COUNT // 5)
    return pose, *rng.normal(size=(2, COUNT, 6)), carriers


def lines(robot, pose, carriers):
    """Lengths, wrench matrix, Jacobian, anchors and sensitivities of the core."""
    count, m = len(pose), robot.m
    results = [np.empty((count, *shape)) for shape in [(m,), (6, m), (m, 6), (m, 3), (m, 7)]]
    _core.lines(record_of(robot), pose, carriers, *results)
    return results


@pytest.fixture(params=available())
def robot(request):
    return load(request.param)


def test_the_record_is_that_of_the_core(robot):
    assert RECORD.itemsize == _core.ROBOT_BYTES
    record = record_of(robot)
    assert record["cables"] == robot.m
    np.testing.assert_array_equal(record["cable"]["anchor"][: robot.m], robot.anchors)


def test_lines_and_wrenches_are_those_of_the_symbolic_model(robot):
    rng = np.random.default_rng(1)
    pose, velocity, acceleration, carriers = motions(robot, rng)
    functions = Dynamics(robot).functions
    symbol, at_carriers = ca.SX.sym("pose", 6), ca.SX.sym("carriers", *functions["cable_lengths"].size_in(1))
    by_pose = ca.Function(
        "J", [symbol, at_carriers], [ca.jacobian(functions["cable_lengths"](symbol, at_carriers), symbol)]
    )
    lengths, A, J, anchors, _ = lines(robot, pose, carriers)
    wind = rng.normal(scale=5.0, size=(COUNT, 3)) if robot.platform.aero else None
    w = np.empty((COUNT, 6))
    _core.required_wrench(record_of(robot), pose, velocity, acceleration, wind, w)
    weight, size = robot.force_scale, max(1.0, np.abs(lengths).max())
    for row in range(COUNT):
        given = (pose[row], carriers[row])
        np.testing.assert_allclose(A[row], functions["wrench_matrix"](*given).full(), rtol=0, atol=1e-14 * size)
        np.testing.assert_allclose(
            lengths[row], functions["cable_lengths"](*given).full()[:, 0], rtol=0, atol=1e-14 * size
        )
        np.testing.assert_allclose(J[row], by_pose(*given).full(), rtol=0, atol=2e-14 * size)
        owners = carriers[row, robot.carrier_of_cable]
        at = owners[:, :3] + Rotation.from_euler("ZYX", owners[:, 5:2:-1]).apply(robot.anchors)
        np.testing.assert_allclose(anchors[row], at, rtol=0, atol=1e-14 * size)
        expected = Dynamics(robot).required_wrench(
            pose[row], velocity[row], acceleration[row], carriers[row], wind=None if wind is None else wind[row]
        )
        np.testing.assert_allclose(w[row], expected, rtol=1e-14, atol=2e-14 * max(weight, np.abs(expected).max()))


def test_rows_in_lanes_have_the_bits_of_one_pose(robot):
    rng = np.random.default_rng(2)
    pose, velocity, acceleration, carriers = motions(robot, rng)
    together = lines(robot, pose, carriers)
    w = np.empty((COUNT, 6))
    _core.required_wrench(record_of(robot), pose, velocity, acceleration, None, w)
    for row in range(COUNT):
        alone = lines(robot, pose[row : row + 1], carriers[row : row + 1])
        for one, all_rows in zip(alone, together, strict=True):
            np.testing.assert_array_equal(one[0], all_rows[row])
        wrench = np.empty(6)
        _core.required_wrench(record_of(robot), pose[row], velocity[row], acceleration[row], None, wrench)
        np.testing.assert_array_equal(wrench, w[row])


def test_sensitivities_are_slopes_of_the_lengths(robot):
    """Central differences of the record's anchors, attachments and radii."""
    pose, _, _, carriers = motions(robot, np.random.default_rng(3))
    pose, carriers, h = pose[:20], carriers[:20], 1e-5
    exact = lines(robot, pose, carriers)[4]
    names = [("anchor", k) for k in range(3)] + [("attachment", k) for k in range(3)]
    for column, (name, axis) in enumerate([*names, ("radius", None)]):
        if name == "radius" and not robot.pulley_radii.all():
            continue
        found = []
        for sign in (1, -1):
            record = record_of(robot).copy()
            values = record["cable"][name][: robot.m]
            (values if axis is None else values[:, axis])[...] += sign * h
            lengths = np.empty((20, robot.m))
            _core.lines(record, pose, carriers, lengths, None, None, None, None)
            found.append(lengths)
        np.testing.assert_allclose(exact[..., column], (found[0] - found[1]) / (2 * h), atol=1e-5)


@pytest.mark.parametrize(
    ("robot_record", "sizes"),
    [
        (np.zeros(3), (6, 6, 8)),
        ("cogiro", (5, 6, 8)),
        ("cogiro", (6, 12, 8)),
        ("cogiro", (12, 6, 8)),
        ("cogiro", (6, 6, 7)),
    ],
)
def test_arrays_that_do_not_fit_are_refused(robot_record, sizes):
    record = record_of(load(robot_record)) if isinstance(robot_record, str) else robot_record
    poses, carriers, lengths = (np.zeros(size) for size in sizes)
    with pytest.raises(ValueError, match="rows of the sizes that fit it"):
        _core.lines(record, poses, carriers, lengths, None, None, None, None)


def test_a_record_with_a_cable_of_no_carrier_is_refused():
    record = record_of(load("cogiro")).copy()
    record["cable"]["carrier"][3] = 7
    with pytest.raises(ValueError, match="robot's record"):
        _core.lines(record, np.zeros(6), np.zeros(6), np.zeros(8), None, None, None, None)
