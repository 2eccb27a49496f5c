"""Elastic cables, the element chain and paper F's driving forces, against plain formulas and assembly by hand."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.models import Dynamics, Robot, load
from towline.models.cables import ElementChain, elastic
from towline.models.cables.driving_force import driving_force

EA, C = 13000.0, 200.0


def random_chain(rng, n, **options):
    return ElementChain(rng.normal(size=3), rng.normal(size=3), EA, n, **options)


# --- elastic


def test_elastic_tension_and_its_inverse():
    unstrained = elastic.unstrained_length(1.3, 25.0, EA)
    assert elastic.tension(1.3, 0.0, unstrained, EA) == pytest.approx(25.0, rel=1e-10)
    step = 1e-6
    slope = (elastic.tension(1.3 + step, 0.0, unstrained, EA) - 25.0) / step
    assert slope == pytest.approx(elastic.axial_stiffness(EA, unstrained), rel=1e-6)


def test_elastic_cable_never_pushes():
    lengths = np.array([0.9, 1.0, 1.0 + 1e-3, 1.0 + 1e-3, 0.9])
    rates = np.array([0.0, 5.0, 0.0, -1.0, 5.0])
    np.testing.assert_allclose(elastic.tension(lengths, rates, 1.0, EA, C), [0, 0, 13, 0, 0], atol=1e-10)
    length, rate = ca.SX.sym("l"), ca.SX.sym("dl")
    symbolic = ca.Function("T", [length, rate], [elastic.tension(length, rate, 1.0, EA, C)])
    np.testing.assert_array_equal(
        symbolic(lengths[None], rates[None]).full()[0], elastic.tension(lengths, rates, 1.0, EA, C)
    )


# --- element chain


@pytest.mark.parametrize("n", range(1, 65))
def test_chain_is_the_whole_cable(n):
    """EA / l times the elongation for every n, from the assembled matrices, to 1e-10."""
    rng = np.random.default_rng(n)
    chain = random_chain(rng, n)
    end = 1e-3 * (chain.direction + 0.3 * rng.normal(size=3))
    winding = 2e-4 / n
    expected = EA / chain.length * (end @ chain.direction + 2e-4)
    assert expected > 0
    assert chain.end_increment(end, winding) == pytest.approx(expected, rel=1e-10)
    forces = chain.node_forces(chain.displacements(end), winding)
    np.testing.assert_allclose(forces[1:-1], 0, atol=1e-10 * n * expected)
    np.testing.assert_allclose(forces[-1], expected * chain.direction, rtol=0, atol=1e-10 * expected)
    np.testing.assert_allclose(forces[0], -expected * chain.direction, rtol=0, atol=1e-10 * expected)


@pytest.mark.parametrize("n", [1, 2, 3, 8])
def test_chain_matrices_against_assembly_by_hand(n):
    """Eqs. 17 to 19 entry by entry, element after element, with slack ones among them."""
    rng = np.random.default_rng(n)
    chain = random_chain(rng, n)
    taut = rng.integers(0, 2, n).astype(float)
    K_n, K_l = np.zeros((3 * n + 3, 3 * n + 3)), np.zeros((3 * n + 3, n))
    c = (chain.attachment - chain.anchor) / np.linalg.norm(chain.attachment - chain.anchor)
    for j in range(n):
        S = taut[j] * EA / (np.linalg.norm(chain.attachment - chain.anchor) / n)
        to_cable = np.zeros((2, 6))
        to_cable[0, :3] = to_cable[1, 3:] = c
        nodes = slice(3 * j, 3 * j + 6)
        K_n[nodes, nodes] += to_cable.T @ (S * np.array([[1, -1], [-1, 1]])) @ to_cable
        K_l[nodes, j] += to_cable.T @ (S * np.array([-1, 1]))
    np.testing.assert_allclose(chain.K_n(taut).toarray(), K_n, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(chain.K_l(taut).toarray(), K_l, rtol=1e-12, atol=1e-9)
    assert chain.K_n().nnz <= 9 * (3 * n + 1)


def test_interior_nodes_rest_by_the_assembled_matrix():
    """Solving K_n for the inner nodes gives the even placement."""
    rng = np.random.default_rng(5)
    chain = random_chain(rng, 7)
    end = 2e-3 * chain.direction
    K = chain.K_n().toarray()
    inner = slice(3, -3)
    placed = np.linalg.lstsq(K[inner, inner], -K[inner, -3:] @ end, rcond=1e-10)[0]
    np.testing.assert_allclose(placed.reshape(-1, 3), chain.displacements(end)[1:-1], atol=1e-12)


def test_slack_elements_carry_nothing():
    rng = np.random.default_rng(6)
    chain = random_chain(rng, 4)
    shorter = -1e-3 * chain.direction
    assert chain.end_increment(shorter) == 0
    assert chain.taut(chain.displacements(shorter)).sum() == 0
    tight = random_chain(np.random.default_rng(6), 4, pretension=5.0)
    assert tight.end_increment(5 * shorter) == pytest.approx(-5.0)
    little = -1e-4 * chain.direction
    assert tight.end_increment(little) == pytest.approx(-EA / chain.length * 1e-4, rel=1e-10)
    always = random_chain(np.random.default_rng(6), 4, pretension=np.inf)
    assert always.end_increment(shorter) == pytest.approx(-EA / chain.length * 1e-3, rel=1e-10)
    # one element shortened, the others lengthened: only that one carries nothing
    nodes = chain.displacements(1e-3 * chain.direction)
    nodes[1] *= -1
    assert chain.taut(nodes).tolist() == [0, 1, 1, 1]
    np.testing.assert_array_equal(chain.node_forces(nodes)[0], 0)


def test_chain_refuses_what_is_no_cable():
    for arguments, field in [
        (([0, 0, 0], [0, 0, 0], EA, 3), "distance"),
        (([0, 0, 0], [0, 0, 1], -1.0, 3), "stiffness"),
        (([0, 0, 0], [0, 0, 1], EA, 0), "elements"),
        (([0, 0, np.nan], [0, 0, 1], EA, 3), "anchor"),
        (([0, 0, 0], [0, 1], EA, 3), "attachment"),
        (([0, 0, 0], [0, 0, 1], EA, 3, -1.0), "pretension"),
    ]:
        with pytest.raises(InputError, match=field):
            ElementChain(*arguments)


# --- driving force


def circle(radius=0.15, instants=101):
    """Paper F's circle, small enough that every cable pulls, under a base that sways."""
    time = np.linspace(0, 10, instants)
    zero = np.zeros_like(time)
    omega = 0.2 * np.pi
    along, across = radius * np.cos(omega * time), radius * np.sin(omega * time)
    pose = np.stack([along, across, zero - 1, zero, zero, zero], axis=1)
    velocity = omega * np.stack([-across, along, zero, zero, zero, zero], axis=1)
    acceleration = -(omega**2) * np.stack([along, across, zero, zero, zero, zero], axis=1)
    base = [
        np.array([50, 50, 100, 0, 0, 0]) + np.outer(np.sin(time), [0.3, 0.2, 0.1, 0.05, 0.04, 0.1]),
        np.outer(np.cos(time), [0.3, 0.2, 0.1, 0.05, 0.04, 0.1]),
        -np.outer(np.sin(time), [0.3, 0.2, 0.1, 0.05, 0.04, 0.1]),
    ]
    shake = 2e-6 * np.stack([np.sin((3 + k) * time + k) for k in range(6)], axis=1)
    return (pose, velocity, acceleration), base, shake, time


