"""The exported C code, compiled and called, gives what Python gives."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

from towline.models import Dynamics, load
from towline.models.c_code import to_c

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler on this machine")


def call(library, name, arguments, size):
    """Call a CasADi C function with dense arguments, matrices by columns."""
    function = getattr(library, name)
    arrays = [np.asfortranarray(a, dtype=float).ravel(order="F") for a in arguments]
    pointer = ctypes.POINTER(ctypes.c_double)
    sizes = [ctypes.c_longlong() for _ in range(4)]
    getattr(library, f"{name}_work")(*(ctypes.byref(s) for s in sizes))
    arg = (pointer * max(sizes[0].value, len(arrays)))(*(a.ctypes.data_as(pointer) for a in arrays))
    result = np.full(size, np.nan)
    res = (pointer * max(sizes[1].value, 1))(result.ctypes.data_as(pointer))
    iw, w = (ctypes.c_longlong * (sizes[2].value + 1))(), (ctypes.c_double * (sizes[3].value + 1))()
    assert function(arg, res, iw, w, 0) == 0
    return result


@pytest.mark.parametrize("name", ["wang-flying", "wang-ctmrts", "ipanema-1"])
def test_compiled_code_equals_python(name, tmp_path):
    robot = load(name)
    dynamics = Dynamics(robot)
    (tmp_path / "robot.c").write_text(to_c(robot))
    subprocess.run([COMPILER, "-O2", "-shared", "-fPIC", "-o", "robot.so", "robot.c", "-lm"], cwd=tmp_path, check=True)
    library = ctypes.CDLL(str(tmp_path / "robot.so"))
    rng = np.random.default_rng(1)
    for _ in range(20):
        pose = robot.home + 0.1 * rng.normal(size=6)
        velocity, acceleration = rng.normal(size=(2, 6))
        carriers = robot.carrier_home + 0.01 * rng.normal(size=robot.carrier_home.shape)
        tensions = rng.uniform(1, 10, size=robot.m)
        A = call(library, "wrench_matrix", [pose, carriers], 6 * robot.m).reshape(robot.m, 6).T
        np.testing.assert_allclose(A, dynamics.wrench_matrix(pose, carriers), rtol=1e-13, atol=1e-14)
        still = np.zeros_like(carriers)
        w = call(library, "required_wrench", [pose, velocity, acceleration, carriers, still, still], 6)
        np.testing.assert_allclose(w, dynamics.required_wrench(pose, velocity, acceleration), rtol=1e-12, atol=1e-12)
        found = call(library, "acceleration", [pose, velocity, tensions, carriers], 6)
        expected = dynamics.acceleration(pose, velocity, tensions, carriers)
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)
