"""Let the linear algebra of IPOPT's factorisations run in one thread: `run_in_one_thread`."""

import ctypes
import os
from functools import cache
from pathlib import Path

import casadi as ca

VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")


@cache
def run_in_one_thread() -> None:
    """Set the OpenBLAS that CasADi brings along to one thread; to be called after CasADi has loaded IPOPT.

    The dense blocks of a program's factorisation are so small that more threads only wait for each other: on two cores
    a team of six was planned 1.6 times as fast with one, in a third of the processor time. Other users of BLAS are not
    affected, and neither is a number of threads that the environment gives.
    """
    if any(name in os.environ for name in VARIABLES) or not hasattr(os, "RTLD_NOLOAD"):
        return
    for file in Path(ca.__file__).parent.glob("libcasadi-tp-openblas*"):
        try:
            # By its bare name, and only if it is loaded: a wheel has several copies, which would not share the setting.
            library = ctypes.CDLL(file.name, mode=os.RTLD_NOLOAD)
            library.openblas_set_num_threads(1)
        except (OSError, AttributeError):
            continue
