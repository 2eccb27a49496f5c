"""A box of winds: its decisive ones against convex hulls, plans by linear programs and in closed form."""

import numpy as np
import pytest
from scipy.optimize import linprog

from towline.base.errors import InputError
from towline.models import Dynamics, Robot, load
from towline.ocp import MotionStatus, plan
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task
from towline.ocp.tasks.wind_set import WindBox, WindDisc, decisive_winds_at, possible_winds_at
from towline.solvers import TensionProblem, certify

from .told import told

GRAVITY = 9.81
CIRCLE = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.1, "rate": 0.2 * np.pi}
FREE = {"kind": "free", "acceleration_max": 3, "ends": "periodic"}


def flying(**aero):
    data = load("wang-flying").model_dump(mode="json")
    data["platform"]["aero"] |= aero
    return Robot.model_validate(data)


def in_hull(points, corners):
    """Whether each point is a mean of the corners, by linear programming."""
    A = np.vstack([corners.T, np.ones(len(corners))])
    scale = np.abs(corners).max() + 1e-12
    A[:-1] /= scale
    return all(
        linprog(np.zeros(len(corners)), A_eq=A, b_eq=[*(p / scale), 1], bounds=(0, None)).success for p in points
    )


@pytest.mark.parametrize("aero", [{}, {"lift": 0}, {"drag": 0, "lift": 0.3}, {"form": "printed"}])
def test_every_force_of_a_box_is_in_the_hull_of_the_decisive_ones(aero):
    robot, rng = flying(**aero), np.random.default_rng(3)
    dynamics = Dynamics(robot)
    for low, high in (
        ([-3, -2, -1], [4, 5, 1]),
        ([1, -2, 0], [4, 5, 0]),
        ([2, 3, 0], [2, 6, 0]),
        ([2, 3, 0], [2, 3, 0]),
    ):
        box = WindBox(min=low, max=high)
        pose, velocity = np.zeros(6), np.array([*rng.uniform(-5, 5, 3), *rng.uniform(-1, 1, 3)])
        winds = np.vstack(decisive_winds_at(box, robot, pose[None], velocity[None]))
        assert len(winds) <= 9
        assert ((winds >= low) & (winds <= high)).all()
        corners = dynamics.aerodynamic_wrench(pose, velocity, winds)[:, :3]
        samples = rng.uniform(low, high, (25, 3))
        assert in_hull(dynamics.aerodynamic_wrench(pose, velocity, samples)[:, :3], corners)


@pytest.mark.parametrize("aero", [{}, {"lift": 0.9}, {"lift": 0}, {"form": "printed"}])
@pytest.mark.parametrize("speed", [0.0, 1.0, 7.0])
def test_every_force_of_a_disc_is_in_the_hull_of_the_decisive_ones(aero, speed):
    robot, rng, disc = flying(**aero), np.random.default_rng(4), WindDisc(speed=5)
    dynamics, pose = Dynamics(robot), np.zeros(6)
    angle = rng.uniform(0, 2 * np.pi)
    velocity = np.array([speed * np.cos(angle), speed * np.sin(angle), 0.5, 0, 0, 0])
    winds = np.vstack(decisive_winds_at(disc, robot, pose[None], velocity[None]))
    radius, angles = 5 * np.sqrt(rng.random(25)), rng.uniform(0, 2 * np.pi, 25)
    radius[::2] = 5
    samples = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(25)], axis=1)
    force = dynamics.aerodynamic_wrench(pose, velocity, samples)[:, :3]
    corners = dynamics.aerodynamic_wrench(pose, velocity, winds)[:, :3]
    assert in_hull(force, corners)
    # No force is larger along an axis than the disc's own, and the sum along both, of the largest |V|^2, hardly is.
    along = dynamics.aerodynamic_wrench(pose, velocity, 5 * np.vstack([np.eye(3)[:2], -np.eye(3)[:2]]))
    own = np.abs(np.diag(along[:2, :2])), np.abs(np.diag(along[2:, :2]))
    assert np.abs(corners[:, :2]).max(axis=0) == pytest.approx(np.maximum(*own))
    farthest = dynamics.aerodynamic_wrench(pose, velocity * 0, np.array([[5 + speed, 0, 0]]))[0, 0]
    assert np.abs(corners[:, :2]).sum(axis=1).max() <= 1.08 * farthest
    possible = np.vstack(possible_winds_at(disc, robot, pose[None], velocity[None]))
    for those in (possible, disc.inner(200), *([winds] if speed == 0 else [])):
        assert np.linalg.norm(those, axis=1).max() <= 5 * (1 + 1e-12)


