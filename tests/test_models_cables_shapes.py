"""Cables with mass and cables over pulleys, against energy balances, string formulas, quadrature and geometry."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from towline.base.errors import InputError
from towline.models.batch import call
from towline.models.cables import exit_points, hang

EA, RHO, L0 = 13000.0, 0.02, 2.0
UP = np.array([0.0, 0.0, 1.0])

# --- sag


def ends_by_irvine(cable):
    """Where the end lies by Irvine's own pair of equations, from the start's force."""
    H, V = np.hypot(*cable.start_force[..., :2].T), cable.start_force[..., 2]
    w, L, stretch = cable.weight, cable.length, cable.stiffness
    x = H * L / stretch + H / w * (np.arcsinh((V + w * L) / H) - np.arcsinh(V / H))
    z = V * L / stretch + w * L**2 / (2 * stretch) + (np.hypot(H, V + w * L) - np.hypot(H, V)) / w
    return x, z


def random_cables(rng, count):
    start = rng.normal(size=(count, 3))
    end = start + rng.normal(size=(count, 3))
    chord = np.linalg.norm(end - start, axis=1)
    return start, end, chord * 10 ** rng.uniform(-0.05, 0.7, size=count), chord


def test_sag_by_irvines_equations_and_force_balance():
    start, end, length, _ = random_cables(np.random.default_rng(2), 2000)
    for stiffness, weight in [(100.0, 5.0), (13000.0, 0.1), (1e6, 20.0)]:
        cable = hang(start, end, length, stiffness, weight)
        x, z = ends_by_irvine(cable)
        # Irvine's differences lose digits as the cable tightens: T / (w L) of them
        loose = np.maximum(cable.start_tension, cable.end_tension) < 1e3 * weight * length
        assert loose.sum() > 1000
        np.testing.assert_allclose(x[loose], np.linalg.norm((end - start)[loose, :2], axis=1), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(z[loose], (end - start)[loose, 2], atol=1e-9)
        balance = cable.start_force + cable.end_force
        np.testing.assert_allclose(balance, -weight * length[:, None] * UP, atol=1e-12 * cable.start_tension.max())
        np.testing.assert_allclose(cable.points([0, 1])[:, 0], start, atol=1e-13)
        np.testing.assert_allclose(cable.points([0, 1])[:, 1], end, atol=1e-12)


def test_sag_profile_by_integration():
    """dr/ds = T / EA + T / |T| from the start force, by solve_ivp."""
    cable = hang([0, 0, 2], [1.0, 0.7, 1.5], 1.6, 40.0, 3.0)

    def slope(s, _):
        T = cable.start_force + 3.0 * s * UP
        return T / 40.0 + T / np.linalg.norm(T)

    s = np.linspace(0, 1.6, 9)
    path = solve_ivp(slope, (0, 1.6), [0, 0, 2], t_eval=s, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(cable.points(s / 1.6), path.y.T, atol=1e-9)
    np.testing.assert_allclose(cable.tension([0, 1]), [cable.start_tension, cable.end_tension])


def test_sag_without_weight_is_the_straight_elastic_cable():
    start, end, _, chord = random_cables(np.random.default_rng(3), 200)
    length = 0.99 * chord
    cable = hang(start, end, length, EA, 1e-9)
    T = EA * (chord - length) / length
    np.testing.assert_allclose(cable.end_tension, T, rtol=1e-9)
    np.testing.assert_allclose(cable.end_force, (start - end) / chord[:, None] * T[:, None], rtol=1e-8, atol=1e-8)


def test_sag_of_a_stiff_cable_is_the_catenary():
    """Level ends: y = a cosh(x / a), L = 2 a sinh(x / 2 a), T = w a at the lowest point and w a cosh at the ends."""
    for a in (0.2, 1.0, 5.0):
        x, w = 2.0, 0.7
        length = 2 * a * np.sinh(x / (2 * a))
        for stiffness in (np.inf, 1e12):
            cable = hang([0, 0, 0], [x, 0, 0], length, stiffness, w)
            assert pytest.approx(w * a, rel=1e-8) == cable.H
            assert cable.end_tension == pytest.approx(w * a * np.cosh(x / (2 * a)), rel=1e-8)
            lowest = cable.points([0.5])[0]
            np.testing.assert_allclose(lowest, [x / 2, 0, a * (1 - np.cosh(x / (2 * a)))], atol=1e-8)


def test_sag_of_vertical_cables():
    """Taut: the lower end carries the stretch, the upper the weight more. Folded: each end carries its own side."""
    taut = hang([0, 0, 0], [0, 0, -1.02], 1.0, 100.0, 0.5)
    assert taut.end_tension == pytest.approx(100 * 0.02 - 0.25)
    assert taut.start_tension == pytest.approx(100 * 0.02 + 0.25)
    folded = hang([0, 0, 0], [0, 0, -1.0], 2.0, 1e9, 0.5)
    np.testing.assert_allclose(folded.end_force, [0, 0, -0.25], atol=1e-6)
    np.testing.assert_allclose(folded.points([0.75])[0], [0, 0, -1.5], atol=1e-6)
    nearly = hang([0, 0, 0], [1e-9, 0, -1.0], 2.0, 1e9, 0.5)
    np.testing.assert_allclose(nearly.end_force, folded.end_force, atol=1e-6)


def test_sag_from_taut_to_slack_and_across_twelve_decades():
    """Every one of 50,000 cables meets its end; the slowest takes some twenty steps."""
    rng = np.random.default_rng(4)
    count = 50_000
    angle = rng.uniform(-np.pi / 2, np.pi / 2, count)
    gap = 10 ** rng.uniform(-12, 0, count)
    chord = np.where(rng.random(count) < 0.5, 1 + gap, 1 - gap * 0.999999)
    end = chord[:, None] * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    for softness in (1e-10, 1e-5, 1.0):
        cable = hang(np.zeros(3), end, 1.0, 1 / softness, 1.0)
        np.testing.assert_allclose(cable.points([1.0])[:, 0], end, atol=3e-14)
        assert cable.iterations <= 40


def test_sag_forces_are_the_energys_derivative():
    """Potential and elastic energy of the hanging cable, by quadrature, falls as the end yields to its pull."""

    def energy(end):
        cable = hang([0, 0, 0], end, 1.5, 30.0, 2.0)
        nodes, weights = np.polynomial.legendre.leggauss(60)
        share = (nodes + 1) / 2
        density = 2.0 * cable.points(share)[:, 2] + cable.tension(share) ** 2 / 60.0
        return density @ (weights / 2 * 1.5)

    end, step = np.array([1.0, 0.2, 0.4]), 1e-5
    gradient = [(energy(end + step * d) - energy(end - step * d)) / (2 * step) for d in np.eye(3)]
    np.testing.assert_allclose(hang([0, 0, 0], end, 1.5, 30.0, 2.0).end_force, -np.array(gradient), atol=1e-7)


def test_sag_batches_and_refuses():
    one = hang([0, 0, 0], [1, 0, 0], 1.2, EA, 0.1)
    many = hang(np.zeros((4, 1, 3)), [1, 0, 0], [1.2, 1.2, 1.0], EA, 0.1)
    assert many.end_force.shape == (4, 3, 3)
    assert many.points(np.linspace(0, 1, 5)).shape == (4, 3, 5, 3)
    np.testing.assert_allclose(many.end_force[2, 1], one.end_force, rtol=1e-12)
    upside = hang([0, 0, 0], [0, 1, 0], 1.2, EA, 0.1, up=[0, 0, -2])
    np.testing.assert_allclose(upside.end_force[[1, 2]], one.end_force[[0, 2]] * [1, -1], rtol=1e-12)
    assert hang(np.zeros((0, 3)), [1, 0, 0], 1.2, EA, 0.1).end_force.shape == (0, 3)
    for arguments, field in [
        (([0, 0, 0], [1, 0, 0], -1.0, EA, 0.1), "length"),
        (([0, 0, 0], [1, 0, 0], 1.2, EA, 0.0), "weight"),
        (([0, 0, 0], [1, 0, 0], 0.9, np.inf, 0.1), "length"),
        (([0, 0], [1, 0, 0], 0.9, EA, 0.1), "start"),
        (([0, 0, 0], [1, 0, np.inf], 0.9, EA, 0.1), "end"),
        ((np.zeros((2, 3)), np.ones((3, 3)), 0.9, EA, 0.1), "leading dimensions"),
        (([0, 0, 0], [1, 0, 0], 1.2, EA, 0.1, (0, 0, 0)), "up"),
    ]:
        with pytest.raises(InputError, match=field):
            hang(*arguments)


# --- pulleys


def random_pulleys(rng, count, radius):
    """Pulleys and attachments around them, above and below, off the axis and out of the sheave's reach."""
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    anchor = rng.normal(size=(count, 3))
    offset = rng.normal(size=(count, 3))
    up = np.einsum("ni,ni->n", offset, axis)
    out = np.linalg.norm(offset - up[:, None] * axis, axis=1)
    usable = (np.hypot(out - radius, up) > 1.2 * radius) & (out > 0.05)
    return anchor[usable], axis[usable], anchor[usable] + offset[usable]


