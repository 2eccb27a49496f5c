"""The mechanics against other derivations: momentum derivatives, scipy's rotations, paper F's relative form."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.models import Dynamics, Robot, available, load, rotation as symbolic_rotation

GENERATOR_SEED = 20261121


def off_centre(robot: Robot) -> Robot:
    """The same robot with its CoM off the platform frame's origin and products of inertia, so that no term vanishes."""
    platform = robot.platform.model_copy(
        update={"com": (0.03, -0.05, 0.08), "inertia": (0.9, 0.7, 1.1, 0.05, -0.08, 0.11)}
    )
    return Robot.model_validate(robot.model_copy(update={"platform": platform}).model_dump())


def polynomial_motion(rng, scale):
    """Coefficients of a smooth random motion (6 coordinates, order 4), and its value and derivatives at 0."""
    coefficients = rng.normal(size=(5, 6)) * np.array([1, 1, 1, 0.4, 0.4, 0.4]) * scale
    return coefficients, coefficients[0], coefficients[1], 2 * coefficients[2]


def pose_at(coefficients, time):
    return sum(c * time**k for k, c in enumerate(coefficients))


def rotation_of(pose):
    return Rotation.from_euler("ZYX", pose[..., [5, 4, 3]]).as_matrix()


def derivative(function, step=2e-3):
    """Eighth-order central difference at 0."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return sum(w * (function(k * step) - function(-k * step)) for k, w in weights.items()) / step


def spin(coefficients, time):
    """Angular velocity in {G} from R' R^T, by differences of scipy's rotation matrices."""
    turned = (
        derivative(lambda s: rotation_of(pose_at(coefficients, time + s))) @ rotation_of(pose_at(coefficients, time)).T
    )
    return np.array([turned[2, 1], turned[0, 2], turned[1, 0]])


def test_rotation_is_scipys():
    angles = np.random.default_rng(1).uniform(-3, 3, size=(200, 3))
    for roll, pitch, yaw in angles:
        ours = symbolic_rotation.rotation(ca.DM([roll, pitch, yaw])).full()
        np.testing.assert_allclose(ours, Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix(), atol=1e-15)


def test_rate_matrix_derivative_and_inverse():
    angles, rates = ca.SX.sym("angles", 3), ca.SX.sym("rates", 3)
    P = symbolic_rotation.rate_matrix(angles)
    by_chain_rule = ca.reshape(ca.jtimes(ca.vec(P), angles, rates), 3, 3)
    inverse = symbolic_rotation.inverse_rate_matrix(angles) @ P
    difference = by_chain_rule - symbolic_rotation.rate_matrix_derivative(angles, rates)
    check = ca.Function("check", [angles, rates], [difference, inverse])
    for values in np.random.default_rng(2).normal(size=(50, 6)):
        zero, identity = check(values[:3], values[3:])
        np.testing.assert_allclose(zero.full(), 0, atol=1e-14)
        np.testing.assert_allclose(identity.full(), np.eye(3), atol=1e-9)


@pytest.mark.parametrize("name", available())
def test_required_wrench_is_the_derivative_of_momentum(name):
    robot = off_centre(load(name))
    dynamics = Dynamics(robot)
    rng = np.random.default_rng(GENERATOR_SEED)
    com = np.array(robot.platform.com)
    for _ in range(8):
        coefficients, pose, velocity, acceleration = polynomial_motion(rng, 1.0)

        def com_at(time, coefficients=coefficients):
            p = pose_at(coefficients, time)
            return p[:3] + rotation_of(p) @ com

        def linear(time, com_at=com_at):
            return robot.platform.mass * derivative(lambda s: com_at(time + s))

        def angular(time, coefficients=coefficients):
            R = rotation_of(pose_at(coefficients, time))
            return R @ robot.inertia @ R.T @ spin(coefficients, time)

        force = derivative(linear) - robot.platform.mass * np.array(robot.gravity)
        expected = np.concatenate([force, derivative(angular)])
        w = dynamics.required_wrench(pose, velocity, acceleration)
        np.testing.assert_allclose(w, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("shift_com", [False, True])
def test_world_and_relative_form_agree_on_random_motions(shift_com):
    """1,000 motions of platform and base with every derivative non-zero; both forms to 1e-9 of the wrench."""
    robot = off_centre(load("wang-flying")) if shift_com else load("wang-flying")
    dynamics = Dynamics(robot)
    rng = np.random.default_rng(GENERATOR_SEED)
    relative = [rng.normal(size=(1000, 6)) for _ in range(3)]
    base = [rng.normal(size=(1000, 6)) for _ in range(3)]
    for motion in (relative, base):
        motion[0][:, 4] = rng.uniform(-1.2, 1.2, size=1000)  # pitch, away from +-90 degrees
    world = dynamics.relative.motion_in_world(*relative, *base)
    usable = np.abs(np.cos(world[0][:, 4])) > 0.05
    assert usable.sum() > 950
    in_G = dynamics.required_wrench(*world)
    in_A = dynamics.relative.required_wrench(*relative, *base)
    R_A = rotation_of(base[0])
    rotated = np.concatenate([np.einsum("nij,nj->ni", R_A, in_A[:, :3]), np.einsum("nij,nj->ni", R_A, in_A[:, 3:])], 1)
    error = np.abs(rotated - in_G).max(axis=1) / np.abs(in_G).max(axis=1)
    assert error[usable].max() < 1e-9

    A_G = dynamics.wrench_matrix(world[0], carrier_pose=base[0][:, None, :])
    A_A = dynamics.relative.wrench_matrix(relative[0])
    rotated = np.concatenate([R_A @ A_A[:, :3], R_A @ A_A[:, 3:]], axis=1)
    np.testing.assert_allclose(rotated[usable], A_G[usable], atol=1e-9)


def test_motion_in_world_by_differences():
    """Position and angles in {G} along a motion, differentiated, are the rates that the chain rule gave."""
    dynamics = Dynamics(load("wang-flying"))
    rng = np.random.default_rng(3)
    for _ in range(20):
        relative = polynomial_motion(rng, 0.5)
        base = polynomial_motion(rng, 0.5)
        zero = np.zeros(6)

        def world_pose(time, relative=relative, base=base):
            return dynamics.relative.motion_in_world(
                pose_at(relative[0], time), zero, zero, pose_at(base[0], time), zero, zero
            )[0]

        _, velocity, acceleration = dynamics.relative.motion_in_world(*relative[1:], *base[1:])
        np.testing.assert_allclose(velocity, derivative(world_pose), rtol=1e-7, atol=1e-7)
        second = derivative(lambda t: derivative(lambda s: world_pose(t + s)))
        np.testing.assert_allclose(acceleration, second, rtol=1e-6, atol=1e-6)


def test_motion_in_world_of_symbols_is_that_of_arrays():
    relative = Dynamics(load("wang-flying")).relative
    symbols = [ca.SX.sym("x", 6) for _ in range(6)]
    motion = list(0.3 * np.random.default_rng(4).normal(size=(6, 6)))
    function = ca.Function("motion", symbols, list(relative.motion_in_world(*symbols)))
    for symbolic, array in zip(function(*motion), relative.motion_in_world(*motion), strict=True):
        np.testing.assert_allclose(symbolic.full().ravel(), array, rtol=1e-12)


def test_printed_angular_acceleration_is_not_in_the_code():
    """Paper F's (31), alpha = dP dTheta + ddTheta, is off by several per cent of the moment; ours is not."""
    robot = load("wang-flying")
    dynamics = Dynamics(robot)
    rng = np.random.default_rng(GENERATOR_SEED)
    coefficients, pose, velocity, acceleration = polynomial_motion(rng, 1.0)
    R = rotation_of(pose)
    angles, rates = ca.DM(pose[3:]), ca.DM(velocity[3:])
    dP = symbolic_rotation.rate_matrix_derivative(angles, rates).full()
    P = symbolic_rotation.rate_matrix(angles).full()
    Omega = P @ velocity[3:]
    printed = R @ (robot.inertia @ (dP @ velocity[3:] + acceleration[3:]) + np.cross(Omega, robot.inertia @ Omega))
    momentum = lambda t: (  # noqa: E731
        (lambda R_t: R_t @ robot.inertia @ R_t.T)(rotation_of(pose_at(coefficients, t))) @ spin(coefficients, t)
    )
    truth = derivative(momentum)
    ours = dynamics.required_wrench(pose, velocity, acceleration)[3:]
    assert np.linalg.norm(ours - truth) < 1e-7 * np.linalg.norm(truth)
    assert np.linalg.norm(printed - truth) > 0.02 * np.linalg.norm(truth)


