"""Forward dynamics, stiffness, frequencies and rest poses against formulas of textbooks and against differences."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.models import Dynamics, Robot, load, points
from towline.statics.equilibria import equilibria

from .framed import framed

GRAVITY = 9.81


def hanging(cables, mass=2.0, inertia=(0.3, 0.2, 0.4, 0, 0, 0), **platform):
    """A platform under ground cables, given as (anchor, attachment) pairs."""
    return framed(cables, {"mass": mass, "inertia": inertia, **platform}, stiffness=1e4)


def test_acceleration_inverts_the_required_wrench():
    robot = load("wang-flying")
    platform = robot.platform.model_copy(
        update={"com": (0.03, -0.05, 0.08), "inertia": (0.9, 0.7, 1.1, 0.05, -0.08, 0.11)}
    )
    dynamics = Dynamics(robot.model_copy(update={"platform": platform}))
    rng = np.random.default_rng(1)
    pose = robot.home + 0.1 * rng.normal(size=(50, 6))
    velocity, acceleration = rng.normal(size=(2, 50, 6))
    for air in (None, [3.0, -2.0, 1.0]):
        w = dynamics.required_wrench(pose, velocity, acceleration, wind=air)
        tensions = np.linalg.solve(dynamics.wrench_matrix(pose), w[..., None])[..., 0]
        found = dynamics.acceleration(pose, velocity, tensions, wind=air)
        np.testing.assert_allclose(found, acceleration, rtol=1e-9, atol=1e-9)


def test_a_point_mass_does_not_turn():
    robot = hanging([([1, 0, 2], [0, 0, 0]), ([-1, 0, 2], [0, 0, 0])], inertia=None, dof=["x", "y", "z"])
    found = Dynamics(robot).acceleration(np.zeros(6), np.zeros(6), [3.0, 0.0])
    along = np.array([1, 0, 2]) / np.sqrt(5)
    np.testing.assert_allclose(found, [*(3 * along / 2 - [0, 0, GRAVITY]), 0, 0, 0], atol=1e-14)


def test_free_flight_conserves_energy_and_momentum():
    """No tension: a torque-free body, integrated for a while, keeps its angular momentum and its energy."""
    robot = load("wang-ctmrts")
    dynamics = Dynamics(robot)
    start = np.concatenate([robot.home, [0.5, 0.2, 3.0, 1.0, 0.8, -1.2]])

    def rate(_, state):
        return np.concatenate([state[6:], dynamics.acceleration(state[:6], state[6:], np.zeros(3))])

    def invariants(state):
        R = Rotation.from_euler("ZYX", state[5:2:-1]).as_matrix()
        roll, pitch = state[3:5]
        P = np.array(
            [
                [1, 0, -np.sin(pitch)],
                [0, np.cos(roll), np.sin(roll) * np.cos(pitch)],
                [0, -np.sin(roll), np.cos(roll) * np.cos(pitch)],
            ]
        )
        omega = P @ state[9:]
        energy = 5 * state[6:9] @ state[6:9] + 98.1 * state[2] + omega @ robot.inertia @ omega / 2
        return np.append(R @ robot.inertia @ omega, energy)

    end = solve_ivp(rate, (0, 0.6), start, rtol=1e-11, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(invariants(end), invariants(start), rtol=1e-7, atol=1e-8)


def test_linearisation_by_differences():
    robot = load("ipanema-1")
    dynamics = Dynamics(robot)
    rng = np.random.default_rng(2)
    pose, velocity = robot.home + 0.1 * rng.normal(size=6), rng.normal(size=6)
    tensions = rng.uniform(50, 100, size=8)
    A, B = dynamics.linearise(pose, velocity, tensions)
    h = 1e-6

    def rate(state, t):
        return np.concatenate([state[6:], dynamics.acceleration(state[:6], state[6:], t)])

    state = np.concatenate([pose, velocity])
    for i, step in enumerate(h * np.eye(12)):
        column = (rate(state + step, tensions) - rate(state - step, tensions)) / (2 * h)
        np.testing.assert_allclose(A[:, i], column, rtol=1e-6, atol=1e-4 * np.abs(A).max() * 1e-2)
    for i, step in enumerate(np.eye(8)):
        np.testing.assert_allclose(B[:, i], rate(state, tensions + step) - rate(state, tensions), atol=1e-9)


def test_quadrotor_feels_what_the_platform_feels():
    """Inside forces cancel: without gravity and thrust the common CoM of both does not accelerate."""
    robot = load("wang-flying")
    quad = {
        "name": "quad",
        "kind": "quadrotor",
        "mass": 2.5,
        "inertia": [0.03, 0.03, 0.05, 0, 0, 0],
        "thrust_max": 60,
        "torque_max": [2, 2, 1],
    }
    data = robot.model_dump(mode="json")
    coupled = Robot.model_validate({**data, "carriers": [quad], "gravity": [0, 0, 0]})
    dynamics = Dynamics(coupled)
    rng = np.random.default_rng(3)
    tensions = rng.uniform(1, 5, size=6)
    state = (robot.home, rng.normal(size=6), 0.1 * rng.normal(size=(1, 6)), rng.normal(size=(1, 6)))
    platform, carrier = dynamics.coupled_acceleration(*state, tensions, [0.0], np.zeros((1, 3)))
    np.testing.assert_allclose(1.2 * platform[:3] + 2.5 * carrier[0, :3], 0, atol=1e-12)
    lifted, thrusting = dynamics.coupled_acceleration(*state, tensions, [10.0], np.zeros((1, 3)))
    z_axis = Rotation.from_euler("ZYX", state[2][0, 5:2:-1]).as_matrix()[:, 2]
    np.testing.assert_allclose(lifted, platform)
    np.testing.assert_allclose(thrusting[0, :3] - carrier[0, :3], 10 * z_axis / 2.5, atol=1e-12)


def test_stiffness_is_how_elastic_cables_pull_back():
    """Displace the platform, stretch each cable by Hooke's law: the change of wrench is -K delta."""
    robot = load("wang-flying")
    dynamics = Dynamics(robot)
    rng = np.random.default_rng(4)
    pose = robot.home + 0.05 * rng.normal(size=6)
    tensions = rng.uniform(2, 4, size=6)
    lengths = dynamics.cable_lengths(pose)
    EA = 13000.0
    unstrained = lengths / (1 + tensions / EA)
    R = Rotation.from_euler("ZYX", pose[5:2:-1])

    def wrench(delta, elastic):
        turned = (Rotation.from_rotvec(delta[3:]) * R).as_euler("ZYX")[::-1]
        moved = np.concatenate([pose[:3] + delta[:3], turned])
        t = EA * (dynamics.cable_lengths(moved) / unstrained - 1) if elastic else tensions
        return dynamics.wrench_matrix(moved) @ t

    for elastic in (True, False):
        K = dynamics.stiffness(pose, tensions, elastic=elastic)
        for i, step in enumerate(1e-6 * np.eye(6)):
            column = -(wrench(step, elastic) - wrench(-step, elastic)) / 2e-6
            np.testing.assert_allclose(K[:, i], column, rtol=1e-6, atol=1e-6 * np.abs(K).max())


