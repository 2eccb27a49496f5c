"""Four quadrotors take their load through a slot of 1 m between two walls; `python examples/four_quadrotors_slot.py`.

The quadrotors start 1.7 m apart, as at home, and end so: they have to draw together to pass, and to spread again behind
the walls. No guess is given: the planner begins with a formation that keeps clear.
"""

from towline.models import load
from towline.ocp import plan

HALF_SLOT, HALF_WALL = 0.5, 0.2  # [m]
KEEP = {"kind": "box", "platform": 0.05, "carriers": 0.1, "cables": 0.05}  # how far off the walls [m]
WALLS = [
    {**KEEP, "name": "left wall", "min": [-HALF_WALL, HALF_SLOT, -2], "max": [HALF_WALL, 3, 4]},
    {**KEEP, "name": "right wall", "min": [-HALF_WALL, -3, -2], "max": [HALF_WALL, -HALF_SLOT, 4]},
]

WAY = 2.5  # to either side of the walls [m]

robot = load("multi-quadrotor-4")
escorts = {}  # each quadrotor beside the load, as at home
for carrier in robot.carriers:
    x, *rest = carrier.home
    escorts[carrier.name] = {"kind": "line", "start": [x - WAY, *rest], "end": [x + WAY, *rest]}
found = plan(
    robot,
    {
        "name": "four-quadrotors-slot",
        "path": {"kind": "line", "start": [-WAY, 0, 0], "end": [WAY, 0, 0]},
        "tube": {"position": "free", "attitude": "free", "ends": "exact"},  # the line is a first guess only
        "duration": 7,  # [s]
        "steps": 28,
        "base": {
            "kind": "free",
            "around": escorts,
            "ends": "exact",
        },  # thrust, torque and tilt inside the limits of the robot's file
        "limits": {"keep_out": WALLS, "carrier_separation": 0.6},  # [m]
    },
    progress=lambda iteration, cost, missing: print(f"\r{iteration:4d} iterations", end="", flush=True),
)
print(f"\r{found.report()}")
found.save("four_quadrotors_slot.nc")
found.figures()["views"].savefig("four_quadrotors_slot.png", dpi=80)
print("saved: four_quadrotors_slot.nc, four_quadrotors_slot.png")
