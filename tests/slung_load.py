"""A load that hangs under one quadrotor, by a cable of constant length."""

from towline.models import Robot

MASS, LENGTH, ACCELERATION = 0.5, 1.0, 5.0


def slung(thrust=40, **platform):
    quadrotor = {"mass": 1.5, "inertia": [0.02, 0.02, 0.04, 0, 0, 0], "home": [0, 0, 2, 0, 0, 0], "radius": 0.3}
    limits = {"thrust_max": thrust, "torque_max": [3, 3, 0.6], "tilt_max": 0.6, "speed_max": 8}
    cable = {"anchor": [0, 0, 0], "attachment": [0, 0, 0], "t_min": 0.5, "t_max": 30}
    return Robot.model_validate(
        {
            "name": "slung",
            "source": "a test",
            "platform": {"mass": MASS, "home": [0, 0, 1, 0, 0, 0], **platform},
            "carriers": [
                {"name": "drone", "kind": "quadrotor", "acceleration_max": ACCELERATION, **quadrotor, **limits}
            ],
            "drive": "fixed-length",
            "cables": [{"carrier": "drone", **cable}],
        }
    )
