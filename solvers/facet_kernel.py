"""The normals of the available wrench set's facets and its support along them, eight wrench matrices at once.

Each normal is orthogonal to n - 1 columns. The subsets come in lexicographic order, so that one shares its first
columns with the one before: an orthonormal basis of what is orthogonal to them is kept for every number of columns, and
a Householder reflection takes the next column out of it. The innermost loops run over the matrices of a block, which
the compiler turns into vector instructions.
"""

from __future__ import annotations

import numpy as np

from .compiled import machine_code

__all__ = ["facets", "full_rank"]

LANES = 8


@machine_code
def facets(
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    subsets: np.ndarray,
    shared: np.ndarray,
    normals: np.ndarray,
    least: np.ndarray,
    most: np.ndarray,
) -> None:
    """Write `normals` (N, K, n) of length one, and the `least` and `most` (N, K) that tensions give along them.

    A (N, n, m); low, high (m,): limits of the tensions; subsets (K, n - 1): columns, in lexicographic order;
    shared (K,): how many of them are those of the subset before.
    """
    count, n, m = A.shape
    column = np.empty((m, n, LANES))
    per_length = np.empty((m, LANES))
    basis = np.empty((n, n, n, LANES))  # by number of columns taken out, vector of the basis, row
    along, onto = np.empty((n, LANES)), np.empty((n, LANES))
    factor = np.empty(LANES)
    down, up = np.empty(LANES), np.empty(LANES)
    for first in range(0, count, LANES):
        for lane in range(LANES):
            matrix = min(first + lane, count - 1)
            for j in range(m):
                square = 0.0
                for i in range(n):
                    column[j, i, lane] = A[matrix, i, j]
                    square += A[matrix, i, j] ** 2
                # Columns of length one, so that a short one affects where its facet is.
                per_length[j, lane] = 1.0 / np.sqrt(square) if square > 0.0 else 0.0
        basis[0] = 0.0
        for i in range(n):
            basis[0, i, i] = 1.0
        for k in range(subsets.shape[0]):
            for depth in range(shared[k], n - 1):
                j = subsets[k, depth]
                left = n - depth
                for v in range(left):
                    along[v] = 0.0
                    for i in range(n):
                        for lane in range(LANES):
                            along[v, lane] += basis[depth, v, i, lane] * column[j, i, lane]
                    for lane in range(LANES):
                        along[v, lane] *= per_length[j, lane]
                for lane in range(LANES):
                    rest = 0.0
                    for v in range(1, left):
                        rest += along[v, lane] ** 2
                    size = np.sqrt(along[0, lane] ** 2 + rest)
                    along[0, lane] += size if along[0, lane] > 0.0 else -size
                    square = along[0, lane] ** 2 + rest
                    # A column that depends on those before leaves any basis as good as another.
                    factor[lane] = 2.0 / square if square > 0.0 else 0.0
                for i in range(n):
                    onto[i] = 0.0
                for v in range(left):
                    for i in range(n):
                        for lane in range(LANES):
                            onto[i, lane] += basis[depth, v, i, lane] * along[v, lane]
                for i in range(n):
                    for lane in range(LANES):
                        onto[i, lane] *= factor[lane]
                for v in range(1, left):
                    for i in range(n):
                        for lane in range(LANES):
                            basis[depth + 1, v - 1, i, lane] = basis[depth, v, i, lane] - onto[i, lane] * along[v, lane]
            normal = basis[n - 1, 0]
            down[:] = 0.0
            up[:] = 0.0
            for j in range(m):
                for lane in range(LANES):
                    pull = 0.0
                    for i in range(n):
                        pull += normal[i, lane] * column[j, i, lane]
                    at_low, at_high = pull * low[j], pull * high[j]
                    down[lane] += min(at_low, at_high)
                    up[lane] += max(at_low, at_high)
            for lane in range(min(LANES, count - first)):
                for i in range(n):
                    normals[first + lane, k, i] = normal[i, lane]
                least[first + lane, k], most[first + lane, k] = down[lane], up[lane]


@machine_code
def full_rank(A: np.ndarray, tolerance: float, full: np.ndarray) -> None:
    """Write to `full` (N,) whether each of A (N, n, m) has n independent columns, by QR with column pivoting.

    A column counts as dependent if less than `tolerance` of the longest one is left of it.
    """
    count, n, m = A.shape
    work, square = np.empty((m, n)), np.empty(m)
    for matrix in range(count):
        longest = 0.0
        for j in range(m):
            square[j] = 0.0
            for i in range(n):
                work[j, i] = A[matrix, i, j]
                square[j] += work[j, i] ** 2
            longest = max(longest, square[j])
        full[matrix] = m >= n and longest > 0.0
        for step in range(n):
            if not full[matrix]:
                break
            pivot = step
            for j in range(step, m):
                square[j] = 0.0
                for i in range(n):
                    square[j] += work[j, i] ** 2
                if square[j] > square[pivot]:
                    pivot = j
            if not square[pivot] > tolerance**2 * longest:
                full[matrix] = False
                break
            for i in range(n):
                work[step, i], work[pivot, i] = work[pivot, i], work[step, i]
            size = np.sqrt(square[pivot])
            for j in range(step + 1, m):
                part = 0.0
                for i in range(n):
                    part += work[step, i] * work[j, i]
                part /= size * size
                for i in range(n):
                    work[j, i] -= part * work[step, i]
