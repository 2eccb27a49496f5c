"""Places of numbers in the arrays that the kernels of the plant share: constants alone, copied into the machine code.

A state is one row: a block for each body, the platform first and then the carriers, and then blocks of one number for
each cable. The platform's block is that of its CoM, a carrier's that of its frame.
"""

# A body in a state: position [m], quaternion (w, x, y, z), velocity in {G} [m/s], rate in its own axes [rad/s].
BODY = 13
QUATERNION, VELOCITY, RATE = 3, 7, 10
# Blocks of cables in a state: unstrained length [m] (or tension [N] where that is commanded), its rate, the length
# last commanded, and the condition.
CABLE_BLOCKS = 4
LENGTH, LENGTH_RATE, REFERENCE, CONDITION = 0, 1, 2, 3
WORKS, STUCK, CUT = 0.0, 1.0, 2.0

# What the cables are commanded.
LENGTHS, RATES, FORCES, TENSIONS = 0, 1, 2, 3

# A row of `bodies`, which describes platform and carriers.
MOTION, MASS, INVERSE_MASS, INERTIA, INVERSE_INERTIA, LIMITS, ACTUATORS, BODY_COLUMNS = 0, 1, 4, 7, 16, 25, 27, 75
RESTS, FREE, LAGGED, IMPOSED = 0, 1, 2, 3  # values of MOTION
ACTUATOR, MOST_ACTUATORS = 8, 6  # numbers of one: wrench (6), lowest and highest command

# A row of `cables`.
OWNER, ANCHOR, ATTACHMENT, AXIS, RADIUS, STIFFNESS, DAMPING = 0, 1, 4, 7, 10, 11, 12
INERTIA_OF_WINCH, FRICTION, SPEED_MAX, FORCE_MAX, CABLE_COLUMNS = 13, 14, 15, 16, 17

# `settings`.
GRAVITY, DRAG, LIFT, PRINTED, DRIVE, LOCATE, CARRIER_BANDWIDTH, WINCH_BANDWIDTH, LAG = 0, 3, 4, 5, 6, 7, 8, 9, 10
FORCE_SCALE, LENGTH_SCALE, HAS_WINCHES, SETTINGS = 11, 12, 13, 14

# A command: whether there is air, its velocity, force and moment on the platform, a number for each cable, and a block
# for each carrier, of the commands of its actuators and of its reference (pose, velocity, acceleration).
AIR, WIND, WRENCH, COMMANDS, CARRIER, REFERENCE_POSE = 0, 1, 4, 10, 24, 6
# After these blocks the kernels write for each carrier, from the command's beginning on, the six coefficients of the
# polynomial of time that each coordinate of its reference follows, and whether it moves and turns.
POLYNOMIAL, MOVES, TURNS = 38, 36, 37

# What is computed of a body at a state: rotation matrix (first), rate in {G}, force and moment about its CoM in {G}.
OMEGA, FORCE, MOMENT, BODY_WORK = 9, 12, 15, 18
# What is computed of a cable: direction, arms about platform and carrier, length and rate, elongation and its rate,
# tension, curvature of the length along the motion, and the modes in which cable and winch stay during a step.
U, ARM, CARRIER_ARM, L, L_RATE, E, E_RATE, T, CURVATURE, MODE, SLIP = 0, 3, 6, 9, 10, 11, 12, 13, 14, 15, 16
TURN, CARRIER_TURN = 17, 20  # angular acceleration of platform and carrier per newton of the cable
REFERENCE_RATE, CONTACT, STICKING, IMPULSE, GIVE, CABLE_WORK = 23, 24, 25, 26, 27, 28
SLACK, PULLS, LIMP = 0.0, 1.0, 2.0  # values of MODE; limp: longer than unstrained, with a damper that outweighs it

# Rows of whole numbers for the choice of cables: those that may pull, the order of those that do, and the excluded.
CANDIDATE, PICKED, BARRED, PICKS = 0, 1, 2, 3
GIVING = 1e-10  # of the mean entry on G's diagonal, added there: dependent cables share what they carry
REFINED = 2  # solutions with that, of which each takes away all but some 1e-10 of what the one before has left
DEPENDENT = 1e-14  # of a cable's own entry in G: with less left after elimination it depends on others
TOUCHING = 1e-12  # of `LENGTH_SCALE` by which a cable without stiffness may be short of taut to be treated as taut
CAUGHT = 1e-13  # of `LENGTH_SCALE` by which it is longer when its impact is located
PARTING = (
    1e-6  # [m/s] with which a taut cable gets slack; a slower one is held, which ends trains of ever smaller impacts
)
STILL = 1e-12  # [m/s] with which a taut cable stretches without an impact, which is what rounding leaves
RESTING = 1e-9  # of `LENGTH_SCALE` by which one that is as slow may be short of taut: the sign of its tension decides
SUDDEN = 100.0  # [m/s^2, rad/s^2] that a polynomial would need beyond those of its reference: the carrier jumps to it
MOST_EVENTS = 40  # in one step; those beyond are not located
FEW_EVENTS = 1  # in one step; each after them makes `PARTING` 16 times as large, so that a platform that rattles rests
MOST_SHIFTS = 10  # that bring cables without stiffness to their lengths, a few where a state is far from them
SHORTEST = 1e-3  # [m] of cable that a winch leaves out
ELASTIC, WITH_FRICTION, CONSTRAINED = 0, 1, 2  # what the end of a step must be checked for