def test_wrench_matrix_is_the_lengths_derivative():
    """Virtual work: -dl_i = u_i . dB_i, so A^T times a small twist is minus the change of length."""
    for name in available():
        robot = off_centre(load(name))
        dynamics = Dynamics(robot)
        pose = robot.home + np.array([0.05, -0.03, 0.02, 0.1, -0.2, 0.15])
        A = dynamics.wrench_matrix(pose)
        R = rotation_of(pose)
        com = pose[:3] + R @ np.array(robot.platform.com)
        for axis in range(6):
            twist = np.eye(6)[axis]

            def lengths(s, twist=twist, R=R, com=com):
                moved_R = Rotation.from_rotvec(s * twist[3:]).as_matrix() @ R
                moved = com + s * twist[:3] - moved_R @ np.array(robot.platform.com)
                angles = Rotation.from_matrix(moved_R).as_euler("ZYX")[::-1]
                return dynamics.cable_lengths(np.concatenate([moved, angles]))

            np.testing.assert_allclose(-derivative(lengths), A.T @ twist, atol=1e-9)


def test_wrench_matrix_of_paper_f():
    """Singular values at x_b = (0, 0, -1) with crossed pairs, and rank 3 with the printed ones."""
    crossed = Dynamics(load("wang-flying")).relative.wrench_matrix([0, 0, -1, 0, 0, 0])
    expected = [2.19, 0.775, 0.775, 0.387, 0.387, 0.274]
    np.testing.assert_allclose(np.linalg.svd(crossed, compute_uv=False), expected, atol=6e-4)
    printed = Dynamics(load("wang-flying-printed"))
    rng = np.random.default_rng(4)
    level = np.concatenate([rng.uniform([-1, -1, -2], [1, 1, -0.3], size=(50, 3)), np.zeros((50, 3))], axis=1)
    assert (np.linalg.matrix_rank(printed.relative.wrench_matrix(level), tol=1e-9) == 3).all()


