"""Plan a circle of the platform under a quadrotor; run `python examples/flying_circle.py`.

In the paper of Wang, Chen, Su and Qiao the platform follows a circle of radius 1 m under a hovering quadrotor. All
anchors are within 0.52 m of the quadrotor's axis, so the cables cannot hold the platform on that circle; the first plan
proves it. In the second plan the quadrotor may move, and the platform follows the circle exactly.
"""

import numpy as np

from towline import load, plan

HOVER = [50, 50, 100, 0, 0, 0]  # pose of the quadrotor: x, y, z [m], roll, pitch, yaw [rad]

robot = load("wang-flying")
circle = {"kind": "circle", "centre": [50, 50, 99], "radius": 1.0, "rate": 0.2 * np.pi}  # [m], [rad/s]

hovering = plan(robot, {"path": circle, "base": {"kind": "hold", "poses": {"quad": HOVER}}})
print(hovering.report().splitlines()[0])

moving = plan(
    robot,
    {
        "name": "flying-circle",
        "path": circle,
        "base": {
            "kind": "free",
            "around": {"quad": {"kind": "rest", "pose": HOVER}},  # the objective is zero while it stays here
            "acceleration_max": 3.0,  # [m/s^2]
            "ends": "periodic",  # the final state equals the initial state
        },
    },
)
print(moving.report())
moving.save("flying_circle.nc")
moving.figures()["views"].savefig("flying_circle.png", dpi=150)
print("saved: flying_circle.nc, flying_circle.png")
