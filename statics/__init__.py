"""One instant of a robot: tensions, equilibria, and the robots of an uncertainty."""
