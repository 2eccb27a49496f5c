"""What the kernels answer, and the numbers by which they judge beside those of `tolerances`."""

OPTIMAL, INFEASIBLE, SINGULAR, INACCURATE, INVALID, FAILED, UNSURE = range(7)

# After so many steps of Newton's method the problems that are left are put together, so many times.
STEPS, TURNS = 5, 5

SLACK = 1e-12  # how far s may pass a limit, relative to the size of s
PARALLEL = 1e-11  # length of a normal, or of its part outside the span of others, that is rounding
STATIONARY = 1e-10  # part of the gradient that the multipliers may leave, relative to the size of s
DECISIVE = 1e-5  # relative change of the cost if the limits move by the slack: above it rounding chose the tensions
CLEAR = 4.0  # a shortfall is beyond doubt from this many tolerances
REACH_OF_PULL = 1e2  # of the reach of a cable along a direction this many ROUNDINGs are in doubt,
REACH_OF_TERMS = 1e-2  # and this many of its limit times the terms that its pull is the sum of
