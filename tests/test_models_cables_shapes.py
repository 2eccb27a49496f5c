"""Cables with mass and cables over pulleys, against energy balances, string formulas, quadrature and geometry."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from towline.base.errors import InputError
from towline.models.batch import call
from towline.models.cables import LumpedChain, exit_points, hang, pulley_motion

EA, RHO, L0 = 13000.0, 0.02, 2.0
UP = np.array([0.0, 0.0, 1.0])

# --- lumped chain


def resting(chain, start, end):
    return {"start": start, "start_velocity": np.zeros(3), "end": end, "end_velocity": np.zeros(3)}


def test_power_balance_at_random_states():
    """dE/dt is what the ends put in less what the dampers take, with segments of all kinds, slack ones among them."""
    chain = LumpedChain(L0, EA, RHO, damping=0.3, segments=6)
    names = chain.energy.name_in()
    inputs = [ca.SX.sym(name, *chain.energy.size_in(name)) for name in names]
    state, start, start_velocity, end, end_velocity = inputs
    total = chain.energy(**dict(zip(names, inputs, strict=True)))["total"]
    motion = chain.dynamics(**dict(zip(names, inputs, strict=True)))
    moved = ca.vertcat(state, start, end)
    rate = ca.jtimes(total, moved, ca.vertcat(motion["dstate"], start_velocity, end_velocity))
    put_in = -ca.dot(motion["start_force"], start_velocity) - ca.dot(motion["end_force"], end_velocity)
    balance = ca.Function("balance", inputs, [rate - put_in, motion["tensions"]])
    rng = np.random.default_rng(1)
    slack = taut = 0
    for _ in range(200):
        ends = rng.normal(size=3), rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
        values = chain.straight(ends[0], ends[2]) + 0.1 * rng.normal(size=chain.state_size)
        difference, tensions = balance(values, *ends)
        lost = float(chain.energy(values, *ends)[4])
        assert lost >= 0
        assert float(difference) == pytest.approx(-lost, rel=1e-9, abs=1e-7)
        slack += int((tensions.full() == 0).sum())
        taut += int((tensions.full() > 0).sum())
    assert slack > 100
    assert taut > 100


@pytest.mark.parametrize("span", [1.2, 2.005])
def test_energy_decays_monotonically_when_undriven(span):
    """A cable let go in a straight line, slack or taut, between resting ends."""
    chain = LumpedChain(L0, 500.0, RHO, damping=0.5, segments=6)
    start, end = np.zeros(3), np.array([span, 0.0, 0.0])
    ends = resting(chain, start, end)
    state = chain.straight(start, end)
    state[1:15:3] += 0.02 * np.sin(np.arange(5))  # out of the plane, too
    solution = solve_ivp(
        lambda _, x: chain.dynamics(x, *ends.values())[0].full().ravel(), (0, 0.5), state, rtol=1e-8, atol=1e-10
    )
    energy = call(chain.energy, {"state": solution.y.T} | ends)["total"][..., 0]
    allowed = 1e-9 * np.abs(energy).max()  # of the integrator
    assert len(energy) > 200
    assert np.diff(energy).max() < allowed
    assert energy[-1] < energy[0] - 1e-3 * np.abs(energy[0])


def test_energy_of_an_undamped_chain_is_constant():
    chain = LumpedChain(L0, 500.0, RHO, segments=4)
    ends = resting(chain, np.zeros(3), np.array([2.05, 0.0, 0.0]))
    state = chain.straight(ends["start"], ends["end"])
    state[1] = 0.01
    solution = solve_ivp(
        lambda _, x: chain.dynamics(x, *ends.values())[0].full().ravel(),
        (0, 0.2),
        state,
        "DOP853",
        rtol=1e-9,
        atol=1e-11,
    )
    energy = call(chain.energy, {"state": solution.y.T} | ends)["total"][..., 0]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)


@pytest.mark.parametrize("segments", [10, 40])
def test_frequencies_of_a_taut_string(segments):
    """K / (2 l) sqrt(T / rho_l) across and k / (2 L0) sqrt(E A / rho) along, within (k pi / 2 n)^2 / 6."""
    T = 60.0
    stretched = L0 * (1 + T / EA)
    chain = LumpedChain(L0, EA, RHO, segments=segments, gravity=(0.0, 0.0, 0.0))
    ends = resting(chain, np.zeros(3), np.array([0.0, stretched, 0.0]))
    inputs = {"state": chain.straight(ends["start"], ends["end"])} | ends
    jacobian = chain.dynamics.factory("J", chain.dynamics.name_in(), ["jac:dstate:state"])
    half = chain.state_size // 2
    stiffness = -jacobian(**inputs)["jac_dstate_state"].full()[half:, :half]
    axes = {axis: stiffness[axis::3, axis::3] for axis in range(3)}
    k = np.arange(1, segments)
    for axis, speed, span in [
        (0, np.sqrt(T * stretched / (RHO * L0)), stretched),  # rho_l = rho L0 / l
        (2, np.sqrt(T * stretched / (RHO * L0)), stretched),
        (1, np.sqrt(EA / RHO), L0),
    ]:
        found = np.sqrt(np.sort(np.linalg.eigvalsh(axes[axis])))
        string = np.pi * k * speed / span
        error = 1 - found / string
        bound = (k * np.pi / (2 * segments)) ** 2 / 6
        low = k <= 3
        assert (error[low] > 0).all()
        assert (error[low] < bound[low]).all()
        np.testing.assert_allclose(found, 2 * segments * speed / span * np.sin(k * np.pi / (2 * segments)), rtol=1e-8)


def test_longitudinal_wave_is_damped_as_the_whole_cable_says():
    """Of end velocities v apart at the right length, the damper gives C v, for every number of segments."""
    for segments in (2, 7):
        chain = LumpedChain(L0, EA, RHO, damping=3.0, segments=segments, gravity=(0.0, 0.0, 0.0))
        state = chain.straight([0, 0, 0], [L0 * 1.01, 0, 0])
        shares = np.arange(1, segments) / segments
        state[chain.state_size // 2 :: 3] = 0.4 * shares
        tensions = chain.dynamics(state, [0, 0, 0], [0, 0, 0], [L0 * 1.01, 0, 0], [0.4, 0, 0])[3]
        np.testing.assert_allclose(tensions.full(), EA * 0.01 + 3.0 * 0.4, rtol=1e-10)


def test_resting_chain_is_irvines_catenary():
    """Equilibrium of 60 segments against the closed form: forces at both ends, half a segment's weight added."""
    chain = LumpedChain(L0, 50.0, RHO, segments=60)
    start, end = np.array([0.1, 0.2, 0.3]), np.array([1.5, -0.5, 1.0])
    smooth = hang(start, end, L0, 50.0, RHO * 9.81)
    state = chain.straight(start, end)
    half = chain.state_size // 2
    state[:half] = smooth.points(np.arange(1, 60) / 60).ravel()
    place = ca.SX.sym("place", half)
    ends = [start, np.zeros(3), end, np.zeros(3)]
    pulled = chain.dynamics(ca.vertcat(place, np.zeros(half)), *ends)
    balance = ca.Function("balance", [place], [pulled[0][half:]])
    rest = ca.rootfinder("rest", "newton", balance)(state[:half])
    _, start_force, end_force, _ = chain.dynamics(ca.vertcat(rest, np.zeros(half)), *ends)
    weight = -UP * chain.end_mass * 9.81
    np.testing.assert_allclose(start_force.full().ravel() + weight, smooth.start_force, atol=2e-3 * RHO * L0 * 9.81)
    np.testing.assert_allclose(end_force.full().ravel() + weight, smooth.end_force, atol=2e-3 * RHO * L0 * 9.81)
    np.testing.assert_allclose(rest.full().ravel(), state[:half], atol=2e-3)


