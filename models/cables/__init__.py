"""Cable models besides the straight line: elastic, cut into elements, heavy, sagging, or over a pulley.

`driving_force` is not imported here: it needs the dynamics of a robot, which may need these pulleys.
"""

from .element_chain import ElementChain
from .pulley import Exit, exit_points
from .sag import SaggingCable, hang

__all__ = ["ElementChain", "Exit", "SaggingCable", "exit_points", "hang"]
