"""The papers' motions in forward time: each essential figure of the claims by a second derivation, and the command."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.layout_engine import ConstrainedLayoutEngine
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from towline.cli.main import app
from towline.figures import style
from towline.models import Dynamics, load
from towline.studies.accounts.claim import Verdict
from towline.studies.flying import flights, plans, shaken, wind
from towline.studies.flying.shaken import FLIGHT, PERIOD
from towline.studies.papers import FLYING
from towline.studies.towing import flights as towed

from .numbered import ERRATA, unnamed

GRAVITY = np.array([0, 0, -9.81])


@pytest.fixture(scope="module")
def robot():
    return load("wang-flying")


@pytest.fixture(scope="module")
def flown_once():
    """Keep the simulations that the command makes, which the other tests look at."""
    with pytest.MonkeyPatch.context() as patch:
        for module, names in ((flights, ("fly", "small_circle")), (shaken, ("shake", "release", "blow"))):
            for name in names:
                patch.setattr(module, name, cache(getattr(module, name)))
        yield


@pytest.fixture(scope="module")
def circle(robot, flown_once):
    return flights.fly(robot, "circle")


@pytest.fixture(scope="module")
def hovering(robot, flown_once):
    return flights.small_circle(robot, 0.0), flights.small_circle(robot, flights.AWAY)


@pytest.fixture(scope="module")
def seen(robot, flown_once):
    return shaken.shake(robot)


@pytest.fixture(scope="module")
def vibrations(flown_once):
    return {claim.id: claim for claim in shaken.chapter().claims}


def pulls(robot, platform, carriers):
    """Forces of unit tensions (n, 3, m) of level bodies, and the arms of their attachments (n, m, 3)."""
    owner = robot.carrier_of_cable
    arms = np.broadcast_to(robot.attachments, (len(platform), *robot.attachments.shape))
    lines = carriers[:, owner, :3] + robot.anchors - platform[:, None, :3] - arms
    return (lines / np.linalg.norm(lines, axis=2, keepdims=True)).transpose(0, 2, 1), arms


def drag(robot, air):
    """Half rho S (C_d V_x |V_x|, C_d V_y |V_y|, C_l (V_x^2 + V_y^2)) for velocities of the air, (n, 3)."""
    aero = robot.platform.aero
    along = aero.drag * air[:, :2] * np.abs(air[:, :2])
    lift = aero.lift * (air[:, :2] ** 2).sum(axis=1)
    return 0.5 * aero.air_density * aero.area * np.column_stack([along, lift])


def test_the_command_reproduces_the_paper(flown_once, tmp_path, monkeypatch):
    monkeypatch.setattr(style, "svg", lambda figure: "<svg/>")  # each figure is printed into its file,
    monkeypatch.setattr(style, "DPI", 20)  # of few pixels, and not laid out
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda self, figure: None)
    arguments = ["reproduce", "flying", "--out", str(tmp_path / "out"), "--json"]
    printed = json.loads(CliRunner().invoke(app, arguments, catch_exceptions=False).stdout)
    assert printed["complete"]
    assert {"id", "printed", "computed", "verdict"} <= set(printed["claims"][0])
    names = [claim["id"] for claim in printed["claims"]]
    assert len(names) == len(set(names)) > 50
    assert not unnamed("flying", [claim["place"] for claim in printed["claims"]])
    by_name = {claim["id"]: claim for claim in printed["claims"]}
    assert by_name["circle"]["verdict"] == "impossible"
    places = {by_name[name]["place"] for name in ("VI.A-flown", "VI.B-flown", "circle-repair", "helix-repair")}
    assert places <= {"VI.A", "VI.B", "VI.A, figure 6", "VI.B, figure 8"}
    for name in ("circle-repair", "helix-repair", "VI.A-flown", "VI.B-flown", "flown-positive"):
        assert by_name[name]["verdict"] == "repaired"
        assert by_name[name]["statement"].startswith("Not in the paper: ")
        assert by_name[name]["printed"] is None
    assert {"circle", "radius", "circle-any-pairing"} <= {
        name for name, claim in by_name.items() if claim["verdict"] == "impossible"
    }
    assert by_name["fig-11"]["verdict"] == "not determined"
    assert by_name["eq-6-flown"]["verdict"] == "reproduced"
    assert by_name["conclusion-stability"]["verdict"] == by_name["VI.C-flown"]["verdict"] == "not determined"
    assert by_name["fig-10-tension"]["verdict"] == "differs"
    assert all(Path(file).stat().st_size > 0 for file in printed["files"])
    drawn = {Path(file).stem for file in printed["files"] if file.endswith(".png")}
    assert {claim["figure"] for claim in printed["claims"]} - {None} <= drawn
    page = (tmp_path / "out" / "flying.html").read_text()
    assert page.count("<details>") == len(names)
    assert page.count("data:image/svg+xml") == len(drawn)
    assert not re.search(r'(src|href)="(?!data:|#claim-|#chapter-|#errata)', page)
    errata = (tmp_path / "out" / "flying-errata.md").read_text()
    assert all((f"(`{name}`):" in errata) == (by_name[name]["verdict"] != "reproduced") for name in names)
    assert FLYING in errata
    words, numbers = words_and_numbers(errata)
    assert (words, pytest.approx(numbers, rel=0.03, abs=1e-6)) == words_and_numbers((ERRATA / "flying.md").read_text())


def words_and_numbers(text):
    """The words of a page, and its numbers apart: their last digits differ from machine to machine."""
    number = r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?"
    return re.sub(number, "#", text), [float(found) for found in re.findall(number, text)]


# --- paper F: flights


def test_a_flown_platform_is_on_the_circle_of_the_paper(circle):
    """The claim's distance is that from the plan; here it is that from r = 1 m about [50, 50, 99], by the pose."""
    pose = circle.gives.trajectory["pose"].values
    from_centre = pose[:, :3] - [50, 50, 99]
    off = np.hypot(np.linalg.norm(from_centre[:, :2], axis=1) - 1, from_centre[:, 2])
    claim = flights._followed("VI.B-flown", "circle", {"circle": circle})
    assert claim.verdict is Verdict.REPAIRED  # the paper's quadrotor hovers, this one is free
    assert off.max() <= claim.computed < 1.5 * off.max()  # beside that it may be early or late
    turned = np.unwrap(np.arctan2(from_centre[:, 1], from_centre[:, 0]))
    assert turned[-1] - turned[0] == pytest.approx(2 * np.pi, rel=1e-3)


