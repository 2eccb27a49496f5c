"""Carry 10 kg with three robots and one cable each; run `python examples/three_robots_carry.py`.

These are the robots of Wang, Zhao, Li and Ji: their ends move inside reach boxes, and winches change the cable lengths.
They lift the load off a table, carry it across, and set it down on another table. The load stays level. Three cables
hold it level only for certain positions of the ends; the planner computes them.
"""

from towline import load, plan

PICK, PLACE, HIGH = (1.10, 0.90, 0.20), (1.45, 1.05, 0.30), 0.55  # of the load's centre [m]

robot = load("wang-ctmrts")
result = plan(
    robot,
    {
        "name": "three-robots-carry",
        "path": {
            "kind": "waypoints",  # straight legs, rounded at the points
            "points": [PICK, (*PICK[:2], HIGH), (*PLACE[:2], HIGH), PLACE],
        },
        "duration": 8,  # [s]
        "base": {"kind": "free", "ends": "rest"},  # inside the robot file's reach, speed and acceleration
        "margin": 5,  # distance of every tension from its limits [N]
    },
)
print(result.report())
result.save("three_robots_carry.nc")
result.figures()["views"].savefig("three_robots_carry.png", dpi=150)
print("saved: three_robots_carry.nc, three_robots_carry.png")