def test_circle_of_paper_f_needs_pushing_cables():
    """Tensions that A^-1 w asks for along the circle: -12.2 N to 12.1 N at r = 1 m, and the smallest by radius."""
    dynamics = Dynamics(load("wang-flying"))
    omega = 0.2 * np.pi
    angle = np.linspace(0, 2 * np.pi, 721)
    zero = np.zeros_like(angle)
    for radius, smallest in {0.10: 1.32, 0.20: 0.35, 0.25: -0.17, 1.0: -12.2}.items():
        along, across = radius * np.cos(angle), radius * np.sin(angle)
        pose = np.stack([along, across, zero - 1, zero, zero, zero], axis=-1)
        acceleration = -(omega**2) * np.stack([along, across, zero, zero, zero, zero], axis=-1)
        w = dynamics.required_wrench(pose, np.zeros_like(pose), acceleration)
        t = np.linalg.solve(dynamics.wrench_matrix(pose), w[..., None])[..., 0]
        assert t.min() == pytest.approx(smallest, abs=0.01 if radius < 1 else 0.05)
    assert t.max() == pytest.approx(12.1, abs=0.05)


def test_disturbance_of_a_resting_base_is_the_weight():
    dynamics = Dynamics(load("wang-flying"))
    D_B = dynamics.relative.base_disturbance([0.1, 0.2, -1, 0.1, 0.2, 0.3], np.ones(6))
    np.testing.assert_allclose(D_B, [0, 0, 1.2 * 9.81, 0, 0, 0], atol=1e-14)