def test_forces_of_a_flight_are_in_balance_with_wind(robot, circle):
    """M a = sum of T u + m g + F_e by Newton, of what the plant's dataset reports; the platform stays nearly level."""
    data = circle.gives.trajectory
    pose, carriers = data["pose"].values, data["carrier_pose"].values
    assert np.abs(pose[:, 3:]).max() < 0.02
    velocity = data["velocity"].values[:, :3]
    forces = drag(robot, data["wind"].values - velocity)
    units, _ = pulls(robot, pose, carriers)
    given = np.einsum("nij,nj->ni", units, data["tensions"].values) + forces
    wanted = robot.platform.mass * (np.gradient(velocity, flights.STEP, axis=0) - GRAVITY)
    off = np.linalg.norm(given - wanted, axis=1)
    assert np.linalg.norm(forces, axis=1).max() > 1.5
    assert np.median(off) < 0.03


def test_a_looser_or_tighter_tolerance_decides_the_verdict(circle, monkeypatch):
    monkeypatch.setattr(flights, "ON_CIRCLE", 1e-4)
    assert flights._followed("VI.B-flown", "circle", {"circle": circle}).verdict is Verdict.NOT_DETERMINED
    assert flights._lengths({"circle": circle}).verdict is Verdict.DIFFERS


def test_the_platform_sags_by_what_its_cables_are_longer(robot, circle):
    """By the elongations T l / (E A) of the planned tensions, and the platform's shift J^-1 dl."""
    row = 5000
    T = flights.required(robot, circle)[row]
    lengths = Dynamics(robot).cable_lengths(circle.body.pose[row], circle.carriers.pose[row])
    A = Dynamics(robot).wrench_matrix(circle.body.pose[row], circle.carriers.pose[row])
    shift = np.linalg.solve(-A.T, T * lengths / 13000)  # dl = -A^T dx
    flown = (circle.calm.states.pose - circle.body.pose)[row]
    np.testing.assert_allclose(flown[:3], shift[:3], atol=2e-5)


def test_the_wind_of_figure_5_changes_the_tensions_by_its_force(robot, circle):
    claim = flights._wind(robot, circle)
    platform, carriers = circle.body.pose, circle.carriers.pose
    units, arms = pulls(robot, platform, carriers)
    A = np.concatenate([units, np.cross(arms, units.transpose(0, 2, 1)).transpose(0, 2, 1)], axis=1)
    force = drag(robot, flights.gust(FLIGHT, 0) - circle.body.velocity[:, :3])
    change = np.linalg.solve(A, np.hstack([-force, 0 * force])[..., None])[..., 0]
    planned = circle.stays.references
    tensions = np.stack([reference.tensions for reference in planned])
    most = 100 * np.abs(change[:-1:2] / tensions).max()  # references are 2 ms apart
    assert float(claim.computed.removesuffix(" %")) == pytest.approx(most, abs=1)


