"""A cable as a spring and a damper beside it: its tension, its stiffness, and how long it must be unstrained.

    T = E A (l - L0) / L0 + C dl/dt   while l > L0 and T > 0, otherwise nothing: a cable never pushes
    L0 = l / (1 + T / (E A))          the unstrained length that gives the tension T at rest
    k = E A / L0

All of it is element by element, for NumPy arrays that broadcast and for CasADi expressions. Source: paper F, Eqs. 6
and 11; physics.md, section 3.
"""

from typing import Any

Value = Any  # float, np.ndarray or a CasADi expression, in and out


def tension(length: Value, rate: Value, unstrained: Value, stiffness: Value, damping: Value = 0.0) -> Value:
    """Return T [N] of l = `length` [m], dl/dt = `rate` [m/s], L0 = `unstrained` > 0 [m], E A = `stiffness` [N].

    `damping` is C of the whole cable [N s/m]. T is zero when slack, also where the damper outweighs the spring of a
    shortening cable.
    """
    pull = stiffness * (length - unstrained) / unstrained + damping * rate
    return (pull + abs(pull)) / 2 * (length > unstrained)


def unstrained_length(length: Value, tension: Value, stiffness: Value) -> Value:
    """Return L0 [m] of a cable at rest of l = `length` [m], T = `tension` [N] and E A = `stiffness` [N]."""
    return length / (1 + tension / stiffness)


def axial_stiffness(stiffness: Value, unstrained: Value) -> Value:
    """Return k = E A / L0 [N/m], by which the tension of a taut cable grows with its length."""
    return stiffness / unstrained
