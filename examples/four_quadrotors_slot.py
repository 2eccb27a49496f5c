"""Fly a load on four quadrotors through a slot 1.8 m wide; run `python examples/four_quadrotors_slot.py`.

The quadrotors start and end 1.7 m apart, as at home, and their formation is 2.4 m wide, rotors included. To pass
between the walls they must fly closer together, and they spread again behind them; no rotor touches a wall or another
rotor. The user gives no initial guess, because the planner finds a formation that avoids the walls.
"""

from towline import load, plan

HALF_SLOT, HALF_WALL = 0.9, 0.2  # [m]
robot = load("multi-quadrotor-4")
RADIUS = robot.carrier_radius.max()  # of a quadrotor with its rotors [m]
KEEP = {"kind": "box", "platform": 0.05, "carriers": RADIUS + 0.05, "cables": 0.05}  # distances from the walls [m]
WALLS = [
    {**KEEP, "name": "left wall", "min": [-HALF_WALL, HALF_SLOT, -2], "max": [HALF_WALL, 3, 4]},
    {**KEEP, "name": "right wall", "min": [-HALF_WALL, -3, -2], "max": [HALF_WALL, -HALF_SLOT, 4]},
]

TRAVEL = 2.5  # distance of start and end from the walls [m]

escorts = {}  # the path of each quadrotor, at its home position relative to the load
for carrier in robot.carriers:
    x, *rest = carrier.home
    escorts[carrier.name] = {"kind": "line", "start": [x - TRAVEL, *rest], "end": [x + TRAVEL, *rest]}
result = plan(
    robot,
    {
        "name": "four-quadrotors-slot",
        "path": {"kind": "line", "start": [-TRAVEL, 0, 0], "end": [TRAVEL, 0, 0]},
        "tube": {"position": "free", "attitude": "free", "ends": "exact"},  # the line is only the initial guess
        "duration": 7,  # [s]
        "steps": 28,
        "base": {"kind": "free", "around": escorts, "ends": "exact"},  # within the thrust, torque and tilt limits
        "limits": {"keep_out": WALLS, "carrier_separation": 2 * RADIUS + 0.05},  # [m]
    },
    progress=lambda iteration, cost, missing: print(f"\r{iteration:4d} iterations", end="", flush=True),
)
print(f"\r{result.report()}")
result.save("four_quadrotors_slot.nc")
result.figures()["views"].savefig("four_quadrotors_slot.png", dpi=150)
print("saved: four_quadrotors_slot.nc, four_quadrotors_slot.png")
