"""`framed`: robots whose cables hang from one frame, with the numbers that a test chooses."""

from towline import Robot


def framed(cables, platform, robot=None, **cable):
    """Return a robot with `cables`, (anchor, attachment) each, from a frame on the ground.

    `robot` has more fields of the robot, and `cable` of all its cables.
    """
    cable = {"carrier": "frame", "t_min": 0, "t_max": 1000, **cable}
    data = {
        "name": "framed",
        "source": "a test",
        "platform": platform,
        "carriers": [{"name": "frame", "kind": "ground"}],
        "cables": [{**cable, "anchor": list(anchor), "attachment": list(end)} for anchor, end in cables],
    }
    return Robot.model_validate({**data, **(robot or {})})