def test_the_corners_of_a_box_alone_are_not_enough_with_lift():
    """Between opposite winds the lift has its least: so the calm counts too."""
    robot = flying(lift=0.9)
    dynamics, still = Dynamics(robot), np.zeros(6)
    corners = np.array([[x, y, 0] for x in (-4, 4) for y in (-4, 4)])
    force = dynamics.aerodynamic_wrench(still, still, corners)[:, :3]
    assert not in_hull(dynamics.aerodynamic_wrench(still, still, np.zeros((1, 3)))[:, :3], force)


def test_inner_winds_fill_the_box():
    box = WindBox(min=(-1, 2, 0), max=(3, 4, 0))
    winds = box.inner(4000)
    assert ((winds >= box.min) & (winds <= box.max)).all()
    counts, *_ = np.histogram2d(*winds[np.arange(1, 4001) % 4 != 0, :2].T, bins=10)
    assert counts.min() > 0.6 * counts.mean()
    assert (winds[:, 0] == -1).any()
    assert (winds[:, 0] == 3).any()


def feasible_in(robot, motion, carriers, wind, row):
    """Whether tensions exist at one audited instant in one wind, by linear programming."""
    dynamics = Dynamics(robot)
    A = dynamics.wrench_matrix(motion.pose[row], carriers.pose[row])
    w = dynamics.required_wrench(*(part[row] for part in (*motion, *carriers)), wind=wind)
    scale = np.array([1, 1, 1, robot.length, robot.length, robot.length])
    # How little the equations can be missed: a program that always has a solution.
    m = robot.m
    both = np.hstack([A / scale[:, None], np.eye(6), -np.eye(6)])
    bounds = [*zip(robot.t_min, robot.t_max, strict=True), *[(0, None)] * 12]
    return linprog([*np.zeros(m), *np.ones(12)], A_eq=both, b_eq=w / scale, bounds=bounds).fun < 1e-6


def test_what_still_air_allows_a_box_forbids_at_its_worst_wind():
    """The task fixes the motion: the audit alone decides, and names a wind in which there are no tensions."""
    robot = load("wang-flying")
    assert plan(robot, {"path": CIRCLE, "wind": [0, 0, 0]}).feasible
    found = plan(robot, {"path": CIRCLE, "wind": {"min": [-6, -1, 0], "max": [0, 1, 0]}})
    assert found.status is MotionStatus.INFEASIBLE
    assert np.isfinite(found.audit.tensions).all()  # of the box's middle, (-3, 0, 0)
    wind, certificate, seen = found.audit.certificate.wind, found.certificate, found.audit
    assert wind[0] == -6
    assert certificate.wind == wind
    assert f"in wind ({wind[0]:g}, {wind[1]:g}, 0) m/s" in told(found).splitlines()[0]
    # The direction proves it, from the certificate's own numbers.
    row = int(np.argmin(np.abs(seen.times - certificate.time)))
    dynamics, direction = Dynamics(robot), np.array(certificate.direction)
    w = dynamics.required_wrench(*(part[row] for part in (*seen.motion, *seen.carriers)), wind=wind)
    along = direction @ dynamics.wrench_matrix(seen.motion.pose[row], seen.carriers.pose[row])
    most = np.maximum(along * robot.t_min, along * robot.t_max).sum()
    assert direction @ w - most == pytest.approx(certificate.shortfall, rel=1e-6)
    assert certificate.shortfall > 0.1
    # No wind of the box, at no time, misses more.
    rng = np.random.default_rng(1)
    rows = np.arange(0, len(seen.times), 100)
    A = dynamics.wrench_matrix(seen.motion.pose[rows], seen.carriers.pose[rows])
    for other in rng.uniform([-6, -1, 0], [0, 1, 0], (6, 3)):
        w = dynamics.required_wrench(*(part[rows] for part in (*seen.motion, *seen.carriers)), wind=other)
        proofs = (
            certify(TensionProblem(*pair, robot.t_min, robot.t_max, length=robot.length))
            for pair in zip(A, w, strict=True)
        )
        assert max(0 if proof is None else proof.shortfall for proof in proofs) <= certificate.shortfall + 1e-9


