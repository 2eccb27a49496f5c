"""OSQP's code generation on the tension problems of a control step."""

from __future__ import annotations

import contextlib
import ctypes
import io
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..models import Robot
from .step_code import Array

HARNESS = Path(__file__).parent / "step_osqp.c"


class PeerTimes(NamedTuple):
    """The times of OSQP's code, and its answers."""

    seconds: Array  # (N,), of new data and solve
    tensions: Array  # (N, m) [N]


def osqp_times(
    robot: Robot, A: Array, w: Array, tolerance: float, folder: Path, compiler: str = "cc", repeats: int = 5
) -> PeerTimes:
    """Generate the code for a robot's problems, compile it with -O2, and solve them one after the other.

    Parameters
    ----------
    robot
        Whose limits and length.
    A, w
        (N, 6, m) and (N, 6), as of `States.problems`.
    tolerance
        Absolute and relative, of OSQP; tensions are in units of the largest one.
    folder
        A new folder for the code.
    compiler, repeats
        The command; how often all problems are solved, of which the fastest counts for each.
    """
    import osqp
    from scipy import sparse

    m, unit = robot.m, float(robot.t_max.max())
    scaled = A * robot.wrench_scale[:, None]
    rows = robot.dof_mask > 0.0
    dense = np.concatenate([scaled[:, rows], np.broadcast_to(np.eye(m), (len(A), m, m))], axis=1)  # (N, r + m, m)
    right = (w * robot.wrench_scale / unit)[:, rows]
    low = np.ascontiguousarray(np.hstack([right, np.broadcast_to(robot.t_min / unit, (len(A), m))]))
    high = np.ascontiguousarray(np.hstack([right, np.broadcast_to(robot.t_max / unit, (len(A), m))]))
    count = int(rows.sum())
    pattern = sparse.csc_matrix(np.vstack([np.ones((count, m)), np.eye(m)]))
    first = pattern.copy()
    place = pattern.tocoo()
    numbers = np.ascontiguousarray(dense[:, place.row, place.col])  # by columns, as in `pattern`
    first.data = numbers[0].copy()
    solver = osqp.OSQP()
    settings = {"eps_abs": tolerance, "eps_rel": tolerance, "max_iter": 10_000, "verbose": False}
    solver.setup(P=sparse.csc_matrix(np.eye(m)), q=np.zeros(m), A=first, l=low[0], u=high[0], **settings)
    with contextlib.redirect_stdout(io.StringIO()):
        solver.codegen(str(folder), parameters="matrices", prefix="qp_", force_rewrite=True, compile=False)
    sources = [str(path) for path in [HARNESS, *folder.glob("src/*.c"), *folder.glob("*workspace.c")]]
    include = [f"-I{folder}", f"-I{folder / 'inc/public'}", f"-I{folder / 'inc/private'}"]
    library = folder / "peer.so"
    subprocess.run([compiler, "-O2", "-fPIC", "-shared", *include, *sources, "-lm", "-o", str(library)], check=True)
    seconds, tensions = np.empty(len(A)), np.empty((len(A), m))
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (numbers, low, high, seconds, tensions)]
    sizes = (len(A), numbers.shape[1], count + m, m)
    ctypes.CDLL(str(library)).osqp_rows(*sizes, *pointers[:3], repeats, *pointers[3:])
    return PeerTimes(seconds, tensions * unit)
