"""Each number of both papers has a claim; and paper F's new verdicts, recomputed by code apart."""

import re
from itertools import pairwise, permutations, product

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from towline.models import load
from towline.studies.accounts.claim import Verdict
from towline.studies.flying import (
    balance,
    element,
    every_pairing,
    procedure as steps_of_f,
    radius as largest,
    references,
    rotations,
    structure,
    vibration,
)
from towline.studies.towing import equations, loop, ranges, tensions

from .legible import check_grey, check_size, check_texts, renderer_of
from .numbered import IN_THE_TEXT, NUMBERED, STEPS, TEXTS, misplaced, numbers_of, unnamed

RING = np.radians(60 * np.arange(6))
ANCHORS = np.column_stack([0.52 * np.cos(RING), 0.52 * np.sin(RING), np.full(6, -0.07)])
ATTACHMENTS = np.column_stack([0.25 * np.cos(RING), 0.25 * np.sin(RING), np.full(6, 0.03)])
MASS, GRAVITY, RATE = 1.2, 9.81, 0.2 * np.pi


def claims_of(*chapters):
    return {claim.id: claim for chapter in chapters for claim in chapter.claims}


# --- what is numbered


@pytest.fixture(scope="module")
def chapters_of_f():
    return [study.chapter() for study in (structure, element, rotations, balance, references, steps_of_f)]


@pytest.fixture(scope="module")
def flying(chapters_of_f):
    return claims_of(*chapters_of_f)


@pytest.fixture(scope="module")
def chapters_of_c():
    """Paper C's claims, with fewer loops in its workspaces: which claims there are does not depend on their number."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ranges, "loops", lambda drive, full=ranges.loops, **more: full(drive, count=4000, **more))
        patch.setattr(ranges, "SECTIONS", [0.5, 0.6, 0.7])  # where few loops reach
        patch.setattr(ranges, "volume_of", lambda drive, samples, full=ranges.volume_of: full(drive, 200, 16))
        return [study.chapter() for study in (equations, tensions, loop, ranges)]


@pytest.fixture(scope="module")
def towing(chapters_of_c):
    return claims_of(*chapters_of_c)


def test_a_place_names_numbers_one_by_one():
    assert numbers_of("Eqs. 4, 26 and 37, section V, step 7", "Eq.") == {"4", "26", "37"}
    assert numbers_of("Eqs. 34 to 36, figure 4", "Eq.") == {"34"}
    assert numbers_of("steps (a) and (b), Eq. 2", "step") == {"a", "b"}


def test_the_errata_of_paper_c_are_current(chapters_of_c):
    assert not misplaced("ctmrts", {name: claim.verdict for name, claim in claims_of(*chapters_of_c[:3]).items()})


def test_each_number_of_paper_c_has_a_claim(towing):
    """Those of paper F are in the test of its command."""
    places = [claim.place for claim in towing.values()]
    assert not unnamed("ctmrts", places)
    assert unnamed("ctmrts", [place for place in places if "(g)" not in place]) == {"step": {"g"}}


@pytest.mark.parametrize("paper", NUMBERED)
def test_the_numbers_are_those_of_the_papers(paper):
    if not TEXTS[paper].exists():
        pytest.skip("the texts of the papers are not here")
    text = TEXTS[paper].read_text()
    for kind, pattern in {**IN_THE_TEXT, "step": STEPS[paper]}.items():
        assert set(re.findall(pattern, text, re.MULTILINE)) == {str(number) for number in NUMBERED[paper][kind]}, kind


def test_figures_are_legible_in_a_column(chapters_of_f, chapters_of_c):
    figures = {
        name: drawing.figure for chapter in chapters_of_f + chapters_of_c for name, drawing in chapter.drawings.items()
    }
    assert len(figures) >= 8
    for figure in figures.values():
        renderer = renderer_of(figure)
        check_size(figure, renderer)
        check_texts(figure, renderer)
        check_grey(figure)


# --- paper F, by code apart


@pytest.fixture(scope="module")
def samples():
    return rotations.instants()


def spun(samples, step):
    """Rotations of {A}, of {B} in {A} and positions of both at one time, by scipy and Taylor series."""
    parts = [pose + step * velocity + step**2 / 2 * bend for pose, velocity, bend in (samples.base, samples.body)]
    turns = [Rotation.from_euler("ZYX", part[:, :2:-1]) for part in parts]
    return (*turns, *(part[:, :3] for part in parts))


def test_every_pairing_by_linear_programs():
    """The count of pairings at the centre by Gauss' rank and a program, and none of a sample holds at 0.3 m or 1 m."""
    pairs = np.array(list(permutations(range(6))))

    def matrix(pair, place):
        lines = ANCHORS - ATTACHMENTS[pair] - place
        units = lines / np.linalg.norm(lines, axis=1)[:, None]
        return np.vstack([units.T, np.cross(ATTACHMENTS[pair], units).T])

    weight = np.array([0, 0, MASS * GRAVITY, 0, 0, 0])
    taut = 0
    for pair in pairs:
        A = matrix(pair, np.array([0, 0, -1.0]))
        if np.linalg.matrix_rank(A, tol=1e-9) == 6:
            taut += bool((np.linalg.inv(A) @ weight > 1e-9).all())
    assert taut == every_pairing.at_centre().taut.sum() == 208
    rng = np.random.default_rng(2)
    for radius in (0.3, 1.0):
        for pair in pairs[rng.integers(720, size=12)]:
            statuses = set()
            for angle in RING + 0.1:
                out = np.array([np.cos(angle), np.sin(angle), 0])
                w = np.concatenate([-MASS * radius * RATE**2 * out, np.zeros(3)]) + weight
                A = matrix(pair, radius * out - [0, 0, 1.0])
                statuses.add(linprog(np.ones(6), A_eq=A, b_eq=w, bounds=(0, None)).status)
            assert 2 in statuses


