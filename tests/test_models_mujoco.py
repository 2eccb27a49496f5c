"""Every library robot with point anchors against MuJoCo: inverse dynamics, tendon Jacobian, coupled accelerations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.export.mjcf import to_mjcf
from towline.models import Dynamics, Robot, available, load
from towline.models.cable import Pulley
from towline.models.part import COORDINATES

mujoco = pytest.importorskip("mujoco", reason="the extra 'mujoco' is not installed")

STATES = 60
POINT_ANCHORED = [name for name in available() if all(cable.pulley is None for cable in load(name).cables)]


def quaternion(angles):
    return Rotation.from_euler("ZYX", angles[..., ::-1]).as_quat(scalar_first=True)


def body_rates(pose, velocity, acceleration):
    """Body rate and its derivative from Euler angles, by complex differences of scipy-free rotation formulas."""
    roll, pitch, _ = pose[3:]
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    P = np.array([[1, 0, -sp], [0, cr, sr * cp], [0, -sr, cr * cp]])
    dr, dp, _ = velocity[3:]
    dP = np.array(
        [[0, 0, -cp * dp], [0, -sr * dr, cr * cp * dr - sr * sp * dp], [0, -cr * dr, -sr * cp * dr - cr * sp * dp]]
    )
    return P @ velocity[3:], dP @ velocity[3:] + P @ acceleration[3:]


class Engine:
    """MuJoCo with the robot's parts at stated coordinates."""

    def __init__(self, robot: Robot):
        self.robot = robot
        self.model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
        self.data = mujoco.MjData(self.model)
        self.platform = [self._address(name) for name in self._joints()]

    def _joints(self):
        dof = self.robot.platform.dof
        return ["platform"] if len(dof) == 6 else list(dof)

    def _address(self, joint):
        index = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        return self.model.jnt_qposadr[index], self.model.jnt_dofadr[index]

    def place(self, joint, pose, velocity, acceleration):
        """Set a free joint to a motion given in Euler angles."""
        q, v = self._address(joint)
        rate, alpha = body_rates(pose, velocity, acceleration)
        self.data.qpos[q : q + 7] = np.concatenate([pose[:3], quaternion(pose[3:])])
        self.data.qvel[v : v + 6] = np.concatenate([velocity[:3], rate])
        self.data.qacc[v : v + 6] = np.concatenate([acceleration[:3], alpha])

    def set_platform(self, pose, velocity, acceleration):
        if len(self.robot.platform.dof) == 6:
            self.place("platform", pose, velocity, acceleration)
            return
        for name in self.robot.platform.dof:
            q, v = self._address(name)
            i = COORDINATES.index(name)
            self.data.qpos[q] = pose[i] - self.robot.home[i]
            self.data.qvel[v], self.data.qacc[v] = velocity[i], acceleration[i]

    def set_carriers(self, carrier_pose, carrier_velocity, carrier_acceleration):
        for index, carrier in enumerate(self.robot.carriers):
            body = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, carrier.name)
            mocap = self.model.body_mocapid[body]
            if carrier.kind == "quadrotor":
                self.place(carrier.name, carrier_pose[index], carrier_velocity[index], carrier_acceleration[index])
            elif mocap >= 0:
                self.data.mocap_pos[mocap] = carrier_pose[index, :3]
                self.data.mocap_quat[mocap] = quaternion(carrier_pose[index, 3:])

    def platform_force(self, generalised, pose):
        """Force and moment about the CoM in {G} from generalised forces of the platform's joints."""
        if len(self.robot.platform.dof) == 6:
            v = self.platform[0][1]
            R = Rotation.from_euler("ZYX", pose[5:2:-1]).as_matrix()
            force, moment = generalised[..., v : v + 3], generalised[..., v + 3 : v + 6] @ R.T
            return np.concatenate([force, moment - np.cross(R @ np.array(self.robot.platform.com), force)], axis=-1)
        return np.stack([generalised[..., v] for _, v in self.platform], axis=-1)

    def tendon_jacobian(self):
        """(m, nv), from MuJoCo's sparse rows."""
        dense = np.zeros((self.model.ntendon, self.model.nv))
        values, columns = np.ravel(self.data.ten_J), np.ravel(self.model.ten_J_colind)
        for row in range(self.model.ntendon):
            start, count = self.model.ten_J_rowadr[row], self.model.ten_J_rownnz[row]
            dense[row, columns[start : start + count]] = values[start : start + count]
        return dense


