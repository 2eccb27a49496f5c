"""Events of a simulation: faults, loads, pushes, walls and changes of the reference; a base class for more."""
