"""Numerics that several methods share: least norm, linear programs, the feasible polytope, Newton's method."""
