"""Programs are solved by one thread: others of BLAS would wait at full load, and slow each other down."""

import os
import subprocess
import sys

import pytest

from towline.ocp.nlp.solver import VARIABLES

SCRIPT = """
import time
from towline import load, plan

line = {"kind": "line", "start": [0.0, 0, 1], "end": [0.3, 0, 1]}
plan("ipanema-1", {"path": line, "duration": 3, "steps": 20, "tube": {"position": "free"}})
home = load("multi-quadrotor-3").home.tolist()
path = {"kind": "line", "start": home, "end": [2.0, *home[1:]]}
task = {"path": path, "duration": 4, "tube": {"position": "free"}, "base": {"kind": "free"}, "steps": 60}
wall, processor = time.perf_counter(), time.process_time()
planned = plan("multi-quadrotor-3", task)
print(planned.feasible, (time.process_time() - processor) / (time.perf_counter() - wall))
"""


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core has one thread")
def test_a_plan_takes_no_more_processor_time_than_time():
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    run = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    feasible, share = run.stdout.split()
    assert feasible == "True"
    assert float(share) < 1.2
