"""The mechanics of the core are those of the CasADi model, in lanes as for one pose, at every attitude."""

import subprocess

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Dynamics, available, load
from towline.base.errors import InputError
from towline.core import _core
from towline.models import mechanics
from towline.models.record import RECORD, record_of

from .c_programs import program_of, sources_of, watched_objects

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
    required = Dynamics(robot)._functions.function("required_wrench" if wind is None else "required_wrench_in_wind")
    weight, size = robot.force_scale, max(1.0, np.abs(lengths).max())
    for row in range(0, COUNT, 3):  # of every lane
        given = (pose[row], carriers[row])
        np.testing.assert_allclose(A[row], functions["wrench_matrix"](*given).full(), rtol=0, atol=1e-14 * size)
        np.testing.assert_allclose(
            lengths[row], functions["cable_lengths"](*given).full()[:, 0], rtol=0, atol=1e-14 * size
        )
        np.testing.assert_allclose(J[row], by_pose(*given).full(), rtol=0, atol=2e-14 * size)
        owners = carriers[row, robot.carrier_of_cable]
        at = owners[:, :3] + Rotation.from_euler("ZYX", owners[:, 5:2:-1]).apply(robot.anchors)
        np.testing.assert_allclose(anchors[row], at, rtol=0, atol=1e-14 * size)
        motion = {"pose": pose[row], "velocity": velocity[row], "acceleration": acceleration[row]}
        expected = required(**motion, **({} if wind is None else {"wind": wind[row]}))["w"].full()[:, 0]
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


def symbolic(robot, name, pose, carriers, *others):
    """A method of `Dynamics` by CasADi, row by row: (N, r, c) for each of its outputs."""
    function = Dynamics(robot)._functions.function(name)
    rows = [function.call([pose[k], *(other[k] for other in others), carriers[k]]) for k in range(len(pose))]
    return [np.array([row[i].full() for row in rows]) for i in range(function.n_out())]


def test_points_wrenches_and_their_derivatives_are_those_of_the_symbolic_model(robot):
    rng = np.random.default_rng(5)
    pose, _, _, carriers = motions(robot, rng)
    pose, carriers, dynamics = pose[::3], carriers[::3], Dynamics(robot)
    tensions = rng.uniform(0, robot.force_scale, (len(pose), robot.m))
    size = np.abs(dynamics.cable_lengths(pose, carriers)).max()
    for got, want in zip(dynamics.points(pose, carriers), symbolic(robot, "points", pose, carriers), strict=True):
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-14 * size)
    for name, got in {
        "cable_wrench": dynamics.wrench_matrix(pose, carriers) @ tensions[..., None],
        "wrench_jacobian": dynamics.wrench_jacobian(pose, tensions, carriers),
        "tension_stiffness": dynamics.stiffness(pose, tensions, carriers, elastic=False),
    }.items():
        (want,) = symbolic(robot, name, pose, carriers, tensions)
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-13 * np.abs(want).max())
    if all(cable.stiffness for cable in robot.cables):
        (want,) = symbolic(robot, "stiffness", pose, carriers, tensions)
        got = dynamics.stiffness(pose, tensions, carriers)
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-13 * np.abs(want).max())