def test_the_inward_pull_of_any_pairing_by_hand():
    """From the ring's edge, r_A = 0.52 m, to the nearest attachment, 1 m - r_B, on a height of 1 m - H_1 - H_2."""
    pull = every_pairing.pull_inward(1.0)
    assert pull.least == pytest.approx((1 - 0.25 - 0.52) / (1 - 0.07 - 0.03) * MASS * GRAVITY, rel=1e-9)
    assert pull.needed == pytest.approx(MASS * RATE**2, rel=1e-9)
    claim = largest._inward()
    assert claim.verdict is Verdict.IMPOSSIBLE
    assert (claim.printed, claim.computed) == (pull.needed, pull.least)


def test_the_best_radius_of_any_pairing_is_where_a_cable_goes_slack():
    best = largest.largest_radius_of_any(0.23)
    pairs = every_pairing.hold(0.23)
    motion = every_pairing.circle(best, np.linspace(0, 10, 2001))
    smallest = every_pairing.tensions(motion, every_pairing.hold(best, pairs)).min(axis=(0, 2))
    assert smallest.max() == pytest.approx(0, abs=2e-3)
    assert best == pytest.approx(0.234, abs=1e-3)
    assert len(every_pairing.hold(best + 2 * largest.PRECISION)) == 0


def test_length_and_tension_of_cable_1_by_numpy():
    (crossed,) = np.array([[1, 0, 3, 2, 5, 4]])
    angles = vibration.COARSE * RATE
    places = np.column_stack([0.15 * np.cos(angles), 0.15 * np.sin(angles), np.full(len(angles), -1.0)])
    lengths, pulls = [], []
    for place in places:
        lines = ANCHORS - ATTACHMENTS[crossed] - place
        units = lines / np.linalg.norm(lines, axis=1)[:, None]
        w = np.concatenate([-MASS * RATE**2 * place, np.zeros(3)])
        w[2] = MASS * GRAVITY
        A = np.vstack([units.T, np.cross(ATTACHMENTS[crossed], units).T])
        lengths.append(np.linalg.norm(lines[0]))
        pulls.append(np.linalg.solve(A, w)[0])
    expected = np.corrcoef(lengths, pulls)[0, 1]
    assert vibration.together(crossed[None], 0.15)[0] == pytest.approx(expected, abs=1e-6)
    claim = vibration._tension()
    assert claim.verdict is Verdict.DIFFERS
    assert claim.computed[0] <= expected <= claim.computed[1] < 0


