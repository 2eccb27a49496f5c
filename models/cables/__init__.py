"""Cable models besides the straight line: elastic, cut into elements, heavy, sagging, or over a pulley.

`driving_force` is not imported here: it needs the dynamics of a robot, which may need these pulleys.
"""

from .element_chain import ElementChain
from .lumped_chain import LumpedChain
from .pulley import Exit, exit_points, pulley_motion
from .sag import SaggingCable, hang

__all__ = ["ElementChain", "Exit", "LumpedChain", "SaggingCable", "exit_points", "hang", "pulley_motion"]
