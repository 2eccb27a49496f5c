"""Places of numbers in the rows that states and commands of a plant are; core/plant/plant.h has the same.

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
STUCK, CUT = 1.0, 2.0  # values of CONDITION; 0: the winch works

# What the cables are commanded.
LENGTHS, RATES, FORCES, TENSIONS = 0, 1, 2, 3

# A command: whether there is air, its velocity, force and moment on the platform, a number for each cable, and a block
# for each carrier, of the commands of its actuators and of its reference (pose, velocity, acceleration).
AIR, WIND, WRENCH, COMMANDS, CARRIER, REFERENCE_POSE = 0, 1, 4, 10, 24, 6

SUDDEN = 100.0  # [m/s^2, rad/s^2] that a polynomial would need beyond those of its reference: the carrier jumps to it
SHORTEST = 1e-3  # [m] of cable that a winch leaves out

# All below, and the files bodies.py, lines.py and machine.py, are used by the kernels of controllers alone.

# A row of `bodies`, which describes platform and carriers.
MOTION, MASS, INVERSE_MASS, INERTIA, INVERSE_INERTIA, LIMITS, ACTUATORS, BODY_COLUMNS = 0, 1, 4, 7, 16, 25, 27, 75
RESTS, FREE, LAGGED, IMPOSED = 0, 1, 2, 3  # values of MOTION
ACTUATOR, MOST_ACTUATORS = 8, 6  # numbers of one: wrench (6), lowest and highest command

# A row of `cables`.
OWNER, ANCHOR, ATTACHMENT, AXIS, RADIUS, STIFFNESS, DAMPING = 0, 1, 4, 7, 10, 11, 12
INERTIA_OF_WINCH, CABLE_COLUMNS = 13, 17

# `settings`.
GRAVITY, DRAG, LIFT, PRINTED, CARRIER_BANDWIDTH = 0, 3, 4, 5, 8
FORCE_SCALE, LENGTH_SCALE, HAS_WINCHES, SETTINGS = 11, 12, 13, 14

# After the blocks of a command, the six coefficients of the polynomial of time that each coordinate of a carrier's
# reference follows, and whether it moves and turns.
POLYNOMIAL, MOVES, TURNS = 38, 36, 37

# What is computed of a body at a state: rotation matrix (first), rate in {G}, force and moment about its CoM in {G}.
OMEGA, FORCE, MOMENT, BODY_WORK = 9, 12, 15, 18
# What is computed of a cable: direction, arms about platform and carrier, length and rate, elongation and its rate,
# tension, and curvature of the length along the motion.
U, ARM, CARRIER_ARM, L, L_RATE, E, E_RATE, T, CURVATURE, CABLE_WORK = 0, 3, 6, 9, 10, 11, 12, 13, 14, 28