def test_chain_of_coincident_nodes_is_finite():
    chain = LumpedChain(L0, EA, RHO, damping=1.0, segments=4)
    outputs = chain.dynamics(np.zeros(chain.state_size), *[np.zeros(3)] * 4)
    assert all(np.isfinite(value.full()).all() for value in outputs)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"length": 0}, "length"),
        ({"stiffness": -1}, "stiffness"),
        ({"density": np.nan}, "density"),
        ({"damping": -1}, "damping"),
        ({"segments": 1}, "segments"),
        ({"segments": 2.5}, "segments"),
        ({"gravity": (0, 0)}, "gravity"),
        ({"stiffness": "stiff"}, "stiffness"),
    ],
)
def test_lumped_chain_refuses(arguments, field):
    with pytest.raises(InputError, match=field):
        LumpedChain(**({"length": L0, "stiffness": EA, "density": RHO} | arguments))


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


def test_pulley_motion_against_differences():
    """dl/dB = -u, and both orders of length and direction along random smooth motions."""
    rng = np.random.default_rng(9)
    r, step = 0.1, 2e-3
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}

    def derivative(function, h=step):
        return sum(w * (function(k * h) - function(-k * h)) for k, w in weights.items()) / h

    anchors, axes, attachments = random_pulleys(rng, 60, r)
    for anchor, axis, B in zip(anchors, axes, attachments, strict=True):
        motion = pulley_motion(anchor, 3 * axis, r)
        dB, ddB = 0.3 * rng.normal(size=(2, 3))
        still = np.zeros(3)
        length, d_length, dd_length, u, d_u, dd_u = (v.full().ravel() for v in motion(B, dB, ddB))
        along = [float(derivative(lambda h, d=d: motion(B + h * d, still, still)[0])) for d in np.eye(3)]
        np.testing.assert_allclose(along, -u, atol=1e-8)

        def at(t, B=B, dB=dB, ddB=ddB):
            return B + dB * t + ddB * t**2 / 2

        def place(t, motion=motion):
            value = motion(at(t), still, still)
            return np.r_[value[0].full().ravel(), value[3].full().ravel()]

        def speed(t, motion=motion):
            value = motion(at(t), dB + ddB * t, ddB)
            return np.r_[value[1].full().ravel(), value[4].full().ravel()]

        size = 1 + np.abs(dd_u).max()
        np.testing.assert_allclose(derivative(place), np.r_[d_length, d_u], atol=1e-7 * size)
        np.testing.assert_allclose(derivative(speed), np.r_[dd_length, dd_u], atol=1e-7 * size)
        assert d_length == pytest.approx(-u @ dB, abs=1e-12)
        assert length > 0


