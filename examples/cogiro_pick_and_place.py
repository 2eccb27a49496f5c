"""CoGiRo carries 200 kg from one place to another as fast as may be; `python examples/cogiro_pick_and_place.py`.

The load hangs in the platform from the start. How it goes there past a column, and how long that takes, is the
planner's choice inside the limits of tensions and winches.
"""

from towline.models import Robot, load
from towline.ocp import plan

PICK, PLACE = (-3.0, -2.0, 1.0), (3.0, 2.0, 1.0)  # [m]
LOAD = 200.0  # [kg]
COLUMN = {"kind": "capsule", "name": "column", "start": [0, 0, 0], "end": [0, 0, 1.5], "radius": 0.3}

data = load("cogiro").model_dump(mode="json")
data["platform"]["mass"] += LOAD
robot = Robot.model_validate(data)
found = plan(
    robot,
    {
        "name": "cogiro-pick-and-place",
        "path": {"kind": "waypoints", "points": [PICK, (0, 0, 2.5), PLACE]},  # a first guess only
        "tube": {"position": "free", "attitude": 0.1, "ends": "exact"},  # [rad]
        "duration": {"min": 2, "max": 20},  # [s]
        "steps": 40,
        "limits": {"cable_speed": 1.5, "platform_acceleration": 1.5, "keep_out": [COLUMN]},  # [m/s], [m/s^2]
        "objective": {"time": 1, "jerk": 10, "tension": 10_000},  # a second costs as much as so much of the others
        "margin": 20,  # [N]
    },
)
print(found.report())
found.save("cogiro_pick_and_place.nc")
found.figures()["views"].savefig("cogiro_pick_and_place.png", dpi=80)
print("saved: cogiro_pick_and_place.nc, cogiro_pick_and_place.png")
