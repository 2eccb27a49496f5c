"""What moves a robot whose file does not state it: quadrotors and robot arms tow, frames on the ground have winches."""

import numpy as np
import pytest

from towline import InputError, Robot, load, plan
from towline.models.parsing import parse_yaml, to_yaml

from .warm import towline as run

QUAD = {
    "kind": "quadrotor",
    "mass": 1.2,
    "inertia": [0.01, 0.01, 0.02, 0, 0, 0],
    "thrust_max": 40,
    "torque_max": [2, 2, 0.5],
}
ARM = {"kind": "mobile", "reach": {"min": [-5, -5, 0], "max": [5, 5, 5]}, "speed_max": 1, "acceleration_max": 2}
GROUND, PRESCRIBED = {"kind": "ground"}, {"kind": "prescribed"}
WINCH = {"inertia": 0.1, "speed_max": 3, "force_max": 80}


def beam(carrier, other=None, cable=None, **more):
    """A point mass under two carriers."""
    end = {"anchor": [0, 0, 0], "attachment": [0, 0, 0], "t_min": 0.5, "t_max": 60}
    return Robot.model_validate(
        {
            "name": "beam",
            "source": "test",
            "platform": {"mass": 1, "dof": ["x", "y", "z"], "home": [0, 0, 0.5, 0, 0, 0]},
            "carriers": [
                {"name": "left", "home": [0, -1, 2.5, 0, 0, 0], **carrier},
                {"name": "right", "home": [0, 1, 2.5, 0, 0, 0], **(other or carrier)},
            ],
            "cables": [{"carrier": "left", **end, **(cable or {})}, {"carrier": "right", **end}],
            **more,
        }
    )


@pytest.mark.parametrize(
    ("robot", "drive"),
    [
        (beam(QUAD), "fixed-length"),
        (beam(ARM), "fixed-length"),
        (beam(QUAD, ARM), "fixed-length"),
        (beam(QUAD, cable={"stiffness": 1e4}), "fixed-length"),
        (beam(GROUND), "both"),
        (beam(PRESCRIBED), "both"),
        (beam(QUAD, GROUND), "both"),
        (beam(QUAD, cable={"winch": WINCH}), "both"),
        (beam(QUAD, cable={"encoder": {"offset": 0.1}}), "both"),
        (beam(QUAD, cable={"pulley": {"radius": 0.02, "axis": [1, 0, 0]}}), "both"),
        (beam(QUAD, drive="both"), "both"),
        (beam(QUAD, cable={"winch": WINCH}, drive="fixed-length"), "fixed-length"),
        (beam(ARM, drive="variable-length"), "variable-length"),
    ],
)
def test_the_drive_follows_from_the_file(robot, drive):
    assert robot.drive == drive
    assert (robot.fixed_lengths is not None) == (drive == "fixed-length")
    again = parse_yaml(to_yaml(robot), Robot, "beam")
    assert again == robot
    assert again.drive == drive


def test_a_tilt_in_degrees_is_refused():
    """40 rad are 132 degrees, if only the cosine is compared."""
    with pytest.raises(InputError, match=r"carriers\[0\]\.tilt_max must be less than 1\.5, got 40"):
        beam({**QUAD, "tilt_max": 40})


def test_a_cable_without_a_length_keeps_that_at_home():
    lengths = beam(QUAD, cable={"length": 1.7}).fixed_lengths
    np.testing.assert_allclose(lengths, [1.7, np.hypot(1, 2)], rtol=1e-15)
    moved = beam(QUAD).with_parameters({"cables[0].anchor.x": 0.3})
    np.testing.assert_allclose(moved.fixed_lengths, np.hypot(1, 2))  # of the same cable, tied elsewhere
    with pytest.raises(InputError, match=r"cables\[0\]\.length must be a number > 0 \[m\] if drive is fixed-length"):
        beam(QUAD, cable={"pulley": {"radius": 0.02, "axis": [1, 0, 0]}}, drive="fixed-length")


def test_a_length_that_no_cable_would_keep_is_refused():
    with pytest.raises(InputError, match=r"drive must be given, because cables\[0\] has a length \(1\.7 m\)"):
        beam(QUAD, GROUND, cable={"length": 1.7})
    assert beam(QUAD, GROUND, cable={"length": 1.7}, drive="both").fixed_lengths is None


def test_robots_of_the_library_keep_their_drive():
    fixed = ["flycrane", "multi-quadrotor-3", "multi-quadrotor-4", "multi-quadrotor-6"]
    assert all(load(name).drive == "fixed-length" for name in fixed)
    winches = ["wang-ctmrts", "wang-ctmrts-4", "wang-ctmrts-5", "wang-ctmrts-6", "wang-flying-quadrotor", "cogiro"]
    assert all(load(name).drive == "both" for name in winches)


def test_quadrotors_do_not_reel_cables_in():
    task = {"path": {"kind": "line", "start": [0, 0, 0.5], "end": [0.5, 0, 1.5]}, "duration": 4}
    found = plan(beam(QUAD), {**task, "base": {"kind": "free", "ends": "rest"}, "steps": 30})
    assert found.feasible, found.report()
    ends = found.trajectory.carrier_pose.values[..., :3] - found.trajectory.pose.values[:, None, :3]
    np.testing.assert_allclose(np.linalg.norm(ends, axis=2), np.hypot(1, 2), atol=1e-4)


def test_cables_that_get_short_are_warned_of():
    """A point mass goes to 8 cm from an anchor, from which it hangs at 2.83 m at home."""
    robot = load("point-mass-3")
    near = [0, 1.93, 2.96]
    task = {"path": {"kind": "line", "start": [0, 0, 1], "end": near}, "duration": 4, "time_limit": 1}
    (sentence,) = plan(robot, task).warnings
    length = 1e3 * np.linalg.norm(robot.anchors[0] - near)
    assert (
        f"cable 1 gets as short as {length:.3g} mm at t = 4.000 s, {length / 10 / np.hypot(2, 2):.2g} % of its"
        in sentence
    )
    assert "drive" not in sentence  # without its winch it could not move
    far = {**task, "path": {"kind": "line", "start": [0, 0, 1], "end": [0, 1.5, 2]}}
    assert not plan(robot, far).warnings


def test_the_command_states_the_drive(tmp_path):
    beam(QUAD).save(tmp_path / "beam.yaml")
    done = run("robots", "beam.yaml", cwd=tmp_path)
    assert "drive fixed-length: carriers move" in done.stdout
