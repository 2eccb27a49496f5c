"""Each script in `examples/` does what it says, run as a user runs it, as a script in a folder of its own."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

import towline

from .test_ocp_formation import bodies
from .warm import run

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted(path.stem for path in (ROOT / "examples").glob("*.py"))
MOST_LINES, MOST_BYTES = 60, 110_000


def circles(found):
    arm = found.pose.values[:, :2] - [50, 50]
    np.testing.assert_allclose(np.linalg.norm(arm, axis=1), 1, atol=1e-9)
    np.testing.assert_allclose(found.pose.values[:, 2], 99, atol=1e-9)
    carrier = found.carrier_pose.values[:, 0]
    np.testing.assert_allclose(carrier[0], carrier[-1], atol=1e-6)  # one round after the other
    assert found.tensions.min() > 0.5


def carries(found):
    np.testing.assert_allclose(found.pose.values[[0, -1], :3], [[1.1, 0.9, 0.2], [1.45, 1.05, 0.3]], atol=1e-9)
    np.testing.assert_allclose(found.velocity.values[[0, -1]], 0, atol=1e-9)
    np.testing.assert_allclose(found.pose.values[:, 3:], 0, atol=1e-9)
    # Newton's second law of the load, from cable directions that are computed here.
    corners = np.array([[0.05, -0.028867513459, 0], [0, 0.057735026919, 0], [-0.05, -0.028867513459, 0]])
    along = found.carrier_pose.values[:, :, :3] - (found.pose.values[:, None, :3] + corners)
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    pull = np.einsum("nm,nmi->ni", found.tensions.values, along)
    np.testing.assert_allclose(pull, 10 * (found.acceleration.values[:, :3] + [0, 0, 9.81]), atol=0.1)


def passes(found):
    quads, load = found.carrier_pose.values, found.pose.values
    np.testing.assert_allclose(load[[0, -1], :3], [[-2.5, 0, 0], [2.5, 0, 0]], atol=1e-9)
    between = np.abs(quads[..., 0]) < 0.2  # the walls' thickness
    assert between.any(axis=0).all()  # each of them
    # The rotors as discs, tilted with their quadrotors: none comes within 0.05 m of a wall or of another.
    radius = 0.3 * np.sqrt(1.5)
    angle = np.linspace(0, 2 * np.pi, 73)
    rim = radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(73)], axis=1)
    turned = Rotation.from_euler("ZYX", quads[..., 5:2:-1].reshape(-1, 3)).as_matrix().reshape(*quads.shape[:2], 3, 3)
    rims = quads[:, :, None, :3] + np.einsum("ncij,pj->ncpi", turned, rim)
    robot = towline.load("multi-quadrotor-4")
    platform, cables = bodies(robot, load, quads)
    for points in (rims, platform, cables):
        beyond = np.stack([np.abs(points[..., 0]) - 0.2, 0.9 - np.abs(points[..., 1])], axis=-1)
        outside = np.where((beyond > 0).all(axis=-1), np.linalg.norm(beyond, axis=-1), beyond.max(axis=-1))
        assert outside.min() >= 0.05 - 1e-5
    lengths = np.linalg.norm(cables[:, :, -1] - cables[:, :, 0], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(robot.fixed_lengths, lengths.shape), atol=1e-4)
    assert (robot.t_min - 1e-6 <= found.tensions.values).all()
    assert (found.tensions.values <= robot.t_max + 1e-6).all()
    apart = np.linalg.norm(quads[:, :, None, :3] - quads[:, None, :, :3], axis=3) + 9 * np.eye(4)
    assert apart.min() >= 2 * radius + 0.05 - 1e-5
    assert np.ptp(quads[0, :, 1]) > 1.6  # and wide again, before and after
    assert np.ptp(quads[-1, :, 1]) > 1.6


def picks_and_places(found):
    place = found.pose.values[:, :3]
    np.testing.assert_allclose(place[[0, -1]], [[-3, -2, 1], [3, 2, 1]], atol=1e-6)
    assert 2 < found.time.values[-1] < 8
    assert np.linalg.norm(place[:, :2], axis=1).min() > 0.3  # round the column
    np.testing.assert_allclose(found.tensions, found.tensions.clip(120, 4980), atol=1e-4)


def tracks(found):
    """The receiver is opposite to a source that moves at the sky's pace, seen from the dish's centre."""
    towards = np.array([0, 0, 300]) - found.pose.values[:, :3]
    np.testing.assert_allclose(np.linalg.norm(towards, axis=1), 160, atol=1e-4)
    towards /= 160
    pole = np.array([0, np.cos(np.radians(25.65)), np.sin(np.radians(25.65))])
    np.testing.assert_allclose(towards @ pole, np.sin(np.radians(40)), atol=1e-6)  # its declination
    turned = np.cross(pole, towards[0]) @ towards[-1], (towards[0] @ towards[-1]) - np.sin(np.radians(40)) ** 2
    assert np.arctan2(-turned[0], turned[1]) == pytest.approx(4 / 23.9345 * 2 * np.pi, rel=1e-4)  # westward
    assert found.tensions.min() > 100e3


def takes_off(found):
    """Newton's second law of the load with the force of the ground, from cable directions that are computed here."""
    load = found.pose.values
    turned = Rotation.from_euler("ZYX", load[:, 5:2:-1]).as_matrix()
    corners = np.array([[0.3, 0, 0.05], [-0.15, 0.259807621135, 0.05], [-0.15, -0.259807621135, 0.05]])
    along = found.carrier_pose.values[:, :, :3] - load[:, None, :3] - np.einsum("nij,mj->nmi", turned, corners)
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    force = np.einsum("nm,nmi->ni", found.tensions.values, along)
    force += found.ground_reaction.values[:, None] * [0, 0, 1]
    np.testing.assert_allclose(force, 2.4 * (found.acceleration.values[:, :3] + [0, 0, 9.81]), atol=0.1)
    np.testing.assert_allclose(found.tensions.values[[0, -1]], 0, atol=1e-6)
    np.testing.assert_allclose(found.ground_reaction.values[[0, -1]], 2.4 * 9.81, rtol=1e-6)
    np.testing.assert_allclose(load[[0, -1], :3], [[0, 0, 0], [1, 0, 0]], atol=1e-9)
    assert (found.tensions.values[101:700] > 0.5).all()


