"""The robots that ship with towline: each is there whole, comes from somewhere, and stands still as its file says."""

import numpy as np
import pytest

from towline.models import Dynamics, Robot, available, load
from towline.models.caspr import read_caspr
from towline.models.diagnosis import diagnose
from towline.models.library import FOLDER
from towline.models.parsing import parse_yaml, to_yaml
from towline.solvers import TensionProblem, solve
from towline.statics.distribution import pose_problem

from .caspr_xml import REAL

G = 9.81

# Cables, kinds of carriers, rank of the wrench matrix at home in the rows of its coordinates, and whether tensions
# within the limits carry the platform at home, everything at rest.
ROBOTS = {
    "acrobot": (8, {"ground"}, 6, "optimal"),
    "caroca": (8, {"ground"}, 6, "optimal"),
    "caroca-pulleys": (8, {"ground"}, 6, "optimal"),
    "cogiro": (8, {"ground"}, 6, "optimal"),
    "example-spatial": (7, {"ground"}, 6, "optimal"),
    "fast": (6, {"ground"}, 6, "infeasible"),  # six times 120 kN lift more than its weight of 295 kN at 100 m
    "flycrane": (6, {"quadrotor"}, 6, "optimal"),
    "ipanema-1": (8, {"ground"}, 6, "optimal"),
    "ipanema-1-iros": (8, {"ground"}, 6, "optimal"),
    "ipanema-2": (8, {"ground"}, 6, "optimal"),
    "multi-quadrotor-3": (3, {"quadrotor"}, 3, "optimal"),
    "multi-quadrotor-4": (4, {"quadrotor"}, 4, "optimal"),
    "multi-quadrotor-6": (6, {"quadrotor"}, 6, "optimal"),
    "nist-robocrane": (6, {"ground"}, 6, "optimal"),
    "planar-4": (4, {"ground"}, 3, "optimal"),
    "point-mass-3": (3, {"ground"}, 3, "optimal"),
    "the-cable-robot-simulator": (8, {"ground"}, 6, "optimal"),
    "wang-ctmrts": (3, {"mobile"}, 3, "singular"),  # its home is near a posture of equilibrium, not at one
    "wang-ctmrts-4": (4, {"mobile"}, 3, "optimal"),
    "wang-ctmrts-5": (5, {"mobile"}, 3, "optimal"),
    "wang-ctmrts-6": (6, {"mobile"}, 3, "optimal"),
    "wang-flying": (6, {"prescribed"}, 6, "optimal"),
    "wang-flying-printed": (6, {"prescribed"}, 3, "optimal"),
    "wang-flying-quadrotor": (6, {"quadrotor"}, 6, "optimal"),
}
# Robots of CASPR: its folder, and the cable set if it is not the default.
CASPR = {
    "acrobot": ("ACROBOT", None),
    "caroca": ("CAROCA", None),
    "caroca-pulleys": ("CAROCA", "with_rotating_pulleys"),
    "cogiro": ("CoGiRo", None),
    "example-spatial": ("Example_spatial", None),
    "fast": ("FAST", None),
    "ipanema-1": ("IPAnema_1", None),
    "ipanema-1-iros": ("IPAnema_1", "IROS_CASPR_2016"),
    "ipanema-2": ("IPAnema_2", None),
    "nist-robocrane": ("NIST_ROBOCRANE", None),
    "the-cable-robot-simulator": ("The_Cable_Robot_Simulator", None),
}


def at_rest(robot, pose=None):
    """The problem of carrying the platform with everything at rest, in the rows of its coordinates."""
    dynamics = Dynamics(robot)
    where = robot.home if pose is None else np.asarray(pose, dtype=float)
    rows = np.flatnonzero(robot.dof_mask)
    w = dynamics.required_wrench(where, np.zeros(6), np.zeros(6))
    return TensionProblem(dynamics.wrench_matrix(where)[rows], w[rows], robot.t_min, robot.t_max)


