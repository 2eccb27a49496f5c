"""Three robots, one cable each, pick up 10 kg and set it down elsewhere; `python examples/three_robots_carry.py`.

The robots of Wang, Zhao, Li and Ji: their ends move inside reach boxes, and winches change the cables' lengths. The
load is lifted off a table, carried across, and set down on another, level all the way. Three cables cannot hold a load
at will: where the robot-ends have to be for it to stay level is what the planner finds.
"""

from towline.models import load
from towline.ocp import plan

PICK, PLACE, HIGH = (1.10, 0.90, 0.20), (1.45, 1.05, 0.30), 0.55  # where the load's centre is [m]

robot = load("wang-ctmrts")
found = plan(
    robot,
    {
        "name": "three-robots-carry",
        "path": {
            "kind": "waypoints",  # a smooth curve from rest to rest
            "points": [PICK, (*PICK[:2], HIGH), (*PLACE[:2], HIGH), PLACE],
        },
        "duration": 8,  # [s]
        "base": {"kind": "free", "ends": "rest"},  # robot-ends inside reach, speed and acceleration of the robot's file
        "margin": 5,  # every tension at least so far inside its limits [N]
    },
)
print(found.report())
found.save("three_robots_carry.nc")
found.figures()["views"].savefig("three_robots_carry.png", dpi=80)
print("saved: three_robots_carry.nc, three_robots_carry.png")