def test_driving_force_balances_the_platform_in_the_world():
    """Newton-Euler in {G} with F = T + dT on the platform, at every instant."""
    robot = load("wang-flying")
    motion, base, shake, time = circle()
    result = driving_force(robot, *motion, shake, 0.1, base=base)
    np.testing.assert_allclose(result.time, time, atol=1e-12)
    dynamics = Dynamics(robot)
    world = dynamics.relative.motion_in_world(*motion, *base)
    A = dynamics.wrench_matrix(world[0], carrier_pose=base[0][:, None])
    given = np.einsum("nij,nj->ni", A, result.T + result.dT)
    np.testing.assert_allclose(given, dynamics.required_wrench(*world), atol=1e-9)
    assert (result.rank == 6).all()
    assert result.residual.max() < 1e-10
    np.testing.assert_allclose(result.lengths, dynamics.cable_lengths(world[0], base[0][:, None]), atol=1e-9)


@pytest.mark.parametrize("elements", [1, 16])
def test_driving_force_increments_instant_by_instant(elements):
    """Each cable alone, in {G}: lengths by scipy's rotations, dT_K by the assembled chain."""
    robot = load("wang-flying")
    motion, base, shake, _ = circle(instants=11)
    result = driving_force(robot, *motion, shake, 0.01, elements, base=(base[0], None, None))
    for k in range(11):
        R_A = Rotation.from_euler("ZYX", base[0][k, [5, 4, 3]]).as_matrix()
        R_B = R_A @ Rotation.from_euler("ZYX", motion[0][k, [5, 4, 3]]).as_matrix()
        for i, cable in enumerate(robot.cables):
            anchor = base[0][k, :3] + R_A @ cable.anchor
            arm = R_B @ cable.attachment
            attachment = base[0][k, :3] + R_A @ motion[0][k, :3] + arm
            turn = Rotation.from_rotvec(shake[k, 3:]).as_matrix()
            moved = attachment + shake[k, :3] + (turn - np.eye(3)) @ arm
            change = np.linalg.norm(moved - anchor) - np.linalg.norm(attachment - anchor)
            # the small turn is linear in the procedure, and the anchor 100 m away costs digits here
            assert result.dT_C[k, i] == pytest.approx(C * change / 0.01, abs=1e-5)
            assert cable.stiffness is not None
            chain = ElementChain(anchor, attachment, cable.stiffness, elements)
            expected = chain.end_increment(shake[k, :3] + np.cross(shake[k, 3:], arm))
            assert result.dT_K[k, i] == pytest.approx(expected, abs=1e-9)
    assert result.dT_K.min() == 0
    assert result.dT_K.max() > 1e-3


