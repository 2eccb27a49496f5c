"""FAST's receiver, 30 t on six cables, tracks a source across the sky; `python examples/fast_tracks_a_source.py`.

The dish is a sphere of 300 m radius; its focus lies 160 m from the centre on the side away from the source, and that is
where the cables hold the receiver. Four hours of the sky pass in a minute, 240 times too fast: even so the forces of
inertia are half a percent of the weight, so the tensions are those of the true pace, 12 mm/s at most.

By CASPR's numbers no tension of this robot may fall below 120 kN, which leaves a narrow column above 138 m and none of
the sky away from the zenith. Here it is 100 kN, and the receiver leans as its cables like.
"""

import numpy as np

from towline.models import Robot, load
from towline.ocp import plan

LATITUDE, DECLINATION = np.radians(25.65), np.radians(40.0)  # of the telescope, of the source
CENTRE, FOCAL = np.array([0, 0, 300.0]), 160.0  # of the dish's sphere in the robot's frame, and the focal radius [m]
HOURS, FASTER = 4.0, 240.0
SIDEREAL = 2 * np.pi / 86164.0905  # the Earth's turn [rad/s]

times = np.linspace(0, HOURS * 3600, 81)  # [s]
hour_angle = SIDEREAL * (times - times[-1] / 2)  # the source is highest half way
east = -np.cos(DECLINATION) * np.sin(hour_angle)
north = np.sin(DECLINATION) * np.cos(LATITUDE) - np.cos(DECLINATION) * np.sin(LATITUDE) * np.cos(hour_angle)
up = np.sin(DECLINATION) * np.sin(LATITUDE) + np.cos(DECLINATION) * np.cos(LATITUDE) * np.cos(hour_angle)
focus = CENTRE - FOCAL * np.stack([east, north, up], axis=1)  # (n, 3) [m], x to the east

data = load("fast").model_dump(mode="json")
data["cables"] = [{**cable, "t_min": 100_000} for cable in data["cables"]]  # [N]
robot = Robot.model_validate(data)
found = plan(
    robot,
    {
        "name": "fast-tracks-a-source",
        "path": {"kind": "samples", "times": list(times / FASTER), "poses": focus.tolist()},
        "tube": {"attitude": 0.5},  # the place is exact; the receiver may lean as its cables like [rad]
        "objective": {
            "margin": 10_000,
            "deviation": 100,
            "jerk": 0.001,
        },  # well inside the limits, and slowly [N, m, m/s^3]
        "steps": 60,
        "output_rate": 5,  # [1/s]
    },
)
print(found.report())
print(f"zenith angle: {np.degrees(np.arccos(up)).min():.1f} to {np.degrees(np.arccos(up)).max():.1f} degrees")
found.save("fast_tracks_a_source.nc")
found.figures()["views"].savefig("fast_tracks_a_source.png", dpi=80)
print("saved: fast_tracks_a_source.nc, fast_tracks_a_source.png")