def test_cable_leaves_the_sheave_tangentially():
    """Geometry by hand: on the sheave, at right angles to its radius, in its plane, pulling from B to C."""
    r = 0.3
    anchor, axis, attachment = random_pulleys(np.random.default_rng(7), 500, r)
    leaving = exit_points(ca.DM(anchor.T), ca.DM(axis.T), r, ca.DM(attachment.T))
    points, u = leaving.points.full().T, leaving.directions.full().T
    wraps, lengths = leaving.wraps.full().ravel(), leaving.lengths.full().ravel()
    offset = attachment - anchor
    across = offset - np.einsum("ni,ni->n", offset, axis)[:, None] * axis
    e = across / np.linalg.norm(across, axis=1)[:, None]
    centre = anchor + r * e
    spoke = points - centre
    np.testing.assert_allclose(np.linalg.norm(spoke, axis=1), r, rtol=1e-10)
    np.testing.assert_allclose(np.einsum("ni,ni->n", spoke, u), 0, atol=1e-12)
    np.testing.assert_allclose(np.einsum("ni,ni->n", np.cross(e, axis), u), 0, atol=1e-12)
    straight = np.linalg.norm(points - attachment, axis=1)
    np.testing.assert_allclose(points - attachment, straight[:, None] * u, atol=1e-12)
    np.testing.assert_allclose(lengths, r * wraps + straight, rtol=1e-12)
    # the wrap, counted from A in the sense in which the cable comes up, reaches C and there runs along -u
    on_sheave = centre + r * (-np.cos(wraps)[:, None] * e + np.sin(wraps)[:, None] * axis)
    np.testing.assert_allclose(points, on_sheave, atol=1e-11)
    np.testing.assert_allclose(-u, np.sin(wraps)[:, None] * e + np.cos(wraps)[:, None] * axis, atol=1e-11)
    assert wraps.min() > 0
    assert wraps.max() < 2 * np.pi
    assert (wraps > np.pi).any()
    assert (wraps < np.pi / 2).any()


