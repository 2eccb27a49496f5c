"""A quadrotor carries a cable robot whose platform goes round a circle; `python examples/flying_circle.py`.

Wang, Chen, Su and Qiao let the platform circle with a radius of 1 m under a hovering quadrotor. All cables hang from
within 0.52 m of the quadrotor's axis, so none of them can hold the platform out there: that is proven first. Then the
quadrotor is let go, and the planner finds how it has to fly so that the platform follows the circle exactly.
"""

import numpy as np

from towline.models import load
from towline.ocp import plan

HOVER = [50, 50, 100, 0, 0, 0]  # where the quadrotor is at home: x, y, z [m], roll, pitch, yaw [rad]

robot = load("wang-flying")
circle = {"kind": "circle", "centre": [50, 50, 99], "radius": 1.0, "rate": 0.2 * np.pi}  # [m], [rad/s]

hovering = plan(robot, {"path": circle, "base": {"kind": "hold", "poses": {"quad": HOVER}}})
print(hovering.report().splitlines()[0])

free = plan(
    robot,
    {
        "name": "flying-circle",
        "path": circle,
        "base": {
            "kind": "free",
            "around": {"quad": {"kind": "rest", "pose": HOVER}},  # staying here costs nothing
            "acceleration_max": 3.0,  # [m/s^2]
            "ends": "periodic",  # one round after the other
        },
    },
)
print(free.report())
free.save("flying_circle.nc")
free.figures()["path"].savefig("flying_circle.png", dpi=80)
print("saved: flying_circle.nc, flying_circle.png")
