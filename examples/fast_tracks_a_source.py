"""Track a radio source with FAST's receiver, 30 t on six cables; run `python examples/fast_tracks_a_source.py`.

The dish is a sphere with a radius of 300 m. Its focus is 160 m from the centre, opposite to the source; the cables hold
the receiver there. To save computing time, four hours pass in one minute, 240 times too fast. The inertial forces are
then 0.4 percent of the weight, so the tensions are almost those of the real motion, which reaches 9 mm/s.

With CASPR's lower tension limit of 120 kN the receiver could reach only a narrow column above 138 m, and could not
track a source away from the zenith. Here the limit is 100 kN, and the planner chooses the attitude.
"""

import numpy as np

from towline import Robot, load, plan

LATITUDE, DECLINATION = np.radians(25.65), np.radians(40.0)  # of the telescope, of the source
CENTRE, FOCAL = np.array([0, 0, 300.0]), 160.0  # of the dish's sphere in the robot's frame, and the focal radius [m]
HOURS, FASTER = 4.0, 240.0
SIDEREAL = 2 * np.pi / 86164.0905  # angular velocity of the Earth [rad/s]

times = np.linspace(0, HOURS * 3600, 81)  # [s]
hour_angle = SIDEREAL * (times - times[-1] / 2)  # the source is highest halfway
east = -np.cos(DECLINATION) * np.sin(hour_angle)
north = np.sin(DECLINATION) * np.cos(LATITUDE) - np.cos(DECLINATION) * np.sin(LATITUDE) * np.cos(hour_angle)
up = np.sin(DECLINATION) * np.sin(LATITUDE) + np.cos(DECLINATION) * np.cos(LATITUDE) * np.cos(hour_angle)
focus = CENTRE - FOCAL * np.stack([east, north, up], axis=1)  # (n, 3) [m], x to the east

data = load("fast").model_dump(mode="json")
data["cables"] = [{**cable, "t_min": 100_000} for cable in data["cables"]]  # [N]
robot = Robot.model_validate(data)
result = plan(
    robot,
    {
        "name": "fast-tracks-a-source",
        "path": {"kind": "samples", "times": list(times / FASTER), "poses": focus.tolist()},
        "tube": {"attitude": 0.5},  # the position is exact, the attitude is free within 0.5 rad
        "objective": {"margin": 10_000, "deviation": 100, "jerk": 0.001},  # amounts that add 1 each [N, m, m/s^3]
        "steps": 60,
        "output_rate": 5,  # [1/s]
    },
)
print(result.report())
print(f"zenith angle: {np.degrees(np.arccos(up)).min():.1f} to {np.degrees(np.arccos(up)).max():.1f} degrees")
result.save("fast_tracks_a_source.nc")
result.figures()["views"].savefig("fast_tracks_a_source.png", dpi=150)
print("saved: fast_tracks_a_source.nc, fast_tracks_a_source.png")
