"""Carry 200 kg past a column as fast as possible; run `python examples/cogiro_pick_and_place.py`.

The load is fixed to the platform. The planner chooses the path past the column and the duration, inside the limits of
tensions and winches.
"""

from towline import Robot, load, plan

PICK, PLACE = (-3.0, -2.0, 1.0), (3.0, 2.0, 1.0)  # [m]
LOAD = 200.0  # [kg]
COLUMN = {"kind": "capsule", "name": "column", "start": [0, 0, 0], "end": [0, 0, 1.5], "radius": 0.3}

data = load("cogiro").model_dump(mode="json")
data["platform"]["mass"] += LOAD
robot = Robot.model_validate(data)
result = plan(
    robot,
    {
        "name": "cogiro-pick-and-place",
        "path": {"kind": "waypoints", "points": [PICK, (0, 0, 2.5), PLACE]},  # only the initial guess
        "tube": {"position": "free", "attitude": 0.1, "ends": "exact"},  # [rad]
        "duration": {"min": 2, "max": 20},  # [s]
        "steps": 40,
        "limits": {"cable_speed": 1.5, "platform_acceleration": 1.5, "keep_out": [COLUMN]},  # [m/s], [m/s^2]
        "objective": {"time": 1, "jerk": 10, "tension": 10_000},  # amounts that add 1 each [s, m/s^3, N]
        "margin": 20,  # [N]
    },
)
print(result.report())
result.save("cogiro_pick_and_place.nc")
result.figures()["views"].savefig("cogiro_pick_and_place.png", dpi=150)
print("saved: cogiro_pick_and_place.nc, cogiro_pick_and_place.png")
