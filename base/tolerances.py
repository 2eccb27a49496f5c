"""The numbers by which results are judged, in one place. All are relative and have no unit."""

# Wrench error that is accepted, relative to what the problem requires (see `TensionProblem.tolerance`). Tensions
# are called optimal only below it and a certificate is believed only above it, so the two answers cannot both be given.
FEASIBILITY = 1e-9

# Part of the cost's gradient that the multipliers of an optimum may leave, and gap between its cost and the lower bound
# that they give, both relative.
OPTIMALITY = 1e-8

# A limit this near, relative to the size of the tensions, may have a multiplier.
AT_LIMIT = 1e-9

# Rounding of a matrix-vector product, relative to the sum of the absolute terms: 450 machine epsilons.
ROUNDING = 1e-13

# The terms of A t count at most at this many times what the problem requires: tensions that cancel to more digits than
# that give no wrench that they are asked for.
CANCELLED = 1e10

# Singular values below this part of the largest are zero.
RANK = 1e-12

# Directions with singular values between RANK and this part of the largest are required only if w would be missed
# without them: geometry written with twelve digits makes them out of nothing, and tensions that serve them serve the
# rounding. The C core, which looks at pivots, does the same below 4e-11 and leaves those up to 1e-9 alone.
DOUBTFUL = 1e-10

# A direction whose singular value of the wrench matrix is below this part of the largest is one in which the cables
# are taken to give no wrench.
INDEPENDENT = 1e-3

# A cable pulls along a direction d only if |d . a_i| exceeds this part of its column norm; if none does, w is outside
# the range of A. It is larger than RANK, so that a direction which the rank cut calls unreachable is not reached by the
# certificate's own count either. What a smaller pull gives inside a finite limit is known, and counts.
NEGLIGIBLE = 1e-11

# A cable without a limit along d may pull by this part of its column norm, which is ROUNDING: whatever its tension,
# that gives no more along d than A t is rounded by. A larger pull may give anything, and voids the certificate.
ORTHOGONAL = 1e-13

# A pull below it counts if it is more than this part of the terms that it is the sum of: not rounding, but data. The
# cable may have tensions up to CANCELLED times what is required, and what it gives with these is in doubt.
ROUNDED_PULL = 1e-15

# The heaviest weight of a problem, relative to the lightest: beyond it least squares have no digits left.
WEIGHTS_APART = 1e14

# How far a tension may pass a limit before it is moved back, relative to the size of the tensions.
SLACK = 1e-12

# Relative change of the cost if the limits move by the slack: above it rounding chose the tensions.
DECISIVE = 1e-5