def test_driving_force_does_not_depend_on_the_number_of_elements():
    motion, _, shake, _ = circle()
    coarse, fine = (driving_force(load("wang-flying"), *motion, shake, 0.01, n) for n in (1, 64))
    np.testing.assert_allclose(fine.dT_K, coarse.dT_K, rtol=1e-10)


def test_driving_force_without_vibration_is_the_inverse_dynamics():
    """And it does not pull everywhere on a circle of 1 m: -12.2 N, as physics.md has it."""
    motion, *_ = circle(radius=1.0, instants=721)
    result = driving_force(load("wang-flying"), *motion, np.zeros(6), 0.01)
    np.testing.assert_array_equal(result.dT, 0)
    assert result.T.min() == pytest.approx(-12.2, abs=0.05)
    np.testing.assert_array_equal(result.ratio, 0)


def test_driving_force_slack_switch():
    """The paper's rule has no negative dT_K; taut cables have both signs, and shake up and down is odd in them."""
    motion, _, shake, _ = circle()
    robot = load("wang-flying")
    paper = driving_force(robot, *motion, shake, 0.01)
    taut = driving_force(robot, *motion, shake, 0.01, pretension=np.inf)
    np.testing.assert_allclose(paper.dT_K, np.maximum(taut.dT_K, 0), atol=1e-14)
    opposite = driving_force(robot, *motion, -shake, 0.01, pretension=np.inf)
    np.testing.assert_allclose(opposite.dT_K, -taut.dT_K, atol=1e-14)


def test_driving_force_printed_winding_swamps_the_tension():
    """Eq. 13 to the letter: EA / l (l(t + dt) - l(t)), which at 0.5 m/s and 10 ms is beyond any tension here."""
    motion, *_ = circle(radius=1.0, instants=1001)
    result = driving_force(load("wang-flying"), *motion, np.zeros(6), 0.01, winding="printed")
    steps = np.diff(result.lengths, axis=0)
    expected = np.maximum(EA * steps / result.lengths[:-1], 0)
    np.testing.assert_allclose(result.dT_K[:-1], expected, rtol=1e-9, atol=1e-9)
    assert result.dT_K.max() > 20


