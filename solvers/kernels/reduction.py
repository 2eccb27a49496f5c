"""B = P^T L Q_1^T by Householder reflections from the right with row pivoting (Golub and Van Loan, 5.4)."""

from __future__ import annotations

import math

from .codes import SURE_PIVOT, SURE_ZERO
from .jit import compilable

__all__ = ["reduce", "reflect"]


@compilable()
def reflect(B, tau, j, mm, x, at):
    """Subtract tau v v^T x from x[at : at + mm] with the reflector v = B[j, j:]."""
    dot = 0.0
    for c in range(j, mm):
        dot += B[j * mm + c] * x[at + c]
    dot *= tau[j]
    for c in range(j, mm):
        x[at + c] -= dot * B[j * mm + c]


@compilable()
def reduce(B, n, mm, order, diag, tau, norms):
    """Reduce B (n, mm) in place to L and reflectors, largest remaining row first; return the rank, or -1 if unsure."""
    for i in range(n):
        total = 0.0
        for c in range(mm):
            total += B[i * mm + c] * B[i * mm + c]
        norms[i] = total
        order[i] = i
    steps = min(n, mm)
    for j in range(steps):
        best = j
        for i in range(j + 1, n):
            if norms[i] > norms[best]:
                best = i
        if j > 0 and norms[best] <= 1e-12 * diag[0] * diag[0]:
            # The norms are kept by subtraction, which has no digits left this far down.
            for i in range(j, n):
                total = 0.0
                for c in range(j, mm):
                    total += B[i * mm + c] * B[i * mm + c]
                norms[i] = total
                if total > norms[best] or i == j:
                    best = i
        if best != j:
            for c in range(mm):
                B[j * mm + c], B[best * mm + c] = B[best * mm + c], B[j * mm + c]
            norms[best] = norms[j]
            order[j], order[best] = order[best], order[j]
        total = 0.0
        for c in range(j, mm):
            total += B[j * mm + c] * B[j * mm + c]
        length = math.sqrt(total)
        if j == 0 and length == 0.0:
            return 0
        if j > 0 and length <= SURE_PIVOT * abs(diag[0]):
            return j if length <= SURE_ZERO * abs(diag[0]) else -1
        head = B[j * mm + j]
        pivot = -length if head > 0.0 else length
        diag[j] = pivot
        B[j * mm + j] = head - pivot
        tau[j] = -1.0 / (pivot * (head - pivot))
        for i in range(j + 1, n):
            dot = 0.0
            for c in range(j, mm):
                dot += B[j * mm + c] * B[i * mm + c]
            dot *= tau[j]
            for c in range(j, mm):
                B[i * mm + c] -= dot * B[j * mm + c]
            norms[i] -= B[i * mm + j] * B[i * mm + j]
    return steps
