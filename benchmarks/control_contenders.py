"""Define the contenders at the quadratic programs of a predictive controller: towline's `Horizon`, and other solvers.

Each contender has a function that writes a program into the layout which its solver wants, which is not timed, and one
that solves it, which is. What solvers keep from one program to the next they keep: working sets, last solutions.

acados solves the step of its real-time iteration without the linearisation, by its C library. That is given by the
variable `ACADOS_SOURCE_DIR`, with which acados is built and used, or by the package `acados`. The wheel of that package
contains a CasADi that replaces the one of towline, so it needs a folder of its own:

    pip install --no-deps --target DIR comma-deps-acados
    ACADOS_SOURCE_DIR=DIR/acados/install towline bench control
"""

import os
from collections.abc import Callable
from ctypes import CDLL, RTLD_GLOBAL, Structure, byref, c_char_p, c_double, c_int, c_void_p
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..solvers import Horizon

Array = NDArray[np.float64]
REFERENCE, TOWLINE = "condensed, daqp.solve", "towline Horizon, warm-started"
FAR = 1e4  # in place of infinite bounds, for solvers that need numbers
GOOD = 1e-3  # residuals at which predictive control uses a solution that did not converge
FIELDS = ("A", "B", "c", "start", "Q", "R", "q", "r", "u_min", "u_max")
BLOCKS = 10  # of stages, after condensing
ITERATIONS = 100
TOLERANCE = 1e-6
LIBRARIES = ("libblasfeo.so", "libhpipm.so", "libqpOASES_e.so.3.1", "libqpOASES_e.so")  # that acados needs


class Program(NamedTuple):
    """A program of a run: arrays of `Horizon`, the guess, and whether it was used."""

    A: Array  # (N, n, n)
    B: Array  # (N, n, m)
    c: Array  # (N, n)
    start: Array  # (n,)
    Q: Array  # (N + 1, n, n)
    R: Array  # (N, m, m)
    q: Array  # (N + 1, n)
    r: Array  # (N, m)
    u_min: Array  # (N, m)
    u_max: Array  # (N, m)
    states: Array  # (N + 1, n)
    controls: Array  # (N, m)
    warm: bool


class Solver(NamedTuple):
    """One solver at the programs of one run: `solve(arrange(program))` is the controls (N, m), None if none."""

    arrange: Callable[[Program], Any]
    solve: Callable[[Any], Array | None]


class Contender(NamedTuple):
    """A solver, the accuracy that is required of it, and how to start it with the first program of a run."""

    name: str
    tolerance: str
    prepare: Callable[[Program], Solver]


def condense(program: Program) -> tuple[Array, Array]:
    """Return matrix (N m, N m) and vector of the cost of the controls alone, in time that grows with N^2."""
    N, n, m = program.B.shape
    effect, state = np.zeros((N, n, N * m)), program.start
    states = np.zeros((N, n))
    for k in range(N):
        if k > 0:
            np.matmul(program.A[k], effect[k - 1, :, : k * m], out=effect[k, :, : k * m])
        effect[k, :, k * m : k * m + m] = program.B[k]
        state = states[k] = program.A[k] @ state + program.c[k]
    cost, slope = np.zeros((N * m, N * m)), program.r.copy()
    weighed, along = np.zeros((n, N * m)), np.zeros(n)
    for k in range(N - 1, -1, -1):
        if k < N - 1:
            weighed, along = program.A[k + 1].T @ weighed[:, : k * m + m], program.A[k + 1].T @ along
        weighed = weighed[:, : k * m + m] + program.Q[k + 1] @ effect[k, :, : k * m + m]
        along = along + program.Q[k + 1] @ states[k] + program.q[k + 1]
        rows = slice(k * m, k * m + m)
        part = program.B[k].T @ weighed
        cost[rows, : k * m + m], cost[: k * m + m, rows] = part, part.T
        cost[rows, rows] += program.R[k]
        slope[k] += program.B[k].T @ along
    return cost, slope.ravel()


