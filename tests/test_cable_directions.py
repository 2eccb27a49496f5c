"""Directions of cables in logs: frames, signs and angles, calibration, poses; by a simulation of its own."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Dynamics, load, read_measurements
from towline.base.errors import InputError
from towline.estimation.calibration import Measurements, calibrate
from towline.estimation.calibration.model import Model
from towline.estimation.calibration.normal_equations import NormalEquations
from towline.estimation.calibration.parameters import OF_CABLE, Parameters
from towline.estimation.calibration.sightings import SEEN
from towline.estimation.calibration.solving import model_of
from towline.estimation.logs import names, read_log
from towline.estimation.pose.from_log import poses_from_log

from . import user_recordings as user
from .recorded import motion, stamp
from .warm import towline

NAMES = [f"cable{i + 1}_dir_{axis}" for i in range(2) for axis in "xyz"]
OF_THRUSTS = 0.005 * np.hypot(
    0.6 + 0.2, 0.65 + 0.2
)  # error of the mass [kg] if thrusts are 0.5 % wrong: drone, half load


@pytest.fixture(scope="module")
def recorded():
    return user.team(12)


@pytest.fixture
def robot(tmp_path):
    return user.team_robot(tmp_path)


def test_a_team_from_log_to_replay(recorded, robot, tmp_path):
    """Cables of 0.82 and 0.79 m and a load of 0.4 kg, where the file says 0.8 m and 0.35 kg."""
    user.flight(tmp_path / "flight.csv", recorded, user.directions_of(recorded[2]), NAMES)
    said = towline("log", "flight.csv", "--robot", robot, cwd=tmp_path).stdout
    assert "directions                 cable1_dir_x [1], cable1_dir_y [1]" in said
    options = ("--free", "offsets,mass", "--sigma", "directions=0.01", "--json")
    told = json.loads(towline("calibrate", robot, "flight.csv", *options, cwd=tmp_path).stdout)
    values = {one["name"]: one for one in told["parameters"]}
    for name, truth in (("cables[0].offset", 0.02), ("cables[1].offset", -0.01), ("mass", 0.4)):
        assert abs(values[name]["value"] - truth) < 4 * values[name]["sigma"] + 1e-5
        assert values[name]["sigma"] < (1e-3 if "offset" in name else 1.2 * OF_THRUSTS)
    sigma = ("--sigma", "lengths=0.0005,directions=0.01")
    towline("pose", "team-calibrated.yaml", "--log", "flight.csv", *sigma, cwd=tmp_path)
    poses = np.loadtxt(tmp_path / "flight-poses.csv", delimiter=",", skiprows=1)
    errors = poses[:, 1:4] - recorded[1]
    assert np.abs(errors).max() < 0.03
    upper = np.zeros((len(poses), 6, 6))
    upper[:, *np.triu_indices(6)] = poses[:, 7:28]
    covariance = (upper + np.swapaxes(np.triu(upper, 1), 1, 2))[:, :3, :3]
    inside = np.einsum("ni,ni->n", errors, np.linalg.solve(covariance, errors[..., None])[..., 0]) < 7.815
    assert 0.93 < inside.mean() < 0.975
    assert "1.143 times the file's" in towline("simulate", robot, "flight.csv", cwd=tmp_path).stdout
    assert "PASSED" in towline("simulate", "team-calibrated.yaml", "flight.csv", cwd=tmp_path).stdout


@pytest.mark.parametrize(
    ("frame", "sign", "load_seen", "said"),
    [
        ("world", -1, True, None),
        ("world", 1, True, "in {G} and from the platform to the anchors"),
        ("carrier", -1, True, "in the frames of the carriers and from the anchors to the platform"),
        ("carrier", 1, False, "in the frames of the carriers and from the platform to the anchors"),
    ],
)
def test_frames_and_signs_are_found(frame, sign, load_seen, said, recorded, robot, tmp_path):
    directions = user.directions_of(recorded[2], frame, sign)
    log = user.flight(tmp_path / "flight.csv", recorded, directions, NAMES, load=load_seen)
    read = read_measurements(log, robot=robot)
    truth = np.stack([-q for *_, q in recorded[2]], axis=1)
    np.testing.assert_allclose(read.directions, truth, atol=0.07)
    assert not any("unknown names" in note for note in read_log(log, robot=robot).notes)
    done = towline("pose", robot, "--log", log, cwd=tmp_path).stdout
    assert (said or "") in done
    assert ("look recorded" in done) == (said is not None)


def test_a_load_that_no_camera_sees_is_not_at_rest(recorded, robot, tmp_path):
    """Accelerations of up to 1 m/s^2 are a tenth of the weight: as errors of a rest they would hide the load's mass."""
    log = user.flight(tmp_path / "flight.csv", recorded, user.directions_of(recorded[2]), NAMES, load=False)
    read = read_measurements(log, {"lengths": 1e-3, "directions": 0.01}, robot=robot)
    found = {one["name"]: one for one in calibrate(robot, read, ("offsets", "mass")).to_dict()["parameters"]}
    for name, truth in (("cables[0].offset", 0.02), ("cables[1].offset", -0.01), ("mass", 0.4)):
        assert abs(found[name]["value"] - truth) < 4 * found[name]["sigma"]
    assert found["mass"]["sigma"] == pytest.approx(OF_THRUSTS, rel=0.2)