def test_wind_blows_along_and_drag_resists():
    """Signed form: the force turns with the wind and is zero when the platform moves with the air."""
    robot = load("wang-flying")
    dynamics = Dynamics(robot)
    pose, still = robot.home, np.zeros(6)
    push = dynamics.aerodynamic_wrench(pose, still, [5, 0, 0])
    assert push[0] == pytest.approx(0.5 * 1.29 * 0.45 * 0.16 * 25)
    assert push[2] == pytest.approx(0.5 * 1.29 * 0.05 * 0.16 * 25)
    np.testing.assert_allclose(dynamics.aerodynamic_wrench(pose, still, [-5, 0, 0])[:2], -push[:2])
    np.testing.assert_allclose(dynamics.aerodynamic_wrench(pose, [5, 2, 0, 0, 0, 0], [5, 2, 0]), 0, atol=1e-15)
    assert dynamics.aerodynamic_wrench(pose, [1, 0, 0, 0, 0, 0], [0, 0, 0])[0] < 0
    aero = robot.platform.aero.model_copy(update={"form": "printed"})
    printed = Dynamics(
        robot.model_copy(update={"platform": robot.platform.model_copy(update={"aero": aero})})
    ).aerodynamic_wrench(pose, still, [-5, 0, 0])
    assert printed[0] == pytest.approx(push[0])


def test_wind_enters_both_forms():
    dynamics = Dynamics(off_centre(load("wang-flying")))
    rng = np.random.default_rng(5)
    relative = [0.4 * rng.normal(size=6) for _ in range(3)]
    base = [0.4 * rng.normal(size=6) for _ in range(3)]
    air = np.array([5.0, -6.0, 2.0])
    in_G = dynamics.required_wrench(*dynamics.relative.motion_in_world(*relative, *base), wind=air)
    in_A = dynamics.relative.required_wrench(*relative, *base, wind=air)
    R_A = rotation_of(base[0])
    np.testing.assert_allclose(np.concatenate([R_A @ in_A[:3], R_A @ in_A[3:]]), in_G, atol=1e-10)


def test_wind_without_aero_is_an_error():
    robot = load("ipanema-1")
    with pytest.raises(InputError, match=r"wind must be left out for robot 'ipanema-1', which has no platform\.aero"):
        Dynamics(robot).required_wrench(robot.home, np.zeros(6), np.zeros(6), wind=[1, 0, 0])


@pytest.mark.parametrize("count", [63, 64, 65, 127, 128, 191])
def test_one_wind_for_any_number_of_poses(count):
    """Rows are evaluated in blocks: each number of them in the last one, also with one argument for all."""
    dynamics, wind = Dynamics(load("wang-flying")), np.array([1.0, 2.0, 0.0])
    motion = np.random.default_rng(0).uniform(-0.5, 0.5, (2, count, 6))
    singly = [dynamics.aerodynamic_wrench(pose, velocity, wind) for pose, velocity in zip(*motion, strict=True)]
    np.testing.assert_array_equal(dynamics.aerodynamic_wrench(*motion, wind), singly)


