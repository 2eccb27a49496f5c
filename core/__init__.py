"""The numeric core, in C: tension distribution, a robot's mechanics and motion, and the program of predictive control.

Its functions work on the memory of arrays; `_core.pyi` and the headers describe their arguments. Packages above call
them with checked arrays.
"""

from ._core import *  # noqa: F403 -- its functions, which `_core.pyi` lists