def test_angles_from_straight_down(recorded, robot, tmp_path):
    d = user.directions_of(recorded[2], noise=0.002)
    angles = np.degrees(np.stack([np.arctan2(d[..., 1], d[..., 0]), np.arccos(-d[..., 2])], axis=2))
    labels = [f"{name}_{i} [deg]" for i in range(2) for name in ("azimuth", "elevation")]
    log = user.flight(tmp_path / "flight.csv", recorded, angles, labels)
    np.testing.assert_allclose(read_measurements(log, robot=robot).directions, d, atol=1e-6)
    assert "with angles from straight down" in towline("pose", robot, "--log", log, cwd=tmp_path).stdout


def test_directions_of_carriers_by_their_topics(recorded, robot, tmp_path):
    """A bag of a flight: poses in /tf, each cable's direction in a topic of its drone, at another rate."""
    from mcap_ros2.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    t, x, drones = recorded
    d = user.directions_of(drones, "carrier", noise=0.002)
    with (tmp_path / "flight.mcap").open("wb") as file:
        writer = Writer(file)
        kinds = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/Vector3Stamped")
        pose, vector = (writer.register_msgdef(kind, store.generate_msgdef(kind, ros_version=2)[0]) for kind in kinds)
        for k in range(0, len(t), 2):
            ns = round((user.EPOCH + t[k]) * 1e9)
            header = {"stamp": stamp(user.EPOCH + t[k]), "frame_id": "map"}
            for name, p, R in (
                ("load", x[k], np.eye(3)),
                *((f"cf{i + 1}", drones[i][0][k], drones[i][1][k]) for i in range(2)),
            ):
                q = dict(zip("xyzw", Rotation.from_matrix(R).as_quat(), strict=True))
                message = {"header": header, "pose": {"position": dict(zip("xyz", p, strict=True)), "orientation": q}}
                writer.write_message(f"/{name}/pose", pose, message, ns, ns)
            for i in range(2) if k % 4 == 0 else ():
                message = {"header": header, "vector": dict(zip("xyz", d[k, i], strict=True))}
                writer.write_message(f"/cf{i + 1}/cable_direction", vector, message, ns, ns)
        writer.finish()
    read = read_measurements(tmp_path / "flight.mcap", robot=robot)
    np.testing.assert_allclose(read.directions[10:-10], d_in_world(drones)[20:-20:2], atol=0.02)
    again = read_measurements(read.save(tmp_path / "again.nc"))
    np.testing.assert_allclose(again.directions, read.directions, rtol=1e-12)


def d_in_world(drones):
    return np.stack([-q for *_, q in drones], axis=1)