def test_batches_broadcast_and_equal_single_calls():
    robot = load("wang-ctmrts")
    dynamics = Dynamics(robot)
    rng = np.random.default_rng(6)
    pose = robot.home + 0.1 * rng.normal(size=(4, 1, 6))
    carriers = robot.carrier_home + 0.1 * rng.normal(size=(5, 3, 6))
    A = dynamics.wrench_matrix(pose, carriers)
    assert A.shape == (4, 5, 6, 3)
    lengths = dynamics.cable_lengths(pose, carriers)
    assert lengths.shape == (4, 5, 3)
    for i in range(4):
        for j in range(5):
            np.testing.assert_array_equal(A[i, j], dynamics.wrench_matrix(pose[i, 0], carriers[j]))
            np.testing.assert_array_equal(lengths[i, j], dynamics.cable_lengths(pose[i, 0], carriers[j]))
    assert dynamics.wrench_matrix(np.zeros((0, 6))).shape == (0, 6, 3)


@pytest.mark.parametrize("symbol", [ca.SX, ca.MX])
def test_symbols_in_give_symbols_out(symbol):
    robot = load("wang-flying")
    dynamics = Dynamics(robot)
    pose = symbol.sym("pose", 6)
    A = dynamics.wrench_matrix(pose)
    assert isinstance(A, symbol)
    evaluated = ca.Function("f", [pose], [A])(robot.home).full()
    np.testing.assert_allclose(evaluated, dynamics.wrench_matrix(robot.home), rtol=1e-15)


def test_wrong_symbols_are_named():
    dynamics = Dynamics(load("wang-flying"))
    pose = ca.MX.sym("pose", 6)
    for arguments, message in (
        ({"pose": ca.MX.sym("x")}, r"pose must have the shape \(6, 1\), got an expression of shape \(1, 1\)"),
        ({"pose": pose, "carrier_pose": ca.SX.sym("c", 1, 6)}, "SX and MX in one call"),
        (
            {"pose": pose, "carrier_pose": np.zeros((4, 1, 6))},
            "carrier_pose must have the shape .* with expressions, got",
        ),
        ({"pose": pose, "carrier_pose": np.full((1, 6), np.nan)}, "carrier_pose must be finite numbers, got nan"),
    ):
        with pytest.raises(InputError, match=message):
            dynamics.wrench_matrix(**arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"pose": [0, 0, 1]}, r"pose must have the shape \(\.\.\., 6\), got \(3,\)"),
        ({"pose": [0, 0, np.nan, 0, 0, 0]}, r"pose must be finite numbers, got nan at index \(2,\)"),
        ({"pose": "home"}, r"pose must be numbers of shape .*, got 'home'"),
        (
            {"pose": np.zeros(6), "carrier_pose": np.zeros(6)},
            r"carrier_pose must have the shape \(\.\.\., 1, 6\), got \(6,\)",
        ),
        (
            {"pose": np.zeros((2, 6)), "carrier_pose": np.zeros((3, 1, 6))},
            "must have leading dimensions that are equal or 1",
        ),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    with pytest.raises(InputError, match=message):
        Dynamics(load("wang-flying")).wrench_matrix(**arguments)


def test_relative_form_needs_one_carrier():
    with pytest.raises(InputError, match=r"requires a robot with one carrier, got .* with 3"):
        _ = Dynamics(load("wang-ctmrts")).relative


def test_pulleys_lead_the_cables():
    """A robot with pulleys: lengths' derivatives are -A, also for carriers that turn; r -> 0 is the point anchor."""
    robot = load("caroca-pulleys")
    dynamics = Dynamics(robot)
    pose = robot.home + np.array([0.1, -0.2, 0.1, 0.05, -0.1, 0.15])
    carriers = robot.carrier_home + np.array([0.1, 0.2, -0.1, 0.1, -0.05, 0.2])
    A = dynamics.wrench_matrix(pose, carriers)
    R = rotation_of(pose)
    for axis in range(6):
        twist = np.eye(6)[axis]

        def lengths(s, twist=twist):
            moved = Rotation.from_rotvec(s * twist[3:]).as_matrix() @ R
            angles = Rotation.from_matrix(moved).as_euler("ZYX")[::-1]
            com = pose[:3] + R @ np.array(robot.platform.com) + s * twist[:3]
            return dynamics.cable_lengths(
                np.concatenate([com - moved @ np.array(robot.platform.com), angles]), carriers
            )

        np.testing.assert_allclose(-derivative(lengths), A.T @ twist, atol=1e-8)
    cables = [c.model_copy(update={"pulley": c.pulley.model_copy(update={"radius": 1e-9})}) for c in robot.cables]
    points = [c.model_copy(update={"pulley": None}) for c in robot.cables]
    small = Dynamics(robot.model_copy(update={"cables": tuple(cables)})).wrench_matrix(pose)
    bare = Dynamics(robot.model_copy(update={"cables": tuple(points)})).wrench_matrix(pose)
    np.testing.assert_allclose(small, bare, atol=1e-8)