def hanging(t_min, com=(0.0, 0.0, 0.0)):
    """A 2 kg point mass on four cables to the corners of a square 1 m above it, half a metre away each."""
    data = load("point-mass-3").model_dump(mode="json")
    data["platform"] |= {"mass": 2.0, "com": com, "home": [0, 0, 0, 0, 0, 0]}
    data["platform"]["aero"] = {"air_density": 1.29, "drag": 0.8, "lift": 0.0, "area": 0.5, "form": "signed"}
    anchors = [(x, y, 1) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    cable = {**data["cables"][0], "t_min": t_min, "t_max": 100}
    data["cables"] = [{**cable, "anchor": anchor} for anchor in anchors]
    return Robot.model_validate(data)


@pytest.mark.parametrize(("share", "feasible"), [(0.999, True), (1.001, False)])
def test_a_rest_leaves_exactly_as_much_as_the_box_needs(share, feasible):
    """Four cables, wind along x of speed V on a resting load: F = 1/2 rho C_d S V^2.

    By symmetry two tensions t_1 on the windward side and two t_2: the pairs hold the weight, 2 (t_1 + t_2) u_z = m g,
    and the wind, 2 (t_1 - t_2) u_x = F, with u = (0.5, 0.5, 1) / sqrt(1.5). So t_2 = (m g / u_z - F / u_x) / 4 reaches
    t_min at F = u_x (m g / u_z - 4 t_min).
    """
    u_x, u_z, t_min = 0.5 / np.sqrt(1.5), 1 / np.sqrt(1.5), 3.0
    force = u_x * (2 * GRAVITY / u_z - 4 * t_min)
    speed = share * np.sqrt(force / (0.5 * 1.29 * 0.8 * 0.5))
    rest = {"path": {"kind": "rest", "pose": [0, 0, 0]}, "duration": 0.5}
    for wind in ({"min": [-speed, 0, 0], "max": [0, 0, 0]}, {"min": [0, 0, 0], "max": [0, speed, 0]}):
        found = plan(hanging(t_min), {**rest, "wind": wind})
        assert found.feasible is feasible
        if not feasible:
            assert found.audit.certificate.wind == pytest.approx([min(wind["min"][0], 0), wind["max"][1], 0])


@pytest.mark.parametrize(("share", "feasible"), [(0.999, True), (1.001, False)])
def test_a_rest_leaves_exactly_as_much_as_the_disc_needs(share, feasible):
    """The same load in wind from any side: at rest the forces fill |X| + |Y| <= F, and along an axis they do most.

    Between two axes, X = Y = F / 2, the inner tension of four cables lets the slackest lose half as much.
    """
    u_x, u_z, t_min = 0.5 / np.sqrt(1.5), 1 / np.sqrt(1.5), 3.0
    speed = share * np.sqrt(u_x * (2 * GRAVITY / u_z - 4 * t_min) / (0.5 * 1.29 * 0.8 * 0.5))
    task = {"path": {"kind": "rest", "pose": [0, 0, 0]}, "duration": 0.5, "wind": {"speed": speed}}
    found = plan(hanging(t_min), task)
    assert found.status is (MotionStatus.FEASIBLE if feasible else MotionStatus.INFEASIBLE)
    if not feasible:
        assert sorted(np.abs(found.certificate.wind)) == pytest.approx([0, 0, speed])


def test_a_moving_platform_is_called_infeasible_only_in_a_wind_of_the_disc():
    """Those that enclose the disc are faster while the platform moves; they alone prove nothing."""
    line = {"kind": "line", "start": [-0.1, 0, 0], "end": [0.1, 0.1, 0]}
    statuses = {}
    for speed in np.linspace(3.0, 5.0, 11):
        found = plan(hanging(1.0), {"path": line, "duration": 0.8, "wind": {"speed": float(speed)}})
        statuses[found.status] = statuses.get(found.status, 0) + 1
        if found.status is MotionStatus.INFEASIBLE:
            assert np.linalg.norm(found.certificate.wind) <= speed * (1 + 1e-12)
        if found.feasible:
            rng, audit = np.random.default_rng(0), found.audit
            for _ in range(20):
                angle, row = rng.uniform(0, 2 * np.pi), int(rng.integers(len(audit.times)))
                wind = speed * np.array([np.cos(angle), np.sin(angle), 0])
                assert feasible_in(found.scenario.robot, audit.motion, audit.carriers, wind, row)
    assert min(statuses[MotionStatus.FEASIBLE], statuses[MotionStatus.INFEASIBLE]) > 3
    assert MotionStatus.NOT_FOUND not in statuses, "the winds that enclose those of the disc are hardly faster"


def test_a_motion_that_no_wind_of_the_disc_rules_out_is_offered_others(monkeypatch):
    monkeypatch.setattr("towline.ocp.audits.tensions.possible_winds_at", lambda *_: [])
    line = {"kind": "line", "start": [-0.1, 0, 0], "end": [0.1, 0.1, 0]}
    found = plan(hanging(1.0), {"path": line, "duration": 0.8, "wind": {"speed": 4.06}})
    assert found.status is MotionStatus.NOT_FOUND
    assert found.certificate is None
    assert "winds a little stronger than the task's" in told(found).splitlines()[0]
    assert "wind" in {each.name for each in found.relaxations}
    assert all(each.plan.feasible for each in found.relaxations)


def test_a_free_motion_is_planned_so_that_every_wind_is_held():
    """At random instants, in winds of the box, a linear program finds tensions; without the box it does not."""
    robot = load("wang-flying")
    box = {"min": [-8, -8, 0], "max": [8, 8, 0]}
    task = {"path": {**CIRCLE, "radius": 0.5}, "base": FREE, "steps": 20}
    calm, all_winds = plan(robot, {**task, "wind": [0, 0, 0]}), plan(robot, {**task, "wind": box})
    assert calm.feasible
    assert all_winds.feasible, all_winds.report()
    rng = np.random.default_rng(5)
    missed = 0
    for _ in range(80):
        row, wind = int(rng.integers(len(calm.audit.times))), rng.uniform(box["min"], box["max"])
        wind[:2] = np.where(rng.random(2) < 0.4, np.sign(wind[:2]) * 8, wind[:2])  # faces and corners too
        assert feasible_in(robot, all_winds.audit.motion, all_winds.audit.carriers, wind, row)
        missed += not feasible_in(robot, calm.audit.motion, calm.audit.carriers, wind, row)
    assert missed > 10


def test_a_free_motion_is_planned_so_that_wind_from_any_side_is_held():
    """At random instants, in winds of the disc, a linear program finds tensions."""
    robot = load("wang-flying")
    task = {"path": {**CIRCLE, "radius": 0.5}, "base": FREE, "steps": 20, "wind": {"speed": 9}}
    found = plan(robot, task)
    assert found.feasible, found.report()
    assert "any horizontal one up to 9 m/s" in found.report()
    rng = np.random.default_rng(5)
    for _ in range(60):
        row, angle = int(rng.integers(len(found.audit.times))), rng.uniform(0, 2 * np.pi)
        wind = 9 * np.array([np.cos(angle), np.sin(angle), 0])
        assert feasible_in(robot, found.audit.motion, found.audit.carriers, wind, row)


def test_a_box_that_nothing_holds_is_told_with_the_closest_motion():
    """The elastic program has missing wrenches of its own for each wind."""
    robot = load("wang-flying")
    task = {"path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 1, "steps": 10}
    tube = {"tube": {"position": 0.01}}
    found = plan(robot, {**task, **tube, "wind": {"min": [-15, 0, 0], "max": [15, 0, 0]}})
    assert found.status is MotionStatus.NOT_FOUND
    assert abs(found.audit.certificate.wind[0]) == 15
    assert found.certificate.shortfall > 1
    # The least that is missed in a mean over winds and nodes is near the largest that rest amid them misses.
    alone = plan(robot, {**task, "wind": [15, 0, 0]})
    assert found.certificate.shortfall < 1.1 * alone.certificate.shortfall


def test_a_path_in_the_frame_of_a_base_that_moves_feels_the_wind_of_the_ground():
    robot = load("wang-flying")
    path = {"kind": "line", "start": [0, 0, -1], "end": [0.1, 0, -1.1], "frame": "quad"}
    base = {"kind": "free", "acceleration_max": 3, "ends": "rest", "tilt_max": 0.2, "turn_acceleration_max": 2}
    box = {"min": [-5, 0, 0], "max": [5, 2, 0]}
    found = plan(robot, {"path": path, "duration": 2, "steps": 20, "base": base, "wind": box})
    assert found.feasible, found.report()
    rng = np.random.default_rng(2)
    for _ in range(40):
        row = int(rng.integers(len(found.audit.times)))
        assert feasible_in(robot, found.audit.motion, found.audit.carriers, rng.uniform(box["min"], box["max"]), row)


def test_margins_count_in_every_wind():
    robot = load("wang-flying")
    task = {"path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 1}
    box = {"min": [-3, 0, 0], "max": [3, 0, 0]}
    least = []
    for x in (-3, 0, 3):
        least.append(plan(robot, {**task, "wind": [x, 0, 0]}).margin)
    assert plan(robot, {**task, "wind": box, "margin": 0.99 * min(least)}).feasible
    narrow = plan(robot, {**task, "wind": box, "margin": 1.01 * min(least)})
    assert not narrow.feasible
    assert abs(narrow.audit.certificate.wind[0]) == 3


@pytest.mark.parametrize(
    ("wind", "message"),
    [
        ({"min": [1, 0, 0], "max": [0, 0, 0]}, "wind.min must not exceed max, 0 m/s along x, got 1 m/s"),
        ({"min": [1, 0, 0]}, "wind.max is missing"),
        ({"min": [1, 0, 0], "max": [1, 0, 0], "mx": [1, 0, 0]}, "is not a known key, did you mean 'max'"),
        ({"speed": 0}, "wind.speed must be greater than 0, got 0"),
        ({"sped": 5}, "wind.sped is not a known key, did you mean 'speed'"),
        ({"speed": 5, "min": [0, 0, 0]}, "wind.min is not a known key"),
        ([1, 0], "wind must be 3 numbers, got [1, 0]"),
        ([1, 0, "fast"], "wind[2] must be a number"),
        (3, "wind must be"),
    ],
)
def test_wrong_boxes_are_one_line(wind, message):
    with pytest.raises(InputError) as caught:
        read_task({"path": CIRCLE, "wind": wind})
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_who_has_no_box_of_winds():
    box = {"min": [-1, 0, 0], "max": [1, 0, 0]}
    with pytest.raises(
        InputError,
        match=r"wind must be one velocity .*got a range: the cables pull on carrier 'quad' of kind quadrotor",
    ):
        lay_out(load("wang-flying-quadrotor"), read_task({"path": CIRCLE, "wind": box}))
    with pytest.raises(InputError, match=r"has no platform\.aero"):
        lay_out(load("ipanema-1"), read_task({"path": CIRCLE, "wind": box}))


def test_the_first_line_says_what_holds_in_any_wind():
    """It told the margin of the planned tensions, which are those of one wind; in others they may be smaller."""
    task = {"path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 1, "wind": {"min": [-5, -5, 0], "max": [5, 5, 0]}}
    found = plan("wang-flying", task | {"margin": 0.3})
    assert found.feasible
    assert found.margin > 1
    first = found.report().splitlines()[0]
    assert first.endswith("every tension at least 0.3 N inside its limits, in every wind of the task")
    assert (
        plan("wang-flying", task)
        .report()
        .splitlines()[0]
        .endswith("every tension inside its limits, in every wind of the task")
    )