def test_the_library_is_known():
    assert set(available()) == set(ROBOTS)
    assert len(available()) >= 20


@pytest.mark.parametrize("name", ROBOTS)
def test_loads_and_survives_writing(name):
    robot = load(name)
    cables, kinds, _, _ = ROBOTS[name]
    assert (robot.name, robot.m) == (name, cables)
    assert {carrier.kind for carrier in robot.carriers} == kinds
    assert parse_yaml(to_yaml(robot), Robot, name) == robot


@pytest.mark.parametrize("name", ROBOTS)
def test_source_says_where_numbers_come_from(name):
    """A published model, or what is assumed; and nothing but facts: no comment besides the editor's line."""
    source = load(name).source
    assert "CASPR (D. Lau et al., BSD-3-Clause)" in source or "Assumed" in source or "assumed" in source
    comments = [line for line in (FOLDER / f"{name}.yaml").read_text().splitlines() if "#" in line]
    assert comments == ["# yaml-language-server: $schema=robot.schema.json"]


@pytest.mark.parametrize("name", ROBOTS)
def test_carries_its_platform_at_home_as_stated(name):
    robot = load(name)
    _, _, rank, status = ROBOTS[name]
    problem = at_rest(robot)
    assert np.linalg.matrix_rank(problem.A, tol=1e-9) == rank
    answer = solve(problem)
    assert answer.status.value == status
    if answer.feasible:
        np.testing.assert_allclose(problem.A @ answer.tensions, problem.w, atol=1e-8 * robot.weight)
        assert (answer.tensions >= robot.t_min - 1e-9 * robot.weight).all()
        assert (answer.tensions <= robot.t_max).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_diagnosis_runs(name):
    diagnosis = diagnose(load(name))
    assert (diagnosis.lengths > 0).all()
    assert np.isfinite(diagnosis.singular_values).all()


def test_fast_balances_where_its_file_says():
    robot = load("fast")
    assert [solve(at_rest(robot, [0, 0, z, 0, 0, 0])).feasible for z in (137, 138)] == [False, True]


@pytest.mark.parametrize("name", CASPR)
def test_caspr_robots_equal_an_import_of_the_real_data(name):
    folder, cable_set = CASPR[name]
    if not REAL.is_dir():
        pytest.skip(f"the CASPR robots are not there: {REAL}")
    real, ours = read_caspr(REAL / folder, cable_set).robot, load(name)
    for array in ("anchors", "attachments", "t_min", "t_max", "inertia", "home", "carrier_home", "dof_mask"):
        np.testing.assert_allclose(getattr(ours, array), getattr(real, array), rtol=0, atol=1e-9, err_msg=array)
    np.testing.assert_allclose(ours.platform.com, real.platform.com, rtol=0, atol=1e-9)
    assert ours.platform.mass == real.platform.mass
    assert ours.gravity == real.gravity
    assert [cable.pulley for cable in ours.cables] == [cable.pulley for cable in real.cables]


def test_every_caspr_folder_is_in_the_library():
    if not REAL.is_dir():
        pytest.skip(f"the CASPR robots are not there: {REAL}")
    assert {folder for folder, _ in CASPR.values()} == {path.name for path in REAL.iterdir() if path.is_dir()}