def exact(program: Program) -> list[Array]:
    """Return the controls of the optimum, (N, m), as accurately as `Horizon`, and daqp, can; one of them may be off."""
    import daqp

    horizon = horizon_of(program, 1e-11, 100)
    horizon.solve()
    kinds, none = np.zeros(program.r.size, dtype=np.int32), np.zeros((0, program.r.size))
    found = daqp.solve(*condense(program), none, program.u_max.ravel(), program.u_min.ravel(), kinds, primal_tol=1e-11)
    return [horizon.controls.copy(), found[0].reshape(program.r.shape)]


def horizon_of(program: Program, tolerance: float, iterations: int) -> Horizon:
    """Write a program into a horizon."""
    N, n, m = program.B.shape
    horizon = Horizon(N, n, m)
    horizon.tolerance, horizon.iterations_max = tolerance, iterations
    fill(horizon, program)
    return horizon


def fill(horizon: Horizon, program: Program | Horizon) -> None:
    """Write the arrays of a program, or of another horizon, into a horizon."""
    for name in FIELDS:
        getattr(horizon, name)[...] = getattr(program, name)


def _towline(first: Program, warm: bool) -> Solver:
    horizon = horizon_of(first, 1e-6, 20)

    def arrange(program: Program) -> bool:
        fill(horizon, program)
        horizon.states[:], horizon.controls[:] = program.states, program.controls
        return warm and program.warm

    def solve(begun: bool) -> Array | None:
        horizon.solve(warm=begun)
        usable = horizon.converged or all(residual <= GOOD for residual in horizon.residuals)
        return horizon.controls.copy() if usable else None

    return Solver(arrange, solve)


def _daqp(first: Program, alone: bool) -> Solver:
    """Start DAQP: `alone` without the time of condensing, from the last solution."""
    import daqp

    none, kinds = np.zeros((0, first.r.size)), np.zeros(first.r.size, dtype=np.int32)

    def condensed(program: Program) -> tuple[Any, ...]:
        return *condense(program), none, program.u_max.ravel(), program.u_min.ravel(), kinds

    def solve(given: tuple[Any, ...], guess: Array | None = None) -> Array | None:
        u, _, flag, _ = daqp.solve(*given, primal_start=guess)
        return u.reshape(first.r.shape) if flag > 0 else None

    if alone:
        return Solver(lambda program: (condensed(program), program.controls.ravel()), lambda given: solve(*given))
    return Solver(lambda program: program, lambda program: solve(condensed(program)))


class Sparse:
    """Matrices of programs of one size, for z = (u_0, x_1, u_1, ..., x_N); behind x_0 if that is a variable.

    `controls`, `states`: indices of controls and states in z, (N, m) and (N, n).
    """

    def __init__(self, first: Program, fixed_start: bool):
        N, n, m = first.B.shape
        self.offset = 0 if fixed_start else n
        stages = np.arange(N)[:, None] * (m + n) + self.offset
        self.controls, self.states = stages + np.arange(m), stages + m + np.arange(n)
        blocks = [block for k in range(N) for block in (first.R[k], first.Q[k + 1])]
        # Hessian of the cost, with ones for x_0, whose bounds determine it
        self.H = sp.block_diag([np.eye(self.offset), *blocks]).toarray()
        full = first._replace(A=np.ones_like(first.A), B=np.ones_like(first.B))
        self.mask = self.dynamics(full) != 0  # entries of the rows of `dynamics` that are not zero, (N n, size) of bool

    def dynamics(self, program: Program) -> Array:
        """Return the rows B u + A x - x of the next stage, (N n, size)."""
        N, n, _ = program.B.shape
        rows = np.zeros((N, n, len(self.H)))
        for k in range(N):
            rows[k][:, self.controls[k]], rows[k][:, self.states[k]] = program.B[k], -np.eye(n)
            if k > 0:
                rows[k][:, self.states[k - 1]] = program.A[k]
        if self.offset:
            rows[0, :, :n] = program.A[0]
        return rows.reshape(N * n, -1)

    def right(self, program: Program) -> Array:
        """Return the right-hand side of the dynamics equations, (N n,)."""
        right = -program.c.copy()
        if self.offset == 0:
            right[0] -= program.A[0] @ program.start
        return right.ravel()

    def linear(self, program: Program) -> Array:
        """Return the linear cost."""
        slope = np.zeros(len(self.H))
        slope[self.controls], slope[self.states] = program.r, program.q[1:]
        return slope