def test_forces_are_in_balance_with_the_printed_wind(flying, samples):
    """Eq. 24 in {G}, whose F_e is up to 3 N: accelerations by differences, F_e by Eq. 25 of the air past the platform.

    The claim's tensions are those of the wrench that Newton and Euler require here.
    """
    step = 1e-4
    (R_A, _, x_A, x_b), *others = (spun(samples, at) for at in (0.0, step, -step))
    places = [at_A + turned.apply(at_b) for turned, _, at_A, at_b in others]
    velocity, now = (places[0] - places[1]) / (2 * step), x_A + R_A.apply(x_b)
    bend = (places[0] - 2 * now + places[1]) / step**2
    air = np.array([5.0, 6.0, 2.0]) - velocity
    half = 0.5 * 1.29 * 0.16
    force = half * np.column_stack([0.45 * air[:, :2] * np.abs(air[:, :2]), 0.05 * (air[:, :2] ** 2).sum(axis=1)])
    assert np.linalg.norm(force, axis=1).max() == pytest.approx(3.0364, rel=1e-3)
    change, _, _, _ = momenta(samples)
    weight = np.array([0, 0, -MASS * GRAVITY])
    wanted = np.hstack([MASS * bend - weight - force, R_A.apply(change)])  # what [u] T is by Eq. 24, dT included
    dynamics = balance.Dynamics("wang-flying")
    world = dynamics.relative.motion_in_world(*samples.body, *samples.base)
    own = dynamics.required_wrench(*world, wind=balance.WIND)
    np.testing.assert_allclose(own, wanted, atol=1e-4)
    assert flying["eq-24"].verdict is Verdict.REPRODUCED
    assert flying["eq-24"].computed < 1e-12


def test_six_lines_of_a_level_platform_span_three_dimensions():
    """A proof, in symbols: every coordinate is affine in c = cos a_i and s = sin a_i, wherever c^2 + s^2 = 1.

    Each is at most quadratic in c and s, with a Hessian that is a multiple of the unit matrix and does not depend on
    them: the multiple times (c^2 + s^2) / 2 is a constant. The Hessian's entries are k_0 + k_1 cos(yaw) + k_2 sin(yaw),
    with k free of x, y and z, so that three yaws decide them.
    """
    c, s, x, y, z, yaw = (ca.SX.sym(name) for name in ("c", "s", "x", "y", "z", "yaw"))
    anchor = ca.vertcat(0.52 * c, 0.52 * s, -0.07)
    turned = ca.vertcat(0.25 * (c * ca.cos(yaw) - s * ca.sin(yaw)), 0.25 * (c * ca.sin(yaw) + s * ca.cos(yaw)), 0.03)
    end = ca.vertcat(x, y, z) + turned
    for coordinate in ca.vertsplit(ca.vertcat(anchor - end, ca.cross(end, anchor - end))):
        hessian = ca.hessian(coordinate, ca.vertcat(c, s))[0]
        assert not ca.depends_on(hessian, ca.vertcat(c, s, x, y, z))
        f = ca.Function("hessian", [yaw], [hessian])
        for angle in (0.1, 1.0, 2.5):
            H = f(angle).full()
            np.testing.assert_allclose(H, H[0, 0] * np.eye(2), atol=1e-15)
    # The points of the robot file are these.
    np.testing.assert_allclose(load("wang-flying-printed").attachments, ATTACHMENTS, atol=1e-9)
    rng = np.random.default_rng(4)
    for _ in range(20):
        pose = np.r_[rng.uniform(-2, 2, 3) - [0, 0, 3], 0, 0, rng.uniform(-3, 3)]
        assert np.linalg.matrix_rank(balance.Dynamics("wang-flying-printed").wrench_matrix(pose), tol=1e-9) == 3


