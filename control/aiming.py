"""Kernel: the reference of a predictive controller, changed the least so that its motion obeys the model."""

import numpy as np

from .carrier_compensation import solve_positive

ALMOST = 1e-4  # of the largest entry of the gram matrix of efforts: wrenches that cost more are not corrected


def aim(dt, length, efforts, A, B, c, wanted, planned):
    """Change tensions and moved places of the reference so that x_(k+1) = A x_k + B u_k + c holds for the pose's rate.

    Parameters
    ----------
    dt
        Duration of each stage, (N,) [s].
    length
        The robot's, by which angular accelerations are multiplied [m].
    efforts
        What squares of tensions and of moved places cost, (m + f,).
    A, B, c
        The dynamics of all stages, (N, n, n), (N, n, m + f) and (N, n), with n = 12 + 2 f.
    wanted, planned
        States (N + 1, n) and controls (N + 1, m + f) of the reference.
    """
    n, count = A.shape[1], B.shape[2]
    moved = (n - 12) // 2
    m = count - moved
    gains, gram = np.zeros((6, count)), np.zeros((6, 7))
    for k in range(A.shape[0]):
        for i in range(6):
            by = (1.0 if i < 3 else length) / dt[k]  # accelerations, all of them in m/s^2
            missing = wanted[k + 1, 6 + i] - c[k, 6 + i]
            for j in range(n):
                missing -= A[k, 6 + i, j] * wanted[k, j]
            for j in range(count):
                missing -= B[k, 6 + i, j] * planned[k, j]
                gains[i, j] = by * (B[k, 6 + i, j] if j < m else A[k, 6 + i, 12 + j - m])
            gram[i, 6] = by * missing
        largest = 0.0
        for i in range(6):
            for other in range(6):
                gram[i, other] = 0.0
                for j in range(count):
                    gram[i, other] += gains[i, j] * gains[other, j] / efforts[j]
            largest = max(largest, gram[i, i])
        for i in range(6):
            gram[i, i] += max(ALMOST * largest, 1e-200)
        solve_positive(gram)
        for j in range(count):
            change = 0.0
            for i in range(6):
                change += gains[i, j] * gram[i, 6] / efforts[j]
            if j < m:
                planned[k, j] += change
            else:
                wanted[k, 12 + j - m] += change
                if k == A.shape[0] - 1:
                    wanted[k + 1, 12 + j - m] += change