def test_cable_takes_the_shortest_way_round_the_sheave():
    """Of all ways on which the cable hugs the sheave for an angle and then goes straight outside it, the taut one."""
    r, B = 0.3, np.array([0.9, -0.8])  # in the plane of e and k
    leaving = exit_points(ca.DM([0, 0, 0]), ca.DM([0, 0, 1]), r, ca.DM([B[0], 0, B[1]]))
    wrap = float(leaving.wraps)

    def way(theta):
        return r * theta + np.hypot(*(B - [r - r * np.cos(theta), r * np.sin(theta)]))

    # left earlier it would cut through the sheave, wrapped further it is longer: stationary at the tangent
    step = 1e-4
    assert abs(way(wrap + step) - way(wrap - step)) / (2 * step) < 1e-7
    assert way(wrap + 0.1) > way(wrap)
    assert minimize_scalar(way, bounds=(wrap, wrap + 1), method="bounded").x == pytest.approx(wrap, abs=1e-4)


def test_wrap_of_simple_places():
    axis, r = ca.DM([0, 0, 1]), 0.2
    for B, wrap, length in [
        ([2 * r, 0, -1], np.pi, np.pi * r + 1),  # straight below the far rim
        ([1.5, 0, r], np.pi / 2, np.pi / 2 * r + 1.5 - r),  # far out, level with the top
        ([1e-9, 0, 3], 0, 3),  # straight above the anchor
    ]:
        leaving = exit_points(ca.DM([0, 0, 0]), axis, r, ca.DM(B))
        assert float(leaving.wraps) == pytest.approx(wrap, abs=1e-8)
        assert float(leaving.lengths) == pytest.approx(length, abs=1e-8)