@pytest.mark.parametrize("name", ["cogiro", "caroca-pulleys", "wang-ctmrts", "flycrane", "planar-4"])
def test_points_are_where_scipy_puts_them(name):
    """Anchors and attachments in {G}: arrays with batch dimensions and symbols agree with scipy's rotations."""
    robot = load(name)
    dynamics = Dynamics(robot)
    rng = np.random.default_rng(GENERATOR_SEED)
    pose = robot.home + rng.normal(size=(3, 1, 6))
    carriers = robot.carrier_home + rng.normal(size=(1, 4, len(robot.carriers), 6))
    anchors, attachments = dynamics.points(pose, carriers)
    assert anchors.shape == attachments.shape == (3, 4, robot.m, 3)
    p, c = ca.SX.sym("pose", 6), ca.SX.sym("carriers", len(robot.carriers), 6)
    symbolic = ca.Function("points", [p, c], list(dynamics.points(p, c)))
    for i, j in np.ndindex(3, 4):
        at, frames = pose[i, 0], carriers[0, j][robot.carrier_of_cable]
        on_platform = robot.attachments @ rotation_of(at).T + at[:3]
        on_carriers = np.einsum("mij,mj->mi", rotation_of(frames), robot.anchors) + frames[:, :3]
        np.testing.assert_allclose(attachments[i, j], on_platform, atol=1e-12)
        np.testing.assert_allclose(anchors[i, j], on_carriers, atol=1e-12)
        for ours, theirs in zip(symbolic(at, carriers[0, j]), (on_carriers, on_platform), strict=True):
            np.testing.assert_allclose(ours.full(), theirs, atol=1e-12)
    anchors, attachments = dynamics.points(robot.home)
    np.testing.assert_array_equal(anchors, robot.home_anchors)
    np.testing.assert_array_equal(attachments, robot.home_attachments)


@pytest.mark.parametrize("name", ["caroca-pulleys", "cogiro", "wang-flying"])
def test_a_cable_pulls_from_its_attachment_to_its_exit(name):
    robot = load(name)
    dynamics = Dynamics(robot)
    pose = robot.home + np.random.default_rng(GENERATOR_SEED).uniform(-0.05, 0.05, size=(7, 6))
    along = dynamics.exits(pose) - dynamics.points(pose)[1]
    directions = np.moveaxis(dynamics.wrench_matrix(pose)[..., :3, :], -1, -2)
    np.testing.assert_allclose(along / np.linalg.norm(along, axis=-1, keepdims=True), directions, atol=1e-12)


def test_points_refuse_what_does_not_fit():
    dynamics = Dynamics("wang-ctmrts")
    for arguments in ((np.zeros(5),), ("home",), (np.full(6, np.nan),), (np.zeros((2, 6)), np.zeros((5, 3, 6)))):
        with pytest.raises(InputError) as caught:
            dynamics.points(*arguments)
        assert "\n" not in str(caught.value)


def test_dynamics_load_a_robot_by_name_and_refuse_what_is_none(tmp_path):
    assert Dynamics("cogiro").robot == load("cogiro")
    for wrong in (3, None, {"name": "x"}, "cogyro", tmp_path / "none.yaml"):
        with pytest.raises(InputError, match=r"robot|none\.yaml") as caught:
            Dynamics(wrong)
        assert "\n" not in str(caught.value)