def test_wind_is_that_of_the_figure(robot):
    drawn = wind.trapezoid(plans.TIMES, wind.PEAK, noise=wind.NOISE)
    np.testing.assert_array_equal(flights.gust(plans.TIMES, 0), drawn)


def test_a_flight_has_drag_without_wind(robot):
    """At (6, 5) m/s and 0.2 pi m/s about the circle, by Eq. 25's own numbers."""
    times = np.linspace(0, 10, 10001)
    turn = 0.2 * np.pi * times
    velocity = np.column_stack([6 - 0.2 * np.pi * np.sin(turn), 5 + 0.2 * np.pi * np.cos(turn)])
    largest = (0.5 * 1.29 * 0.45 * 0.16 * np.linalg.norm(velocity**2, axis=1)).max()
    reference = flights.read_trajectory(robot, plans.planned("helix"), None).at(FLIGHT)
    body, carriers = (plans.Motion(*part) for part in reference)
    claim = flights._own_drag(robot, flights.Flown(None, None, None, None, body, carriers))
    assert claim.computed == pytest.approx(largest, rel=1e-3)
    assert claim.verdict is Verdict.DIFFERS
    # 60 m, 50 m and 62.45 m in 10 s
    assert f"{np.sqrt(6**2 + 5**2 + 6.245**2):.1f} m/s ({np.hypot(6, 5):.1f} m/s horizontally)" in claim.why


def test_a_repair_states_what_its_quadrotor_does(circle):
    """The quadrotor is level whatever its acceleration, which is that of its path by second differences."""
    data = circle.gives.trajectory
    carrier = data["carrier_pose"].values[:, 0]
    assert np.abs(carrier[:, 3:]).max() < 1e-9
    bend = np.diff(carrier[::10, :2], 2, axis=0) / (10 * flights.STEP) ** 2
    claim = flights._followed("VI.B-flown", "circle", {"circle": circle})
    (stated,) = re.findall(r"horizontal accelerations of up to ([\d.]+) m/s\^2", claim.why)
    assert float(stated) == pytest.approx(np.linalg.norm(bend, axis=1).max(), rel=0.15)
    assert "below the assumed t_min = 0.5 N for 0.0% of the time" in claim.why
    assert data["tensions"].values.min() > 0.5


def test_no_tensions_hold_the_platform_where_the_quadrotor_hovers(robot, hovering):
    """By linear programs along the reference itself: the share of instants without tensions, and an error beyond."""
    claim = flights._stability(*hovering)
    assert claim.verdict is Verdict.NOT_DETERMINED  # "stable" is not defined, and may be the quadrotor's own motion
    rows = np.arange(0, 10_000, 100)
    body = plans.circle(plans.FEASIBLE, FLIGHT[rows])
    units, arms = pulls(robot, body.pose, np.zeros((len(rows), 1, 6)))
    A = np.concatenate([units, np.cross(arms, units.transpose(0, 2, 1)).transpose(0, 2, 1)], axis=1)
    force = robot.platform.mass * (body.acceleration[:, :3] - GRAVITY)
    force -= drag(robot, flights.gust(FLIGHT[rows], 0) - body.velocity[:, :3])
    bounds = list(zip(robot.t_min, robot.t_max, strict=True))
    without = [
        linprog(np.ones(6), A_eq=one, b_eq=[*wanted, 0, 0, 0], bounds=bounds).status == 2
        for one, wanted in zip(A, force, strict=True)
    ]
    stays, gives = hovering
    assert np.mean(without) == pytest.approx(1 - stays.answered["as planned"] / 5000, abs=0.05)
    assert gives.answered["as planned"] == 5000
    # Along x and y the quadrotor is where the load hangs in the wind as without: its pull leans by F_e / (m g).
    air = gives.trajectory["wind"].values[2500]
    lean = 0.9 * drag(robot, air[None])[0, :2] / (robot.platform.mass * 9.81)
    offset = (gives.trajectory["carrier_pose"] - gives.trajectory["carrier_reference"]).values[2500, 0, :2]
    assert np.dot(offset, lean) < 0
    assert 0.5 < np.linalg.norm(offset) / np.linalg.norm(lean) < 2


# --- paper F: a vibration


def test_what_a_vibration_adds_to_tensions_by_newton_and_euler(robot, seen):
    """A dT = M ddx - f, of the motion that the plant computed; the cables turn too little to matter."""
    dynamics, body = Dynamics(robot), plans.circle(plans.FEASIBLE, shaken.SHAKEN)
    times = shaken.SHAKEN
    middle = times - PERIOD / 2  # forces are held: at an instant, the mean of two
    force = 0.1 * np.sin(2 * np.pi * np.outer(middle, [5, 6, 7]) + [0, 1, 2])
    bend = np.gradient(np.gradient(seen.vibration, PERIOD, axis=0), PERIOD, axis=0)
    inertia = np.array([1.2] * 3 + [0.81, 0.81, 1.57])
    wanted = inertia * bend - np.pad(force, ((0, 0), (0, 3)))
    added = np.linalg.solve(dynamics.wrench_matrix(body.pose), wanted[..., None])[..., 0]
    rows = slice(1000, -200)
    assert np.abs(seen.dT[rows]).max() > 0.1
    assert np.abs(added[rows, 0] - seen.dT[rows]).max() < 0.01 * np.abs(seen.dT[rows]).max()