def test_azimuths_of_swivels_add_what_lengths_lack(tmp_path):
    """Eight cables with lengths of 50 mm of noise, and swivel angles of 1 mrad."""
    robot, draw = load("cogiro"), np.random.default_rng(0)
    poses = motion(robot, np.arange(0, 10, 0.5))
    u = -np.swapaxes(Dynamics(robot).wrench_matrix(poses)[:, :3], 1, 2)
    azimuth = np.arctan2(u[..., 1], u[..., 0]) + draw.normal(0, 1e-3, u.shape[:2])
    lengths = Dynamics(robot).cable_lengths(poses) + draw.normal(0, 0.05, u.shape[:2])
    header = [*(f"l{i}" for i in range(8)), *(f"swivel_{i} [deg]" for i in range(8))]
    user.write(tmp_path / "log.csv", header, np.hstack([lengths, np.degrees(azimuth)]))
    sigma = {"lengths": 0.05, "directions": 1e-3}
    read = read_measurements(tmp_path / "log.csv", sigma, robot=robot)
    assert np.isnan(read.directions[..., 2]).all()
    better, worse = (
        np.abs(poses_from_log(robot, one, 0.05).estimate.pose - poses)[:, :2].max()
        for one in (read, read.changed(directions=None))
    )
    assert better < 0.03
    assert worse > 2 * better


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("name", ["caroca-pulleys", "flycrane"])
def test_gradients_are_slopes_of_the_cost(name, flat):
    robot, draw = load(name), np.random.default_rng(3)
    count = 5
    poses = robot.home + draw.normal(0, 0.05, (count, 6))
    u = np.array([0.5, 0.4, 0.6]) + draw.normal(0, 0.2, (count, robot.m, 3))
    u /= np.linalg.norm(u, axis=2, keepdims=True)
    u[1, 2] = np.nan
    if flat:
        u[..., 2] = np.nan
    carriers = robot.carrier_home + draw.normal(0, 0.05, (count, *robot.carrier_home.shape))
    lengths = Dynamics(robot).cable_lengths(poses, carriers) + 0.01
    sigma = {"lengths": 0.01, "position": 0.02, "rotation": 0.05, "directions": 0.03}
    given = Measurements(lengths, poses, sigma=sigma, carrier_poses=carriers, directions=u)
    groups = ("anchors", "attachments", "offsets", *(("radii",) if robot.pulley_radii.any() else ()))
    model = Model(Parameters(robot, groups), given, {}, np.ones((robot.m, count)))
    state = model.begin()
    _, derivatives = model.linearised(state)
    e, by_pose = derivatives.directions.residuals, derivatives.directions.poses

    def seen(dx, dq):
        return model.residuals(model.moved(state, dx, dq)).directions

    for i in np.flatnonzero(model.parameters.varies):
        dx = np.zeros_like(state.x)
        dx[i] = 1e-6
        slope = (seen(dx, None) - seen(-dx, None)) / 2e-6
        cable, column = divmod(i, OF_CABLE)
        found = np.zeros_like(e)  # those of other cables do not depend on it
        if column in SEEN:
            found[cable] = derivatives.directions.cables[cable, ..., SEEN.index(column)]
        # Along the horizontal part alone, its size is taken as constant.
        kept = np.ones_like(e, dtype=bool) if not flat else e == 0
        np.testing.assert_allclose(found[kept], slope[kept], atol=2e-4)
    for i in range(6):
        dq = np.zeros((count, 6))
        dq[:, i] = 1e-6
        slope = (seen(np.zeros_like(state.x), dq) - seen(np.zeros_like(state.x), -dq)) / 2e-6
        kept = np.ones_like(e, dtype=bool) if not flat else e == 0
        np.testing.assert_allclose(by_pose[..., i][kept], slope[kept], atol=2e-4)


@pytest.mark.parametrize("known", [True, False])
def test_normal_equations_are_those_of_all_residuals(known):
    """Assembled from blocks of cables, they equal those of the dense Jacobian, by differences, of all residuals."""
    robot, draw, count = load("flycrane"), np.random.default_rng(2), 4
    poses = robot.home + draw.normal(0, 0.05, (count, 6))
    carriers = robot.carrier_home + draw.normal(0, 0.05, (count, *robot.carrier_home.shape))
    u = -np.swapaxes(Dynamics(robot).wrench_matrix(poses, carriers)[:, :3], 1, 2)
    u[2, 1] = np.nan
    lengths = Dynamics(robot).cable_lengths(poses, carriers) + draw.normal(0, 0.01, (count, robot.m))
    sigma = {"lengths": 0.01, "directions": 0.03} | ({} if known else {"position": 0.02, "rotation": 0.05})
    given = Measurements(lengths, poses, sigma=sigma, carrier_poses=carriers, directions=u)
    prior = {"anchors": 0.1, "attachments": 0.1, "offsets": 0.1}
    model = Model(Parameters(robot, tuple(prior)), given, prior, np.ones((robot.m, count)))
    state, varies = model.begin(), model.parameters.varies
    size = int(varies.sum())

    def whole(step):
        dx, dq = np.zeros_like(state.x), None if known else step[size:].reshape(count, 6)
        dx[varies] = step[:size]
        residuals = model.residuals(model.moved(state, dx, dq))
        return np.concatenate([np.ravel(part) for part in residuals])

    zero = np.zeros(size + (0 if known else 6 * count))
    J = np.array([(whole(zero + h) - whole(zero - h)) / 2e-6 for h in 1e-6 * np.eye(len(zero))]).T
    H, g = J.T @ J, J.T @ whole(zero)
    own, poses_too = H[:size, size:], H[size:, size:]
    S = H[:size, :size] - (0 if known else own @ np.linalg.solve(poses_too, own.T))
    b = g[:size] - (0 if known else own @ np.linalg.solve(poses_too, g[size:]))
    equations = NormalEquations.at(model, state, np.ones_like(state.x))
    np.testing.assert_allclose(equations.S, S, rtol=2e-5, atol=2e-5 * np.abs(S).max())
    np.testing.assert_allclose(equations.b, b, rtol=2e-5, atol=2e-5 * np.abs(b).max())