def test_stiffness_needs_elastic_cables():
    robot = load("ipanema-1")
    with pytest.raises(InputError, match=r"cables\[0\]\.stiffness must be E A > 0 \[N\]"):
        Dynamics(robot).stiffness(robot.home, np.ones(8))


def test_pendulum():
    """A point mass on one cable swings with sqrt(g / L) / 2 pi both ways."""
    length = 1.7
    robot = hanging([([0, 0, 0], [0, 0, 0])], inertia=None, dof=["x", "y", "z"], home=[0, 0, -length, 0, 0, 0])
    f, modes = Dynamics(robot).natural_frequencies(robot.home, [2 * GRAVITY])
    np.testing.assert_allclose(f, np.sqrt(GRAVITY / length) / (2 * np.pi), rtol=1e-12)
    np.testing.assert_allclose(modes[2], 0, atol=1e-12)


def test_bifilar_pendulum():
    """Two parallel cables at +-b: yaw frequency b sqrt(m g / (I L)) / 2 pi, swaying sqrt(g / L) / 2 pi."""
    b, length, inertia = 0.4, 1.5, 0.4
    robot = hanging([([b, 0, 0], [b, 0, 0]), ([-b, 0, 0], [-b, 0, 0])], home=[0, 0, -length, 0, 0, 0])
    f, _ = Dynamics(robot).natural_frequencies(robot.home, [GRAVITY, GRAVITY])
    yaw = b * np.sqrt(2 * GRAVITY / (inertia * length)) / (2 * np.pi)
    sway = np.sqrt(GRAVITY / length) / (2 * np.pi)
    # Roll about the line of attachments is neutral: the CoM lies on it.
    np.testing.assert_allclose(np.sort(f), np.sort([0, sway, sway, yaw]), atol=1e-6)