def test_columns_by_geometry_are_slopes_of_the_wrench_matrix(robot):
    """Central differences of the record's anchors, attachments and radii."""
    pose, _, _, carriers = motions(robot, np.random.default_rng(6))
    pose, carriers, h = pose[:40], carriers[:40], 1e-5
    exact = mechanics.Mechanics(robot).columns_by_geometry(pose, carriers)
    for column in range(7):
        name, axis = ("anchor", "attachment", "radius")[column // 3], column % 3
        if name == "radius" and not robot.pulley_radii.all():
            continue
        found = []
        for sign in (1, -1):
            record = record_of(robot).copy()
            record["cable"][name].reshape(len(record["cable"]), -1)[: robot.m, axis] += sign * h
            A = np.empty((len(pose), 6, robot.m))
            _core.lines(record, pose, carriers, None, A, None, None, None)
            found.append(A)
        slope = (found[0] - found[1]).swapaxes(1, 2) / (2 * h)
        np.testing.assert_allclose(exact[..., column], slope, atol=1e-6 * max(1, np.abs(slope).max()))


def test_derivatives_of_rows_in_lanes_have_the_bits_of_one_pose(robot):
    rng = np.random.default_rng(7)
    pose, _, _, carriers = motions(robot, rng)
    tensions, numeric = rng.normal(size=(COUNT, robot.m)), mechanics.Mechanics(robot)

    def results(rows):
        some, at, pulls = pose[rows], carriers[rows], tensions[rows]
        yield from numeric.points(some, at)
        yield numeric.columns_by_geometry(some, at)
        yield numeric.wrench_jacobian(some, pulls, at)
        yield numeric.stiffness(some, pulls, at, False)

    together = list(results(slice(None)))
    for row in range(0, COUNT, 20):
        for one, all_rows in zip(results(row), together, strict=True):
            np.testing.assert_array_equal(one, all_rows[row])


def test_results_do_not_depend_on_threads(monkeypatch):
    robot = load("wang-flying")
    rng = np.random.default_rng(8)
    pose, velocity, acceleration, carriers = motions(robot, rng)
    numeric, wind = Dynamics(robot), [1.0, 2.0, 0.5]

    def results():
        yield numeric.wrench_matrix(pose, carriers)
        yield numeric.cable_lengths(pose)
        yield numeric.required_wrench(pose, velocity, acceleration, wind=wind)
        yield numeric.wrench_matrix(pose[:0], carriers[:1])

    alone = list(results())
    monkeypatch.setattr(mechanics, "ROWS_WORTH_A_THREAD", 20)
    monkeypatch.setattr(mechanics.processors, "available", lambda: 7)
    for one, many in zip(alone, results(), strict=True):
        np.testing.assert_array_equal(one, many)


def test_a_robot_beyond_the_core_is_casadis():
    """Of 40 cables, as five copies of each of eight: the columns of the wrench matrix are those of the eight."""
    robot = load("cogiro")
    data = robot.model_dump(mode="json")
    large = type(robot).model_validate(data | {"cables": data["cables"] * 5})
    pose, tensions = robot.home + 0.1 * np.arange(6), np.arange(40.0)
    dynamics, few = Dynamics(large), Dynamics(robot)
    np.testing.assert_allclose(dynamics.wrench_matrix(pose), np.tile(few.wrench_matrix(pose), 5), atol=1e-14)
    np.testing.assert_allclose(dynamics.length_jacobian(pose), np.tile(few.length_jacobian(pose), (5, 1)), atol=1e-13)
    together = few.wrench_jacobian(pose, tensions.reshape(5, 8).sum(axis=0))
    np.testing.assert_allclose(dynamics.wrench_jacobian(pose, tensions), together, atol=1e-12)
    with pytest.raises(InputError, match="must have at most 32 cables, got 40"):
        record_of(large)


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none_are_found_at_any_address(number):
    values = np.random.default_rng(9).normal(size=20)
    assert _core.finite(values)
    assert _core.finite(values[:0])
    assert _core.finite(np.array([1.7e308, -1.7e308, 5e-324, -0.0]))
    for place in range(20):
        wrong = values.copy()
        wrong[place] = number
        assert not _core.finite(wrong)
        moved = np.frombuffer(b"x" + wrong.tobytes(), dtype="i1")[1:]
        assert not _core.finite(moved)


def test_the_extent_of_an_array_is_that_which_numpy_computes():
    values = np.random.default_rng(9).normal(size=21) * 10.0 ** np.arange(-150, 270, 20)
    for count in range(1, 22):
        part = values[:count]
        assert _core.extent(part) == (part.min(), part.max())
        assert _core.extent(np.frombuffer(b"x" + part.tobytes(), dtype="i1")[1:]) == (part.min(), part.max())
    assert _core.extent(values[:0]) == (np.inf, -np.inf)
    with pytest.raises(TypeError):
        _core.extent(None)
    with pytest.raises(ValueError, match="not C-contiguous"):
        _core.extent(values[::2])


@pytest.mark.parametrize(
    ("lanes", "processor"), [(False, 0), *((True, processor) for processor in range(_core.PROCESSOR + 1))]
)
def test_sanitizers_are_silent_and_bits_are_the_same(tmp_path_factory, lanes, processor):
    """Of all results at poses of which some have a number that is none, infinite or huge, with lanes and without.

    The driver says which processor this is, so that each form runs that can.
    """
    program = program_of(
        tmp_path_factory, "core_mechanics.c", watched_objects(tmp_path_factory, sources_of("mechanics"), lanes=lanes)
    )
    for name in ("caroca-pulleys", "wang-ctmrts-6"):
        robot, rng = load(name), np.random.default_rng(11)
        pose, velocity, acceleration, carriers = motions(robot, rng)
        tensions = rng.normal(size=(COUNT, robot.m))
        for array in (pose, velocity, carriers.reshape(COUNT, -1), tensions):
            array[rng.integers(COUNT, size=12), rng.integers(6, size=12) % array.shape[1]] = rng.choice(
                [np.nan, np.inf, -np.inf, 1e300, -1e300], 12
            )
        for rows in (COUNT, 1):
            given = [array[:rows] for array in (pose, velocity, acceleration, carriers, tensions)]
            sent = record_of(robot).tobytes() + b"".join(array.tobytes() for array in given)
            done = subprocess.run([program, str(rows), str(processor)], input=sent, capture_output=True, check=False)
            assert done.returncode == 0, done.stderr.decode()
            record, (m, c) = record_of(robot), (robot.m, given[3])
            of_lines = [np.empty((rows, size * m)) for size in (1, 6, 6, 3, 7)]
            ends, S, D, w = (
                np.empty((2, rows, m, 3)),
                np.empty((rows, 42 * m)),
                np.empty((2, rows, 36)),
                np.empty((rows, 6)),
            )
            _core.lines(record, given[0], c, *of_lines)
            _core.ends(record, given[0], c, *ends)
            distances = np.empty((rows, m * (m - 1) // 2))
            _core.cable_distances(record, given[0], c, distances)
            _core.columns_by_geometry(record, given[0], c, S)
            _core.wrench_by_pose(record, given[0], c, given[4], D[0])
            _core.wrench_by_axes(record, given[0], c, given[4], D[1])
            _core.required_wrench(record, pose[:rows], velocity[:rows], acceleration[:rows], None, w)
            expected = np.concatenate([array.ravel() for array in (*of_lines, ends, S, distances, D, w)])
            np.testing.assert_array_equal(np.frombuffer(done.stdout), expected)


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e308, 1e-308, 0.0])
def test_any_numbers_give_results(number):
    """A record, poses, tensions of any numbers: what is not meant by them is nan, in the rows where they are."""
    robot = load("caroca-pulleys")
    rng = np.random.default_rng(10)
    pose, _, _, carriers = motions(robot, rng)
    pose[3, rng.integers(6)] = carriers[50, 0, 1] = number
    tensions = rng.normal(size=(COUNT, robot.m))
    tensions[90, 2] = number
    A, D = np.empty((COUNT, 6, robot.m)), np.empty((COUNT, 6, 6))
    record = record_of(robot)
    _core.lines(record, pose, carriers, None, A, None, None, None)
    _core.wrench_by_pose(record, pose, carriers, tensions, D)
    untouched = np.delete(np.arange(COUNT), [3, 50, 90])
    assert np.isfinite(A[untouched]).all()
    assert np.isfinite(D[untouched]).all()


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