def momenta(samples):
    """dL/dt in {A} by differences of L = R I_b R^T omega, and omega of {A} and of {B} in {A}, in their frames."""
    step, inertia = 1e-4, np.array([0.81, 0.81, 1.57])

    def spin(at):
        (A, B), (now_A, now_B), (C, D) = (spun(samples, at + shift)[:2] for shift in (step, 0, -step))
        after, now, before = A * B, now_A * now_B, C * D
        rate = ((before.inv() * after).as_rotvec()) / (2 * step)  # in {B}
        return now.apply(inertia * rate)

    R_A, R_B = spun(samples, 0.0)[:2]
    change = R_A.inv().apply((spin(step) - spin(-step)) / (2 * step))
    rates = [(spun(samples, -step)[part].inv() * spun(samples, step)[part]).as_rotvec() / (2 * step) for part in (0, 1)]
    return change, rates, R_B, inertia


def test_angular_momentum_by_differences(flying, samples):
    """Eq. 29 holds, and Eq. 33 is off by what stands for omega_A x R I_b Omega in it: Omega x R I_b Omega."""
    change, (omega_A, Omega), R_B, inertia = momenta(samples)
    np.testing.assert_allclose(
        rotations.turn_back(samples.R_A.R, balance.newton_euler(balance.Dynamics("wang-flying"), samples)[:, 3:]),
        change,
        atol=1e-4,
    )
    assert flying["eq-29"].verdict is Verdict.REPRODUCED
    wrong = np.cross(Omega - omega_A, R_B.apply(inertia * Omega))
    off = np.linalg.norm(wrong, axis=1) / np.linalg.norm(change, axis=1)
    assert flying["eq-33"].verdict is Verdict.DIFFERS
    assert flying["eq-33"].computed == pytest.approx(np.median(off), rel=1e-3)


def test_signs_of_an_element_by_a_spring(flying):
    """E A / e between two nodes that move 1 um and 3 um, wound by 2 um: the spring gets 4 um longer."""
    length = np.linalg.norm(np.array([0.52, 0, -0.07]) - [0.125, 0.216506350946, -0.97])
    pull = 13000 * 8 / length * 4e-6
    assert flying["eq-12-13-sign"].printed == pytest.approx(pull, rel=1e-9)
    assert flying["eq-12-13-sign"].computed == pytest.approx(-pull, rel=1e-9)
    wound = pull / 2
    assert flying["eq-15-sign"].printed == pytest.approx((wound, -wound), rel=1e-9)
    assert flying["eq-15-sign"].computed == pytest.approx((-wound, wound), rel=1e-9)


@pytest.mark.parametrize(
    ("name", "factors", "fits"),
    [
        ("eq-14-size", ((2, 1), (2, 1)), False),
        ("eq-20-size", ((6, 1), (6, 1)), False),
        ("eq-21-size", ((27, 1), (27, 1)), False),
        (None, ((6, 2), (2, 2), (2, 6)), True),
    ],
)
def test_sizes_fit_where_neighbours_are_equal(flying, name, factors, fits):
    assert all(left[1] == right[0] for left, right in pairwise(factors)) == fits
    assert (element.product(*factors) != element.UNDEFINED) == fits
    if name is not None:
        assert flying[name].computed == element.UNDEFINED
        assert flying[name].verdict is Verdict.DIFFERS


def test_a_small_displacement_by_matrices(flying, samples):
    """The error of Eqs. 8 and 10 is |dTheta|^2 / 2 of the arm across the axis for a rotation about {G}'s axes.

    Changes of roll, pitch and yaw turn about other axes, by scipy's P: the error is of first order.
    """
    turn = 1e-4 * np.array([0.3, 0.9, -0.7])
    R = Rotation.from_euler("ZYX", samples.base.pose[:, :2:-1]) * Rotation.from_euler(
        "ZYX", samples.body.pose[:, :2:-1]
    )
    arms = np.stack([R.apply(arm) for arm in ATTACHMENTS])
    across = np.linalg.norm(np.cross(turn, arms), axis=-1).max() * np.linalg.norm(turn) / 2
    (error,) = re.findall(r"second order \((\S+) m", flying["eq-8"].why)
    assert float(error) == pytest.approx(across, rel=0.2)
    base = samples.base.pose[:, :2:-1]
    moved = Rotation.from_euler("ZYX", base + turn[::-1]) * Rotation.from_euler("ZYX", base).inv()
    shift = 1e-4 * np.array([0.6, -0.8, 0.5])
    level = np.stack([Rotation.from_euler("ZYX", base).apply(arm) for arm in ATTACHMENTS])
    true = shift + np.cross(moved.as_rotvec(), level)
    off = np.linalg.norm(true - shift - np.cross(turn, level), axis=-1) / np.linalg.norm(true, axis=-1)
    assert flying["eq-8"].computed == pytest.approx(off.max(), rel=1e-2)
    assert flying["eq-8"].verdict is Verdict.DIFFERS


