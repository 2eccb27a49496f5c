"""The nonlinear program of a scenario: a node, an interval, the whole, its first guess and its solvers."""