def flies(found):
    """It stays on the circle, in a wind that pushes, with tensions that are not those of the plan."""
    angle = 0.2 * np.pi * found.time.values
    on_circle = np.stack([50 + np.cos(angle), 50 + np.sin(angle), np.full(len(angle), 99.0)], axis=1)
    assert np.linalg.norm(found.pose.values[:, :3] - on_circle, axis=1).max() < 0.005
    assert np.linalg.norm(found.wind.values.mean(axis=0)) > 2
    assert found.tensions.min() > 0.5


SHOWN = {
    "cogiro_pick_and_place": picks_and_places,
    "fast_tracks_a_source": tracks,
    "flying_circle": circles,
    "flying_in_gusts": flies,
    "four_quadrotors_slot": passes,
    "three_quadrotors_take_off": takes_off,
    "three_robots_carry": carries,
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_does_what_it_says(name, tmp_path):
    script = ROOT / "examples" / f"{name}.py"
    assert len(script.read_text().splitlines()) <= MOST_LINES
    done = run(script, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(rf"{name.replace('_', '-')}: FEASIBLE", done.stdout), done.stdout
    assert "warning" not in done.stdout
    if name == "flying_circle":
        assert "INFEASIBLE, 7.627 N short" in done.stdout  # under a hovering quadrotor, as the demo proves
    assert {file.name for file in tmp_path.iterdir()} == {f"{name}.nc", f"{name}.png"}
    with xr.open_dataset(tmp_path / f"{name}.nc") as found:
        assert found.attrs["status"] == ("passed" if name == "flying_in_gusts" else "feasible")
        SHOWN[name](found)


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_documentation_shows_it(name):
    assert f"`{name}.py`" in (ROOT / "docs" / "examples.md").read_text()
    picture = (ROOT / "docs" / "pictures" / f"{name}.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) <= MOST_BYTES