def test_bouncing_on_an_elastic_cable():
    length, mass = 1.5, 2.0
    robot = hanging([([0, 0, 0], [0, 0, 0])], inertia=None, dof=["x", "y", "z"], home=[0, 0, -length, 0, 0, 0])
    f, _ = Dynamics(robot).natural_frequencies(robot.home, [mass * GRAVITY], elastic=True)
    k = 1e4 / (length / (1 + mass * GRAVITY / 1e4))
    assert f[-1] == pytest.approx(np.sqrt(k / mass) / (2 * np.pi))
    assert f[0] == pytest.approx(np.sqrt(GRAVITY / length) / (2 * np.pi))


def test_upright_is_unstable():
    """A CoM above its two attachments falls over: a negative frequency."""
    robot = hanging(
        [([0.4, 0, 0], [0.4, 0, 0]), ([-0.4, 0, 0], [-0.4, 0, 0])], com=[0, 0, 0.2], home=[0, 0, -1, 0, 0, 0]
    )
    f, _ = Dynamics(robot).natural_frequencies(robot.home, [GRAVITY, GRAVITY])
    assert f[0] < -0.1


def test_held_on_all_sides_nothing_moves():
    robot = load("wang-flying")
    f, modes = Dynamics(robot).natural_frequencies(robot.home, np.full(6, 2.2))
    assert f.shape == (0,)
    assert modes.shape == (6, 0)


def test_rest_of_a_point_mass_on_two_cables():
    """Lengths 3 and 4 over a span of 5: a right angle, so the tensions are the weight's components along them."""
    robot = hanging([([0, 0, 0], [0, 0, 0]), ([5, 0, 0], [0, 0, 0])], inertia=None, dof=["x", "y", "z"])
    (rest,) = equilibria(robot, [3.0, 4.0])
    np.testing.assert_allclose(rest.pose[:3], [9 / 5, 0, -12 / 5], atol=1e-7)
    np.testing.assert_allclose(rest.tensions, [2 * GRAVITY * 4 / 5, 2 * GRAVITY * 3 / 5], rtol=1e-6)
    assert rest.slack.size == 0


def test_a_long_cable_hangs_slack():
    robot = hanging([([0, 0, 0], [0, 0, 0]), ([1, 0, 0], [0, 0, 0])], inertia=None, dof=["x", "y", "z"])
    (rest,) = equilibria(robot, [2.0, 9.0])
    np.testing.assert_allclose(rest.pose[:3], [0, 0, -2], atol=1e-6)
    assert rest.slack.tolist() == [1]
    assert rest.tensions[0] == pytest.approx(2 * GRAVITY, rel=1e-6)


