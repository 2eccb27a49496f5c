"""The quadratic programs of predictive control solved by acados: partial condensing and HPIPM, through its C library.

The step of acados' real-time iteration without the linearisation, so that all solvers have the same programs. The
library is given by the variable `ACADOS_SOURCE_DIR`, with which acados is built and used, or by the package `acados`.
The wheel of that package contains a CasADi that replaces the one of towline, so it needs a folder of its own:

    pip install --no-deps --target DIR comma-deps-acados
    ACADOS_SOURCE_DIR=DIR/acados/install towline bench control
"""

import os
from ctypes import CDLL, RTLD_GLOBAL, Structure, byref, c_char_p, c_double, c_int, c_void_p
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from .control_contenders import FAR, Array, Contender, Program, Solver

BLOCKS = 10  # of stages, after condensing
ITERATIONS = 100
TOLERANCE = 1e-6
LIBRARIES = ("libblasfeo.so", "libhpipm.so", "libqpOASES_e.so.3.1", "libqpOASES_e.so")  # that acados needs
MAKERS = {
    "ocp_qp_xcond_solver_config_create",
    "ocp_qp_dims_create",
    "ocp_qp_xcond_solver_dims_create_from_ocp_qp_dims",
    "ocp_qp_xcond_solver_opts_create",
    "ocp_qp_in_create",
    "ocp_qp_out_create",
    "ocp_qp_create",
}


class _Plan(Structure):
    """The solver of `ocp_qp_solver_plan_t`; 0 is partial condensing with HPIPM."""

    _fields_ = (("solver", c_int),)


def folder() -> Path | None:
    """Return the folder of acados' libraries, or None if there is none."""
    spec = find_spec("acados")
    packages = [] if spec is None else list(spec.submodule_search_locations or [])
    known = [os.environ.get("ACADOS_SOURCE_DIR"), *(str(Path(place) / "install") for place in packages)]
    places = [Path(place) / "lib" for place in known if place]
    return next((place for place in places if (place / "libacados.so").is_file()), None)


def _acados(first: Program) -> Solver:
    place = folder()
    assert place is not None
    needed = [CDLL(str(place / name), mode=RTLD_GLOBAL) for name in LIBRARIES if (place / name).is_file()]
    hpipm = next(library for library in needed if "hpipm" in library._name)
    acados = CDLL(str(place / "libacados.so"), mode=RTLD_GLOBAL)
    for name in MAKERS:
        getattr(acados, name).restype = c_void_p
    N, n, m = first.B.shape

    def make(name: str, *given: Any) -> c_void_p:
        return c_void_p(getattr(acados, name)(*given))

    config, dims = make("ocp_qp_xcond_solver_config_create", _Plan(0)), make("ocp_qp_dims_create", N)
    sizes = [("nx", n, n), ("nu", m, 0), ("nbx", 0, 0), ("nbu", m, 0)]
    rows = [(k, name, last if k == N else size) for k in range(N + 1) for name, size, last in sizes]
    for k, name, size in [*rows, (0, "nbx", n), (0, "nbxe", n)]:  # the first state is known
        acados.ocp_qp_dims_set(config, dims, k, name.encode(), byref(c_int(size)))
    condensed = make("ocp_qp_xcond_solver_dims_create_from_ocp_qp_dims", config, dims)
    options = make("ocp_qp_xcond_solver_opts_create", config, condensed)
    given = {"cond_N": byref(c_int(min(BLOCKS, N))), "hpipm_mode": c_char_p(b"SPEED")}
    given["iter_max"] = byref(c_int(ITERATIONS))
    given |= {f"tol_{name}": byref(c_double(TOLERANCE)) for name in ("stat", "eq", "ineq", "comp")}
    for name, value in given.items():
        acados.ocp_qp_xcond_solver_opts_set(config, options, name.encode(), value)
    inputs, outputs = make("ocp_qp_in_create", dims), make("ocp_qp_out_create", dims)
    solver = make("ocp_qp_create", config, condensed, options)
    every, cross = np.arange(max(n, m), dtype=np.int32), np.zeros((m, n))

    def write(k: int, **arrays: Array | np.ndarray) -> None:
        for name, array in arrays.items():
            columns = np.asfortranarray(array)
            acados.ocp_qp_in_set(config, inputs, k, name.encode(), c_void_p(columns.ctypes.data))

    def arrange(program: Program) -> None:
        for k in range(N):
            write(k, A=program.A[k], B=program.B[k], b=program.c[k], R=program.R[k], S=cross, r=program.r[k])
            low, high = program.u_min[k], program.u_max[k]
            masks = {"lbu_mask": np.isfinite(low) * 1.0, "ubu_mask": np.isfinite(high) * 1.0}
            write(k, idxbu=every, lbu=np.maximum(low, -FAR), ubu=np.minimum(high, FAR), **masks)
        for k in range(N + 1):
            write(k, Q=program.Q[k], q=program.q[k])
        write(0, idxbx=every, lbx=program.start, ubx=program.start, idxbxe=every)

    controls = np.empty((N, m))
    rows_of_controls = [(k, c_void_p(controls[k:].ctypes.data)) for k in range(N)]

    def solve(_: None) -> Array | None:
        failed = acados.ocp_qp_solve(solver, inputs, outputs)
        for k, row in rows_of_controls:
            hpipm.d_ocp_qp_sol_get_u(k, outputs, row)
        return None if failed else controls.copy()

    return Solver(arrange, solve)


ACADOS = (Contender("acados, partial condensing and HPIPM", f"{TOLERANCE:g}", _acados),) if folder() else ()