def test_driving_force_of_a_singular_robot():
    """The printed pairing has rank 3: what is given is as near as it can be, and the rest is told."""
    robot = load("wang-flying-printed")
    motion, _, shake, _ = circle()
    result = driving_force(robot, *motion, shake, 0.01)
    assert (result.rank == 3).all()
    dynamics = Dynamics(robot).relative
    A, w = dynamics.wrench_matrix(motion[0]), dynamics.required_wrench(*motion)
    scale = np.r_[np.ones(3), np.full(3, 1 / robot.length)]
    for k in range(0, len(A), 20):
        nearest = np.linalg.lstsq(A[k] * scale[:, None], w[k] * scale, rcond=1e-9)[0]
        np.testing.assert_allclose(result.residual[k], np.linalg.norm((A[k] @ nearest - w[k]) * scale), atol=1e-9)
    assert result.residual.max() > 0.01


def test_driving_force_of_eight_cables_has_the_least_norm():
    robot = load("wang-flying")
    data = robot.model_dump()
    data["cables"] = [*data["cables"], {**data["cables"][0], "attachment": (0.0, 0.1, 0.2)}]
    more = Robot.model_validate(data)
    motion, _, shake, _ = circle(instants=5)
    result = driving_force(more, *motion, shake, 0.01)
    assert result.residual.max() < 1e-10
    A = Dynamics(more).relative.wrench_matrix(motion[0])
    kernel = np.linalg.svd(A)[2][:, 6]
    np.testing.assert_allclose(np.einsum("nj,nj->n", kernel, result.T), 0, atol=1e-9)


def test_amplitude_that_gives_the_papers_ratio_exists():
    """Max dT / T of cable 1 grows with the amplitude, through the 12.47 % that the paper reports."""
    robot = load("wang-flying")
    motion, _, shake, _ = circle()

    def largest(amplitude):
        return np.abs(driving_force(robot, *motion, amplitude * shake / 2e-6, 0.01).ratio[:, 0]).max() - 0.1247

    amplitude = brentq(largest, 1e-9, 2e-5)
    assert 1e-6 < amplitude < 1e-5


def test_driving_force_refuses_in_one_line():
    robot = load("wang-flying")
    motion, _, shake, _ = circle(instants=5)
    zero = np.zeros((5, 6))
    bare = Robot.model_validate(
        {**robot.model_dump(), "cables": [{**c, "damping": None} for c in robot.model_dump()["cables"]]}
    )
    wheels = Robot.model_validate(
        {**robot.model_dump(), "cables": [{**c, "pulley": {"radius": 0.01}} for c in robot.model_dump()["cables"]]}
    )
    calls = [
        (lambda: driving_force(load("wang-ctmrts"), zero, zero, zero, zero, 0.1), "."),
        (lambda: driving_force(bare, *motion, shake, 0.1), "damping"),
        (lambda: driving_force(wheels, *motion, shake, 0.1), "pulley"),
        (lambda: driving_force(robot, *motion, shake[:3], 0.1), "vibration"),
        (lambda: driving_force(robot, *motion, shake, 0.0), "time_step"),
        (lambda: driving_force(robot, *motion, shake, 0.1, 0), "elements"),
        (lambda: driving_force(robot, *motion, shake, 0.1, base=motion[:2]), "base"),
        (lambda: driving_force(robot, *motion, shake, 0.1, pretension=-1.0), "pretension"),
        (lambda: driving_force(robot, *motion, shake, 0.1, winding="paid"), "winding"),
        (lambda: driving_force(robot, motion[0][0], *motion[1:], shake, 0.1), "pose"),
    ]
    for call, field in calls:
        with pytest.raises(InputError, match=field) as caught:
            call()
        assert "\n" not in str(caught.value)