def random_state(robot, rng):
    """A random motion near home of the coordinates that move, and of the carriers."""
    mask = robot.dof_mask
    span = 0.2 * np.linalg.norm(robot.home_anchors - robot.home[:3], axis=1).min()
    pose = robot.home + mask * rng.normal(size=6) * np.array([span, span, span, 0.3, 0.3, 0.3]) / 2
    velocity, acceleration = mask * rng.normal(size=6), mask * rng.normal(size=6)
    moves = np.array([[carrier.kind != "ground"] for carrier in robot.carriers])
    shift = rng.normal(size=(len(robot.carriers), 6)) * np.array([span, span, span, 0.3, 0.3, 0.3]) / 4
    carriers = robot.carrier_home + moves * shift
    carrier_velocity = moves * rng.normal(size=carriers.shape)
    return pose, velocity, acceleration, carriers, carrier_velocity


def difference(one, other):
    """Largest difference relative to the largest entry."""
    return np.abs(one - other).max() / max(np.abs(other).max(), 1e-300)


@pytest.mark.parametrize("name", POINT_ANCHORED)
def test_wrench_matrix_and_required_wrench(name):
    robot = load(name)
    dynamics, engine = Dynamics(robot), Engine(robot)
    rows = slice(None) if len(robot.platform.dof) == 6 else np.flatnonzero(robot.dof_mask)
    rng = np.random.default_rng(20261121)
    worst = 0.0
    for _ in range(STATES):
        pose, velocity, acceleration, carriers, carrier_velocity = random_state(robot, rng)
        engine.set_carriers(carriers, carrier_velocity, np.zeros_like(carriers))
        engine.set_platform(pose, velocity, acceleration)
        mujoco.mj_inverse(engine.model, engine.data)
        w = dynamics.required_wrench(pose, velocity, acceleration)[rows]
        worst = max(worst, difference(w, engine.platform_force(engine.data.qfrc_inverse, pose)))
        A = dynamics.wrench_matrix(pose, carriers)[rows]
        jacobian = engine.platform_force(engine.tendon_jacobian(), pose)
        worst = max(worst, difference(A, -jacobian.T))
        lengths = dynamics.cable_lengths(pose, carriers)
        worst = max(worst, difference(lengths, np.array(engine.data.ten_length)))
    assert worst < 1e-8