@pytest.mark.parametrize(("size", "mass"), [(1e-4, 1e-10), (100.0, 1e4)])
def test_rest_poses_do_not_depend_on_the_scale(size, mass):
    """A robot of any size rests as the large one does: 3, 4, 5 again, and a platform below two crossed cables."""
    point = hanging([([0, 0, 0], [0, 0, 0]), ([5 * size, 0, 0], [0, 0, 0])], mass, None, dof=["x", "y", "z"])
    (rest,) = equilibria(point, [3 * size, 4 * size], starts=4)
    np.testing.assert_allclose(rest.pose[:3] / size, [9 / 5, 0, -12 / 5], atol=1e-7)
    np.testing.assert_allclose(rest.tensions / (mass * GRAVITY), [4 / 5, 3 / 5], rtol=1e-6)

    def crossed(s, m):
        cables = [([s, 0, s], [-0.2 * s, 0, 0]), ([-s, 0, s], [0.2 * s, 0, 0])]
        inertia = tuple(m * s**2 * np.array([0.1, 0.2, 0.1, 0, 0, 0]))
        return equilibria(hanging(cables, m, inertia, dof=["x", "z", "pitch"]), np.full(2, 1.8 * s), starts=6)

    for one, other in zip(crossed(size, mass), crossed(1.0, 2.0), strict=True):
        np.testing.assert_allclose(one.energy / (mass * size), other.energy / 2, rtol=1e-6)
        np.testing.assert_allclose(one.tensions / mass, other.tensions / 2, rtol=1e-5)


def test_rest_poses_of_a_robot_from_its_own_lengths():
    """Forward statics of the lengths at a known equilibrium finds it again, and others beside it."""
    robot = load("wang-flying")
    dynamics = Dynamics(robot)
    found = equilibria(robot, dynamics.cable_lengths(robot.home))
    np.testing.assert_allclose(found[0].pose, robot.home, atol=1e-6)
    np.testing.assert_allclose(found[0].tensions, 2.19401594, rtol=1e-6)
    assert len(found) > 1
    assert np.all(np.diff([rest.energy for rest in found]) >= 0)
    for rest in found:
        assert (rest.lengths <= dynamics.cable_lengths(robot.home) + 1e-7).all()
        w = dynamics.required_wrench(rest.pose, np.zeros(6), np.zeros(6))
        np.testing.assert_allclose(dynamics.wrench_matrix(rest.pose) @ rest.tensions, w, atol=1e-5)


def test_three_robots_hold_the_load_at_rest():
    """Paper C's robot with fixed lengths: the rest pose has three taut cables and three slow swinging modes."""
    robot = load("wang-ctmrts")
    (rest, *_) = equilibria(robot, np.full(3, 1.2))
    assert (rest.tensions > 0).all()
    f, _ = Dynamics(robot).natural_frequencies(rest.pose, rest.tensions)
    assert len(f) == 3
    assert (f > 0).all()


def test_wrong_lengths_are_named():
    robot = load("wang-ctmrts")
    for lengths, message in (
        ([1.0, 1.0], r"lengths must be an array of shape \(3,\) of finite numbers, got"),
        ([1.0, np.nan, 1.0], r"lengths must be an array of shape \(3,\) of finite numbers, got"),
        ([1.0, -1.0, 1.0], r"lengths must be numbers > 0 \[m\], got -1"),
    ):
        with pytest.raises(InputError, match=message):
            equilibria(robot, lengths)
    # Cables too short to meet: no equilibrium, and no exception.
    assert equilibria(robot, np.full(3, 0.2), starts=4) == []


def test_a_top_heavy_platform_is_not_reported_upright():
    """Saddles, which symmetric starts find first, are left; what is reported is stable."""
    one = hanging([([0, 0, 1], [0, 0, -0.1])], com=[0, 0, 0.1], home=[0, 0, 0.1, 0, 0, 0])
    for starts in (1, 8):
        (rest,) = equilibria(one, [1.0], starts=starts)  # turned about the vertical it is the same rest
        assert rest.neutral
        # The CoM hangs straight below: 1 m of cable and 0.2 m from attachment to CoM under the anchor.
        assert rest.energy == pytest.approx(2 * GRAVITY * (1 - 1 - 0.2), rel=1e-6)
    two = hanging([([1, 0, 1], [0.1, 0, -0.1]), ([-1, 0, 1], [-0.1, 0, -0.1])], com=[0, 0, 0.2])
    for rest in equilibria(two, [1.5, 1.5], starts=8):
        f, _ = Dynamics(two).natural_frequencies(rest.pose, rest.tensions)
        assert f[0] > -1e-3


