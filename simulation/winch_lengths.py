"""Kernel: the unstrained lengths that winches without a model reach within a period, so that tensions are as ordered.

    L0 + dt (dl/dt - (t L0 - E A (l - L0)) / (C L0 + E A dt))

which is the rate v = dl/dt - dL0/dt of t = E A (l - L0) / L0 + (C + E A dt / L0) v, with the lengths at its beginning
and the mean of dl/dt in the period, extrapolated from the last one: with dl/dt at the beginning, a damper would pull
too much by C dt/2 times the acceleration, as if the platform were heavier.
"""


def write_lengths(states, first, lengths, last, tensions, stiffness, damping, period, shortest, rows, at):
    """Write them into the commands of cables.

    Parameters
    ----------
    states, first
        (N, n), of the plant, and the place of the first unstrained length in one.
    lengths
        (N, 2, m), lengths of the cables [m] and their rates.
    last
        (N, m), the rates one period before, nan if there was none [m/s]; they are overwritten with those of now.
    tensions
        (N, m) [N], as ordered.
    stiffness, damping
        (m,), E A [N] and C [N s/m].
    period
        [s].
    shortest
        Least length of a cable [m].
    rows, at
        Results: commands of the plant (N, k), and the place of the first cable's in one.
    """
    for row in range(states.shape[0]):
        for i in range(lengths.shape[2]):
            own, EA = states[row, first + i], stiffness[i]
            missing = tensions[row, i] * own - EA * (lengths[row, 0, i] - own)
            rate = lengths[row, 1, i]
            mean = 1.5 * rate - 0.5 * last[row, i]
            last[row, i] = rate
            if mean != mean:  # nan, in the first period
                mean = rate
            rows[row, at + i] = max(own + period * (mean - missing / (damping[i] * own + EA * period)), shortest)