def test_pulley_motion_by_complex_step():
    """First order once more, of the formula written for complex numbers: exact to rounding."""
    r, B, dB = 0.1, np.array([0.5, 0.4, -0.9]), np.array([0.3, -0.2, 0.5])

    def complex_length(B):
        out = np.sqrt(B[0] ** 2 + B[1] ** 2) - r
        s = np.sqrt(out**2 + B[2] ** 2 - r**2)
        # B is below the sheave's centre and outside its rim: both angles in the range of arctan
        return r * (np.pi - (np.pi / 2 - np.arctan(r / s)) - np.arctan(B[2] / out)) + s

    step = 1e-30
    slope = complex_length(B + 1j * step * dB).imag / step
    motion = pulley_motion([0, 0, 0], [0, 0, 1], r)
    assert float(motion(B, dB, np.zeros(3))[1]) == pytest.approx(slope, rel=1e-13)
    assert float(motion(B, dB, np.zeros(3))[0]) == pytest.approx(complex_length(B + 0j).real, rel=1e-13)


def test_symbols_and_batches():
    for kind in (ca.SX, ca.MX):
        B = kind.sym("B", 3, 2)
        leaving = exit_points(ca.DM.zeros(3, 2), ca.DM([[0, 0], [0, 0], [1, 1]]), [0.1, 0.0], B)
        function = ca.Function("lengths", [B], [leaving.lengths])
        value = function(np.array([[1.0, 1.0], [0.0, 0.0], [-1.0, -1.0]]))
        assert float(value[1]) == pytest.approx(np.sqrt(2))
        assert float(value[0]) > float(value[1])
    motion = pulley_motion([0, 0, 0], [0, 0, 1], 0.1)
    points = np.random.default_rng(10).normal(size=(4, 5, 3)) - 3 * UP
    batch = call(motion, {"attachment": points, "velocity": np.ones(3), "acceleration": np.zeros(3)})
    assert batch["dd_direction"].shape == (4, 5, 3)


def test_outside_the_domain_is_nan():
    motion = pulley_motion([0, 0, 0], [0, 0, 1], 0.1)
    inside = motion([0.12, 0, 0.02], np.zeros(3), np.zeros(3))
    assert all(np.isnan(value.full()).all() for value in (inside[0], inside[3]))
    on_axis = motion([0, 0, -1], np.zeros(3), np.zeros(3))
    assert np.isnan(on_axis[3].full()).any()
    with pytest.raises(InputError, match="radius"):
        pulley_motion([0, 0, 0], [0, 0, 1], -0.1)
    with pytest.raises(InputError, match="axis"):
        pulley_motion([0, 0, 0], [0, 0, 0], 0.1)
