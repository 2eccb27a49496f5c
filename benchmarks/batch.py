"""Wrench matrices of many poses of wang-flying: kernel, map, and CasADi as one would use it without towline.

    python -m towline.benchmarks.batch [--poses 1000000] [--runs 5]

Each row is the median of several runs after one that is not counted; the poses differ, the carrier stays at home. "map
and conversion" is `Function.map` called with NumPy arrays and its answer taken out with `DM.full`, as the call of
towline was before it had kernels; making the map is not counted.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from statistics import median

import numpy as np

from ..models import Dynamics, load
from ..models import batch as models_batch
from .machine import machine

ROBOT = "wang-flying"

_START = f"""
import time
from towline.models import Dynamics, batch, load
function = Dynamics(load("{ROBOT}")).functions["wrench_matrix"]
start = time.perf_counter()
import numba
imported = time.perf_counter()
batch.compiled(function)
print(imported - start, time.perf_counter() - imported)
"""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--poses", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    print(machine())
    report_start()
    report_evaluation(options.poses, options.runs)


def report_start() -> None:
    """Measure how long a process waits for its kernel: with nothing on the disk, and with it."""
    with tempfile.TemporaryDirectory() as folder:
        for label in ("compile, nothing cached", "load from the disk"):
            command = [sys.executable, "-c", _START]
            environment = os.environ | {"TOWLINE_CACHE": folder}
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
            imported, ready = map(float, done.stdout.split())
            print(f"{label:28} {ready:8.2f} s, after {imported:.2f} s to import Numba")


def report_evaluation(count: int, runs: int) -> None:
    """Measure the time for `count` poses, and the ratio to map and conversion."""
    dynamics = Dynamics(load(ROBOT))
    function = dynamics.functions["wrench_matrix"]
    poses = dynamics.robot.home + np.random.default_rng(1).uniform(-0.3, 0.3, (count, 6))
    arguments = {"pose": poses, "carrier_pose": dynamics.robot.carrier_home}
    mapped = function.map(count)
    carrier = np.tile(dynamics.robot.carrier_home, (1, count))

    def map_and_conversion() -> np.ndarray:
        return mapped(poses.T, carrier).full().reshape(6, count, -1).transpose(1, 0, 2)

    def kernel(threads: int) -> np.ndarray:
        return models_batch.call(function, arguments, threads=threads)["A"]

    expected, reference = timed(map_and_conversion, min(runs, 3))
    rows = {"map and conversion": reference}
    models_batch.compiled(function)
    got, rows["kernel, one thread"] = timed(lambda: kernel(1), runs)
    all_threads = os.cpu_count() or 1
    if all_threads > 1:
        rows[f"kernel, {all_threads} threads"] = timed(lambda: kernel(all_threads), runs)[1]
    print(f"\n{ROBOT}, wrench matrices of {count} poses, largest relative difference {difference(got, expected):.1e}")
    for name, seconds in rows.items():
        print(f"{name:28} {seconds:8.3f} s {seconds / count * 1e6:8.3f} us a pose   ratio {reference / seconds:6.1f}")
    pose = poses[0]
    single = timed(lambda: [dynamics.wrench_matrix(pose) for _ in range(1000)], runs)[1] / 1000
    directly = timed(lambda: [function(pose, dynamics.robot.carrier_home).full() for _ in range(1000)], runs)[1] / 1000
    print(f"one pose, one call: {single * 1e6:.1f} us; the CasADi Function called directly {directly * 1e6:.1f} us")


def timed(work: Callable[[], np.ndarray | list[np.ndarray]], runs: int) -> tuple[np.ndarray, float]:
    """Return what `work` returns and the median of its times, after a run that is not counted."""
    result = work()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - start)
    return np.asarray(result), median(times)


def difference(got: np.ndarray, expected: np.ndarray) -> float:
    """Return the largest difference of two matrices of a batch, relative to the larger one's norm."""
    norms = np.linalg.norm(expected, axis=(1, 2))
    return float((np.linalg.norm(got - expected, axis=(1, 2)) / norms).max())


if __name__ == "__main__":
    main()