@pytest.mark.parametrize("name", POINT_ANCHORED)
def test_forward_accelerations(name):
    """Platform and quadrotor carriers as one system under random tensions, thrusts and torques."""
    robot = load(name)
    dynamics, engine = Dynamics(robot), Engine(robot)
    rng = np.random.default_rng(20261122)
    flying = [i for i, carrier in enumerate(robot.carriers) if carrier.kind == "quadrotor"]
    worst = 0.0
    for _ in range(STATES):
        pose, velocity, _, carriers, carrier_velocity = random_state(robot, rng)
        tensions = rng.uniform(0.1, 1, size=robot.m) * np.minimum(robot.t_max, 10 * robot.weight)
        thrust, torque = np.zeros(len(robot.carriers)), np.zeros((len(robot.carriers), 3))
        zero = np.zeros_like(carriers)
        engine.set_carriers(carriers, carrier_velocity, zero)
        engine.set_platform(pose, velocity, np.zeros(6))
        for i in flying:
            carrier = robot.carriers[i]
            thrust[i] = rng.uniform(carrier.thrust_min, carrier.thrust_max)
            torque[i] = rng.uniform(-1, 1, size=3) * np.array(carrier.torque_max)
            engine.data.actuator(f"{carrier.name} thrust").ctrl = thrust[i]
            for axis, letter in enumerate("xyz"):
                engine.data.actuator(f"{carrier.name} torque {letter}").ctrl = torque[i, axis]
        engine.model.actuator_ctrllimited[:] = 0
        for i in range(robot.m):
            engine.data.actuator(f"cable{i + 1}").ctrl = tensions[i]
        mujoco.mj_forward(engine.model, engine.data)
        ours, carrier_accelerations = dynamics.coupled_acceleration(
            pose, velocity, carriers, carrier_velocity, tensions, thrust, torque
        )
        theirs = np.array(engine.data.qacc)
        if len(robot.platform.dof) == 6:
            v = engine.platform[0][1]
            mine = np.concatenate([ours[:3], body_rates(pose, velocity, ours)[1]])
            worst = max(worst, difference(mine, theirs[v : v + 6]))
        else:
            rows = [COORDINATES.index(n) for n in robot.platform.dof]
            worst = max(worst, difference(ours[rows], theirs[[v for _, v in engine.platform]]))
        for i in flying:
            v = engine._address(robot.carriers[i].name)[1]
            found = carrier_accelerations[i]
            mine = np.concatenate([found[:3], body_rates(carriers[i], carrier_velocity[i], found)[1]])
            worst = max(worst, difference(mine, theirs[v : v + 6]))
    assert worst < 1e-8


def test_what_mujoco_cannot_express_is_one_line():
    robot = load("nist-robocrane")
    cable = robot.cables[0].model_copy(update={"pulley": Pulley(radius=0.05)})
    with pytest.raises(InputError, match=r"cables\[0\]\.pulley must be null, because MuJoCo's tendons have none"):
        to_mjcf(robot.model_copy(update={"cables": (cable, *robot.cables[1:])}))


def test_what_mujoco_would_refuse_is_refused_with_a_reason():
    robot = load("multi-quadrotor-3")
    data = robot.model_dump(mode="json")
    data["carriers"][0]["name"] = data["cables"][0]["carrier"] = "platform"
    with pytest.raises(InputError, match=r"carriers\[0\]\.name must not be 'platform'"):
        to_mjcf(Robot.model_validate(data))
    data["carriers"][0]["name"] = data["cables"][0]["carrier"] = "anchor1"
    mujoco.MjModel.from_xml_string(to_mjcf(Robot.model_validate(data)))
    platform = robot.platform.model_copy(update={"inertia": (1.0, 1.0, 3.0, 0.0, 0.0, 0.0)})
    with pytest.raises(InputError, match=r"platform\.inertia must have .* none above the sum of the others"):
        to_mjcf(robot.model_copy(update={"platform": platform}))


def test_a_motor_pulls_no_more_than_its_winch():
    """A winch whose motor has 60 N, of which friction takes 8 N, hauls in a cable under at most 52 N."""
    data = load("planar-4").model_dump(mode="json")
    data["cables"][1]["winch"] = {"inertia": 0.1, "friction": 8, "speed_max": 3, "force_max": 60}
    robot = Robot.model_validate(data)
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
    low, first = robot.t_min[0], robot.cables[0].t_max
    assert first > 52
    np.testing.assert_allclose(model.actuator_ctrlrange[:2], [[low, first], [low, 52]])


def test_mujoco_takes_a_point_mass_of_a_microgram():
    robot = load("point-mass-3")
    light = robot.model_copy(update={"platform": robot.platform.model_copy(update={"mass": 1e-9})})
    model = mujoco.MjModel.from_xml_string(to_mjcf(light))
    assert model.body("platform").mass[0] == 1e-9