def _osqp(first: Program) -> Solver:
    import osqp

    sparse = Sparse(first, fixed_start=True)
    unit = np.eye(len(sparse.H))[sparse.controls.ravel()]
    mask = np.vstack([sparse.mask, unit != 0])

    def arrange(program: Program) -> dict[str, Array]:
        entries = np.vstack([sparse.dynamics(program), unit]).T[mask.T]  # column by column
        right = sparse.right(program)
        low, high = np.r_[right, program.u_min.ravel()], np.r_[right, program.u_max.ravel()]
        return {"q": sparse.linear(program), "Ax": entries, "l": low, "u": high}

    begun, solver, rows = arrange(first), osqp.OSQP(), sp.csc_matrix(mask, dtype=float)
    rows.data[:] = begun["Ax"]
    options = {"eps_abs": 1e-6, "eps_rel": 1e-6, "max_iter": 20_000, "verbose": False}
    solver.setup(sp.csc_matrix(np.triu(sparse.H)), begun["q"], rows, begun["l"], begun["u"], **options)

    def solve(given: dict[str, Array]) -> Array | None:
        solver.update(**given)
        found = solver.solve(raise_error=False)
        return found.x[sparse.controls] if found.info.status == "solved" else None

    return Solver(arrange, solve)


def _hpipm(first: Program) -> Solver:
    N, n, m = first.B.shape
    sparse = Sparse(first, fixed_start=False)
    H, pattern = ca.DM(sp.csc_matrix(sparse.H)), ca.DM(sp.csc_matrix(sparse.mask, dtype=float)).sparsity()
    sizes = {"N": N, "nx": [n] * (N + 1), "nu": [m] * N + [0], "ng": [0] * (N + 1)}
    # Bounds that are infinite are numbers to this interface: with its own, 1e8, the iterations do not converge.
    settings = {"error_on_fail": False, "inf": FAR, "hpipm": {"mode": "speed_abs", "iter_max": 100}}
    options: dict[str, Any] = {**sizes, **settings}
    solver = ca.conic("stages", "hpipm", {"h": H.sparsity(), "a": pattern}, options)

    def arrange(program: Program) -> dict[str, ca.DM]:
        low, high = np.full(len(sparse.H), -np.inf), np.full(len(sparse.H), np.inf)
        low[:n] = high[:n] = program.start
        low[sparse.controls], high[sparse.controls] = program.u_min, program.u_max
        right, rows = sparse.right(program), ca.DM(pattern, sparse.dynamics(program).T[sparse.mask.T])
        given = {"g": sparse.linear(program), "lbx": low, "ubx": high, "lba": right, "uba": right}
        return {name: ca.DM(value) for name, value in given.items()} | {"h": H, "a": rows}

    def solve(given: dict[str, ca.DM]) -> Array | None:
        found = solver(**given)
        return np.array(found["x"]).ravel()[sparse.controls] if solver.stats()["success"] else None

    return Solver(arrange, solve)


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
    N, n, m = first.B.shape

    def make(name: str, *given: Any) -> c_void_p:
        function = getattr(acados, name)
        function.restype = c_void_p
        return c_void_p(function(*given))

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


CONTENDERS = (
    Contender(TOWLINE, "1e-6", partial(_towline, warm=True)),
    Contender("towline Horizon, cold", "1e-6", partial(_towline, warm=False)),
    Contender(REFERENCE, "1e-6, its own", partial(_daqp, alone=False)),
    Contender("daqp.solve, warm, condensing not counted", "1e-6, its own", partial(_daqp, alone=True)),
    Contender("osqp, sparse, warm", "1e-6", _osqp),
    Contender("hpipm through CasADi", "speed_abs, its own", _hpipm),
    *([Contender("acados, partial condensing and HPIPM", f"{TOLERANCE:g}", _acados)] if folder() else []),
)
