"""Plan a circle under a quadrotor and simulate it in gusty wind; run `python examples/flying_in_gusts.py`.

The plan ignores the wind. It keeps every tension 1.2 N above its limit of 0.5 N, and the controller uses this
margin against the gusts. Each seed has different gusts.
"""

import numpy as np

from towline import load, plan, simulate

HOVER = [50, 50, 100, 0, 0, 0]  # pose of the quadrotor: x, y, z [m], roll, pitch, yaw [rad]

robot = load("wang-flying")
planned = plan(
    robot,
    {
        "name": "flying-in-gusts",
        "path": {"kind": "circle", "centre": [50, 50, 99], "radius": 1.0, "rate": 0.2 * np.pi},  # [m], [rad/s]
        "base": {
            "kind": "free",
            "around": {"quad": {"kind": "rest", "pose": HOVER}},
            "acceleration_max": 3.0,  # [m/s^2]
            "ends": "periodic",
        },
        "margin": 1.2,  # [N]
    },
)
print(planned.report().splitlines()[0])

# Velocity of the air and intensity of its turbulence [m/s].
flight = simulate(robot, planned, wind=[3, 2, 0.5], gusts=1.0, seed=0)
print(flight.report())
flight.save("flying_in_gusts.nc")
flight.figures()["tensions"].savefig("flying_in_gusts.png", dpi=150)
print("saved: flying_in_gusts.nc, flying_in_gusts.png")