def test_an_increment_over_a_time_step_is_no_rate(vibrations):
    """For sines of 5 to 7 Hz the ratio is 1 / (w dt), with w between theirs."""
    claim = vibrations["eq-11-plant"]
    assert claim.verdict is Verdict.DIFFERS
    rates = [1 / (ratio * step) for ratio, step in zip(claim.computed, (0.001, 0.01, 0.1), strict=True)]
    assert rates[0] == pytest.approx(rates[2], rel=1e-2)
    assert 2 * np.pi * 5 < rates[1] < 2 * np.pi * 7
    # The change in a short step is the rate times the step: w dt of the elastic force.
    assert vibrations["eq-10-plant"].computed[0] == pytest.approx(1e-3 * rates[0], rel=1e-2)
    assert vibrations["eq-7-plant"].verdict is vibrations["eq-21-plant"].verdict is Verdict.REPRODUCED


def test_turning_about_z_decays_as_a_damped_oscillator_does(robot, vibrations):
    """I ddq + C dq + K q = 0 about home, with K by differences of the cables' moments, whose lengths stay."""
    dynamics, home = Dynamics(robot), robot.home
    A, lengths = dynamics.wrench_matrix(home), dynamics.cable_lengths(home)
    T = np.linalg.solve(A, [0, 0, robot.weight, 0, 0, 0])
    unstrained = lengths / (1 + T / 13000)

    def moment(turn):
        pose = home + np.array([0, 0, 0, 0, 0, turn])
        pull = 13000 * (dynamics.cable_lengths(pose) - unstrained) / unstrained
        return (dynamics.wrench_matrix(pose) @ pull)[5]

    stiffness, damping = -(moment(1e-6) - moment(-1e-6)) / 2e-6, 200 * (A[5] ** 2).sum()
    decay = damping / (2 * 1.57)
    rate = np.sqrt(stiffness / 1.57 - decay**2)
    times = np.arange(0, 2, 1e-4)
    free = np.exp(-decay * times) * np.sin(rate * times)
    last = times[np.flatnonzero(np.abs(free) > 0.1 * np.abs(free).max())[-1]]
    claim = vibrations["section-III-vibration"]
    assert claim.verdict is Verdict.DIFFERS
    assert float(claim.computed.split(", ")[5].removesuffix(" s")) == pytest.approx(last, abs=0.01)
    (waves,) = re.findall(r"takes ([\d.]+) periods", claim.why)
    assert float(waves) == pytest.approx(last * rate / (2 * np.pi), abs=0.1)


# --- paper C


@pytest.mark.parametrize("drive", ["fixed-length", "both"])
def test_a_towed_load_is_moved_by_its_cables_alone(drive):
    """M a = sum of T u + m g by Newton, from the dataset; lengths and robot-ends are where the drive has them."""
    flight = towed.fly(drive, 3)
    assert flight.passed
    robot, data = flight.robot, flight.trajectory
    pose, carriers, tensions = (data[name].values for name in ("pose", "carrier_pose", "tensions"))
    turned = Rotation.from_euler("ZYX", pose[:, :2:-1]).as_matrix() @ robot.attachments.T
    lines = carriers[:, :, :3].transpose(0, 2, 1) - pose[:, :3, None] - turned
    lengths = np.linalg.norm(lines, axis=1)
    given = (lines * (tensions / lengths)[:, None]).sum(axis=2)
    wanted = robot.platform.mass * (np.gradient(data["velocity"].values[:, :3], PERIOD, axis=0) - GRAVITY)
    assert np.median(np.linalg.norm(given - wanted, axis=1)) < 2e-3 * robot.weight
    assert tensions.min() > 40
    if drive == "fixed-length":
        np.testing.assert_allclose(lengths, 1.2, atol=1e-9)
    else:
        np.testing.assert_allclose(lengths[0], 1.25, atol=1e-4)
        np.testing.assert_allclose(lengths[-1], 1.1, atol=1e-3)
    np.testing.assert_allclose(carriers[-1, :, :3] - carriers[0, :, :3], [[0.08, 0.1, 0.1]] * 3, atol=0.02)
    assert towed.in_boxes(flight)
