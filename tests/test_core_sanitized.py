"""Controllers in C: nothing for sanitizers to find in any numbers, through Python, with the whole extension watched."""

import os
import subprocess
import sys

import pytest

from .c_programs import CORE, link_watched, require, watched_objects

ROBOTS = ["caroca-pulleys", "wang-flying-quadrotor", "multi-quadrotor-3", "wang-ctmrts-4"]

# The module that the package imports is the one that is watched.
FLY = """
import sys
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location("towline.core._core", sys.argv[1])
sys.modules[spec.name] = module = module_from_spec(spec)
spec.loader.exec_module(module)

import numpy as np
from towline.control import ComputedTorque, Predictive, Reference, State, predictive
from towline.core import _core
from towline.models import load
assert _core is module
predictive.grows = lambda *given: False  # a flight of a second, which takes ten under sanitizers

NONSENSE = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300, 0.0]

def fly(name, law, rows, **settings):
    robot, rng = load(name), np.random.default_rng(7)
    controller, c = law(robot, **settings), len(robot.carriers)
    still = np.zeros_like(robot.carrier_home)
    reference = Reference(robot.home, np.zeros(6), np.zeros(6), robot.carrier_home, still, still, np.full(robot.m, 9.0))
    for k in range(10):
        pose, carriers = (np.tile(home, (rows, *[1] * home.ndim)) for home in (robot.home, robot.carrier_home))
        arrays = [pose, 0 * pose, carriers, 0 * carriers, np.full((rows, robot.m), 9.0)]
        for array in arrays:
            array += 1e-3 * rng.normal(size=array.shape)
        if k % 2:  # one number of a row is none, infinite, huge, tiny or zero
            chosen = arrays[k // 2 % 5]
            chosen[rng.integers(rows)].flat[rng.integers(chosen[0].size)] = rng.choice(NONSENSE)
        arrays = arrays if rows > 1 else [array[0] for array in arrays]
        command = controller.step(1e-3 * k, State(*arrays, 1e-3 * k - 3e-3 * (k % 3)), reference)
        low, high = np.minimum(robot.t_min, 0), robot.t_max
        assert ((command.tensions >= low) & (command.tensions <= high)).all()

for name in sys.argv[2:]:
    fly(name, ComputedTorque, 3)
    fly(name, ComputedTorque, 1, reach=(0.3, 0.1), tension_loop=20.0, integral=1.0)
    fly(name, Predictive, 1, stages=5)
"""


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """Return the extension that sanitizers watch, and the environment of a process that can load it."""
    if not sys.platform.startswith("linux"):
        pytest.skip("sanitizers are loaded in other ways than on Linux")
    require("cc")
    libraries = []
    for name in ("libasan.so", "libstdc++.so"):  # CasADi throws: the sanitizer looks for that function as it starts
        path = subprocess.run(["cc", f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout
        if not os.path.isabs(path.strip()):
            pytest.skip(f"there is no {name}")
        libraries.append(path.strip())
    extension = tmp_path_factory.mktemp("sanitized") / "_core.abi3.so"
    link_watched(extension, watched_objects(tmp_path_factory, sorted(CORE.glob("*/*.c"))), "-shared")
    options = {"ASAN_OPTIONS": "detect_leaks=0", "LD_PRELOAD": " ".join(libraries), "PYTHONMALLOC": "malloc"}
    return extension, os.environ | options


def test_controllers_take_any_numbers(watched):
    """One robot and batches, late reports, reactions and predictions: no access outside of an array, no overflow."""
    extension, environment = watched
    command = [sys.executable, "-c", FLY, str(extension), *ROBOTS]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