def test_a_clock_offset_moves_carriers_too():
    """Derivatives by the clock of lengths and directions against differences, with carriers that turn."""
    robot, draw = load("flycrane"), np.random.default_rng(5)
    t = np.arange(0, 2, 0.02)
    waves = np.sin(np.multiply.outer(t, draw.uniform(1, 3, (len(robot.carriers) + 1, 6))))
    poses, carriers = robot.home + 0.1 * waves[:, 0], robot.carrier_home + 0.1 * waves[:, 1:]
    lengths = Dynamics(robot).cable_lengths(poses, carriers)
    u = -np.swapaxes(Dynamics(robot).wrench_matrix(poses, carriers)[:, :3], 1, 2)
    sigma = {"lengths": 0.01, "directions": 0.03}
    given = Measurements(lengths, poses, times=t, sigma=sigma, carrier_poses=carriers, directions=u)
    model = model_of(robot, given, ("offsets", "clock"), {})
    clock, states = model.parameters.clock, []
    for offset in (0.01, 0.01 + 1e-5, 0.01 - 1e-5):
        states.append(model.begin())
        states[-1].x[clock] = offset
    _, derivatives = model.linearised(states[0])
    more, less = (model.residuals(state) for state in states[1:])
    inside = slice(3, -3)
    slope = (more.readings - less.readings) / 2e-5
    np.testing.assert_allclose(derivatives.others[:, inside, 0], slope[:, inside], atol=1e-2 * np.abs(slope).max())
    slope = (more.directions - less.directions) / 2e-5
    found = derivatives.directions.robot[..., 0]
    np.testing.assert_allclose(found[:, inside], slope[:, inside], atol=1e-2 * np.abs(slope).max())


def test_wrong_directions_are_one_line(recorded, robot, tmp_path):
    d = user.directions_of(recorded[2])
    path = tmp_path / "flight.csv"
    user.flight(path, recorded, d[:, ::-1], NAMES)
    with pytest.raises(InputError, match="in an order that looks like 2, 1"):
        read_measurements(path, robot=robot)
    draw = np.random.default_rng(0)
    user.flight(path, recorded, draw.normal(size=d.shape), NAMES)
    with pytest.raises(InputError, match=r"agree with the file's, got differences of \d+ deg"):
        read_measurements(path, robot=robot)
    user.flight(path, recorded, d[:, :1], NAMES[:3])
    with pytest.raises(InputError, match="must have x, y, z for each of the 2 cables, got 3 fields"):
        read_measurements(path, robot=robot)
    user.flight(path, recorded, d.reshape(len(d), -1)[:, :5], NAMES[:5])
    with pytest.raises(InputError, match="directions with the same axes for each cable"):
        read_measurements(path, robot=robot)
    with pytest.raises(InputError, match=r"directions must have the shape \(3, 2, 3\), got \(3, 3\)"):
        Measurements(np.ones((3, 2)), directions=np.ones((3, 3)))
    with pytest.raises(
        InputError, match=r"directions must be unit vectors, got \[0.0, 0.0, 3.0\] at sample 1 of cable 2"
    ):
        Measurements(np.ones((2, 2)), directions=[[[1, 0, 0], [1, 0, 0]], [[1, 0, 0], [0, 0, 3]]])


@pytest.mark.parametrize(
    ("name", "role", "which"),
    [
        ("cable1_dir_x", "directions", "1 x"),
        ("q2_z", "directions", "2 z"),
        ("/cables[3].direction.y", "directions", "3 y"),
        ("/cf1/cable_direction/vector.x", "directions", " x"),
        ("directions[0].x", "directions", "0 x"),
        (["swivel_4", "[deg]"][0], "azimuths", "4 swivel"),
        ("winch_2_azimuth", "azimuths", "2 azimuth"),
        ("payload_x", "position", "x"),
        ("ee_z", "position", "z"),
        ("imu.q_x", "quaternion", "x"),
        ("tension_cable_1", "tensions", "1"),
        ("cable_length(4)", "lengths", "4"),
        ("dir_cable1_x", "directions", "1 x"),
        ("speed_winch_1", None, None),
        ("winch_2_velocity", None, None),
        ("qx", "quaternion", "x"),
    ],
)
def test_usual_names(name, role, which):
    found = names.role(name)
    assert (found and found.role, found and found.which) == (role, which)


def test_calibration_without_positions_of_the_load(recorded, robot, tmp_path):
    log = user.flight(tmp_path / "flight.csv", recorded, user.directions_of(recorded[2]), NAMES, load=False)
    sigma = {"lengths": 1e-3, "directions": 0.01}
    result = calibrate(load(robot), read_measurements(log, sigma, robot=robot), ["offsets"])
    for one, truth in zip(result.parameters, (0.02, -0.01), strict=True):
        assert abs(one.value - truth) < 4 * one.sigma
        assert one.sigma < 1e-3
