"""Press on a wall of 1e5 N/m: the reference is 20 mm behind it, and a controller of 2000 N/m pushes with 39.2 N."""

import numpy as np

from towline import load, simulate
from towline.control import ComputedTorque
from towline.simulation import Wall

robot = load("cogiro")
softly = ComputedTorque(robot, bandwidth=(2000 / robot.platform.mass) ** 0.5, observer=0)
wall = Wall(at=0, point=tuple(robot.home[:3]), normal=(-1, 0, 0), stiffness=1e5, damping=2e3)
behind = robot.home + 0.02 * np.eye(6)[0]
line = {"kind": "line", "start": robot.home.tolist(), "end": behind.tolist()}
run = simulate(robot, line, softly, events=[wall], duration=4.0)
print(f"{1e5 * (run.record.motions[-1, 0, 0] - robot.home[0]):.1f} N")
