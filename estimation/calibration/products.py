"""Products of tall matrices, block by block: each block is small enough for BLAS to keep it on one thread.

With many threads such products are hardly faster, wait for busy processors, and differ in their last bits between
machines.
"""

import numpy as np

ONE_THREAD = 200_000  # multiplications in a block; OpenBLAS starts threads from 262 144 on


def inner(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return A' B over the second but last axis: (..., n, a) and (..., n, b) give (..., a, b)."""
    rows, width = A.shape[-2], max(A.shape[-1] * B.shape[-1], 1)
    block = max(ONE_THREAD // width, 1)
    whole = rows // block * block
    result = np.matmul(np.swapaxes(A[..., whole:, :], -1, -2), B[..., whole:, :])
    if whole:
        first, second = (M[..., :whole, :].reshape(*M.shape[:-2], whole // block, block, M.shape[-1]) for M in (A, B))
        result = result + np.matmul(np.swapaxes(first, -1, -2), second).sum(axis=-3)
    return result


def quadratic_forms(A: np.ndarray, M: np.ndarray) -> np.ndarray:
    """Return a' M a of each row a of a tall matrix A (n, p), (n,), in blocks."""
    block = max(ONE_THREAD // max(M.size, 1), 1)
    parts = (A[start : start + block] for start in range(0, len(A), block))
    return np.concatenate([((part @ M) * part).sum(axis=1) for part in parts] or [np.zeros(0)])