def test_zero_radius_is_a_point_anchor():
    anchor, axis, attachment = random_pulleys(np.random.default_rng(8), 50, 0.0)
    vector = anchor - attachment
    length = np.linalg.norm(vector, axis=1)
    for radius, error in [(0.0, 1e-14), (1e-9, 1e-7)]:
        leaving = exit_points(ca.DM(anchor.T), ca.DM(axis.T), radius, ca.DM(attachment.T))
        np.testing.assert_allclose(leaving.points.full().T, anchor, atol=error)
        np.testing.assert_allclose(leaving.directions.full().T, vector / length[:, None], atol=error)
        np.testing.assert_allclose(leaving.lengths.full().ravel(), length, atol=error)
    mixed = exit_points(ca.DM(anchor[:2].T), ca.DM(axis[:2].T), [0.0, 0.02], ca.DM(attachment[:2].T))
    np.testing.assert_allclose(mixed.points[:, 0].full().ravel(), anchor[0], atol=1e-15)
    assert float(mixed.wraps[1]) > 0


def over_pulley(anchor, axis, radius):
    """Length and direction of a cable over a pulley as a function of its attachment."""
    attachment = ca.SX.sym("attachment", 3)
    leaving = exit_points(ca.DM(anchor), ca.DM(axis / np.linalg.norm(axis)), radius, attachment)
    return ca.Function("over_pulley", [attachment], [leaving.lengths, leaving.directions], ["attachment"], ["l", "u"])


def test_length_over_a_pulley_changes_along_the_cable():
    """dl/dB = -u and du/dB, by CasADi and by differences."""
    rng = np.random.default_rng(9)
    r, step = 0.1, 2e-3
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}

    def derivative(function, h=step):
        return sum(w * (function(k * h) - function(-k * h)) for k, w in weights.items()) / h

    anchors, axes, attachments = random_pulleys(rng, 60, r)
    for anchor, axis, B in zip(anchors, axes, attachments, strict=True):
        cable = over_pulley(anchor, 3 * axis, r)
        slopes = cable.factory("slopes", ["attachment"], ["l", "u", "jac:l:attachment", "jac:u:attachment"])
        length, u, by_length, by_direction = (value.full() for value in slopes(B))
        along = [derivative(lambda h, d=d: cable(B + h * d)[0].full()) for d in np.eye(3)]
        turned = np.hstack([derivative(lambda h, d=d: cable(B + h * d)[1].full()) for d in np.eye(3)])
        np.testing.assert_allclose(np.ravel(along), -u[:, 0], atol=1e-8)
        np.testing.assert_allclose(by_length[0], -u[:, 0], atol=1e-12)
        np.testing.assert_allclose(by_direction, turned, atol=1e-7 * (1 + np.abs(by_direction).max()))
        assert length > 0


def test_length_over_a_pulley_by_complex_step():
    """First order once more, of the formula written for complex numbers: exact to rounding."""
    r, B, dB = 0.1, np.array([0.5, 0.4, -0.9]), np.array([0.3, -0.2, 0.5])

    def complex_length(B):
        out = np.sqrt(B[0] ** 2 + B[1] ** 2) - r
        s = np.sqrt(out**2 + B[2] ** 2 - r**2)
        # B is below the sheave's centre and outside its rim: both angles in the range of arctan
        return r * (np.pi - (np.pi / 2 - np.arctan(r / s)) - np.arctan(B[2] / out)) + s

    step = 1e-30
    slope = complex_length(B + 1j * step * dB).imag / step
    length, u = (value.full().ravel() for value in over_pulley(np.zeros(3), UP, r)(B))
    assert -u @ dB == pytest.approx(slope, rel=1e-13)
    assert length == pytest.approx(complex_length(B + 0j).real, rel=1e-13)


def test_symbols_and_batches():
    for kind in (ca.SX, ca.MX):
        B = kind.sym("B", 3, 2)
        leaving = exit_points(ca.DM.zeros(3, 2), ca.DM([[0, 0], [0, 0], [1, 1]]), [0.1, 0.0], B)
        function = ca.Function("lengths", [B], [leaving.lengths])
        value = function(np.array([[1.0, 1.0], [0.0, 0.0], [-1.0, -1.0]]))
        assert float(value[1]) == pytest.approx(np.sqrt(2))
        assert float(value[0]) > float(value[1])
    points = np.random.default_rng(10).normal(size=(4, 5, 3)) - 3 * UP
    assert call(over_pulley(np.zeros(3), UP, 0.1), {"attachment": points})["u"].shape == (4, 5, 3)


def test_outside_the_domain_is_nan():
    cable = over_pulley(np.zeros(3), UP, 0.1)
    assert all(np.isnan(value.full()).all() for value in cable([0.12, 0, 0.02]))
    assert np.isnan(cable([0, 0, -1])[1].full()).any()
