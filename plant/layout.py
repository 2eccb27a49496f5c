"""Layout of the state and command arrays of a plant; core/plant/plant.h defines the same.

A state is one row: a block for each body, the platform first and then the carriers, then blocks with one number for
each cable. The block of the platform describes its CoM, the block of a carrier its frame.
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
# for each carrier, of the commands of its actuators, force and moment on it, and its reference (pose, velocity,
# acceleration).
AIR, WIND, WRENCH, COMMANDS, CARRIER, CARRIER_WRENCH, REFERENCE_POSE = 0, 1, 4, 10, 30, 6, 12

SUDDEN = 100.0  # [m/s^2, rad/s^2] that a polynomial would need beyond its reference's: the carrier then jumps to it
SHORTEST = 1e-3  # [m] of cable that a winch leaves out
