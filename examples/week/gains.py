"""Compare bandwidths of computed torque under a push of 50 N; needs `winches.nc`, see README.md."""

from towline import simulate
from towline.control import ComputedTorque

for bandwidth in (5, 10, 20, 40):
    run = simulate("cogiro", "winches.nc", ComputedTorque("cogiro", bandwidth), events=["push 50 0 0 at 1 for 0.5"])
    print(f"{bandwidth:2} rad/s: at most {1e3 * run.error.max():.2f} mm off")