@pytest.mark.parametrize("name", [name for name, row in ROBOTS.items() if row[1] == {"quadrotor"}])
def test_quadrotors_hover_at_home(name):
    """Thrust along the quadrotor's own z axis carries its weight and its cables, without any torque."""
    robot = load(name)
    tensions = solve(at_rest(robot)).tensions
    pulls = robot.home_attachments - robot.home_anchors
    pulls *= (tensions / np.linalg.norm(pulls, axis=1))[:, None]
    for index, carrier in enumerate(robot.carriers):
        mine = robot.carrier_of_cable == index
        thrust = np.array([0, 0, carrier.mass * G]) - pulls[mine].sum(axis=0)
        roll, pitch, yaw = carrier.home[3:]
        assert yaw == 0
        axis = np.array([np.sin(pitch) * np.cos(roll), -np.sin(roll), np.cos(pitch) * np.cos(roll)])
        np.testing.assert_allclose(thrust, np.linalg.norm(thrust) * axis, atol=1e-8)
        torque = np.cross(robot.home_anchors[mine] - np.array(carrier.home[:3]), pulls[mine]).sum(axis=0)
        np.testing.assert_allclose(torque, 0, atol=1e-8)
        assert np.arccos(axis[2]) < carrier.tilt_max
        assert 1.5 * np.linalg.norm(thrust) < carrier.thrust_max  # room to move


def test_quadrotors_keep_apart():
    for name in ("flycrane", "multi-quadrotor-3", "multi-quadrotor-4", "multi-quadrotor-6"):
        at = load(name).carrier_home[:, :3]
        apart = np.linalg.norm(at[:, None] - at[None], axis=2) + 10 * np.eye(len(at))
        assert apart.min() > 0.8


def test_one_flying_robot_under_two_kinds_of_carrier():
    prescribed, quadrotor = load("wang-flying"), load("wang-flying-quadrotor")
    assert quadrotor.cables == prescribed.cables
    assert quadrotor.platform == prescribed.platform
    (carrier,) = quadrotor.carriers
    assert carrier.thrust_max == pytest.approx(2 * G * (carrier.mass + quadrotor.platform.mass), rel=0.03)


@pytest.mark.parametrize("m", [4, 5, 6])
def test_more_robots_of_paper_c_stand_on_the_published_circle(m):
    published, robot = load("wang-ctmrts"), load(f"wang-ctmrts-{m}")
    centre = robot.home[:2]
    radii = np.linalg.norm(published.carrier_home[:, :2] - centre, axis=1)
    np.testing.assert_allclose(radii, radii[0], rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(robot.carrier_home[:, :2] - centre, axis=1), radii[0], rtol=1e-9)
    np.testing.assert_allclose(robot.carrier_home[0], published.carrier_home[0], atol=1e-9)
    corners = np.linalg.norm(robot.attachments, axis=1)
    np.testing.assert_allclose(corners, 0.1 / np.sqrt(3), rtol=1e-9)
    spokes = robot.carrier_home[:, :2] - centre
    cosines = np.einsum("ij,ij->i", spokes, robot.attachments[:, :2]) / radii[0] / corners
    np.testing.assert_allclose(cosines, 1, atol=1e-9)
    # Equal cables carry equal parts: t = m g l / (m h), with the cable's length and height.
    run, height = radii[0] - corners[0], 1.2 - 0.4
    expected = 10 * G * np.hypot(run, height) / height / m
    np.testing.assert_allclose(solve(at_rest(robot)).tensions, expected, rtol=1e-8)


def test_point_mass_and_planar_platform():
    mass, planar = load("point-mass-3"), load("planar-4")
    assert mass.platform.inertia is None
    np.testing.assert_allclose(solve(at_rest(mass)).tensions, 5 * G * np.hypot(2, 2) / 2 / 3, rtol=1e-9)
    # Fully constrained: tensions between limits resist a push any way in the plane, and a turn.
    problem = at_rest(planar)
    for push in 5.0 * np.vstack([np.eye(3), -np.eye(3)]) * [1, 1, 0.1]:
        pushed = TensionProblem(problem.A, problem.w + push, planar.t_min, planar.t_max)
        assert solve(pushed).feasible


@pytest.mark.parametrize("name", available())
def test_moments_are_scaled_in_one_way(name):
    """A robot's own scale is the one by which its tension problems compare moments with forces."""
    robot = load(name)
    assert pose_problem(Dynamics(robot), robot.home).row_scale == pytest.approx(robot.wrench_scale, rel=1e-15)
    assert (robot.wrench_scale[:3] == 1).all()