def test_slack_cables_have_no_stiffness():
    robot = load("wang-flying")
    dynamics = Dynamics(robot)
    tensions = np.array([3.0, 3, 3, 3, 3, 0])
    five = Dynamics(robot.model_copy(update={"cables": robot.cables[:5]}))
    expected = five.stiffness(robot.home, tensions[:5])
    np.testing.assert_allclose(dynamics.stiffness(robot.home, tensions), expected, rtol=1e-12, atol=1e-9)


def test_pulleys_under_a_quadrotor_keep_the_angular_momentum():
    """Inside forces make no moment: about any point the rates of angular momentum of both bodies cancel."""
    data = load("multi-quadrotor-3").model_dump(mode="json")
    data |= {"gravity": [0, 0, 0], "carriers": data["carriers"][:1]}
    for index, cable in enumerate(data["cables"]):
        cable |= {"carrier": data["carriers"][0]["name"], "pulley": {"radius": 0.03}}
        cable["anchor"] = [0.1 * np.cos(2 * index), 0.1 * np.sin(2 * index), -0.05]
    robot = Robot.model_validate(data)
    dynamics, quad = Dynamics(robot), robot.carriers[0]
    zero = np.zeros(6)
    platform, carrier = dynamics.coupled_acceleration(
        robot.home, zero, robot.carrier_home, np.zeros((1, 6)), [3.0, 4.0, 5.0], [0.0], np.zeros((1, 3))
    )
    moments = []
    for pose, acceleration, mass, inertia in (
        (robot.home, platform, robot.platform.mass, robot.inertia),
        (robot.carrier_home[0], carrier[0], quad.mass, np.diag(quad.inertia[:3])),
    ):
        R = Rotation.from_euler("ZYX", pose[5:2:-1]).as_matrix()
        roll, pitch = pose[3:5]
        P = np.array(
            [
                [1, 0, -np.sin(pitch)],
                [0, np.cos(roll), np.sin(roll) * np.cos(pitch)],
                [0, -np.sin(roll), np.cos(roll) * np.cos(pitch)],
            ]
        )
        moments.append(np.cross(pose[:3], mass * acceleration[:3]) + R @ inertia @ P @ acceleration[3:])
    assert np.linalg.norm(moments[0]) > 0.1
    np.testing.assert_allclose(sum(moments), 0, atol=1e-12)


def test_only_dof_whose_equations_are_the_wrench_rows():
    for dof in (["pitch"], ["x", "yaw"], ["roll", "pitch", "yaw"], ["x", "y", "z", "roll", "pitch"]):
        with pytest.raises(InputError, match=r"platform\.dof must be any of x, y, z; or"):
            hanging([([0, 0, 1], [0.1, 0, 0])], dof=dof)
    with pytest.raises(InputError, match=r"home must have 0 rad for roll, yaw, which cannot move, got 0\.1, 0"):
        hanging([([0, 0, 1], [0.1, 0, 0])], dof=["x", "z", "pitch"], home=[0, 0, 0, 0.1, 0, 0])


def test_a_turn_about_a_point_leaves_it_where_the_displacement_takes_it():
    rng = np.random.default_rng(3)
    pose, step, point = rng.uniform(-1, 1, (4, 1, 6)), rng.uniform(-1, 1, (5, 6)), rng.uniform(-1, 1, 3)
    after = points.moved(pose, step, point)
    arrived = points.placed(pose, point[None])[..., 0, :] + step[:, :3]
    np.testing.assert_allclose(points.placed(after, point[None])[..., 0, :], arrived, atol=1e-12)
    turned = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ points.rotations(pose[..., 3:])
    np.testing.assert_allclose(points.rotations(after[..., 3:]), turned, atol=1e-12)