def test_terms_and_letters_of_paper_f(flying, samples):
    """The Coriolis term of Eq. 26, the small angle above Eq. 9, and the frame of alpha_BA, by scipy's rotations."""
    step = 1e-4
    (R_A, R_B, _, _), (after, B_after, _, _), (before, B_before, _, _) = (spun(samples, at) for at in (0, step, -step))
    omega = (before.inv() * after).as_rotvec() / (2 * step)
    dx, ddx = samples.body.velocity[:, :3], samples.body.acceleration[:, :3]
    excess = 2 * MASS * (ddx - np.cross(omega, dx))  # of 2 R_A ddx_b over 2 dR_A dx_b, in {A}
    own = balance.Dynamics("wang-flying").relative.base_disturbance(
        samples.body.pose, samples.body.velocity, *samples.base
    )
    off = np.linalg.norm(excess, axis=1) / np.linalg.norm(own[:, :3], axis=1)
    assert flying["eq-26"].verdict is Verdict.DIFFERS
    assert flying["eq-26"].computed == pytest.approx(np.median(off), rel=1e-4)
    small = Rotation.from_euler("ZYX", 1e-4 * np.array([1.0, -0.8, 0.6])).as_matrix() - np.eye(3)
    assert flying["eq-9-small"].computed == pytest.approx(np.abs(small).max(), rel=1e-3)
    assert flying["eq-9-small"].printed == 0.0
    whole = ((R_A * R_B).inv() * after * B_after).as_rotvec() + ((R_A * R_B).inv() * before * B_before).as_rotvec()
    inner = (R_B.inv() * B_after).as_rotvec() + (R_B.inv() * B_before).as_rotvec()
    apart = np.linalg.norm(whole - inner, axis=1) / np.linalg.norm(whole, axis=1)
    assert flying["eq-32-frame"].computed == pytest.approx(np.median(apart), rel=1e-2)
    assert flying["eq-3-alpha"].printed == pytest.approx(0.25, rel=1e-6)
    for name in ("eq-3-alpha", "eq-23-cables", "frames", "eq-33-right", "section-VI-references"):
        assert flying[name].verdict is Verdict.DIFFERS, name


def test_references_count_the_second_equation_2(flying):
    for name in ("section-V-references", "section-II-IV-references"):
        assert flying[name].computed == tuple(number - (number > 2) for number in flying[name].printed)


def test_the_frames_of_figure_2_close_by_scipy(flying, samples):
    R_A, R_B, x_A, x_b = spun(samples, 0.0)
    for anchor, arm in product(ANCHORS[:2], ATTACHMENTS[:2]):
        line = R_A.apply(anchor - x_b - R_B.apply(arm))
        gap = x_A + R_A.apply(x_b) + (R_A * R_B).apply(arm) + line - x_A - R_A.apply(anchor)
        assert np.abs(gap).max() < 1e-13
    assert flying["fig-2"].computed < 1e-13
    shared = MASS * GRAVITY / 6 * np.hypot(0.27, 0.9) / 0.9  # by six equal cables, 0.27 m aside on 0.9 m
    assert flying["fig-1"].computed[0] == pytest.approx(shared, rel=1e-6)
    np.testing.assert_allclose(load("wang-flying-printed").anchors, ANCHORS, atol=1e-9)
