"""Three quadrotors lift a load whose cables are slack; run `python examples/three_quadrotors_take_off.py`.

The load lies on the ground. The tensions rise from zero until they bear its weight. The quadrotors then carry it a
metre away and set it down until the ground bears its weight again.
"""

from towline import load, plan

HERE, ABOVE_HERE, ABOVE_THERE = (0, 0, 0), (0, 0, 0.5), (1, 0, 0.5)  # [m]
THERE = (1, 0, 0)


def move(name, start, end):
    """Return a phase of 2 s along a line."""
    return {"name": name, "duration": 2, "path": {"kind": "line", "start": start, "end": end}}


result = plan(
    load("multi-quadrotor-3"),
    {
        "name": "three-quadrotors-take-off",
        "phases": [
            {"name": "take-off", "duration": 1, "path": {"kind": "rest", "pose": HERE}, "ground": {"slack": True}},
            move("lift", HERE, ABOVE_HERE),
            move("carry", ABOVE_HERE, ABOVE_THERE),
            move("lower", ABOVE_THERE, THERE),
            {"name": "touch-down", "duration": 1, "ground": {"slack": True}},
        ],
        "base": {"kind": "free"},  # within the thrust, torque and tilt limits
        "tube": {"position": 0.1, "attitude": 0.2},  # [m, rad]
        "scheme": "hermite",
        "steps": 60,
    },
    progress=lambda iteration, cost, missing: print(f"\r{iteration:4d} iterations", end="", flush=True),
)
print(f"\r{result.report()}")
result.save("three_quadrotors_take_off.nc")
result.figures()["tensions"].savefig("three_quadrotors_take_off.png", dpi=150)
print("saved: three_quadrotors_take_off.nc, three_quadrotors_take_off.png")
