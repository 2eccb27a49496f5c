"""Method "stiffest": the largest smallest eigenvalue of a matrix that is affine in the tensions, by cutting planes.

The stiffness of a robot with elastic cables is affine in their tensions, as E A / L0 = (E A + t) / l. So its smallest
eigenvalue is concave, and each eigenvector v bounds it everywhere by the linear function v' K(t) v.
"""

from typing import Any

import numpy as np

from .method import Array, Method, Proposal, StandardForm

TOLERANCE = 1e-6  # of the value, between it and its bound
_MOST = 200  # linear programs; about four are needed
_AT_ONCE = 3  # eigenvectors whose cuts are added


class Stiffest(Method):
    """Maximise the smallest eigenvalue of K(t) = stiffness + sum t_i by_tension[i], both of them symmetric.

    Existence: wherever the problem is feasible; failed if no limit bounds the eigenvalue. The tensions need not be
    unique, and may jump as w changes. Cost: about four linear programs in m - rank variables, 0.5 ms. Outside the
    feasible set: a certificate. It is not in `methods()`, as it takes matrices.

    Args:
        stiffness: (p, p).
        by_tension: (m, p, p).

    Attributes:
        value, bound: The smallest eigenvalue at the last proposal, and its upper bound for all tensions inside the
            limits, by the last linear program; both are nan without a proposal.
    """

    name = "stiffest"
    guarantee = "maximises the smallest eigenvalue of the stiffness, to 1e-6"
    source = (
        "S. Behzadipour, A. Khajepour, 'Stiffness of cable-based parallel manipulators with application to stability "
        "analysis', J. Mechanical Design 128(1), 2006, for the stiffness; J. E. Kelley, 'The cutting-plane method for "
        "solving convex programs', J. SIAM 8(4), 1960"
    )
    exact = True

    def __init__(self, stiffness: Array, by_tension: Array):
        self._stiffness, self._by_tension = stiffness, by_tension
        self.value = self.bound = np.nan

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Add cutting planes from eigenvectors until the linear program no longer improves."""
        base = form.b @ form.Q
        t = form.origin.copy()
        t[form.moving] += form.unit * base
        K = self._stiffness + np.tensordot(t, self._by_tension, 1)
        slopes = np.tensordot(form.N * form.unit, self._by_tension[form.moving], 1)  # (d, p, p)
        d, limits = len(form.N), (form.lower - base, form.upper - base)
        z, best, at = np.zeros(d), -np.inf, None
        offsets, gradients = np.zeros(0), np.zeros((0, d))  # of the cuts: value <= offset + gradient . z
        self.value = self.bound = np.nan
        for count in range(_MOST):
            values, vectors = np.linalg.eigh(K + np.tensordot(z, slopes, 1))
            if count and values[0] > best:
                best, at = float(values[0]), z
            self.value = best
            if at is not None and self.bound - best <= TOLERANCE * abs(best):
                break
            v = vectors[:, :_AT_ONCE]
            offsets = np.append(offsets, np.einsum("ia,ij,ja->a", v, K, v))
            gradients = np.vstack([gradients, np.einsum("ia,dij,ja->ad", v, slopes, v)])
            z, self.bound, detail = _highest(offsets, gradients, form.N, limits)
            if z is None:
                return Proposal(None, count, detail)
        return Proposal(None, _MOST, "the cutting planes did not end") if at is None else Proposal(base + at @ form.N)


def _highest(
    offsets: Array, gradients: Array, N: Array, limits: tuple[Array, Array]
) -> tuple[Array | None, float, str]:
    """Maximise the smallest of offsets + gradients z subject to limits of z N; return z, the value, and what failed."""
    import daqp

    d, k = N.shape
    # About one and zero, as the program's tolerances are absolute.
    zero, unit = offsets.min(), np.abs(gradients).max(initial=0.0) or 1.0
    rows = np.block([[N.T, np.zeros((k, 1))], [-gradients / unit, np.ones((len(offsets), 1))]])
    upper = np.append(limits[1], (offsets - zero) / unit)
    lower = np.append(limits[0], np.full(len(offsets), -np.inf))
    cost = np.append(np.zeros(d), -1.0)
    x, _, flag, _ = daqp.solve(np.zeros((d + 1, d + 1)), cost, rows, upper, lower, None, primal_tol=1e-11)
    if flag < 1:
        return None, np.nan, f"daqp: exit flag {flag}"
    return x[:d], float(zero + unit * x[d]), ""
